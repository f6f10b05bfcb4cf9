// Small pieces of drawings: elements, scales, ticks, and text with indices.

import { number, pieces, plain, unitless } from "./words.js";

const SPACE = "http://www.w3.org/2000/svg";

/** An SVG element with attributes and children. */
export function make(name, attributes = {}, ...children) {
  const element = document.createElementNS(SPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

let pen = null;

/** How wide text is in a drawing, in pixels. */
export function widthOf(text) {
  if (!pen) {
    pen = document.createElement("canvas").getContext("2d");
    pen.font = `11px ${getComputedStyle(document.body).fontFamily}`;
  }
  return pen.measureText(text).width;
}

/** A linear map from [low, high] to [from, to], with its inverse. */
export function linear([low, high], [from, to]) {
  const scale = (value) => from + ((value - low) / (high - low)) * (to - from);
  scale.inverse = (pixel) => low + ((pixel - from) / (to - from)) * (high - low);
  scale.domain = [low, high];
  return scale;
}

/** Round values within limits, about as many as asked for. */
export function ticks([low, high], count, least = 0) {
  const rough = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = Math.max(least, power * ([1, 2, 2.5, 5, 10].find((one) => one * power >= rough * 0.999) ?? 10));
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
  return found;
}

const FLAT = 1e-6;

/** The middle of values that are even but for round-off, null of others. least: the smallest change that is one. */
export function evenValue(low, high, least = 0) {
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (size <= least) return 0;
  return high - low <= Math.max(least, FLAT * size) ? (low + high) / 2 : null;
}

/** Limits around values with some room; wide ones around those that are even. least: as above. */
export function limits(values, room = 0.05, least = 0) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [0, 1];
  const even = evenValue(low, high, least);
  if (even !== null) return [even - (0.1 * Math.abs(even) || 1), even + (0.1 * Math.abs(even) || 1)];
  return [low - room * (high - low), high + room * (high - low)];
}

export function tick(value, step) {
  const size = Math.max(Math.abs(value), Math.abs(step));
  if (Math.abs(value) < 1e-9 * size) return "0";
  return number(value, Math.max(1, Math.min(8, Math.ceil(Math.log10(Math.abs(value) / Math.abs(step)) + 2.001))));
}

/** Name, symbol and unit of a quantity as a text element. */
export function title(name, { symbol, unit }, attributes) {
  const text = make("text", attributes);
  if (name) text.append(make("tspan", { class: "name" }, plain(name)), " ");
  if (symbol) append(text, symbol);
  if (!unitless(unit)) {
    text.append(" (");
    append(text, unit);
    text.append(")");
  }
  return text;
}

function append(text, symbol) {
  let level = 0;
  for (const [part, high] of pieces(symbol)) {
    const span = make("tspan", { dy: (level - high) * 3.5, ...(high ? { "font-size": "9" } : {}) }, part);
    text.append(span);
    level = high;
  }
  if (level) text.append(make("tspan", { dy: level * 3.5 }, "\u200b"));
}
