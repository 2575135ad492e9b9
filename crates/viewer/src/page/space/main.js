// The page of splats and meshes.

import { Camera, dot, unit } from "./camera.js";
import { Mesh, parts } from "./mesh.js";
import { Objects } from "./objects.js";
import { Splats, link } from "./splats.js";

const $ = (id) => document.getElementById(id);
const ask = async (path) => {
  const found = await fetch(path);
  if (!found.ok) throw new Error(`The viewer has no answer to ${path}: ${await found.text()}`);
  return found;
};
let hides = 0;
function message(text) {
  clearTimeout(hides);
  $("message").hidden = !text;
  $("message").textContent = text;
  if (text) hides = setTimeout(() => ($("message").hidden = true), 12000);
}

const dark = matchMedia("(prefers-color-scheme: dark)");
const paint = () => (document.documentElement.dataset.theme = dark.matches ? "dark" : "light");
dark.addEventListener("change", paint);
paint();

const scene = await (await ask("space.json")).json();
const canvas = $("space");
const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
if (!gl) {
  message("This browser has no WebGL 2, which this page needs. The map works without it.");
  throw new Error("no WebGL 2");
}
// Sums of many faint splats need more than 8 bits.
const isFine = gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float");
const [sheet, depth] = [gl.createTexture(), gl.createRenderbuffer()];
const target = gl.createFramebuffer();
const finish = link(gl, `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`, `#version 300 es
precision highp float;
uniform sampler2D sheet; uniform float ground;
out vec4 colour;
void main() {
  vec4 found = texelFetch(sheet, ivec2(gl_FragCoord.xy), 0);
  colour = vec4(found.rgb + (1.0 - found.a) * ground, 1.0);
}`);
const empty = gl.createVertexArray();

let layers = [];
let size = [0, 0];
let asked = false;

// The up of a frame without a map is that of its cameras.
const sum = scene.cameras.reduce((all, { rotation }) => all.map((c, i) => c - rotation[1][i]), [0, 0, 0]);
const isMap = scene.crs !== null;
const camera = new Camera(canvas, !isMap && Math.hypot(...sum) > 0 ? sum : [0, 0, 1], () => {
  layers.forEach(({ item, shown }) => shown && item.sort(camera.view(size)));
  redraw();
});

function redraw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    draw();
  });
}

function resize() {
  const scale = devicePixelRatio || 1;
  size = [Math.max(1, Math.round(canvas.clientWidth * scale)), Math.max(1, Math.round(canvas.clientHeight * scale))];
  [canvas.width, canvas.height] = size;
  gl.bindTexture(gl.TEXTURE_2D, sheet);
  const [kind, type] = isFine ? [gl.RGBA16F, gl.HALF_FLOAT] : [gl.RGBA8, gl.UNSIGNED_BYTE];
  gl.texImage2D(gl.TEXTURE_2D, 0, kind, ...size, 0, gl.RGBA, type, null);
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, ...size);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, sheet, 0);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  draw();
}

function draw() {
  const view = camera.view(size);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.viewport(0, 0, ...size);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.disable(gl.BLEND);
  gl.enable(gl.DEPTH_TEST);
  const shown = layers.filter((layer) => layer.shown);
  // Meshes hide splats behind them, so they come first.
  for (const kind of [Mesh, Splats]) shown.filter(({ item }) => item instanceof kind).forEach(({ item }) => item.draw(view, size));
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.disable(gl.DEPTH_TEST);
  gl.useProgram(finish);
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, sheet);
  gl.uniform1i(gl.getUniformLocation(finish, "sheet"), 0);
  gl.uniform1f(gl.getUniformLocation(finish, "ground"), Number($("ground").value));
  gl.bindVertexArray(empty);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  gl.bindVertexArray(null);
  const scale = devicePixelRatio || 1;
  $("frame").hidden = !view.frame;
  if (view.frame) ["left", "top", "width", "height"].forEach((side, i) => ($("frame").style[side] = `${view.frame[i] / scale}px`));
  directions(view);
  mark(view);
  document.documentElement.dataset.drawn = layers.every(({ item, shown: on }) => !on || item.isSorted) ? "all" : "part";
}

