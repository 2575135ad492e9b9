// The page: layers, tools, keys and the read-out around the map.

import { row, hatching, showLegend } from "./legend.js";
import { MapView } from "./map.js";
import { ask, withUnit } from "./numbers.js";
import { Profile } from "./profile.js";
import { Surface } from "./surface.js";
import { Vectors } from "./vectors.js";

const $ = (id) => document.getElementById(id);
let hides = 0;
let pair = null;
const scene = await (await ask("scene.json")).json().catch((error) => message(error.message));
const plain = scene.layers.map((_, i) => i).filter((i) => !scene.layers[i].is_overlay);
const overlays = scene.layers.map((_, i) => i).filter((i) => scene.layers[i].is_overlay);
const unitOf = (layer) => scene.rasters[scene.layers[layer].raster].unit;

const failed = (error) => message(error.message);
const map = new MapView($("map"), scene, { moved, pointed: (x, y, byKey) => pointed(x, y, byKey, map), drawn, failed, clicked });
const profile = new Profile($("plot"), $("profile-at"), scene, (place) => ((map.mark = place), map.redraw()));
let surface = null;
let tool = null;

// Layers.

$("system").textContent = [scene.map.name, scene.map.vertical && `heights: ${scene.map.vertical}`].filter(Boolean).join(" · ");
$("to-space").hidden = !scene.has_space;
document.title = `${scene.rasters[0].file} – skysweep view`;
for (const i of plain) {
  const label = document.createElement("label");
  label.title = scene.rasters[scene.layers[i].raster].file;
  label.append(input("radio", "layer", () => choose(i)), scene.layers[i].title);
  $("layers").append(label);
  for (const id of ["second-layer", "mesh-layer"]) $(id).append(new Option(scene.layers[i].title, i));
}
for (const i of overlays) {
  const label = document.createElement("label");
  const field = row(hatching(scene.layers[i].legend.colour), "");
  const box = input("checkbox", "overlay", () => overlay(i, box.checked));
  label.append(box, field, scene.layers[i].title);
  $("overlays").append(label);
}

// Lines and areas over all layers.

const vectors = scene.vectors.map((one, number) => new Vectors(one, number, scene.vectors));
$("vectors").hidden = !vectors.length;
for (const one of vectors) {
  const label = document.createElement("label");
  const line = document.createElement("i");
  line.style.color = one.colour;
  const box = input("checkbox", "vectors", () => showVectors(one, box.checked));
  label.append(box, line, one.title, Object.assign(document.createElement("small"), { textContent: one.count }));
  $("vectors").append(label);
}

async function showVectors(one, shown) {
  try {
    if (shown) await one.load();
  } catch (error) {
    message(error.message);
  }
  one.shown = shown;
  if (!shown && picked?.vectors === one) pick(null);
  map.vectors = vectors.filter((all) => all.shown);
  map.redraw();
  if (pair) {
    pair.vectors = map.vectors;
    pair.redraw();
  }
}

let picked = null;
function clicked(x, y) {
  for (const one of [...map.vectors].reverse()) {
    const feature = one.at(map, x, y);
    if (feature) return pick({ vectors: one, feature });
  }
  pick(null);
}

/** Shows the attributes of a feature, and marks it. */
function pick(found) {
  vectors.forEach((one) => (one.picked = found?.vectors === one ? found.feature : null));
  picked = found;
  $("feature").hidden = !found;
  if (found) {
    const heading = document.createElement("h2");
    const close = Object.assign(document.createElement("button"), { type: "button", textContent: "×", title: "Close" });
    close.addEventListener("click", () => pick(null));
    heading.append(found.vectors.title, close);
    const table = document.createElement("table");
    for (const [name, text] of found.vectors.attributes(found.feature)) {
      const row = table.insertRow();
      row.append(Object.assign(document.createElement("th"), { textContent: name, scope: "row" }));
      row.insertCell().textContent = text;
    }
    $("feature").replaceChildren(heading, table);
  }
  map.redraw();
  pair?.redraw();
}

function input(type, name, changed) {
  const element = Object.assign(document.createElement("input"), { type, name });
  element.addEventListener("change", changed);
  return element;
}

function choose(layer) {
  map.layer = layer;
  document.querySelectorAll("#layers input")[plain.indexOf(layer)].checked = true;
  legends();
  map.redraw();
}

