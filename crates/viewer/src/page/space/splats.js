// Splats in WebGL 2: quads that are drawn back to front over one another.
//
// Discs (2DGS) meet the ray of each pixel in their plane, exactly, with the least footprint of the
// 2DGS code: the rule of `skysweep train` and `splats render`. Ellipsoids (3DGS) have the projected
// covariance of EWA, widened by 0.3 px² as in the 3DGS code.

const HARMONICS = `
const float C1 = 0.4886025119029199;
vec3 harmonic(int i) {
  // Three halves from position 3 i of the words of this splat.
  vec3 found;
  for (int c = 0; c < 3; c++) {
    int at = 3 * i + c;
    int texel = int(number) * texels + at / 8;
    uvec4 four = texelFetch(harmonics, ivec2(texel % across, texel / across), 0);
    vec2 pair = unpackHalf2x16(four[(at % 8) / 2]);
    found[c] = at % 2 == 0 ? pair.x : pair.y;
  }
  return found;
}
vec3 shaded(vec3 constant, vec3 d) {
  vec3 sum = constant;
  if (degree > 0) sum += C1 * (-d.y * harmonic(0) + d.z * harmonic(1) - d.x * harmonic(2));
  vec3 s = d * d;
  if (degree > 1) {
    sum += 1.0925484305920792 * d.x * d.y * harmonic(3) - 1.0925484305920792 * d.y * d.z * harmonic(4)
      + 0.31539156525252005 * (2.0 * s.z - s.x - s.y) * harmonic(5) - 1.0925484305920792 * d.x * d.z * harmonic(6)
      + 0.5462742152960396 * (s.x - s.y) * harmonic(7);
  }
  if (degree > 2) {
    sum += -0.5900435899266435 * d.y * (3.0 * s.x - s.y) * harmonic(8) + 2.890611442640554 * d.x * d.y * d.z * harmonic(9)
      - 0.4570457994644658 * d.y * (4.0 * s.z - s.x - s.y) * harmonic(10)
      + 0.3731763325901154 * d.z * (2.0 * s.z - 3.0 * s.x - 3.0 * s.y) * harmonic(11)
      - 0.4570457994644658 * d.x * (4.0 * s.z - s.x - s.y) * harmonic(12) + 1.445305721320277 * d.z * (s.x - s.y) * harmonic(13)
      - 0.5900435899266435 * d.x * (s.x - 3.0 * s.y) * harmonic(14);
  }
  // Plain colours below 0 are as they are, as splats render has them.
  return degree > 0 ? max(sum, 0.0) : sum;
}`;

