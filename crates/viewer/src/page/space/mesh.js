// Triangles of a GLB file: positions, normals, colours of corners, colours of materials.
//
// glTF has the axes x east, y up, z south; the scene has x east, y north, z up. Positions of the
// nodes are added in f64 and given to WebGL relative to the origin of the scene.

import { link } from "./splats.js";

const VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 up;
layout(location = 2) in vec3 tint;
uniform mat3 turn;
uniform vec3 eye;
uniform vec2 focal, principal, size, range;
out vec3 shown, facing, sight;
void main() {
  sight = place - eye;
  vec3 c = turn * sight;
  vec2 clip = (2.0 * (focal * c.xy + (principal + 0.5) * c.z)) / size - c.z;
  gl_Position = vec4(clip.x, -clip.y, (c.z * (range.y + range.x) - 2.0 * range.x * range.y) / (range.y - range.x), c.z);
  shown = tint;
  facing = up;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 shown, facing, sight;
out vec4 colour;
void main() {
  // A mesh without normals has those of its faces.
  vec3 n = dot(facing, facing) > 0.0 ? facing : cross(dFdx(sight), dFdy(sight));
  n = normalize(n);
  if (dot(n, sight) > 0.0) n = -n;
  float light = 0.6 + 0.4 * max(dot(n, normalize(vec3(-0.5, -0.4, 0.8))), 0.0);
  colour = vec4(pow(shown, vec3(1.0 / 2.2)) * light, 1.0);
}`;

const COMPONENTS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };
const ARRAYS = { 5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const WHOLE = { 5120: 127, 5121: 255, 5122: 32767, 5123: 65535 };

/** Reads the two chunks of a GLB file. */
export function chunks(bytes) {
  const view = new DataView(bytes);
  if (bytes.byteLength < 20 || view.getUint32(0, true) !== 0x46546c67) throw new Error("it is no binary glTF file");
  const length = view.getUint32(12, true);
  const document = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, length)));
  const start = 20 + length + 8;
  return { document, binary: start < bytes.byteLength ? start : bytes.byteLength };
}

/** Returns the parts of a file: positions in the scene (f64, absolute), normals, colours, corners. */
export function parts(bytes) {
  const { document, binary } = chunks(bytes);
  const needs = document.extensionsRequired ?? [];
  if (needs.length) throw new Error(`it needs ${needs.join(", ")}, which this page cannot draw`);
  const array = (number) => {
    const accessor = document.accessors[number];
    const buffer = document.bufferViews[accessor.bufferView] ?? {};
    const [Kind, width] = [ARRAYS[accessor.componentType], COMPONENTS[accessor.type]];
    if (!Kind || !width || accessor.sparse || accessor.bufferView === undefined) throw new Error("it has arrays that this page cannot read");
    const own = width * Kind.BYTES_PER_ELEMENT;
    const stride = buffer.byteStride ?? own;
    const start = binary + (buffer.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    const found = new Kind(width * accessor.count);
    const all = new Uint8Array(found.buffer);
    if (stride === own) all.set(new Uint8Array(bytes, start, all.length));
    else for (let i = 0; i < accessor.count; i++) all.set(new Uint8Array(bytes, start + i * stride, own), i * own);
    return { found, width, unit: accessor.normalized ? WHOLE[accessor.componentType] : 1 };
  };
  const stated = document.asset?.extras?.origin;
  const made = [];
  const walk = (number, above) => {
    const node = document.nodes[number];
    const matrix = times(above, node.matrix ?? placed(node));
    for (const part of node.mesh === undefined ? [] : document.meshes[node.mesh].primitives) {
      if ((part.mode ?? 4) !== 4 || part.attributes.POSITION === undefined) continue;
      made.push(primitive(document, part, array, matrix, Array.isArray(stated) ? stated : [0, 0, 0]));
    }
    for (const child of node.children ?? []) walk(child, matrix);
  };
  const scene = document.scenes?.[document.scene ?? 0];
  const roots = scene?.nodes ?? (document.nodes ?? []).map((_, i) => i);
  roots.forEach((root) => walk(root, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]));
  return { made, crs: document.asset?.extras?.crs ?? null };
}

function primitive(document, part, array, m, origin) {
  const { found: own } = array(part.attributes.POSITION);
  const count = own.length / 3;
  const turned = (x, y, z, w) => {
    const [a, b, c] = [0, 1, 2].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r] * w);
    return [a, -c, b];
  };
  const places = new Float64Array(own.length);
  for (let i = 0; i < count; i++) {
    const [x, y, z] = turned(own[3 * i], own[3 * i + 1], own[3 * i + 2], 1);
    places.set([x + origin[0], y + origin[1], z + origin[2]], 3 * i);
  }
  const ups = new Float32Array(own.length);
  if (part.attributes.NORMAL !== undefined) {
    const { found, unit } = array(part.attributes.NORMAL);
    for (let i = 0; i < count; i++) ups.set(turned(found[3 * i] / unit, found[3 * i + 1] / unit, found[3 * i + 2] / unit, 0), 3 * i);
  }
  const base = document.materials?.[part.material]?.pbrMetallicRoughness?.baseColorFactor ?? [0.6, 0.6, 0.6, 1];
  const tints = new Float32Array(own.length);
  const tint = part.attributes.COLOR_0 === undefined ? null : array(part.attributes.COLOR_0);
  const factor = tint && part.material === undefined ? [1, 1, 1] : base;
  for (let i = 0; i < count; i++) {
    for (let c = 0; c < 3; c++) tints[3 * i + c] = factor[c] * (tint ? tint.found[tint.width * i + c] / tint.unit : 1);
  }
  const corners = part.indices === undefined ? Uint32Array.from({ length: count }, (_, i) => i) : Uint32Array.from(array(part.indices).found);
  return { places, ups, tints, corners };
}

/** Returns the matrix of a node's translation, rotation and scale, by columns. */
function placed({ translation: t = [0, 0, 0], rotation: [x, y, z, w] = [0, 0, 0, 1], scale: [a, b, c] = [1, 1, 1] }) {
  return [
    a * (1 - 2 * (y * y + z * z)), a * 2 * (x * y + w * z), a * 2 * (x * z - w * y), 0,
    b * 2 * (x * y - w * z), b * (1 - 2 * (x * x + z * z)), b * 2 * (y * z + w * x), 0,
    c * 2 * (x * z + w * y), c * 2 * (y * z - w * x), c * (1 - 2 * (x * x + y * y)), 0,
    ...t, 1,
  ];
}

function times(a, b) {
  return Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0));
}

export class Mesh {
  /** Takes the parts of a file and the origin of the scene in the coordinates of the parts. */
  constructor(gl, layer, made, origin) {
    Object.assign(this, { gl, layer, program: link(gl, VERTEX, FRAGMENT), isSorted: true });
    this.parts = made.map(({ places, ups, tints, corners }) => {
      const local = Float32Array.from(places, (c, i) => c - origin[i % 3]);
      const vertices = gl.createVertexArray();
      gl.bindVertexArray(vertices);
      [local, ups, tints].forEach((data, i) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
        gl.enableVertexAttribArray(i);
        gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 0, 0);
      });
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
      gl.bindVertexArray(null);
      return { vertices, corners, local };
    });
    this.count = made.reduce((sum, part) => sum + part.corners.length / 3, 0);
  }

  sort() {}

  draw(view, size) {
    const { gl, program } = this;
    const at = (name) => gl.getUniformLocation(program, name);
    gl.useProgram(program);
    gl.uniformMatrix3fv(at("turn"), true, view.turn.flat());
    gl.uniform3fv(at("eye"), view.eye);
    gl.uniform2fv(at("focal"), view.focal);
    gl.uniform2fv(at("principal"), view.principal);
    gl.uniform2fv(at("size"), size);
    gl.uniform2fv(at("range"), view.range);
    gl.enable(gl.DEPTH_TEST);
    for (const { vertices, corners } of this.parts) {
      gl.bindVertexArray(vertices);
      gl.drawElements(gl.TRIANGLES, corners.length, gl.UNSIGNED_INT, 0);
    }
    gl.bindVertexArray(null);
  }

  /** Returns the distance along a ray to the nearest triangle, or null (Möller and Trumbore). */
  async pick(eye, direction) {
    let nearest = Infinity;
    const [dx, dy, dz] = direction;
    for (const { corners, local } of this.parts) {
      for (let k = 0; k < corners.length; k += 3) {
        const [a, b, c] = [3 * corners[k], 3 * corners[k + 1], 3 * corners[k + 2]];
        const [ax, ay, az] = [local[a], local[a + 1], local[a + 2]];
        const [ux, uy, uz] = [local[b] - ax, local[b + 1] - ay, local[b + 2] - az];
        const [vx, vy, vz] = [local[c] - ax, local[c + 1] - ay, local[c + 2] - az];
        const [px, py, pz] = [dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx];
        const inverse = 1 / (ux * px + uy * py + uz * pz);
        const [tx, ty, tz] = [eye[0] - ax, eye[1] - ay, eye[2] - az];
        const u = (tx * px + ty * py + tz * pz) * inverse;
        if (!(u >= 0 && u <= 1)) continue;
        const [qx, qy, qz] = [ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux];
        const v = (dx * qx + dy * qy + dz * qz) * inverse;
        const t = (vx * qx + vy * qy + vz * qz) * inverse;
        if (v >= 0 && u + v <= 1 && t > 0 && t < nearest) nearest = t;
      }
    }
    return nearest < Infinity ? { distance: nearest } : null;
  }
}
