// The surface from the side: a mesh of reduced heights with the picture of a layer, in WebGL 2.
//
// The mesh lies around the origin. x is east, y is north (for rasters that are), z is up; the longer
// side of the ground has the length 2. Cells without a height are holes.

import { hatch } from "./legend.js";
import { ask, distance } from "./numbers.js";

/** Most vertices along a side, and the side of the picture, pixels. */
const SIDE = 480;
const PICTURE = 1024;

const VERTEX = `#version 300 es
in vec3 place; in vec3 up; in vec2 spot;
uniform mat4 look; uniform float exaggeration;
out vec2 at; out float light;
void main() {
  gl_Position = look * vec4(place.xy, place.z * exaggeration, 1.0);
  vec3 normal = normalize(vec3(up.xy * exaggeration, up.z));
  light = clamp(dot(normal, normalize(vec3(-0.5, 0.5, 0.75))), 0.0, 1.0);
  at = spot;
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec2 at; in float light;
uniform sampler2D picture; uniform float shade;
out vec4 colour;
void main() {
  vec4 found = texture(picture, at);
  vec3 shown = mix(vec3(0.62), found.rgb, found.a);
  colour = vec4(shown * mix(1.0, 0.35 + 0.8 * light, shade), 1.0);
}`;

export class Surface {
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error("This browser has no WebGL 2, which the 3D view needs. The map works without it.");
    this.program = link(this.gl);
    this.exaggeration = 1;
    this.reset();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  reset() {
    Object.assign(this, { turn: -0.6, tilt: 0.75, away: 3.2, target: [0, -0.08, 0] });
  }

  /** Loads a window of the heights of a raster. */
  async load(index, cells, metres) {
    const query = `c=${cells.c}&r=${cells.r}&w=${cells.w}&h=${cells.h}&side=${SIDE}`;
    const bytes = await (await ask(`grid/${index}?${query}`)).arrayBuffer();
    const [columns, rows] = new Uint32Array(bytes, 0, 2);
    const heights = new Float32Array(bytes, 8);
    this.mesh = build(heights, columns, rows, cells.w * metres[0], cells.h * metres[1]);
    this.upload();
    return this.mesh;
  }

  /** Gives the mesh to the graphics processor, in the place of an earlier one. */
  upload() {
    const { gl, program, mesh } = this;
    this.buffers?.forEach((buffer) => gl.deleteBuffer(buffer));
    this.buffers = [0, 1, 2, 3].map(() => gl.createBuffer());
    [["place", mesh.places, 3], ["up", mesh.ups, 3], ["spot", mesh.spots, 2]].forEach(([name, data, size], i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[i]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[3]);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STATIC_DRAW);
  }

