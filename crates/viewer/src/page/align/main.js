// The page of the alignment by hand: the model over the map, from the side and in a photograph; pairs
// of places; saving.
//
// Places in the world are easting, northing and height, counted from the origin that the program
// names. The program fits pairs and saves; everything else is done here.

import { MapView } from "../map.js";
import { apply, ask, compose } from "../numbers.js";
import { Vectors } from "../vectors.js";
import { cloudOf, coloursByHeight, groundOf } from "./clouds.js";
import { Dots, nearest } from "./dots.js";
import { after, Placement } from "./similarity.js";
import { cross, drawPair, mark, PhotoView, SideView, wrapped } from "./views.js";

const $ = (id) => document.getElementById(id);
/** Moves that can be taken back. */
const UNDO = 200;
/** Part of the smaller side of the map that the ring has as its radius, and its width in pixels. */
const RING = 0.3;
const RING_WIDTH = 9;
/** How near a click must be to a point of the model, pixels. */
const NEAR = 9;
/** Longest side of the reduced heights that are drawn as points. */
const GROUND_SIDE = 256;
/** Colour of the map's heights from the side (0xAABBGGRR): none of the model. */
const GROUND_COLOUR = 0xffb8a890;
/** Colour of the middle of the model. */
const MIDDLE = "#fff";

const [scene, opening, cloud] = await Promise.all([
  ask("scene.json").then((answer) => answer.json()),
  ask("job/opening.json").then((answer) => answer.json()),
  ask("job/cloud.bin").then((answer) => answer.arrayBuffer()).then(cloudOf),
]).catch((error) => {
  message(error.message);
  throw error;
});
const { origin } = opening;
const placement = new Placement(opening.start.world_from_model, opening.pivot);
const heights = scene.layers.find((layer) => layer.is_height)?.raster ?? null;
const pairs = [];
const past = [];
let tool = "move";
let pending = null;
let names = 0;

// The map, and the model over it.

const over = new Dots($("over"));
const map = new MapView($("map"), scene, {
  moved: drawOver,
  pointed: () => {},
  drawn: () => {},
  failed: (error) => message(error.message),
});
const side = new SideView($("side"), placement, { changed, begin: remember });
const photo = new PhotoView($("photograph"), $("photo-dots"));
side.origin = origin[2];

/** From places in the world to column, row and depth on the map. */
function fromWorld() {
  const { a, b, c, d, e, f } = compose(map.screenFromPlane, map.planeFromMap);
  const [x, y] = apply({ a, b, c, d, e, f }, origin[0], origin[1]);
  return [[a, c, 0, x], [b, d, 0, y], [0, 0, -1, 0]];
}

const onScreen = (p) => apply(compose(map.screenFromPlane, map.planeFromMap), p[0] + origin[0], p[1] + origin[1]);

function drawOver() {
  over.begin();
  over.draw(cloud, after(fromWorld(), placement.rows), { size: 2 });
  const context = over.end();
  for (const pair of pairs) drawPair(context, onScreen(placement.apply(pair.model)), onScreen(pair.world), pair.name);
  if (pending) mark(context, ...onScreen(placement.apply(pending)), "#ffe14a");
  const [x, y] = onScreen(placement.place);
  cross(context, x, y, MIDDLE, 11);
  if (tool === "move") drawRing(context, x, y);
  const { width, text } = map.scaleBar();
  $("bar").firstElementChild.style.width = `${width}px`;
  $("bar").lastElementChild.textContent = text;
}

const ringRadius = () => RING * Math.min(map.width, map.height);

