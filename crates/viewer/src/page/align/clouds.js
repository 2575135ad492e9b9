// The points that are drawn: those of the model and, as points, the heights of the map.

/** Colours from low to high: of the map, and of the model, which must differ from it. */
const COLD = [[68, 20, 110], [50, 90, 160], [30, 155, 138], [120, 205, 80], [250, 225, 40]];
const WARM = [[120, 20, 40], [205, 40, 40], [240, 110, 30], [252, 180, 50], [255, 240, 150]];

/** Returns colours of heights, whose lowest and highest fiftieth are left out of the range. */
function heightColours(heights, stops, alpha) {
  const sorted = Float64Array.from(heights).sort();
  const [low, high] = [0.02, 0.98].map((share) => sorted[Math.floor(share * (sorted.length - 1))] ?? 0);
  return Uint32Array.from(heights, (height) => {
    const t = 4 * Math.min(1, Math.max(0, (height - low) / Math.max(high - low, 1e-6)));
    const k = Math.min(3, Math.floor(t));
    const [r, g, b] = [0, 1, 2].map((c) => Math.round(stops[k][c] + (t - k) * (stops[k + 1][c] - stops[k][c])));
    return ((alpha << 24) | (b << 16) | (g << 8) | r) >>> 0;
  });
}

/** Reads the points of the model: x, y, z from its pivot, and colours. */
export function cloudOf(buffer) {
  const [floats, words] = [new Float32Array(buffer), new Uint32Array(buffer)];
  const count = floats.length / 4;
  const [points, colours] = [new Float32Array(3 * count), new Uint32Array(count)];
  for (let i = 0; i < count; i++) {
    points.set(floats.subarray(4 * i, 4 * i + 3), 3 * i);
    colours[i] = words[4 * i + 3] | 0xff000000;
  }
  return { points, colours };
}

/** Returns colours of the points by their heights along an axis that is up. */
export function coloursByHeight({ points, colours }, [a, b, c]) {
  const ups = Array.from(colours, (_, i) => a * points[3 * i] + b * points[3 * i + 1] + c * points[3 * i + 2]);
  return heightColours(ups, WARM, 255);
}

/** Makes the heights of a raster points, counted from an origin. */
export function groundOf(buffer, raster, origin) {
  const [columns, rows] = new Uint32Array(buffer, 0, 2);
  const values = new Float32Array(buffer, 8);
  const [x, a, c, y, b, d] = raster.transform;
  const points = [];
  for (let i = 0; i < values.length; i++) {
    if (!Number.isFinite(values[i])) continue;
    const u = (((i % columns) + 0.5) * raster.width) / columns;
    const v = ((Math.floor(i / columns) + 0.5) * raster.height) / rows;
    points.push(x + u * a + v * c - origin[0], y + u * b + v * d - origin[1], values[i] - origin[2]);
  }
  const ups = points.filter((_, i) => i % 3 === 2);
  return { points: Float32Array.from(points), colours: heightColours(ups, COLD, 150) };
}