/** Draws the arrows of north, east and up. */
function directions({ turn }) {
  const names = isMap ? [["e", "E", [1, 0, 0]], ["n", "N", [0, 1, 0]], ["u", "up", [0, 0, 1]]]
    : [["e", "x", [1, 0, 0]], ["n", "y", [0, 1, 0]], ["u", "z", [0, 0, 1]]];
  const make = (name, of) => {
    const one = document.createElementNS("http://www.w3.org/2000/svg", name);
    Object.entries(of).forEach(([key, value]) => one.setAttribute(key, value));
    return one;
  };
  const arrows = names.map(([kind, name, axis]) => ({ kind, name, at: turn.map((row) => 33 * dot(row, axis)) }));
  arrows.sort((a, b) => b.at[2] - a.at[2]);
  $("axes").replaceChildren(make("circle", { r: 48 }), ...arrows.flatMap(({ kind, name, at: [x, y] }) => {
    const text = make("text", { x: 1.22 * x, y: 1.22 * y, class: kind });
    text.textContent = name;
    return [make("line", { x1: 0, y1: 0, x2: x, y2: y, class: kind }), text];
  }));
}

// Positions of clicked points.

let place = null;
function mark(view) {
  $("spot").hidden = true;
  if (!place) return;
  const c = view.turn.map((row) => dot(row, place.map((p, i) => p - view.eye[i])));
  if (c[2] <= 0) return;
  const scale = devicePixelRatio || 1;
  $("spot").hidden = false;
  ["left", "top"].forEach((side, i) => ($("spot").style[side] = `${((view.focal[i] * c[i]) / c[2] + view.principal[i] + 0.5) / scale}px`));
}

camera.clicked = async (x, y) => {
  const view = camera.view(size);
  const scale = devicePixelRatio || 1;
  const at = [x, y].map((p, i) => (p * scale - 0.5 - view.principal[i]) / view.focal[i]);
  const direction = unit([0, 1, 2].map((i) => at[0] * view.turn[0][i] + at[1] * view.turn[1][i] + view.turn[2][i]));
  const shown = layers.filter((layer) => layer.shown);
  const found = await Promise.all(shown.map(({ item }) => item.pick(view.eye, direction, 1 / view.focal[0])));
  let nearest = null;
  found.forEach((hit, i) => {
    if (hit && (!nearest || hit.distance < nearest.distance)) nearest = { ...hit, ...shown[i] };
  });
  place = nearest && view.eye.map((c, i) => c + nearest.distance * direction[i]);
  readOut(nearest);
  choose(nearest);
  mark(view);
};

/** Shows what is known of the object of a click, and marks its splats. */
function choose(nearest) {
  const objects = nearest?.item.objects;
  const met = objects ? objects.met(nearest.parts) : null;
  layers.forEach(({ item }) => (item.chosen = met && item === nearest.item ? met.object : 0));
  $("object").hidden = !met;
  const lines = met ? [...objects.lines(met), ["splats", objects.count(met.object).toLocaleString("en")]] : [];
  const make = (kind, textContent) => Object.assign(document.createElement(kind), { textContent });
  $("attributes").replaceChildren(...lines.flatMap(([name, text]) => [make("dt", name), make("dd", text)]));
  redraw();
}

function readOut(nearest) {
  if (!place) return void ($("readout").textContent = "There is nothing at this place.");
  const whole = place.map((c, i) => c + scene.origin[i]);
  const names = isMap ? ["easting", "northing", "height"] : ["x", "y", "z"];
  const shown = names.map((name, i) => [name, `${whole[i].toFixed(2)}${isMap ? " m" : ""}`]);
  shown.push(["distance", `${nearest.distance.toFixed(2)}${isMap ? " m" : ""}`], ["of", nearest.layer.name]);
  if (isMap) shown.push(["in", `${scene.crs_name}, heights above ${scene.vertical}`]);
  $("readout").replaceChildren(...shown.map(([name, text]) => {
    const span = document.createElement("span");
    span.append(`${name} `, Object.assign(document.createElement("b"), { textContent: text }));
    return span;
  }));
  $("readout").dataset.place = JSON.stringify(whole);
}

// What is shown.

function entry(layer, item, unitName) {
  const one = { layer, item, shown: true };
  layers.push(one);
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
  box.addEventListener("change", () => {
    one.shown = box.checked;
    if (one.shown) item.sort(camera.view(size));
    redraw();
  });
  const label = document.createElement("label");
  const count = Object.assign(document.createElement("small"), { textContent: `${item.count.toLocaleString("en")} ${unitName}` });
  label.append(box, layer.name, count);
  $("layers").append(label);
}

