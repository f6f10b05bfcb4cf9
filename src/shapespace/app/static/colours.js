// Colour maps that those who do not tell red from green can read, light to dark without a break.

import { evenValue } from "./svg.js";

const STOPS = {
  sea: ["#f7f1de", "#d3e6cf", "#9cd2c9", "#62b4c4", "#3a90bf", "#2b68ac", "#27408b", "#1d1e5c"],
  signed: ["#8a4b00", "#e07b00", "#f6c58a", "#f7f7f7", "#9dc3e0", "#0067a5", "#00395c"],
  coat: ["#c3cad3", "#f5c518"],
  viridis: ["#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725"],
  cividis: ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"],
  grey: ["#f4f4f4", "#303030"],
};
export const MAPS = Object.keys(STOPS);
const SIZE = 256;
const ROUND_OFF = 1e-9;
const AROUND = 0.3;
const tables = new Map();

/** Red, green and blue (256 × 3, from 0 to 1) of a map. */
export function table(name) {
  if (!tables.has(name)) {
    const stops = STOPS[name].map((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255));
    const values = new Float32Array(3 * SIZE);
    for (let i = 0; i < SIZE; i++) {
      const place = (i / (SIZE - 1)) * (stops.length - 1);
      const low = Math.min(Math.floor(place), stops.length - 2);
      for (let k = 0; k < 3; k++) {
        values[3 * i + k] = stops[low][k] + (place - low) * (stops[low + 1][k] - stops[low][k]);
      }
    }
    tables.set(name, values);
  }
  return tables.get(name);
}

/** Row of the table for a value on a scale. */
export function row(value, { low, high, isTurned }) {
  const share = (value - low) / (high - low);
  return Math.max(0, Math.min(SIZE - 1, Math.round((isTurned ? 1 - share : share) * (SIZE - 1)))) || 0;
}

/** The colour of a value on a scale, for style sheets. */
export function colourOf(value, scale) {
  const from = 3 * row(value, scale);
  return `rgb(${[...table(scale.map).subarray(from, from + 3)].map((share) => Math.round(255 * share)).join(" ")})`;
}

export function gradient({ map, isTurned }) {
  return `linear-gradient(to ${isTurned ? "left" : "right"}, ${STOPS[map].join(", ")})`;
}

/**
 * Limits and map for values: even about zero where they have both signs, else with the dark end where they are largest; around
 * one value, which is `all`, where they are even. least: the smallest change that is one.
 */
export function scaleFor(lowest, highest, chosen, { name = "", least = 0 } = {}) {
  const all = evenValue(lowest, highest, least);
  const [low, high] = [lowest, highest].map((one) => (Math.abs(one) < ROUND_OFF * Math.max(-lowest, highest) ? 0 : one));
  const isSigned = low < 0 && high > 0 && Math.min(-low, high) > 0.01 * Math.max(-low, high);
  const map = chosen !== "auto" ? chosen : isSigned && all === null ? "signed" : name === "local_spontaneous_curvature" ? "coat" : "sea";
  if (all !== null) {
    const room = AROUND * Math.abs(all) || 1;
    return { low: all - room, high: all + room, map, isTurned: all < 0, all };
  }
  if (isSigned && map === "signed") {
    const limit = Math.max(-low, high);
    return { low: -limit, high: limit, map, isTurned: false, all };
  }
  return { low, high, map, isTurned: -low > high, all };
}
