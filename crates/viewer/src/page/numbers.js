// Numbers for people, and positions between the cells of rasters, the map and the screen.
//
// A transform {a, b, c, d, e, f} takes (u, v) to (a u + c v + e, b u + d v + f), as a canvas does.

/** Returns a number with about `digits` significant digits, without exponents for usual sizes. */
export function short(value, digits = 4) {
  if (value === null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size > 9 || size < -5) return value.toExponential(2);
  return value.toFixed(Math.max(0, Math.min(digits - 1 - size, 6))).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
}

/** Returns the value and its unit, with a hundredth of a metre for lengths. */
export function withUnit(value, unit) {
  if (value === null || value === undefined) return "no data";
  const text = unit === "m" ? value.toFixed(2) : short(value, Math.abs(value) < 1 ? 3 : 5);
  return unit ? `${text} ${unit}` : text;
}

/** Returns a length in metres or kilometres, without more digits than it has. */
export function distance(length, unit) {
  if (unit === "px") return `${short(length, 3)} px`;
  return length >= 1000 ? `${short(length / 1000, 3)} km` : `${short(length, 3)} m`;
}

/** Returns 1, 2 or 5 times a power of ten, at least `least`. */
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => step >= least * 0.9999);
}

/** Returns the round numbers from `low` to `high`, about `count` of them. */
export function ticks(low, high, count) {
  const step = niceStep(Math.max((high - low) / count, 1e-9));
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => (first + i) * step);
}

/** The transform from a raster's columns and rows (corner of the first cell at 0, 0) to the map. */
export function mapFromCells([x, a, c, y, b, d]) {
  return { a, b, c, d, e: x, f: y };
}

/** Returns the transform that first does `inner`, then `outer`. */
export function compose(outer, inner) {
  const corner = apply(outer, inner.e, inner.f);
  return {
    a: outer.a * inner.a + outer.c * inner.b,
    b: outer.b * inner.a + outer.d * inner.b,
    c: outer.a * inner.c + outer.c * inner.d,
    d: outer.b * inner.c + outer.d * inner.d,
    e: corner[0],
    f: corner[1],
  };
}

/** Returns the transform back. */
export function invert({ a, b, c, d, e, f }) {
  const det = a * d - b * c;
  return { a: d / det, b: -b / det, c: -c / det, d: a / det, e: (c * f - d * e) / det, f: (b * e - a * f) / det };
}

/** Applies a transform to a position. */
export function apply({ a, b, c, d, e, f }, u, v) {
  return [a * u + c * v + e, b * u + d * v + f];
}

/** Fetches from this program; an answer that is none becomes an error with the program's words. */
export async function ask(path) {
  const response = await fetch(path).catch(() => {
    throw new Error("The viewer does not answer. It may have ended: start it again, and open its new address.");
  });
  if (!response.ok) throw new Error(await response.text());
  return response;
}