function drawRing(context, x, y) {
  const radius = ringRadius();
  for (const [colour, width] of [["#0009", 6], ["#fffc", 2.5]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.stroke();
  }
  // A knob shows the heading.
  const angle = (placement.heading - 90) * Math.PI / 180;
  context.fillStyle = "#e0306e";
  context.strokeStyle = "#fff";
  context.lineWidth = 2;
  context.beginPath();
  context.arc(x + radius * Math.cos(angle), y + radius * Math.sin(angle), 7, 0, 7);
  context.fill();
  context.stroke();
}

const onRing = (x, y) => {
  const [px, py] = onScreen(placement.place);
  return tool === "move" && Math.abs(Math.hypot(x - px, y - py) - ringRadius()) <= RING_WIDTH;
};

/** Draws everything again, and writes the numbers. */
function changed() {
  map.redraw();
  queue();
  const { place, scale, heading, tiltEast, tiltNorth } = placement;
  const values = {
    east: (origin[0] + place[0]).toFixed(3),
    north: (origin[1] + place[1]).toFixed(3),
    height: (origin[2] + place[2]).toFixed(3),
    scale: String(Number(scale.toPrecision(7))),
    heading: degrees(heading),
    "tilt-east": degrees(tiltEast),
    "tilt-north": degrees(tiltNorth),
  };
  for (const [id, text] of Object.entries(values)) if (document.activeElement !== $(id)) $(id).value = text;
  showResiduals();
}

/** Returns degrees without a minus before zeros. */
function degrees(angle) {
  return angle.toFixed(4).replace(/^-(0\.0*)$/, "$1");
}

let frame = 0;
function queue() {
  frame ||= requestAnimationFrame(() => {
    frame = 0;
    side.draw(cloud, pairs);
    photo.draw(cloud, placement, pairs, pending);
  });
}

/** Keeps the placement, so that the next change can be taken back. */
function remember() {
  past.push(placement.state);
  if (past.length > UNDO) past.shift();
  $("undo").disabled = false;
}

function undo() {
  const state = past.pop();
  $("undo").disabled = !past.length;
  if (!state) return;
  placement.state = state;
  changed();
}

// Mouse and fingers on the map.

let drag = null;
const pointers = new Map();
$("over").addEventListener("contextmenu", (event) => event.preventDefault());
$("over").addEventListener("pointerdown", (event) => {
  const at = [event.offsetX, event.offsetY];
  $("over").setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, at);
  $("map").focus({ preventScroll: true });
  if (event.button !== 0 || tool === "map") drag = { kind: "map", last: at };
  else if (tool === "pair") drag = { kind: "click", first: at, last: at };
  else drag = { kind: event.shiftKey ? "turnscale" : onRing(...at) ? "turn" : "move", last: at };
  if (["move", "turn", "turnscale"].includes(drag.kind)) remember();
});
$("over").addEventListener("pointermove", (event) => {
  const at = [event.offsetX, event.offsetY];
  pointed(at);
  if (!drag || !pointers.has(event.pointerId)) {
    $("over").classList.toggle("turns", onRing(...at));
    return;
  }
  pointers.set(event.pointerId, at);
  if (pointers.size > 1) return pinch();
  const { last } = drag;
  if (drag.kind === "map" || (drag.kind === "click" && Math.hypot(at[0] - drag.first[0], at[1] - drag.first[1]) > 4)) {
    drag.kind = "map";
    map.pan(last[0] - at[0], last[1] - at[1]);
  } else if (drag.kind === "move") {
    const [a, b] = [map.mapAt(...last), map.mapAt(...at)];
    placement.place[0] += b[0] - a[0];
    placement.place[1] += b[1] - a[1];
    changed();
  } else if (drag.kind !== "click") {
    turn(last, at, drag.kind === "turnscale");
  }
  drag.last = at;
});
const up = (event) => {
  pointers.delete(event.pointerId);
  const ended = drag;
  drag = pointers.size ? { kind: "none" } : null;
  spread = null;
  if (event.type === "pointerup" && ended?.kind === "click") clicked(event.offsetX, event.offsetY);
};
$("over").addEventListener("pointerup", up);
$("over").addEventListener("pointercancel", up);

/** Two fingers move and zoom the map. */
let spread = null;
function pinch() {
  const [a, b] = [...pointers.values()];
  const now = { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, size: Math.hypot(a[0] - b[0], a[1] - b[1]) };
  if (spread) {
    map.pan(spread.x - now.x, spread.y - now.y);
    map.zoom(now.size / Math.max(spread.size, 1), now.x, now.y);
  }
  spread = now;
}

/** Turns the model about its pivot as the mouse goes around it, and scales it with the distance. */
function turn(from, to, scales) {
  // On the ground, so that maps that are turned on the screen do not matter.
  const [a, b] = [map.mapAt(...from), map.mapAt(...to)].map((p) => [0, 1].map((i) => p[i] - origin[i] - placement.place[i]));
  placement.turn("z", wrapped(Math.atan2(b[1], b[0]) - Math.atan2(a[1], a[0])) * 180 / Math.PI);
  const [ra, rb] = [Math.hypot(...a), Math.hypot(...b)];
  if (scales && ra > 0 && rb > 0) placement.scale *= rb / ra;
  changed();
}