function overlay(layer, shown) {
  for (const one of pair ? [map, pair] : [map]) {
    if (shown) one.overlays.add(layer);
    else one.overlays.delete(layer);
    one.redraw();
  }
}

function legends() {
  const right = pair ? pair.layer : map.second;
  showLegend($("legend"), scene.layers[map.layer], unitOf(map.layer));
  $("legend-2").hidden = right === null;
  $("legend").parentElement.classList.toggle("beside", right !== null);
  if (right !== null) showLegend($("legend-2"), scene.layers[right], unitOf(right));
}

// The read-out asks for one position at a time, and then for the latest one.

let place = null;
let asks = false;
async function pointed(x, y, byKey = false, on = map) {
  $("cross").hidden = pair !== null || (!byKey && tool !== "profile");
  if (pair) {
    const other = on === map ? pair : map;
    [on.cursor, other.cursor] = [null, [x, y]];
    on.redraw();
    other.redraw();
  }
  place = [x, y];
  if (asks) return;
  asks = true;
  try {
    while (place) {
      const [px, py] = place;
      place = null;
      readOut(px, py, (await (await ask(`at?x=${px}&y=${py}`)).json()).values);
    }
  } catch (error) {
    message(error.message);
  }
  asks = false;
}

function readOut(x, y, values) {
  const digits = { m: 2, "°": 7, px: 1 }[scene.map.unit] ?? 3;
  const shown = [["x", x.toFixed(digits)], ["y", y.toFixed(digits)]];
  const seen = new Set();
  for (const { raster, title, legend } of scene.layers) {
    if (seen.has(raster)) continue;
    seen.add(raster);
    shown.push([title, value(values[raster], legend, scene.rasters[raster].unit)]);
  }
  $("readout").replaceChildren(...shown.map(([name, text]) => {
    const span = document.createElement("span");
    span.append(`${name} `, Object.assign(document.createElement("b"), { textContent: text }));
    return span;
  }));
  Object.assign($("readout").dataset, { x, y, values: JSON.stringify(values) });
}

function value(values, legend, unit) {
  if (values.length > 1) return values.map((one) => withUnit(one, "")).join(" ");
  const known = legend.kind === "classes" && legend.classes.find((one) => one.code === values[0]);
  return known ? known.label : withUnit(values[0], unit);
}

function moved() {
  const { width, text } = map.scaleBar();
  $("bar").firstElementChild.style.width = `${width}px`;
  $("bar").lastElementChild.textContent = text;
}

// Side by side: a second map of the same ground. Layers of the second of two runs are to its right.

let second = null;
function showPair(on) {
  if (on && map.second !== null) swipe(false);
  $("pair").setAttribute("aria-pressed", on);
  $("map-2").hidden = $("second").hidden = !on;
  $("map").parentElement.classList.toggle("pair", on);
  if (on) {
    $("second-layer").value = partner(map.layer);
    second ??= new MapView($("map-2"), scene, {
      moved: () => {},
      pointed: (x, y, byKey) => pointed(x, y, byKey, second),
      drawn,
      failed,
      clicked: (x, y) => clicked(...map.screenAt(...second.mapAt(x, y))),
    });
    pair = second;
    Object.assign(pair, { layer: Number($("second-layer").value), vectors: map.vectors, overlays: new Set(map.overlays) });
    map.resize();
    pair.resize();
    map.linkTo(pair);
    map.fit();
  } else {
    map.linkTo(null);
    map.cursor = pair = null;
    map.resize();
  }
  legends();
}

/** Returns the layer that is shown beside another: the one of the same name in another run, else the next one. */
function partner(layer) {
  const name = (one) => scene.layers[one].title.split(" · ")[0];
  const twin = plain.find((one) => one !== layer && name(one) === name(layer));
  return twin ?? plain[(plain.indexOf(layer) + 1) % plain.length];
}

// Swipe.

function swipe(on) {
  if (on && pair) showPair(false);
  $("swipe").setAttribute("aria-pressed", on);
  $("handle").hidden = $("second").hidden = !on;
  if (on && Number($("second-layer").value) === map.layer) $("second-layer").value = partner(map.layer);
  map.second = on ? Number($("second-layer").value) : null;
  split(map.split);
  legends();
}

function split(part) {
  map.split = Math.min(Math.max(part, 0), 1);
  $("handle").style.left = `${100 * map.split}%`;
  $("handle").setAttribute("aria-valuenow", Math.round(100 * map.split));
  map.redraw();
}

