// The map: tiles of one layer, or of two beside a swipe, with overlays; moved and zoomed by mouse,
// fingers and keys.
//
// The plane of the map has the directions of the first raster and metres as its unit (pixels
// without a georeference), with its origin at the corner of that raster. `view` is the position of
// the middle of the screen on the plane, and the pixels of the screen in a metre.

import { hatch } from "./legend.js";
import { apply, ask, compose, distance, invert, mapFromCells, niceStep } from "./numbers.js";

/** Most tiles that are kept, and most that are asked for at once. */
const TILES_KEPT = 600;
const TILES_ASKED = 6;

export class MapView {
  /** `events` has functions that are told of what happens: moved, pointed(x, y), drawn(line). */
  constructor(canvas, scene, events) {
    this.canvas = canvas;
    this.scene = scene;
    this.events = events;
    this.layer = 0;
    this.second = null;
    this.split = 0.5;
    this.overlays = new Set();
    this.vectors = [];
    this.link = null;
    this.line = null;
    this.mark = null;
    this.draws = false;
    this.tiles = new Map();
    this.asked = new Set();
    this.place();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.fit();
    this.listen();
  }

  /** Computes the transforms between rasters, the map and the plane. */
  place() {
    const first = this.scene.rasters[0];
    const [, a, c, , b, d] = first.transform;
    const [mx, my] = this.scene.map.metres;
    const cell = { a: Math.hypot(a * mx, b * my), b: 0, c: 0, d: Math.hypot(c * mx, d * my), e: 0, f: 0 };
    this.planeFromMap = compose(cell, invert(mapFromCells(first.transform)));
    this.mapFromPlane = invert(this.planeFromMap);
    this.planeFrom = this.scene.rasters.map((raster) => compose(this.planeFromMap, mapFromCells(raster.transform)));
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = Math.max(1, Math.round(this.width * ratio));
    this.canvas.height = Math.max(1, Math.round(this.height * ratio));
    this.ratio = ratio;
    this.redraw();
  }

  fit() {
    const { width, height } = this.scene.rasters[0];
    const [x, y] = apply(this.planeFrom[0], width, height);
    this.view = { x: x / 2, y: y / 2, scale: 0.96 * Math.min(this.width / x, this.height / y) };
    this.redraw();
  }

  // Positions.

  get screenFromPlane() {
    const { x, y, scale } = this.view;
    return { a: scale, b: 0, c: 0, d: scale, e: this.width / 2 - x * scale, f: this.height / 2 - y * scale };
  }

  /** Returns the map coordinates of a position on the canvas. */
  mapAt(left, top) {
    return apply(compose(this.mapFromPlane, invert(this.screenFromPlane)), left, top);
  }

  /** Returns the position on the canvas of map coordinates. */
  screenAt(x, y) {
    return apply(compose(this.screenFromPlane, this.planeFromMap), x, y);
  }

  /** Returns the part of a raster that is on the screen: column, row, width, height; null for none. */
  visibleCells(index) {
    const raster = this.scene.rasters[index];
    const back = invert(compose(this.screenFromPlane, this.planeFrom[index]));
    const corners = [[0, 0], [this.width, 0], [0, this.height], [this.width, this.height]].map(([x, y]) => apply(back, x, y));
    const range = (axis, count) => {
      const all = corners.map((corner) => corner[axis]);
      return [Math.max(0, Math.floor(Math.min(...all))), Math.min(count, Math.ceil(Math.max(...all)))];
    };
    const [left, right] = range(0, raster.width);
    const [top, bottom] = range(1, raster.height);
    return right > left && bottom > top ? { c: left, r: top, w: right - left, h: bottom - top } : null;
  }

  zoom(factor, left = this.width / 2, top = this.height / 2) {
    const first = this.scene.rasters[0];
    const least = 0.2 * Math.min(this.width, this.height) / Math.max(...apply(this.planeFrom[0], first.width, first.height));
    const most = 64 / Math.min(this.planeFrom[0].a, this.planeFrom[0].d);
    const scale = Math.min(Math.max(this.view.scale * factor, least), most);
    const change = 1 / this.view.scale - 1 / scale;
    this.view = { x: this.view.x + (left - this.width / 2) * change, y: this.view.y + (top - this.height / 2) * change, scale };
    this.redraw();
  }

  pan(right, down) {
    const [width, height] = apply(this.planeFrom[0], this.scene.rasters[0].width, this.scene.rasters[0].height);
    this.view.x = Math.min(Math.max(this.view.x + right / this.view.scale, 0), width);
    this.view.y = Math.min(Math.max(this.view.y + down / this.view.scale, 0), height);
    this.redraw();
  }

  // Drawing.

  /** Shows the same ground as another map from now on, in both directions; null ends it. */
  linkTo(other) {
    if (this.link) this.link.link = null;
    this.link = other;
    if (!other) return;
    if (other.link && other.link !== this) other.link.link = null;
    other.link = this;
    other.view = { ...this.view };
    other.redraw();
  }

