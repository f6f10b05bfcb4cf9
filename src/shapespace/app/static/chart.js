// A drawing with two axes that fits itself into its element.

import { linear, make, tick, ticks, title, widthOf } from "./svg.js";

const LEFT = 50;
const RIGHT = 14;
const TOP = 24;
const BOTTOM = 38;

let charts = 0;

export class Chart {
  constructor(host, words) {
    this.host = host;
    this.svg = make("svg", { role: "img", "aria-label": words });
    host.append(this.svg);
    this.message = document.createElement("div");
    this.message.className = "empty";
    this.message.hidden = true;
    host.append(this.message);
    this.isDue = false;
    this.clip = `clip-${++charts}`;
    // Its size is told, as to ask for it while other drawings change costs a layout each time.
    this.size = { width: 0, height: 0 };
    new ResizeObserver(([{ contentRect: { width, height } }]) => {
      this.size = { width: Math.floor(width), height: Math.floor(height) };
      this.due();
    }).observe(host);
  }

  /** Draw again, once for all that changed. */
  due() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      const { width, height } = this.size;
      if (width > 20 && height > 20) this.draw(width, height);
    });
  }

  /** Words in place of a drawing; none to draw. */
  say(words, ...more) {
    this.message.hidden = words === "";
    this.message.replaceChildren(...(words ? [words, ...more] : []));
    if (words) this.svg.replaceChildren();
  }

  /**
   * Axes for these limits; sets `x` and `y`, the scales, and returns the layer to draw on. Margins widen for long numbers.
   * beyond: pixels above and below the axes in which what lies at their ends is still drawn.
   */
  axes({ width, height, x, y, xTitle, yTitle, equal = false, right = 0, left = LEFT, whole = false, beyond = 6 }) {
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const box = { left, right: width - RIGHT - right, top: TOP, bottom: height - BOTTOM };
    let [xs, ys] = equal ? even(x, y, box) : [x, y];
    box.left = Math.max(left, marginFor(upwards(ys, box)));
    if (equal) [xs, ys] = even(x, y, box);
    this.box = box;
    this.x = linear(xs, [box.left, box.right]);
    this.y = linear(ys, [box.bottom, box.top]);
    const back = make("g");
    this.vertical(back, xs, box, width, whole ? 1 : 0);
    this.horizontal(back, ys, box);
    if (xTitle) {
      back.append(title(xTitle.name, xTitle, { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }));
    }
    if (yTitle) back.append(title(yTitle.name, yTitle, { x: Math.max(box.left - 38, 6), y: 14 }));
    const clip = make("clipPath", { id: this.clip }, make("rect", {
      x: box.left - 1, y: box.top - beyond, width: Math.max(box.right - box.left + 2, 0), height: Math.max(box.bottom - box.top + 2 * beyond, 0),
    }));
    const layer = make("g", { "clip-path": `url(#${this.clip})` });
    this.overlay = make("g");
    this.svg.replaceChildren(make("defs", {}, clip), back, layer, this.overlay);
    return layer;
  }

  vertical(back, xs, box, width, least) {
    for (const [value, text] of across(xs, box, least)) {
      const at = this.x(value);
      const half = widthOf(text) / 2 + 3;
      back.append(make("line", { class: "grid", x1: at, x2: at, y1: box.top, y2: box.bottom }));
      back.append(make("text", { x: Math.max(half, Math.min(width - half, at)), y: box.bottom + 15, "text-anchor": "middle" }, text));
    }
    back.append(make("line", { class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom }));
  }

  horizontal(back, ys, box) {
    for (const [value, text] of upwards(ys, box)) {
      const at = this.y(value);
      back.append(make("line", { class: "grid", x1: box.left, x2: box.right, y1: at, y2: at }));
      back.append(make("text", { x: box.left - 6, y: at + 4, "text-anchor": "end" }, text));
    }
  }

  /** Round values that a drawing of this height has at its side, with their words. */
  marks(limits, height) {
    return upwards(limits, { top: TOP, bottom: height - BOTTOM });
  }

  /** A line through points; gaps where a value is none. */
  path(xs, ys, attributes) {
    let text = "";
    let isDown = false;
    for (let i = 0; i < xs.length; i++) {
      const isKnown = Number.isFinite(xs[i]) && Number.isFinite(ys[i]);
      if (isKnown) text += `${isDown ? "L" : "M"}${this.x(xs[i]).toFixed(2)} ${this.y(ys[i]).toFixed(2)}`;
      isDown = isKnown;
    }
    return make("path", { d: text, fill: "none", ...attributes });
  }
}

/** Round values up the side of a box, with their words. */
function upwards(limits, { top, bottom }) {
  return worded(ticks(limits, Math.min(6, (bottom - top) / 40)));
}

/** Round values along the bottom of a box, with their words, as many as have room beside each other. */
function across(limits, { left, right }, least) {
  for (let count = Math.min(7, (right - left) / 72); ; count /= 2) {
    const found = worded(ticks(limits, count, least));
    const widest = Math.max(0, ...found.map(([, text]) => widthOf(text)));
    if (count < 1 || found.length < 2 || widest + 8 < (right - left) * ((found[1][0] - found[0][0]) / (limits[1] - limits[0]))) return found;
  }
}

function worded(values) {
  return values.map((value) => [value, tick(value, values[1] - values[0] || 1)]);
}

/** Room beside a box for the words at its side. */
export function marginFor(marks) {
  return 12 + Math.max(0, ...marks.map(([, text]) => widthOf(text)));
}

/** Limits widened so that one unit is as long along both axes. */
function even(x, y, box) {
  const perPixel = Math.max((x[1] - x[0]) / (box.right - box.left), (y[1] - y[0]) / (box.bottom - box.top));
  const widen = ([low, high], pixels) => {
    const [middle, half] = [(low + high) / 2, (perPixel * pixels) / 2];
    return [middle - half, middle + half];
  };
  return [widen(x, box.right - box.left), widen(y, box.bottom - box.top)];
}