let wheeled = 0;
$("over").addEventListener("wheel", (event) => {
  event.preventDefault();
  const amount = (event.deltaY || event.deltaX) * (event.deltaMode === 1 ? 30 : 1);
  if (event.shiftKey) {
    // A quick row of steps is one move.
    if (event.timeStamp - wheeled > 600) remember();
    wheeled = event.timeStamp;
    placement.scale *= 1.0005 ** -Math.max(-100, Math.min(100, amount / 5));
    changed();
  } else {
    map.zoom(2 ** (-Math.max(-200, Math.min(200, amount)) / 200), event.offsetX, event.offsetY);
  }
}, { passive: false });

function pointed(at) {
  const [x, y] = map.mapAt(...at);
  const { unit } = scene.map;
  $("readout").replaceChildren(...[["x", x], ["y", y]].map(([name, value]) => {
    const span = document.createElement("span");
    span.append(`${name} `, Object.assign(document.createElement("b"), { textContent: `${value.toFixed(2)} ${unit}` }));
    return span;
  }));
  Object.assign($("readout").dataset, { x, y });
}

// Pairs.

async function clicked(x, y) {
  if (!pending) {
    const found = nearest(cloud, after(fromWorld(), placement.rows), [x, y], NEAR);
    if (found < 0) hint("There is no point of the model here. Click on one, on the map or on the photograph.");
    else begin(found);
    return;
  }
  const model = pending;
  pending = null;
  delete $("photo-dots").dataset.picked;
  const [east, north] = map.mapAt(x, y);
  const pair = { name: String(++names), model, world: [east - origin[0], north - origin[1], Number($("ground").value) - origin[2]], isOut: false };
  pairs.push(pair);
  addRow(pair);
  hint("");
  changed();
  if (heights === null) return;
  try {
    const { values } = await (await ask(`at?x=${east}&y=${north}`)).json();
    const [height] = values[heights];
    if (height === null || height === undefined) {
      hint(`The map has no height at pair ${pair.name}: write it in.`);
    } else {
      pair.world[2] = height - origin[2];
      pair.field.value = height.toFixed(2);
    }
    changed();
  } catch (error) {
    message(error.message);
  }
}

/** Takes a point of the cloud as the first half of a pair. */
function begin(index) {
  pending = [0, 1, 2].map((i) => cloud.points[3 * index + i] + opening.pivot[i]);
  useTool("pair");
  $("photo-dots").dataset.picked = JSON.stringify(pending);
  hint("Now click the same place on the map.");
  map.redraw();
  queue();
}

function giveUp() {
  pending = null;
  delete $("photo-dots").dataset.picked;
  hint("");
  map.redraw();
  queue();
}

function addRow(pair) {
  const row = $("pairs").tBodies[0].insertRow();
  pair.row = row;
  row.dataset.model = JSON.stringify(pair.model);
  row.insertCell().textContent = pair.name;
  pair.flat = row.insertCell();
  pair.up = row.insertCell();
  pair.field = Object.assign(document.createElement("input"), { type: "number", step: "0.1", value: (origin[2] + pair.world[2]).toFixed(2) });
  pair.field.setAttribute("aria-label", `Height of pair ${pair.name} on the map`);
  pair.field.addEventListener("input", () => {
    if (!Number.isFinite(pair.field.valueAsNumber)) return;
    pair.world[2] = pair.field.valueAsNumber - origin[2];
    changed();
  });
  row.insertCell().append(pair.field);
  const remove = Object.assign(document.createElement("button"), { type: "button", textContent: "×", title: `Delete pair ${pair.name}` });
  remove.addEventListener("click", () => {
    pairs.splice(pairs.indexOf(pair), 1);
    row.remove();
    changed();
  });
  row.insertCell().append(remove);
}