const VERTEX = `#version 300 es
precision highp float; precision highp int; precision highp usampler2D;
layout(location = 0) in uint number;
uniform usampler2D splats, harmonics, objects;
uniform uint chosen;
uniform int across, texels, degree;
uniform bool discs;
uniform mat3 turn;
uniform vec3 eye;
uniform vec2 focal, principal, size, range;
flat out vec4 inverse;
flat out vec2 slopes;
flat out vec4 colour;
flat out vec2 limits;
out vec2 offset;
${HARMONICS}
mat3 axesOf(uint word) {
  int largest = int(word >> 30);
  vec3 three = (vec3(uvec3(word >> 20, word >> 10, word) & 1023u) / 1023.0 - 0.5) * 1.4142135623730951;
  float rest = sqrt(max(0.0, 1.0 - dot(three, three)));
  vec4 q = largest == 0 ? vec4(rest, three) : largest == 1 ? vec4(three.x, rest, three.yz)
    : largest == 2 ? vec4(three.xy, rest, three.z) : vec4(three, rest);
  float w = q.x, x = q.y, y = q.z, z = q.w;
  return mat3(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
    2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
    2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  int texel = 2 * int(number);
  uvec4 first = texelFetch(splats, ivec2(texel % across, texel / across), 0);
  texel++;
  uvec4 second = texelFetch(splats, ivec2(texel % across, texel / across), 0);
  vec3 sight = uintBitsToFloat(first.xyz) - eye;
  vec3 centre = turn * sight;
  vec2 rg = unpackHalf2x16(first.w), ba = unpackHalf2x16(second.x), s01 = unpackHalf2x16(second.y);
  float cutoff = 2.0 * log(255.0 * ba.y);
  if (centre.z < range.x || !(cutoff > 0.0)) return;
  vec3 scale = exp(vec3(s01, unpackHalf2x16(second.z).x));
  mat3 axes = turn * axesOf(second.w);
  vec2 pixel = focal * centre.xy / centre.z + principal;
  // Derivatives of the pixel by the position.
  vec3 column = vec3(focal.x / centre.z, 0.0, -focal.x * centre.x / (centre.z * centre.z));
  vec3 row = vec3(0.0, focal.y / centre.z, -focal.y * centre.y / (centre.z * centre.z));
  vec2 low, high;
  if (discs) {
    vec3 u = scale.x * axes[0], v = scale.y * axes[1];
    vec2 ju = vec2(dot(column, u), dot(row, u)), jv = vec2(dot(column, v), dot(row, v));
    if (abs(dot(centre, axes[2])) <= 0.02 * length(centre)) return;
    float determinant = ju.x * jv.y - jv.x * ju.y;
    inverse = vec4(jv.y, -jv.x, -ju.y, ju.x) / determinant;
    slopes = vec2(u.z, v.z) / centre.z;
    float beyond = cutoff * dot(slopes, slopes) - 1.0;
    float least = sqrt(0.5 * cutoff);
    if (beyond > -1e-3) {
      low = -pixel - 0.5;
      high = size - pixel - 0.5;
    } else {
      vec2 square = cutoff * (ju * ju + jv * jv), mixed = cutoff * (ju * slopes.x + jv * slopes.y);
      vec2 root = sqrt(max(mixed * mixed - square * beyond, 0.0));
      low = min((mixed + root) / beyond, -least);
      high = max((mixed - root) / beyond, least);
    }
    limits = vec2(cutoff, 2.0);
  } else {
    // Directions far outside of the image have no useful derivative: as 3DGS, take those at its border.
    vec2 wide = 1.3 * 0.5 * size / focal;
    vec2 at = clamp(centre.xy / centre.z, -wide, wide);
    column.z = -focal.x * at.x / centre.z;
    row.z = -focal.y * at.y / centre.z;
    float xx = 0.3, xy = 0.0, yy = 0.3;
    for (int k = 0; k < 3; k++) {
      vec2 j = scale[k] * vec2(dot(column, axes[k]), dot(row, axes[k]));
      xx += j.x * j.x;
      xy += j.x * j.y;
      yy += j.y * j.y;
    }
    // The inverse of the Cholesky factor makes standard deviations of pixels.
    float l11 = sqrt(xx), l21 = xy / l11, l22 = sqrt(max(yy - l21 * l21, 1e-9));
    inverse = vec4(1.0 / l11, 0.0, -l21 / (l11 * l22), 1.0 / l22);
    slopes = vec2(0.0);
    high = sqrt(cutoff * vec2(xx, yy));
    low = -high;
    limits = vec2(cutoff, 1e9);
  }
  low = max(low, -pixel - 1.0);
  high = min(high, size - pixel);
  if (any(greaterThan(low, high))) return;
  offset = mix(low, high, vec2(gl_VertexID & 1, gl_VertexID >> 1));
  colour = vec4(shaded(vec3(rg, ba.x), normalize(sight)), ba.y);
  if (chosen != 0u && texelFetch(objects, ivec2(int(number) % across, int(number) / across), 0).x == chosen) {
    colour.rgb = mix(colour.rgb, vec3(1.0, 0.72, 0.1), 0.6);
  }
  vec2 clip = 2.0 * (pixel + offset + 0.5) / size - 1.0;
  float depth = (range.y + range.x) / (range.y - range.x) - 2.0 * range.x * range.y / ((range.y - range.x) * centre.z);
  // What lies beyond the range is drawn, too.
  gl_Position = vec4(clip.x, -clip.y, min(depth, 1.0), 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
flat in vec4 inverse;
flat in vec2 slopes;
flat in vec4 colour;
flat in vec2 limits;
in vec2 offset;
out vec4 shown;
void main() {
  vec2 p = vec2(dot(inverse.xy, offset), dot(inverse.zw, offset));
  float ratio = 1.0 - dot(slopes, p);
  vec2 uv = p / max(ratio, 0.05);
  float plane = dot(uv, uv), image = limits.y * dot(offset, offset);
  float squared = plane <= image && ratio >= 0.05 ? plane : image;
  if (squared > limits.x) discard;
  float alpha = min(0.99, colour.a * exp(-0.5 * squared));
  shown = vec4(colour.rgb * alpha, alpha);
}`;