  redraw() {
    // A linked map is asked once, and its own answer changes nothing.
    if (this.link && this.view && !sameView(this.link.view, this.view)) {
      this.link.view = { ...this.view };
      this.link.redraw();
    }
    if (this.frame || !this.view) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      this.draw();
    });
  }

  draw() {
    const context = this.canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.wanted = [];
    const seam = this.second === null ? this.canvas.width : Math.round(this.split * this.canvas.width);
    this.drawPart(context, this.layer, 0, seam);
    if (this.second !== null) this.drawPart(context, this.second, seam, this.canvas.width);
    for (const overlay of this.overlays) this.drawHatched(context, overlay);
    for (const vectors of this.vectors) vectors.draw(context, this);
    this.drawCursor(context);
    this.drawLine(context);
    this.askForTiles();
    this.events.moved();
  }

  drawPart(context, layer, from, to) {
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, this.canvas.height);
    context.clip();
    this.drawLayer(context, layer);
    context.restore();
  }

  /** Draws marked cells as a hatching, whose lines are as wide at every zoom. */
  drawHatched(context, layer) {
    this.sheet ??= document.createElement("canvas");
    [this.sheet.width, this.sheet.height] = [this.canvas.width, this.canvas.height];
    const over = this.sheet.getContext("2d");
    this.drawLayer(over, layer);
    // The lines move with the map.
    const { e, f } = this.screenFromPlane;
    hatch(over, Math.round(6 * this.ratio), (e + f) * this.ratio);
    context.drawImage(this.sheet, 0, 0);
  }

  drawLayer(context, layer) {
    const index = this.scene.layers[layer].raster;
    const raster = this.scene.rasters[index];
    const cells = this.visibleCells(index);
    if (!cells) return;
    const pixels = { a: this.ratio, b: 0, c: 0, d: this.ratio, e: 0, f: 0 };
    const place = compose(compose(pixels, this.screenFromPlane), this.planeFrom[index]);
    const size = Math.hypot(place.a, place.b);
    // Tiles are shown at their size or smaller, until the cells themselves are to be seen.
    const level = Math.min(Math.max(Math.floor(Math.log2(1 / size) + 0.15), 0), raster.levels);
    context.imageSmoothingEnabled = size < 1.5;
    const found = this.tilesOf(layer, raster, level, cells);
    if (found.some((tile) => !tile.image) && level < raster.levels) {
      // Until all tiles are there, coarser ones that are show what they can.
      for (let above = raster.levels; above > level; above--) {
        this.tilesOf(layer, raster, above, cells, above < raster.levels).forEach((tile) => drawTile(context, place, tile));
      }
    }
    found.forEach((tile) => drawTile(context, place, tile));
  }

  /** Returns the tiles of a level that lie on the screen, and notes those that are missing. */
  tilesOf(layer, raster, level, cells, onlyKept = false) {
    const side = this.scene.tile * 2 ** level;
    const found = [];
    for (let y = Math.floor(cells.r / side); y * side < cells.r + cells.h; y++) {
      for (let x = Math.floor(cells.c / side); x * side < cells.c + cells.w; x++) {
        const key = `tile/${layer}/${level}/${x}/${y}.png`;
        const image = this.tiles.get(key);
        if (image) {
          // The latest used are at the end of the map.
          this.tiles.delete(key);
          this.tiles.set(key, image);
        } else if (image === undefined && !onlyKept) {
          this.wanted.push(key);
        }
        const [left, top] = [x * side, y * side];
        const [width, height] = [Math.min(side, raster.width - left), Math.min(side, raster.height - top)];
        found.push({ image, left, top, width, height });
      }
    }
    return found;
  }

  /** Asks for missing tiles, a few at a time; what has left the screen meanwhile is not asked for. */
  askForTiles() {
    for (const key of this.wanted) {
      if (this.asked.size >= TILES_ASKED) return;
      if (!this.asked.has(key)) this.load(key);
    }
  }

  async load(key) {
    this.asked.add(key);
    try {
      this.tiles.set(key, await createImageBitmap(await (await ask(key)).blob()));
    } catch (error) {
      // A tile that failed is not asked for again.
      this.tiles.set(key, null);
      this.events.failed(error);
    }
    this.asked.delete(key);
    while (this.tiles.size > TILES_KEPT) this.tiles.delete(this.tiles.keys().next().value);
    this.redraw();
  }

  /** Draws where the pointer is on the other map of two. */
  drawCursor(context) {
    if (!this.cursor) return;
    const [x, y] = this.screenAt(...this.cursor).map((c) => c * this.ratio);
    const arm = 9 * this.ratio;
    for (const [colour, width] of [["#000a", 4], ["#fff", 1.5]]) {
      context.strokeStyle = colour;
      context.lineWidth = width * this.ratio;
      context.beginPath();
      context.moveTo(x - arm, y);
      context.lineTo(x + arm, y);
      context.moveTo(x, y - arm);
      context.lineTo(x, y + arm);
      context.stroke();
    }
  }

  drawLine(context) {
    if (!this.line) return;
    const points = this.line.map(([x, y]) => this.screenAt(x, y).map((c) => c * this.ratio));
    for (const [colour, width] of [["#000a", 5], ["#fff", 2.5]]) {
      context.strokeStyle = context.fillStyle = colour;
      context.lineWidth = width * this.ratio;
      context.beginPath();
      points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.stroke();
      for (const [x, y] of points) {
        context.beginPath();
        context.arc(x, y, (width + 1.5) * this.ratio, 0, 7);
        context.fill();
      }
    }
    if (!this.mark) return;
    const [x, y] = this.screenAt(...this.mark).map((c) => c * this.ratio);
    context.strokeStyle = "#e0306e";
    context.lineWidth = 2.5 * this.ratio;
    context.beginPath();
    context.arc(x, y, 6 * this.ratio, 0, 7);
    context.stroke();
  }

  // Mouse, fingers, keys.

  listen() {
    const pointers = new Map();
    let last = null;
    const position = (event) => [event.offsetX, event.offsetY];
    this.canvas.addEventListener("pointerdown", (event) => {
      if (event.button > 0) return;
      this.canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, position(event));
      last = gesture(pointers);
      if (this.draws && pointers.size === 1) {
        this.start = this.mapAt(...position(event));
        this.line = [this.start, this.start];
        this.redraw();
      } else {
        this.canvas.classList.add("drags");
      }
    });
    this.canvas.addEventListener("pointermove", (event) => {
      this.events.pointed(...this.mapAt(...position(event)));
      if (!pointers.has(event.pointerId)) return;
      pointers.set(event.pointerId, position(event));
      const now = gesture(pointers);
      if (this.draws && this.start && pointers.size === 1) {
        this.line = [this.start, this.mapAt(...position(event))];
      } else {
        this.pan(last.x - now.x, last.y - now.y);
        if (last.spread && now.spread) this.zoom(now.spread / last.spread, now.x, now.y);
      }
      last = now;
      this.redraw();
    });
    let pressed = null;
    this.canvas.addEventListener("pointerdown", (event) => (pressed = position(event)));
    this.canvas.addEventListener("pointerup", (event) => {
      const [x, y] = position(event);
      const still = pressed && Math.hypot(x - pressed[0], y - pressed[1]) < 4;
      pressed = null;
      if (still && event.button === 0 && !this.draws) this.events.clicked?.(x, y);
    });
    const up = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      last = gesture(pointers);
      this.canvas.classList.remove("drags");
      if (!this.start) return;
      const line = [this.start, this.mapAt(...position(event))];
      this.start = null;
      const [a, b] = line.map((point) => this.screenAt(...point));
      if (event.type === "pointerup" && Math.hypot(a[0] - b[0], a[1] - b[1]) > 3) {
        this.line = line;
        this.events.drawn(line);
      }
    };
    this.canvas.addEventListener("pointerup", up);
    this.canvas.addEventListener("pointercancel", up);
    this.canvas.addEventListener("dblclick", (event) => this.draws || this.zoom(2, ...position(event)));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : 1;
      this.zoom(2 ** (-Math.max(-200, Math.min(200, event.deltaY * lines)) / 200), ...position(event));
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const step = event.shiftKey ? 200 : 50;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    if (moves[event.key]) {
      event.preventDefault();
      this.pan(...moves[event.key]);
      this.events.pointed(...this.mapAt(this.width / 2, this.height / 2), true);
    } else if (event.key === "Enter" && this.draws) {
      // Without a mouse: the cross in the middle is the start, then the end.
      const middle = this.mapAt(this.width / 2, this.height / 2);
      if (this.corner) this.events.drawn((this.line = [this.corner, middle]));
      this.corner = this.corner ? null : middle;
      if (this.corner) this.line = [middle, middle];
      this.redraw();
    }
  }

  /** Returns the width and the text of a bar that shows the scale. */
  scaleBar() {
    const length = niceStep(60 / this.view.scale);
    return { width: length * this.view.scale, text: distance(length, this.scene.map.unit) };
  }
}

/** Draws a tile with its edges on whole pixels, so that no seams show; turned rasters have none. */
function drawTile(context, place, { image, left, top, width, height }) {
  if (!image) return;
  if (Math.abs(place.b) + Math.abs(place.c) > 1e-9 * Math.abs(place.a)) {
    context.save();
    context.setTransform(place.a, place.b, place.c, place.d, place.e, place.f);
    context.drawImage(image, left, top, width, height);
    context.restore();
    return;
  }
  const [x0, y0] = apply(place, left, top).map(Math.round);
  const [x1, y1] = apply(place, left + width, top + height).map(Math.round);
  context.drawImage(image, Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
}

function sameView(a, b) {
  return a && a.x === b.x && a.y === b.y && a.scale === b.scale;
}

/** Returns the middle of the pointers and their distance from it. */
function gesture(pointers) {
  const all = [...pointers.values()];
  const mean = (axis) => all.reduce((sum, point) => sum + point[axis], 0) / (all.length || 1);
  const [x, y] = [mean(0), mean(1)];
  return { x, y, spread: all.length > 1 ? Math.hypot(all[0][0] - x, all[0][1] - y) : 0 };
}
