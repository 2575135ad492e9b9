// A worker that holds the splats of one layer: it sorts them by depth, and finds what a click meets.
//
// A splat has 32 bytes: its position (three f32), and halves of colour, opacity, logarithms of the
// scales, 16 bits of no meaning, and its rotation in 32 bits.

const WORDS = 8;
let words = null;
let places = null;
let count = 0;
let keys, order, spare;

onmessage = ({ data }) => {
  if (data.words) {
    words = new Uint32Array(data.words);
    places = new Float32Array(data.words);
    count = words.length / WORDS;
    [keys, order, spare] = [0, 0, 0].map(() => new Uint32Array(count));
  } else if (data.pick) {
    postMessage({ picked: pick(data.pick), serial: data.serial });
  } else {
    const drawn = sort(data.eye, data.forward, data.near);
    const back = data.back ? new Uint32Array(data.back) : new Uint32Array(count);
    back.set(drawn);
    postMessage({ order: back.buffer, drawn: drawn.length, serial: data.serial }, [back.buffer]);
  }
};

/** Returns the numbers of the splats before the camera, the farthest first. */
function sort(eye, forward, near) {
  const float = new Float32Array(1);
  const bits = new Uint32Array(float.buffer);
  let met = 0;
  for (let i = 0, at = 0; i < count; i++, at += WORDS) {
    const depth = (places[at] - eye[0]) * forward[0] + (places[at + 1] - eye[1]) * forward[1] + (places[at + 2] - eye[2]) * forward[2];
    if (depth <= near) continue;
    // Positive floats have the order of their bits; the farthest comes first.
    float[0] = depth;
    keys[i] = ~bits[0] >>> 0;
    order[met++] = i;
  }
  for (const shift of [0, 16]) {
    const starts = new Uint32Array(65537);
    for (let k = 0; k < met; k++) starts[((keys[order[k]] >>> shift) & 0xffff) + 1]++;
    for (let k = 0; k < 65536; k++) starts[k + 1] += starts[k];
    for (let k = 0; k < met; k++) spare[starts[(keys[order[k]] >>> shift) & 0xffff]++] = order[k];
    [order, spare] = [spare, order];
  }
  return order.subarray(0, met);
}

function half(bits) {
  const [sign, exponent, fraction] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return exponent ? sign * 2 ** (exponent - 15) * (1 + fraction / 1024) : sign * 2 ** -14 * (fraction / 1024);
}

/** Returns the axes of a splat, each as long as its standard deviation. */
function axes(at) {
  const packed = words[at + 7];
  const largest = packed >>> 30;
  const three = [20, 10, 0].map((shift) => (((packed >>> shift) & 1023) / 1023 - 0.5) * Math.SQRT2);
  const q = [0, 1, 2, 3].map((i) => (i === largest ? Math.sqrt(Math.max(0, 1 - three.reduce((sum, v) => sum + v * v, 0))) : three[i < largest ? i : i - 1]));
  const [w, x, y, z] = q;
  const scales = [half(words[at + 5] & 0xffff), half(words[at + 5] >>> 16), half(words[at + 6] & 0xffff)].map(Math.exp);
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ].map((axis, k) => axis.map((c) => c * scales[k]));
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Returns where half of the light of a ray has met splats, the distance along the ray, and the splats with their weights. */
function pick({ eye, direction, pixel }) {
  const hits = [];
  for (let at = 0; at < words.length; at += WORDS) {
    const to = [places[at] - eye[0], places[at + 1] - eye[1], places[at + 2] - eye[2]];
    const along = dot(to, direction);
    if (along <= 0) continue;
    const across = Math.max(0, dot(to, to) - along * along);
    const longest = Math.exp(Math.max(half(words[at + 5] & 0xffff), half(words[at + 5] >>> 16), half(words[at + 6] & 0xffff)));
    const reach = 3.4 * longest + pixel * along;
    if (across > reach * reach) continue;
    // In the frame of the standard deviations, the ray passes the centre at this squared distance.
    const frame = axes(at).map((axis) => axis.map((c) => c / dot(axis, axis)));
    const [o, d] = [frame.map((axis) => -dot(axis, to)), frame.map((axis) => dot(axis, direction))];
    const t = -dot(o, d) / dot(d, d);
    const nearest = o.map((c, k) => c + t * d[k]);
    const squared = dot(nearest, nearest);
    const small = (2 * across) / (pixel * along) ** 2;
    const alpha = Math.min(0.99, half(words[at + 4] >>> 16) * Math.exp(-Math.min(squared, small) / 2));
    if (alpha >= 1 / 255 && t > 0) hits.push([squared <= small ? t : along, alpha, at / WORDS]);
  }
  hits.sort((a, b) => a[0] - b[0]);
  let open = 1;
  let middle = null;
  const parts = [];
  for (const [distance, alpha, splat] of hits) {
    if (open < 1e-4) break;
    parts.push([splat, open * alpha]);
    open *= 1 - alpha;
    if (open < 0.5) middle ??= distance;
  }
  return middle === null ? null : { distance: middle, parts };
}