export class Splats {
  /** Takes a layer, the answer of the server for it, and the objects of its splats where they have some. */
  constructor(gl, layer, words, harmonics, objects, drawn) {
    Object.assign(this, { gl, layer, objects, drawn, chosen: 0, count: words.byteLength / 32, length: 0, serial: 0, waits: null, busy: false });
    this.program = link(gl, VERTEX, FRAGMENT);
    this.across = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const texels = Math.max(2 * this.count, harmonics.byteLength / 16);
    if (texels > this.across * this.across) throw new Error(`${layer.name} has more splats than this browser can draw.`);
    this.texture = this.upload(new Uint32Array(words), 4);
    this.harmonics = this.upload(new Uint32Array(harmonics.byteLength ? harmonics : 4), 4);
    this.numbers = this.upload(objects?.objects ?? new Uint32Array(1), 1);
    this.buffer = gl.createBuffer();
    this.vertices = gl.createVertexArray();
    gl.bindVertexArray(this.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, 4 * this.count, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(0, 1);
    gl.bindVertexArray(null);
    this.worker = new Worker("space/sort.js");
    this.worker.onmessage = ({ data }) => this.answered(data);
    this.picks = new Map();
    this.worker.postMessage({ words }, [words]);
  }

  /** Makes a texture of words, of which each texel has some. */
  upload(words, channels) {
    const { gl, across } = this;
    const texels = words.length / channels;
    const [kind, format] = channels === 4 ? [gl.RGBA32UI, gl.RGBA_INTEGER] : [gl.R32UI, gl.RED_INTEGER];
    const [rows, rest] = [Math.floor(texels / across), texels % across];
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, kind, across, Math.max(1, rows + (rest ? 1 : 0)));
    const put = (row, width, height, from) =>
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, width, height, format, gl.UNSIGNED_INT, words, from);
    if (rows) put(0, across, rows, 0);
    if (rest) put(rows, rest, 1, channels * across * rows);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    return texture;
  }

  local(place) {
    return place.map((c, i) => c - this.layer.shift[i]);
  }

  /** Asks for the order of a view; of several that wait, only the latest is sorted. */
  sort(view) {
    this.waits = { eye: this.local(view.eye), forward: view.turn[2], near: view.range[0] };
    this.ask();
  }

  ask() {
    if (this.busy || !this.waits) return;
    this.busy = true;
    const back = this.spare;
    this.spare = null;
    this.worker.postMessage({ ...this.waits, back, serial: ++this.serial }, back ? [back] : []);
    this.waits = null;
  }

  answered(data) {
    if ("picked" in data) {
      this.picks.get(data.serial)?.(data.picked);
      this.picks.delete(data.serial);
      return;
    }
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, new Uint32Array(data.order, 0, data.drawn));
    Object.assign(this, { length: data.drawn, spare: data.order, busy: false });
    this.ask();
    this.drawn();
  }

  get isSorted() {
    return !this.busy && !this.waits;
  }

  /** Returns the distance along a ray at which it meets the splats, and these with their weights; or null. */
  pick(eye, direction, pixel) {
    const serial = ++this.serial;
    return new Promise((found) => {
      this.picks.set(serial, found);
      this.worker.postMessage({ pick: { eye: this.local(eye), direction, pixel }, serial });
    });
  }

  draw(view, size) {
    const { gl, program, layer } = this;
    const at = (name) => gl.getUniformLocation(program, name);
    gl.useProgram(program);
    [this.texture, this.harmonics, this.numbers].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.uniform1i(at("splats"), 0);
    gl.uniform1i(at("harmonics"), 1);
    gl.uniform1i(at("objects"), 2);
    gl.uniform1ui(at("chosen"), this.chosen);
    gl.uniform1i(at("across"), this.across);
    gl.uniform1i(at("degree"), layer.degree);
    gl.uniform1i(at("texels"), Math.ceil((3 * ((layer.degree + 1) ** 2 - 1)) / 8));
    gl.uniform1i(at("discs"), layer.discs ? 1 : 0);
    gl.uniformMatrix3fv(at("turn"), true, view.turn.flat());
    gl.uniform3fv(at("eye"), this.local(view.eye));
    gl.uniform2fv(at("focal"), view.focal);
    gl.uniform2fv(at("principal"), view.principal);
    gl.uniform2fv(at("size"), size);
    gl.uniform2fv(at("range"), view.range);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.depthFunc(gl.LEQUAL);
    gl.bindVertexArray(this.vertices);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.length);
    gl.bindVertexArray(null);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
}

export function link(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`This browser cannot draw splats: ${gl.getShaderInfoLog(shader)}`);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error("This browser cannot draw splats.");
  return program;
}
