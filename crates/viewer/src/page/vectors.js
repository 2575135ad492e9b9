// Lines and areas over the map, with their attributes.

import { ask, short } from "./numbers.js";

/** Colours of layers that have no meaning of their own. */
const COLOURS = ["#d6276e", "#0b7a75", "#7a3fb0", "#b05a00"];
const GAIN = "#b3202a";
const LOSS = "#1f5fa8";
const CONTOUR = "#6b3a12";
/** Units at the ends of names of attributes. */
const UNITS = { m: "m", m2: "m²", m3: "m³", px: "px", deg: "°" };
/** How near a click must be to a line, pixels. */
const NEAR = 6;

export class Vectors {
  constructor({ title, look, count }, number, all) {
    Object.assign(this, { title, look, count, number, shown: false, features: null, picked: null });
    const plain = all.slice(0, number).filter((one) => one.look === "plain").length;
    this.colour = { contours: CONTOUR, change: GAIN }[look] ?? COLOURS[plain % COLOURS.length];
  }

  async load() {
    if (this.features) return;
    const { features } = await (await ask(`vectors/${this.number}.json`)).json();
    for (const feature of features) feature.box = boxOf(feature.parts);
    // Every fifth line is bold, as on printed maps.
    const heights = [...new Set(features.map((one) => one.properties.elevation))].sort((a, b) => a - b);
    this.step = Math.min(...heights.slice(1).map((height, i) => height - heights[i]));
    this.features = features;
  }

  /** Draws the features that are on the screen. */
  draw(context, map) {
    const seen = this.seen(map);
    for (const feature of seen) {
      if (feature !== this.picked) this.drawOne(context, map, feature, false);
    }
    if (this.picked) this.drawOne(context, map, this.picked, true);
  }

  /** Returns the features whose boxes touch the screen. */
  seen(map) {
    const corners = [[0, 0], [map.width, 0], [0, map.height], [map.width, map.height]].map(([x, y]) => map.mapAt(x, y));
    const [x0, x1] = range(corners.map((corner) => corner[0]));
    const [y0, y1] = range(corners.map((corner) => corner[1]));
    return this.features.filter(({ box }) => box[0] <= x1 && box[2] >= x0 && box[1] <= y1 && box[3] >= y0);
  }

  drawOne(context, map, feature, isPicked) {
    const colour = this.colourOf(feature);
    const path = pathOf(feature, (x, y) => map.screenAt(x, y).map((c) => c * map.ratio), 4 * map.ratio);
    if (feature.kind !== "lines") {
      context.fillStyle = colour + (isPicked ? "70" : "38");
      context.fill(path, "evenodd");
    }
    const width = this.look === "contours" ? (this.isBold(feature) ? 1.8 : 0.9) : 2;
    context.lineJoin = "round";
    // A light rim keeps lines legible on dark ground.
    for (const [stroke, more] of [[isPicked ? "#ffe14a" : "#fff9", isPicked ? 5 : 1.6], [colour, 0]]) {
      context.strokeStyle = stroke;
      context.lineWidth = (width + more) * map.ratio;
      context.stroke(path);
    }
  }

  colourOf(feature) {
    if (this.look === "change") return feature.properties.mean_m < 0 ? LOSS : GAIN;
    return this.colour;
  }

  isBold(feature) {
    const place = feature.properties.elevation / (5 * this.step);
    return Number.isFinite(place) && Math.abs(place - Math.round(place)) < 1e-6;
  }

  /** Returns the feature at a position on the canvas: an area that holds it, or the nearest line. */
  at(map, x, y) {
    const probe = document.createElement("canvas").getContext("2d");
    const screen = (u, v) => map.screenAt(u, v);
    probe.lineWidth = 2 * NEAR;
    return this.seen(map).findLast((feature) => {
      const path = pathOf(feature, screen, 4);
      return probe.isPointInStroke(path, x, y) || (feature.kind !== "lines" && probe.isPointInPath(path, x, y, "evenodd"));
    });
  }

  /** Returns the attributes in words, with their units. */
  attributes({ properties }) {
    return Object.entries(properties).map(([name, value]) => {
      const parts = name.split("_");
      const unit = parts.length > 1 ? UNITS[parts.at(-1)] : undefined;
      const words = (unit ? parts.slice(0, -1) : parts).join(" ");
      const text = typeof value === "number" ? short(value, 4).replace("-", "−") : String(value ?? "–");
      return [words, unit ? `${text} ${unit}` : text];
    });
  }
}

/** Returns the path of a feature on a canvas. */
function pathOf({ kind, parts }, place, radius) {
  const path = new Path2D();
  for (const part of parts) {
    for (let i = 0; i < part.length; i += 2) {
      const [x, y] = place(part[i], part[i + 1]);
      if (kind === "points") {
        path.moveTo(x + radius, y);
        path.arc(x, y, radius, 0, 7);
      } else if (i) path.lineTo(x, y);
      else path.moveTo(x, y);
    }
    if (kind === "polygons") path.closePath();
  }
  return path;
}

function range(values) {
  return [Math.min(...values), Math.max(...values)];
}

function boxOf(parts) {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (const part of parts) {
    for (let i = 0; i < part.length; i += 2) {
      box[0] = Math.min(box[0], part[i]);
      box[1] = Math.min(box[1], part[i + 1]);
      box[2] = Math.max(box[2], part[i]);
      box[3] = Math.max(box[3], part[i + 1]);
    }
  }
  return box;
}