  /** Lays pictures over the surface, each a layer with its window of cells; all but the first are hatched. */
  async paint(pictures, shade) {
    const images = await Promise.all(pictures.map(async ([layer, cells]) => {
      const query = `c=${cells.c}&r=${cells.r}&w=${cells.w}&h=${cells.h}&side=${PICTURE}`;
      return createImageBitmap(await (await ask(`picture/${layer}.png?${query}`)).blob());
    }));
    const size = { width: images[0].width, height: images[0].height };
    const [sheet, over] = [0, 1].map(() => Object.assign(document.createElement("canvas"), size));
    const [context, marks] = [sheet, over].map((one) => one.getContext("2d"));
    context.drawImage(images[0], 0, 0);
    marks.imageSmoothingEnabled = false;
    images.slice(1).forEach((image) => marks.drawImage(image, 0, 0, size.width, size.height));
    hatch(marks, 6);
    context.drawImage(over, 0, 0);
    const { gl } = this;
    gl.deleteTexture(this.texture ?? null);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, sheet);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    this.shade = shade;
    this.draw();
  }

  draw() {
    const { gl, canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.mesh || !this.texture) return;
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.program);
    const at = (name) => gl.getUniformLocation(this.program, name);
    gl.uniformMatrix4fv(at("look"), false, this.look(canvas.width / canvas.height));
    gl.uniform1f(at("exaggeration"), this.exaggeration);
    gl.uniform1f(at("shade"), this.shade);
    gl.drawElements(gl.TRIANGLES, this.mesh.triangles.length, gl.UNSIGNED_INT, 0);
  }

  /** Returns the directions of the camera: to its right, up, and back towards it. */
  directions() {
    const [s, c, st, ct] = [Math.sin(this.turn), Math.cos(this.turn), Math.sin(this.tilt), Math.cos(this.tilt)];
    return [[c, s, 0], [-s * st, c * st, ct], [s * ct, -c * ct, st]];
  }

  /** Returns the matrix from the scene to the screen, by columns. */
  look(aspect) {
    const [right, up, back] = this.directions();
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const [near, far] = [this.away / 50, this.away + 6];
    const zoom = 1 / Math.tan(0.35);
    const [zx, zy] = aspect > 1 ? [zoom / aspect, zoom] : [zoom, zoom * aspect];
    const depth = (far + near) / (near - far);
    const moved = [-dot(right, this.target), -dot(up, this.target), -dot(back, this.target) - this.away];
    const column = (i) => [zx * right[i], zy * up[i], depth * back[i], -back[i]];
    const last = [zx * moved[0], zy * moved[1], depth * moved[2] + (2 * far * near) / (near - far), -moved[2]];
    return new Float32Array([...column(0), ...column(1), ...column(2), ...last]);
  }

  rotate(right, down) {
    this.turn -= right * 0.006;
    this.tilt = Math.min(Math.max(this.tilt + down * 0.006, 0.05), 1.55);
    this.draw();
  }

  move(right, down) {
    const [r, u] = this.directions();
    const step = this.away / Math.max(this.canvas.clientHeight, 1) * 0.75;
    this.target = this.target.map((t, i) => Math.min(Math.max(t - r[i] * right * step + u[i] * down * step, -2), 2));
    this.draw();
  }

  zoom(factor) {
    this.away = Math.min(Math.max(this.away / factor, 0.15), 12);
    this.draw();
  }

  listen() {
    let moves = null;
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      moves = event.shiftKey || event.button === 2;
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (moves === null) return;
      if (moves) this.move(event.movementX, event.movementY);
      else this.rotate(event.movementX, event.movementY);
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => (moves = null));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(2 ** (-Math.max(-200, Math.min(200, event.deltaY)) / 300));
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, 20], ArrowDown: [0, -20] };
      const turn = turns[event.key];
      if (turn) event.preventDefault();
      if (turn && event.shiftKey) this.move(-turn[0], turn[1]);
      else if (turn) this.rotate(...turn);
      else if (event.key === "+" || event.key === "=") this.zoom(1.25);
      else if (event.key === "-") this.zoom(0.8);
      else if (event.key === "r" || event.key === "R") (this.reset(), this.draw());
    });
  }
}

/** Makes vertices and triangles of heights in metres; the ground measures `wide` × `high` metres. */
function build(heights, columns, rows, wide, high) {
  const scale = 2 / Math.max(wide, high);
  let [low, top] = [Infinity, -Infinity];
  for (const h of heights) if (h < low) low = h;
  for (const h of heights) if (h > top) top = h;
  const middle = (low + top) / 2;
  const [places, ups, spots] = [3, 3, 2].map((n) => new Float32Array(n * heights.length));
  const [dx, dy] = [(wide / columns) * scale, (high / rows) * scale];
  const at = (c, r, otherwise) => {
    const h = heights[Math.min(Math.max(r, 0), rows - 1) * columns + Math.min(Math.max(c, 0), columns - 1)];
    return Number.isNaN(h) ? otherwise : h;
  };
  const triangles = [];
  for (let r = 0, i = 0; r < rows; r++) {
    for (let c = 0; c < columns; c++, i++) {
      const h = heights[i];
      places.set([(c + 0.5) * dx - (wide * scale) / 2, (high * scale) / 2 - (r + 0.5) * dy, (h - middle) * scale], 3 * i);
      ups.set([((at(c - 1, r, h) - at(c + 1, r, h)) * scale) / (2 * dx), ((at(c, r + 1, h) - at(c, r - 1, h)) * scale) / (2 * dy), 1], 3 * i);
      spots.set([(c + 0.5) / columns, (r + 0.5) / rows], 2 * i);
      if (c + 1 === columns || r + 1 === rows) continue;
      const [b, d, e] = [i + 1, i + columns, i + columns + 1];
      if (!Number.isNaN(heights[b]) && !Number.isNaN(heights[d])) {
        if (!Number.isNaN(h)) triangles.push(i, d, b);
        if (!Number.isNaN(heights[e])) triangles.push(b, d, e);
      }
    }
  }
  const text = `${columns} × ${rows} heights over ${distance(wide, "m")} × ${distance(high, "m")}`;
  return { places, ups, spots, triangles: new Uint32Array(triangles), text };
}

function link(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error("The 3D view cannot be drawn by this browser.");
  return program;
}