$("second-layer").addEventListener("change", () => {
  if (!pair) return swipe(true);
  pair.layer = Number($("second-layer").value);
  pair.redraw();
  legends();
});
$("handle").addEventListener("pointerdown", (event) => $("handle").setPointerCapture(event.pointerId));
$("handle").addEventListener("pointermove", (event) => {
  const { left, width } = $("map").getBoundingClientRect();
  if (event.buttons) split((event.clientX - left) / width);
});
$("handle").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
  if (!step) return;
  event.preventDefault();
  split(map.split + step);
});

// Profile.

const numbers = plain.filter((i) => scene.rasters[scene.layers[i].raster].bands.length === 1);
const heights = [...new Set(numbers.filter((i) => scene.layers[i].is_height).map((i) => scene.layers[i].raster))];
if (heights.length > 1) $("profile-of").append(new Option("all heights", heights.slice(0, 8).join(",")));
for (const raster of new Set(numbers.map((i) => scene.layers[i].raster))) {
  const { title } = scene.layers.find((layer) => layer.raster === raster);
  $("profile-of").append(new Option(title, String(raster)));
}
$("profile-of").addEventListener("change", () => drawn(map.line));

function useProfile(on) {
  tool = on ? "profile" : null;
  map.draws = on;
  map.start = map.corner = null;
  $("map").classList.toggle("draws", on);
  $("profile").setAttribute("aria-pressed", on);
  if (!on) {
    map.line = map.mark = null;
    $("chart").hidden = true;
    $("cross").hidden = true;
  } else if (!map.line) {
    // Values of the layer that is shown; heights with all others.
    const { raster, is_height } = scene.layers[map.layer];
    const wanted = is_height && heights.length > 1 ? heights.slice(0, 8).join(",") : String(raster);
    if ([...$("profile-of").options].some((option) => option.value === wanted)) $("profile-of").value = wanted;
  }
  map.redraw();
  if (on) $("map").focus({ preventScroll: true });
}

async function drawn(line) {
  if (!line) return;
  $("chart").hidden = false;
  await profile.show(line, $("profile-of").value.split(",").map(Number)).catch((error) => message(error.message));
}

$("csv").addEventListener("click", () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([profile.csv()], { type: "text/csv" }));
  link.download = "profile.csv";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
});

// 3D: the part of the map that is on the screen.

for (const raster of heights) {
  $("mesh-of").append(new Option(scene.layers.find((layer) => layer.raster === raster).title, raster));
}
const picture = plain.find((i) => /^Ortho( ·|$)/.test(scene.layers[i].title));
$("mesh-layer").value = picture ?? plain[0];
$("mesh-hatch-label").hidden = !overlays.length;
$("surface").disabled = !heights.length;
if (!heights.length) $("surface").title = "No layer holds heights";

async function show3d(on) {
  $("surface").setAttribute("aria-pressed", on);
  $("scene3d").hidden = !on;
  document.body.classList.toggle("in3d", on);
  message("");
  if (!on) return void $("map").focus();
  try {
    surface ??= new Surface($("mesh"));
    await loadMesh();
    $("mesh").focus();
  } catch (error) {
    message(error.message);
    $("scene3d").hidden = true;
    document.body.classList.remove("in3d");
    $("surface").setAttribute("aria-pressed", false);
  }
}

/** Returns the part of a raster that shows the same ground as `cells` of another one. */
function sameGround(cells, from, to) {
  if (from === to) return cells;
  const [a, b] = [scene.rasters[from], scene.rasters[to]];
  const corner = (c, r) => {
    const t = a.transform;
    const [x, y] = [t[0] + c * t[1] + r * t[2], t[3] + c * t[4] + r * t[5]];
    const u = b.transform;
    const det = u[1] * u[5] - u[2] * u[4];
    return [((x - u[0]) * u[5] - (y - u[3]) * u[2]) / det, ((y - u[3]) * u[1] - (x - u[0]) * u[4]) / det].map(Math.round);
  };
  const [left, top] = corner(cells.c, cells.r);
  const [right, bottom] = corner(cells.c + cells.w, cells.r + cells.h);
  if (left < 0 || top < 0 || right > b.width || bottom > b.height) return null;
  return { c: left, r: top, w: right - left, h: bottom - top };
}