let ball = null;
function fit() {
  if (ball) camera.fit(ball.centre, ball.radius);
}

/** Returns the middle and the extent of most of some positions: few far ones do not count. */
function around(places, step, shift) {
  const count = Math.floor(places.length / step);
  const every = Math.max(1, Math.floor(count / 20000));
  const sides = [0, 1, 2].map((i) => {
    const values = [];
    for (let k = 0; k < count; k += every) values.push(places[k * step + i] + shift[i]);
    values.sort((a, b) => a - b);
    return [values[Math.floor(0.1 * (values.length - 1))], values[Math.ceil(0.9 * (values.length - 1))]];
  });
  const centre = sides.map(([a, b]) => (a + b) / 2);
  return { centre, radius: Math.max(1e-3, 0.75 * Math.hypot(...sides.map(([a, b]) => b - a))) };
}

async function load() {
  for (const [number, layer] of scene.splats.entries()) {
    message(`Loading ${layer.name} …`);
    const words = await (await ask(`splats/${number}.bin`)).arrayBuffer();
    const harmonics = layer.degree ? await (await ask(`harmonics/${number}.bin`)).arrayBuffer() : new ArrayBuffer(0);
    ball ??= around(new Float32Array(words), 8, layer.shift);
    const labels = layer.labelled ? await (await ask(`labels/${number}.bin`)).arrayBuffer() : null;
    const objects = labels ? new Objects(labels, await (await ask(`objects/${number}.json`)).json()) : null;
    entry(layer, new Splats(gl, layer, words, harmonics, objects, redraw), "splats");
  }
  for (const [number, layer] of scene.meshes.entries()) {
    message(`Loading ${layer.name} …`);
    const { made, crs } = parts(await (await ask(`meshes/${number}.glb`)).arrayBuffer());
    if (!made.length) throw new Error(`${layer.name} has no triangles.`);
    if (crs && scene.crs && crs !== scene.crs) throw new Error(`${layer.name} is in ${crs}, the scene in ${scene.crs}: convert one of them.`);
    if (!scene.has_origin) {
      // A scene of meshes alone counts from the first corner, rounded, so that f32 is precise.
      scene.origin = [0, 1, 2].map((i) => Math.round(made[0].places[i] / 1000) * 1000);
      scene.has_origin = true;
    }
    // Files without a place of their own lie in the frame of the scene.
    const far = [0, 1].some((i) => Math.abs(made[0].places[i]) > 1e5);
    const origin = far ? scene.origin : [0, 1, 2].map((i) => -layer.shift[i]);
    const mesh = new Mesh(gl, layer, made, origin);
    ball ??= around(mesh.parts[0].local, 3, [0, 0, 0]);
    entry(layer, mesh, "triangles");
  }
  message("");
}

const name = scene.crs_name ? `${scene.crs_name}, heights above ${scene.vertical}` : "no coordinate system";
$("system").textContent = name;
$("to-map").hidden = !scene.has_map;
$("cameras").hidden = !scene.cameras.length;
const order = scene.cameras.map((one, i) => [one, i]).sort(([a], [b]) => Number(b.held_out) - Number(a.held_out));
for (const [one, i] of order) $("camera").append(new Option(one.held_out ? `${one.name} (held out)` : one.name, i));
$("camera").addEventListener("change", () => camera.take(scene.cameras[Number($("camera").value)]));
function step(by) {
  const options = $("camera").options;
  if (!options.length) return;
  $("camera").selectedIndex = (($("camera").selectedIndex < 0 && by < 0 ? 0 : $("camera").selectedIndex) + by + options.length) % options.length;
  camera.take(scene.cameras[Number($("camera").value)]);
}

function fly(on) {
  camera.flies = on;
  $("fly").setAttribute("aria-pressed", on);
}
$("fit").addEventListener("click", fit);
$("fly").addEventListener("click", () => fly(!camera.flies));
$("help").addEventListener("click", () => $("keys").showModal());
$("ground").addEventListener("change", redraw);
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input") || $("keys").open) return;
  const keys = { 0: fit, f: () => fly(!camera.flies), n: () => step(1), p: () => step(-1), "?": () => $("keys").showModal() };
  const action = keys[event.key.toLowerCase()];
  if (action) action();
  if (action || camera.key(event)) event.preventDefault();
});

resize();
new ResizeObserver(resize).observe(canvas);
try {
  await load();
} catch (error) {
  message(error.message);
}
fit();
document.documentElement.dataset.ready = "true";
