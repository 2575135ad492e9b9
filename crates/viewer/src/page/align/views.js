// The two views beside the map: the model from the side, and a photograph with what the model and the
// map say of it.

import { Dots, nearest } from "./dots.js";
import { after } from "./similarity.js";
import { niceStep } from "../numbers.js";

/** The model from the side: height over one horizontal axis. */
export class SideView {
  /** `events` has changed(), begin(). */
  constructor(canvas, placement, events) {
    Object.assign(this, { canvas, placement, events });
    this.dots = new Dots(canvas);
    this.axis = 0;
    this.strip = Infinity;
    this.ground = null;
    this.level = null;
    this.middle = [0, 0];
    this.scale = 1;
    this.listen();
  }

  /** Shows the whole model. */
  fit(cloud) {
    const { place, scale } = this.placement;
    let far = 0;
    const step = Math.max(1, Math.floor(cloud.colours.length / 2000));
    const away = [];
    for (let i = 0; i < cloud.colours.length; i += step) away.push(Math.hypot(...cloud.points.subarray(3 * i, 3 * i + 3)));
    away.sort((a, b) => a - b);
    far = away[Math.floor(0.95 * (away.length - 1))] * scale || 1;
    this.middle = [place[this.axis], place[2]];
    this.scale = 0.46 * this.canvas.clientWidth / far;
  }

  /** From places in the world to column, row and depth. */
  get projection() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [u, v] = this.middle;
    const across = [0, 0, 0, width / 2 - u * this.scale];
    across[this.axis] = this.scale;
    // From the south, what lies north is behind; from the east, what lies west.
    const depth = this.axis === 0 ? [0, 1, 0, 0] : [-1, 0, 0, 0];
    return [across, [0, 0, -this.scale, height / 2 + v * this.scale], depth];
  }

  draw(cloud, pairs) {
    const { projection, placement } = this;
    this.dots.begin();
    const at = this.axis === 0 ? placement.place[1] : -placement.place[0];
    const only = Number.isFinite(this.strip) ? (depth) => Math.abs(depth - at) <= this.strip / 2 : null;
    // The surface never hides the points that are held against it.
    if (this.ground) this.dots.draw(this.ground, projection, { size: 1.5, only, behind: 1e7 });
    this.dots.draw(cloud, after(projection, placement.rows), { size: 2, only });
    const context = this.dots.end();
    this.drawScale(context);
    const on = (p) => projection.slice(0, 2).map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
    for (const pair of pairs) drawPair(context, on(placement.apply(pair.model)), on(pair.world), pair.name);
    const [x, y] = on(placement.place);
    cross(context, x, y, "#fff", 9);
  }

  drawScale(context) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "bottom";
    context.lineWidth = 1;
    const ink = getComputedStyle(this.canvas).color;
    const step = niceStep(34 / this.scale);
    const origin = this.origin ?? 0;
    const [low, high] = [this.middle[1] - height / 2 / this.scale, this.middle[1] + height / 2 / this.scale].map((v) => v + origin);
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      const y = Math.round(height / 2 - (v - origin - this.middle[1]) * this.scale) + 0.5;
      context.globalAlpha = 0.22;
      context.strokeStyle = ink;
      line(context, 0, y, width, y);
      context.globalAlpha = 0.8;
      context.fillStyle = ink;
      context.fillText(`${Number(v.toFixed(3))} m`, 4, y - 1);
    }
    context.globalAlpha = 1;
    if (this.level !== null && !this.ground) {
      const y = height / 2 - (this.level - this.middle[1]) * this.scale;
      context.strokeStyle = "#b05a00";
      context.lineWidth = 2;
      line(context, 0, y, width, y);
    }
  }

  listen() {
    let from = null;
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      from = [event.offsetX, event.offsetY];
      if (event.button === 0) this.events.begin();
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const to = [event.offsetX, event.offsetY];
      if (event.buttons & 1) {
        if (event.shiftKey) this.tilt(from, to);
        else this.placement.place[2] -= (to[1] - from[1]) / this.scale;
      } else {
        this.middle[0] -= (to[0] - from[0]) / this.scale;
        this.middle[1] += (to[1] - from[1]) / this.scale;
      }
      from = to;
      this.events.changed();
    });
    const up = () => (from = null);
    this.canvas.addEventListener("pointerup", up);
    this.canvas.addEventListener("pointercancel", up);
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const factor = 2 ** (-Math.max(-200, Math.min(200, event.deltaY)) / 200);
      const { clientWidth: width, clientHeight: height } = this.canvas;
      const change = (1 - 1 / factor) / this.scale;
      this.middle[0] += (event.offsetX - width / 2) * change;
      this.middle[1] -= (event.offsetY - height / 2) * change;
      this.scale *= factor;
      this.events.changed();
    }, { passive: false });
  }

  /** Turns the model about the axis of sight as the mouse goes around its pivot. */
  tilt(from, to) {
    const [across, up] = this.projection;
    const { place } = this.placement;
    const middle = [across, up].map((row) => row[0] * place[0] + row[1] * place[1] + row[2] * place[2] + row[3]);
    const angle = (p) => Math.atan2(-(p[1] - middle[1]), p[0] - middle[0]);
    const degrees = (wrapped(angle(to) - angle(from)) * 180) / Math.PI;
    // From the south, what turns to the left turns about the axis to the south.
    if (this.axis === 0) this.placement.turn("y", -degrees);
    else this.placement.turn("x", degrees);
  }
}

