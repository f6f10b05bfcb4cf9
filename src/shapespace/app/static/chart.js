// A drawing with two axes that fits itself into its element.

import { linear, make, tick, ticks, title } from "./svg.js";

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
    new ResizeObserver(() => this.due()).observe(host);
  }

  /** Draw again, once for all that changed. */
  due() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => {
      this.isDue = false;
      const { clientWidth, clientHeight } = this.host;
      if (clientWidth > 20 && clientHeight > 20) this.draw(clientWidth, clientHeight);
    });
  }

  /** Words in place of a drawing; none to draw. */
  say(words, ...more) {
    this.message.hidden = words === "";
    this.message.replaceChildren(...(words ? [words, ...more] : []));
    if (words) this.svg.replaceChildren();
  }

  /** Axes for these limits; sets `x` and `y`, the scales, and returns the layer to draw on. */
  axes({ width, height, x, y, xTitle, yTitle, equal = false, right = 0, left = LEFT, whole = false }) {
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const box = { left, right: width - RIGHT - right, top: TOP, bottom: height - BOTTOM };
    let [xs, ys] = [x, y];
    if (equal) [xs, ys] = even(x, y, box);
    this.box = box;
    this.x = linear(xs, [box.left, box.right]);
    this.y = linear(ys, [box.bottom, box.top]);
    const back = make("g");
    this.vertical(back, xs, box, whole ? 1 : 0);
    this.horizontal(back, ys, box);
    if (xTitle) {
      back.append(title(xTitle.name, xTitle, { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }));
    }
    if (yTitle) back.append(title(yTitle.name, yTitle, { x: Math.max(box.left - 38, 6), y: 14 }));
    const clip = make("clipPath", { id: this.clip }, make("rect", {
      x: box.left - 1, y: box.top - 6, width: Math.max(box.right - box.left + 2, 0), height: Math.max(box.bottom - box.top + 12, 0),
    }));
    const layer = make("g", { "clip-path": `url(#${this.clip})` });
    this.overlay = make("g");
    this.svg.replaceChildren(make("defs", {}, clip), back, layer, this.overlay);
    return layer;
  }

  vertical(back, xs, box, least) {
    const values = ticks(xs, Math.min(7, (box.right - box.left) / 72), least);
    const step = values[1] - values[0] || 1;
    for (const value of values) {
      const at = this.x(value);
      back.append(make("line", { class: "grid", x1: at, x2: at, y1: box.top, y2: box.bottom }));
      back.append(make("text", { x: at, y: box.bottom + 15, "text-anchor": "middle" }, tick(value, step)));
    }
    back.append(make("line", { class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom }));
  }

  horizontal(back, ys, box) {
    const values = ticks(ys, Math.min(6, (box.bottom - box.top) / 40));
    const step = values[1] - values[0] || 1;
    for (const value of values) {
      const at = this.y(value);
      back.append(make("line", { class: "grid", x1: box.left, x2: box.right, y1: at, y2: at }));
      back.append(make("text", { x: box.left - 6, y: at + 4, "text-anchor": "end" }, tick(value, step)));
    }
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

/** Limits widened so that one unit is as long along both axes. */
function even(x, y, box) {
  const perPixel = Math.max((x[1] - x[0]) / (box.right - box.left), (y[1] - y[0]) / (box.bottom - box.top));
  const widen = ([low, high], pixels) => {
    const [middle, half] = [(low + high) / 2, (perPixel * pixels) / 2];
    return [middle - half, middle + half];
  };
  return [widen(x, box.right - box.left), widen(y, box.bottom - box.top)];
}
