// The legend of a layer, as elements.

import { short } from "./numbers.js";

/** Fills `place` with the legend of a layer. */
export function showLegend(place, layer, unit) {
  const heading = document.createElement("h2");
  heading.textContent = layer.title + (unit && layer.legend.kind === "ramp" ? `, ${unit}` : "");
  place.replaceChildren(heading, ...content(layer.legend));
}

function content(legend) {
  if (legend.kind === "ramp") return ramp(legend);
  if (legend.kind === "classes") return legend.classes.map((one) => row(`rgb(${one.colour.join(" ")})`, one.label));
  if (legend.kind === "marked") return [row(hatching(legend.colour), "filled, not observed")];
  return [];
}

function ramp({ low, high, colours }) {
  const bar = document.createElement("div");
  bar.className = "ramp";
  bar.style.background = `linear-gradient(90deg, ${colours.join(", ")})`;
  const ends = document.createElement("div");
  ends.className = "ends";
  for (const value of [low, (low + high) / 2, high]) {
    const text = document.createElement("span");
    text.textContent = short(value, 3);
    ends.append(text);
  }
  return [bar, ends];
}

/** Returns a line with a field of colour. */
export function row(background, label) {
  const line = document.createElement("div");
  line.className = "class";
  const field = document.createElement("i");
  field.style.background = background;
  line.append(field, label);
  return line;
}

/** Returns the background of a hatching. */
export function hatching(colour) {
  return `repeating-linear-gradient(135deg, ${colour} 0 2px, ${colour}50 2px 5px)`;
}

/** Turns what is drawn on a canvas into lines of `period` pixels, which begin at `x`, over a tint of the same colour. */
export function hatch(context, period, x = 0) {
  const { width, height } = context.canvas;
  const tile = Object.assign(document.createElement("canvas"), { width: period, height: period });
  const lines = tile.getContext("2d");
  lines.fillStyle = "#0005";
  lines.fillRect(0, 0, period, period);
  lines.lineWidth = period / 3;
  for (const shift of [-period, 0, period]) {
    lines.moveTo(shift - period, period * 2);
    lines.lineTo(shift + period * 2, -period);
  }
  lines.stroke();
  context.save();
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.globalCompositeOperation = "destination-in";
  context.fillStyle = context.createPattern(tile, "repeat");
  context.translate(Math.round(x % period) - period, 0);
  context.fillRect(0, 0, width + 2 * period, height);
  context.restore();
}