/** Writes how far apart the ends of the pairs are. */
function showResiduals() {
  let squares = 0;
  for (const pair of pairs) {
    const at = placement.apply(pair.model);
    const [e, n, u] = [0, 1, 2].map((i) => at[i] - pair.world[i]);
    squares += e * e + n * n + u * u;
    pair.flat.textContent = Math.hypot(e, n).toFixed(2);
    pair.up.textContent = `${u < 0 ? "−" : "+"}${Math.abs(u).toFixed(2)}`;
    pair.row.classList.toggle("out", pair.isOut);
  }
  $("pairs").hidden = !pairs.length;
  $("fit-pairs").disabled = !pairs.length;
  $("residual").textContent = pairs.length ? `RMS ${Math.sqrt(squares / pairs.length).toFixed(2)} m` : "";
}

const wish = () => ({ world_from_model: placement.similarity, pairs: pairs.map(({ model, world }) => ({ model, world })) });

async function post(name) {
  const body = JSON.stringify(wish());
  const response = await fetch(`job/${name}`, { method: "POST", headers: { "content-type": "application/json" }, body }).catch(() => {
    throw new Error("The program does not answer. It may have ended: start it again, and open its new address.");
  });
  if (!response.ok) throw new Error(await response.text());
  return response.json();
}

async function fitPairs() {
  const sent = [...pairs];
  try {
    const found = await post("fit");
    remember();
    placement.set(found.world_from_model);
    sent.forEach((pair, i) => (pair.isOut = !found.inliers[i]));
    const left = found.inliers.filter((inlier) => !inlier).length;
    hint(`Fitted to ${found.how}${left ? `; ${left} left out, as the others disagree` : ""}.`);
    message("");
    changed();
  } catch (error) {
    message(`The pairs cannot be fitted: ${error.message}`);
  }
}

async function save() {
  $("save").disabled = true;
  try {
    const { pairs: count, rmse_m } = await post("save");
    const rms = rmse_m === null ? "" : `, RMS ${rmse_m.toFixed(2)} m`;
    $("saved").textContent = `Saved at ${new Date().toTimeString().slice(0, 8)} with ${count} pairs${rms}.`;
    message("");
  } catch (error) {
    $("saved").textContent = "";
    message(`Nothing was saved: ${error.message}`);
  }
  $("save").disabled = false;
}

// The photograph.

$("photo-dots").addEventListener("click", (event) => {
  const found = photo.pick(cloud, opening.pivot, [event.offsetX, event.offsetY]);
  if (found < 0) hint("There is no point of the model here: click near one.");
  else begin(found);
});
for (const camera of [...opening.cameras].sort((a, b) => a.name.localeCompare(b.name))) {
  $("camera").append(new Option(camera.name, camera.number));
}
async function showPhoto() {
  const camera = opening.cameras.find((one) => one.number === Number($("camera").value));
  if (!camera) return;
  await photo.show(camera);
  queue();
}
$("camera").addEventListener("change", showPhoto);
$("shows-ground").addEventListener("change", () => ((photo.showsGround = $("shows-ground").checked), queue()));
$("shows-cloud").addEventListener("change", () => ((photo.showsCloud = $("shows-cloud").checked), queue()));
$("axis").addEventListener("change", () => {
  side.axis = Number($("axis").value);
  side.middle = [placement.place[side.axis], side.middle[1]];
  queue();
});
$("strip").addEventListener("change", () => ((side.strip = Number($("strip").value)), queue()));

async function loadGround() {
  if (heights === null) return;
  const raster = scene.rasters[heights];
  const answer = await ask(`grid/${heights}?c=0&r=0&w=${raster.width}&h=${raster.height}&side=${GROUND_SIDE}`);
  photo.ground = groundOf(await answer.arrayBuffer(), raster, origin);
  side.ground = { points: photo.ground.points, colours: photo.ground.colours.map(() => GROUND_COLOUR) };
}

// Tools, numbers, keys.

function useTool(name) {
  tool = name;
  if (name !== "pair" && pending) giveUp();
  for (const one of ["move", "map", "pair"]) {
    $(`tool-${one}`).setAttribute("aria-pressed", one === name);
    $("over").classList.toggle(one, one === name);
  }
  if (name === "pair" && !pending) hint("Click a point of the model, on the photograph or on the map.");
  map.redraw();
}

const hint = (text) => ($("hint").textContent = text || (pairs.length ? "" : "None yet. With three pairs, “Fit to pairs” finds the rest."));

function message(text) {
  $("message").hidden = !text;
  $("message").firstElementChild.textContent = text;
}
$("message").lastElementChild.addEventListener("click", () => message(""));