let ground = null;
async function loadMesh() {
  const raster = Number($("mesh-of").value);
  const cells = map.visibleCells(raster);
  if (!cells || cells.w < 2 || cells.h < 2) throw new Error("The surface lies outside of the map: move it back first.");
  ground = { raster, cells };
  const { a, d } = map.planeFrom[raster];
  const mesh = await surface.load(raster, cells, [Math.abs(a), Math.abs(d)]);
  $("mesh-size").textContent = mesh.text;
  await paintMesh();
}

async function paintMesh() {
  const layer = Number($("mesh-layer").value);
  const pictures = [layer, ...($("mesh-hatch").checked ? overlays : [])].filter((one) => {
    return sameGround(ground.cells, ground.raster, scene.layers[one].raster);
  });
  if (pictures[0] !== layer) throw new Error("The picture does not cover this part of the surface: zoom in, or choose another.");
  message("");
  const isShaded = scene.layers[layer].is_height;
  await surface.paint(pictures.map((one) => [one, sameGround(ground.cells, ground.raster, scene.layers[one].raster)]), isShaded ? 0 : 0.75);
}

const retry = (work) => () => work().catch((error) => message(error.message));
$("mesh-of").addEventListener("change", retry(loadMesh));
$("mesh-layer").addEventListener("change", retry(paintMesh));
$("mesh-hatch").addEventListener("change", retry(paintMesh));
$("mesh-scale").addEventListener("input", () => {
  surface.exaggeration = Number($("mesh-scale").value);
  $("mesh-scale-out").value = $("mesh-scale").value;
  surface.draw();
});

// Messages, theme, keys.

function message(text) {
  clearTimeout(hides);
  $("message").hidden = !text;
  $("message").textContent = text;
  if (text) hides = setTimeout(() => ($("message").hidden = true), 8000);
}

const dark = matchMedia("(prefers-color-scheme: dark)");
let theme = "auto";
function paintTheme() {
  document.documentElement.dataset.theme = theme === "auto" ? (dark.matches ? "dark" : "light") : theme;
  $("theme").textContent = `Theme: ${theme}`;
}
dark.addEventListener("change", paintTheme);

const actions = {
  fit: () => map.fit(),
  profile: () => useProfile(tool !== "profile"),
  swipe: () => swipe(map.second === null),
  pair: () => showPair(pair === null),
  surface: () => show3d($("scene3d").hidden),
  theme: () => ((theme = { auto: "light", light: "dark", dark: "auto" }[theme]), paintTheme()),
  help: () => $("keys").showModal(),
};
for (const [id, action] of Object.entries(actions)) $(id).addEventListener("click", action);
$("mesh-close").addEventListener("click", () => show3d(false));
$("profile-close").addEventListener("click", () => useProfile(false));

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input[type=range]")) return;
  const in3d = !$("scene3d").hidden;
  if (!in3d && event.target === document.body) map.key(event);
  const keys = { 0: actions.fit, p: actions.profile, s: actions.swipe, b: actions.pair, d: actions.surface, "?": actions.help };
  const digit = Number(event.key);
  if (event.key.toLowerCase() === "v") {
    const boxes = [...document.querySelectorAll("#vectors input")];
    const wanted = !boxes.some((box) => box.checked);
    return boxes.filter((box) => box.checked !== wanted).forEach((box) => box.click());
  }
  if (event.key === "Escape" && picked) return pick(null);
  if (event.key === "Escape") return in3d ? void show3d(false) : useProfile(false);
  if (!in3d && (event.key === "+" || event.key === "=")) map.zoom(1.5);
  else if (!in3d && event.key === "-") map.zoom(1 / 1.5);
  else if (event.key.toLowerCase() === "f") document.querySelector("#overlays input")?.click();
  else if (digit >= 1 && digit <= plain.length) choose(plain[digit - 1]);
  else if (!(in3d && "spb0".includes(event.key.toLowerCase()))) keys[event.key.toLowerCase()]?.();
});

paintTheme();
choose(plain[0]);
for (const box of document.querySelectorAll("#overlays input")) box.click();
// Contour lines are many: they wait to be asked for. Changes and areas are why one looks.
document.querySelectorAll("#vectors input").forEach((box, i) => scene.vectors[i].look !== "contours" && box.click());
if (scene.folders === 2 && plain.length > 1) showPair(true);
pointed(...map.mapAt(map.width / 2, map.height / 2));
document.documentElement.dataset.ready = "true";