/** A photograph, the points of the model and those of the map over it. */
export class PhotoView {
  constructor(image, canvas) {
    Object.assign(this, { image, canvas, camera: null, ground: null, showsGround: true, showsCloud: false });
    this.dots = new Dots(canvas);
  }

  /** Shows the photograph of a camera; waits until it is there. */
  async show(camera) {
    this.camera = camera;
    this.image.hidden = !camera.has_photograph;
    if (!camera.has_photograph) return;
    this.image.src = `job/photo/${camera.number}.png`;
    // A photograph that cannot be read leaves the points on the plain ground.
    await this.image.decode().catch(() => (this.image.hidden = true));
  }

  /** The part of the canvas that the photograph covers: left, top and pixels of the page in one of it. */
  get frame() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [columns, rows] = this.camera.size;
    const scale = Math.min(width / columns, height / rows);
    return { left: (width - columns * scale) / 2, top: (height - rows * scale) / 2, scale };
  }

  /** From offsets to the pivot in the model to column, row and depth, as a pinhole sees them. */
  projection(pivot) {
    const { rotation, centre, focal, principal } = this.camera;
    const { left, top, scale } = this.frame;
    const seen = rotation.map((row) => [...row, row.reduce((sum, c, i) => sum + c * (pivot[i] - centre[i]), 0)]);
    // The centre of the first pixel is 0, its corner half a pixel before.
    const across = (f, c, edge) => [f * scale, (c + 0.5) * scale + edge];
    const [fx, cx] = across(focal[0], principal[0], left);
    const [fy, cy] = across(focal[1], principal[1], top);
    return [0, 1, 2, 3].reduce((rows, j) => {
      rows[0].push(fx * seen[0][j] + cx * seen[2][j]);
      rows[1].push(fy * seen[1][j] + cy * seen[2][j]);
      rows[2].push(seen[2][j]);
      return rows;
    }, [[], [], []]);
  }

  draw(cloud, placement, pairs, pending) {
    if (!this.camera) return;
    const { left, top, scale } = this.frame;
    const style = this.image.style;
    [style.left, style.top] = [`${left}px`, `${top}px`];
    [style.width, style.height] = [`${this.camera.size[0] * scale}px`, `${this.camera.size[1] * scale}px`];
    const projection = this.projection(placement.pivot);
    const fromWorld = after(projection, placement.rowsBack);
    this.dots.begin();
    if (this.showsGround && this.ground) this.dots.draw(this.ground, fromWorld, { size: 2, isPinhole: true });
    if (this.showsCloud) this.dots.draw(cloud, projection, { size: 2, isPinhole: true });
    const context = this.dots.end();
    const on = (rows, p) => {
      const [x, y, depth] = rows.map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
      return depth > 0 ? [x / depth, y / depth] : null;
    };
    const offset = (model) => model.map((c, i) => c - placement.pivot[i]);
    for (const pair of pairs) drawPair(context, on(projection, offset(pair.model)), on(fromWorld, pair.world), pair.name);
    const place = pending && on(projection, offset(pending));
    if (place) mark(context, ...place, "#ffe14a");
  }

  /** Returns the number of the point of the model nearest to a position, -1 for none. */
  pick(cloud, pivot, at) {
    return this.camera ? nearest(cloud, this.projection(pivot), at, 9, true) : -1;
  }
}

/** Draws both ends of a pair, each on a position or null: a circle of the model, a cross of the map. */
export function drawPair(context, model, world, name) {
  if (model && world) {
    for (const [colour, width] of [["#000b", 4], ["#ffe14a", 1.6]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      line(context, ...model, ...world);
    }
  }
  if (world) cross(context, ...world, "#35d0ff", 8);
  if (!model) return;
  mark(context, ...model, "#ffe14a");
  context.font = "600 12px system-ui, sans-serif";
  context.textBaseline = "bottom";
  context.lineWidth = 3;
  context.strokeStyle = "#000b";
  context.strokeText(name, model[0] + 8, model[1] - 5);
  context.fillStyle = "#ffe14a";
  context.fillText(name, model[0] + 8, model[1] - 5);
}

export function mark(context, x, y, colour) {
  for (const [stroke, width] of [["#000b", 4.5], [colour, 2]]) {
    context.strokeStyle = stroke;
    context.lineWidth = width;
    context.beginPath();
    context.arc(x, y, 6, 0, 7);
    context.stroke();
  }
}

export function cross(context, x, y, colour, arm) {
  for (const [stroke, width] of [["#000b", 4], [colour, 1.8]]) {
    context.strokeStyle = stroke;
    context.lineWidth = width;
    line(context, x - arm, y, x + arm, y);
    line(context, x, y - arm, x, y + arm);
  }
}

export function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

/** Returns an angle between -pi and pi. */
export function wrapped(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