const fields = {
  east: (value) => (placement.place[0] = value - origin[0]),
  north: (value) => (placement.place[1] = value - origin[1]),
  height: (value) => (placement.place[2] = value - origin[2]),
  scale: (value) => value > 0 && (placement.scale = value),
  heading: (value) => (placement.heading = value),
  "tilt-east": (value) => (placement.tiltEast = value),
  "tilt-north": (value) => (placement.tiltNorth = value),
};
for (const [id, take] of Object.entries(fields)) {
  $(id).addEventListener("focus", remember);
  $(id).addEventListener("input", () => {
    if (!Number.isFinite($(id).valueAsNumber)) return;
    take($(id).valueAsNumber);
    changed();
  });
  $(id).addEventListener("blur", changed);
}
$("ground").value = (opening.ground_m ?? 0).toFixed(2);
$("ground").addEventListener("input", () => ((side.level = Number($("ground").value) - origin[2]), queue()));
const looks = { photographs: cloud.colours, heights: coloursByHeight(cloud, placement.base[2]) };
$("colours").addEventListener("change", () => {
  cloud.colours = looks[$("colours").value];
  map.redraw();
  queue();
});
cloud.colours = looks.heights;
$("opacity").addEventListener("input", () => ($("over").style.opacity = $("opacity").value));

const actions = {
  "tool-move": () => useTool("move"),
  "tool-map": () => useTool("map"),
  "tool-pair": () => useTool("pair"),
  undo,
  fit: () => {
    map.fit();
    side.fit(cloud);
    queue();
  },
  help: () => $("keys").showModal(),
  "fit-pairs": fitPairs,
  save,
};
for (const [id, action] of Object.entries(actions)) $(id).addEventListener("click", action);
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input")) return;
  if (event.target === document.body) map.key(event);
  const keys = { m: "tool-move", g: "tool-map", p: "tool-pair", z: "undo", 0: "fit", "?": "help" };
  if (event.key === "Escape") giveUp();
  else if (event.key === "+" || event.key === "=") map.zoom(1.5);
  else if (event.key === "-") map.zoom(1 / 1.5);
  else if (event.key.toLowerCase() === "h") {
    $("opacity").value = Number($("opacity").value) > 0 ? 0 : 1;
    $("over").style.opacity = $("opacity").value;
  } else if (keys[event.key.toLowerCase()]) actions[keys[event.key.toLowerCase()]]();
});

const dark = matchMedia("(prefers-color-scheme: dark)");
const paint = () => ((document.documentElement.dataset.theme = dark.matches ? "dark" : "light"), queue());
dark.addEventListener("change", paint);
new ResizeObserver(queue).observe($("beside"));

$("system").textContent = `${scene.map.name} · heights above: ${opening.vertical}`;
scene.layers.forEach((layer, i) => layer.is_overlay || $("layer").append(new Option(layer.title, i)));
$("layer").addEventListener("change", () => ((map.layer = Number($("layer").value)), map.redraw()));
map.layer = Number($("layer").value);
$("ground-row").hidden = heights !== null;
side.level = Number($("ground").value) - origin[2];
const drawn = cloud.colours.length.toLocaleString("en");
$("count").textContent = opening.stride > 1
  ? `${drawn} of ${opening.points.toLocaleString("en")} points are drawn, one in ${opening.stride}; ${opening.start.up_from}.`
  : `All ${drawn} points are drawn; ${opening.start.up_from}.`;
$("output").textContent = `The moved model and its similarity go to ${opening.output}.`;
for (const [number, one] of scene.vectors.entries()) {
  const vectors = new Vectors(one, number, scene.vectors);
  const label = document.createElement("label");
  const box = Object.assign(document.createElement("input"), { type: "checkbox" });
  box.addEventListener("change", async () => {
    await vectors.load().catch((error) => message(error.message));
    map.vectors = map.vectors.filter((shown) => shown !== vectors).concat(box.checked && vectors.features ? [vectors] : []);
    map.redraw();
  });
  label.append(box, ` ${one.title}`);
  $("vectors").append(label);
  $("vectors").hidden = false;
}
paint();
useTool("move");
hint("");
side.fit(cloud);
await loadGround().catch((error) => message(error.message));
await showPhoto();
changed();
pointed([map.width / 2, map.height / 2]);
document.documentElement.dataset.ready = "true";
