// The profile: values of rasters along a line, as a chart and as CSV.

import { ask, distance, short, ticks, withUnit } from "./numbers.js";

const MARGIN = { left: 58, right: 14, top: 16, bottom: 28 };
const SVG = "http://www.w3.org/2000/svg";

export class Profile {
  /** `marked` is told the map coordinates under the mouse, or null. */
  constructor(svg, label, scene, marked) {
    Object.assign(this, { svg, label, scene, marked, data: null, rasters: [] });
    new ResizeObserver(() => this.draw()).observe(svg);
    svg.addEventListener("pointermove", (event) => this.point(event.offsetX));
    svg.addEventListener("pointerleave", () => this.point(null));
  }

  /** Asks for the values along a line, and draws them. */
  async show(line, rasters) {
    const [[x1, y1], [x2, y2]] = line;
    const path = `profile?rasters=${rasters.join(",")}&x1=${x1}&y1=${y1}&x2=${x2}&y2=${y2}`;
    this.latest = path;
    const data = await (await ask(path)).json();
    if (this.latest !== path) return;
    Object.assign(this, { data, rasters });
    this.draw();
    this.point(null);
  }

  /** Returns the name of a raster: its file, or the title of its layer where two files have one name. */
  nameOf(raster) {
    const { file } = this.scene.rasters[raster];
    const isOne = this.scene.rasters.filter((other) => other.file === file).length === 1;
    return isOne ? file : this.scene.layers.find((layer) => layer.raster === raster).title;
  }

  /** The values as CSV, with one column for each raster. */
  csv() {
    const names = this.rasters.map((i) => this.nameOf(i).replace(/[",\r\n]/g, "_"));
    const rows = this.data.distance.map((d, i) => {
      const values = this.data.values.map((one) => one[i] ?? "");
      return [d.toFixed(3), this.data.x[i], this.data.y[i], ...values].join(",");
    });
    return [["distance_m", "x", "y", ...names].join(","), ...rows, ""].join("\r\n");
  }

  draw() {
    const { svg, data } = this;
    const [width, height] = [svg.clientWidth, svg.clientHeight];
    svg.setAttribute("viewBox", `0 0 ${Math.max(width, 1)} ${Math.max(height, 1)}`);
    svg.replaceChildren();
    if (!data || width < 100) return;
    const all = data.values.flat().filter((value) => value !== null);
    svg.setAttribute("aria-label", this.summary(all));
    if (!all.length) return void this.text("no data along the line", width / 2, height / 2, "middle");
    const length = data.distance.at(-1);
    let [low, high] = all.reduce(([l, h], value) => [Math.min(l, value), Math.max(h, value)], [Infinity, -Infinity]);
    const room = Math.max((high - low) * 0.06, Math.abs(high) * 1e-6, 1e-6);
    [low, high] = [low - room, high + room];
    this.x = (d) => MARGIN.left + (d / length) * (width - MARGIN.left - MARGIN.right);
    this.y = (v) => height - MARGIN.bottom - ((v - low) / (high - low)) * (height - MARGIN.top - MARGIN.bottom);
    this.axes(low, high, length, width, height);
    data.values.forEach((values, i) => this.path(values, i));
    this.names(width);
    this.cursor = this.add("line", { class: "cursor", y1: MARGIN.top, y2: height - MARGIN.bottom, visibility: "hidden" });
  }

  axes(low, high, length, width, height) {
    const bottom = height - MARGIN.bottom;
    for (const value of ticks(low, high, 4)) {
      const y = this.y(value);
      this.add("line", { class: "grid", x1: MARGIN.left, x2: width - MARGIN.right, y1: y, y2: y });
      this.text(short(value, 5), MARGIN.left - 6, y + 4, "end");
    }
    for (const d of ticks(0, length, Math.max(2, width / 120))) {
      this.add("line", { class: "grid", x1: this.x(d), x2: this.x(d), y1: bottom, y2: bottom + 4 });
      this.text(distance(d, this.scene.map.unit), this.x(d), bottom + 17, "middle");
    }
  }

  /** Draws values as a line that is interrupted where there is none. */
  path(values, series) {
    let line = "";
    let before = null;
    values.forEach((value, i) => {
      if (value !== null) line += `${before === null ? "M" : "L"}${this.x(this.data.distance[i]).toFixed(1)} ${this.y(value).toFixed(1)}`;
      before = value;
    });
    this.add("path", { class: `s${series % 4}`, d: line });
  }

  names(width) {
    let x = MARGIN.left + 6;
    this.rasters.forEach((raster, i) => {
      const [file, { unit }] = [this.nameOf(raster), this.scene.rasters[raster]];
      this.add("rect", { class: `s${i % 4}`, x, y: 3, width: 12, height: 4 });
      const text = this.text(unit ? `${file}, ${unit}` : file, x + 16, 10, "start");
      x += 34 + text.getComputedTextLength();
    });
  }

  /** Shows the values at a place of the chart. */
  point(left) {
    if (!this.data || !this.cursor) return;
    const { distance: along, values } = this.data;
    const part = left === null ? null : (left - this.x(0)) / (this.x(along.at(-1)) - this.x(0));
    if (part === null || part < 0 || part > 1) {
      this.cursor.setAttribute("visibility", "hidden");
      this.label.textContent = this.summary();
      return this.marked(null);
    }
    const i = Math.round(part * (along.length - 1));
    for (const end of ["x1", "x2"]) this.cursor.setAttribute(end, this.x(along[i]));
    this.cursor.setAttribute("visibility", "visible");
    const shown = values.map((one, s) => withUnit(one[i], this.scene.rasters[this.rasters[s]].unit));
    this.label.textContent = `${distance(along[i], this.scene.map.unit)}: ${shown.join(" · ")}`;
    this.marked([this.data.x[i], this.data.y[i]]);
  }

  summary() {
    if (!this.data) return "";
    const { distance: along } = this.data;
    return `${distance(along.at(-1), this.scene.map.unit)}, ${along.length} cells`;
  }

  add(kind, attributes) {
    const element = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    this.svg.append(element);
    return element;
  }

  text(content, x, y, anchor) {
    const element = this.add("text", { x, y, "text-anchor": anchor });
    element.textContent = content;
    return element;
  }
}
