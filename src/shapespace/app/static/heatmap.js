// A diagram as colours over the plane of two keys, with its boundaries drawn over.

import { Chart } from "./chart.js";
import { choice, refill } from "./choices.js";
import { colourOf, gradient, MAPS, row, scaleFor, table } from "./colours.js";
import { recall } from "./data.js";
import { sample } from "./diagram.js";
import { dense, place as placeLabels } from "./labels.js";
import { mark } from "./marks.js";
import { layerOf, placeOf, session } from "./session.js";
import { make } from "./svg.js";
import { hideTip, showTip } from "./tip.js";
import { view } from "./view.js";
import { escaped, html, number, plain, safe, stabilityWords } from "./words.js";

const IS_STATE = 1;
const NOT_COMPUTED = 0;
const NEAR = 6;

/** Red, green, blue and opacity of a value, from 0 to 255. */
function tableColours(scale) {
  const colours = Uint8ClampedArray.from(table(scale.map), (share) => 255 * share);
  const found = new Uint8ClampedArray(4).fill(255);
  return (value) => {
    const from = 3 * row(value, scale);
    for (let c = 0; c < 3; c++) found[c] = colours[from + c];
    return found;
  };
}

function kindColours(kinds) {
  const colours = new Map(kinds.map(([code, , hex]) => [code, [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)).concat(255)]));
  return (value) => colours.get(value);
}

function sampleOf([, words, colour]) {
  const one = document.createElement("span");
  const square = document.createElement("i");
  square.className = "bar kind";
  square.style.background = colour;
  one.append(square, words);
  return one;
}

export class Heatmap extends Chart {
  constructor(host, tools, legend) {
    super(host, "Map of all states");
    Object.assign(this, { tools, legend });
    this.canvas = document.createElement("canvas");
    this.canvas.hidden = true;
    this.svg.classList.add("map");
    host.prepend(this.canvas);
    host.addEventListener("pointermove", (event) => this.hover(event));
    host.addEventListener("pointerleave", () => this.leave());
    host.addEventListener("click", (event) => {
      const at = this.map && this.x ? this.point(event) : null;
      if (at) session.choose(placeOf(this.map, this.layer, ...at));
    });
    session.on("state", () => this.map && this.mark());
    session.on("closed", () => { this.canvas.hidden = true; this.values = null; });
    view.on(["of", "state"], () => this.map && this.arrange());
    view.on(["mapcolours", "theme"], () => this.map && this.due());
  }

  get map() {
    return session.overview?.map;
  }

  get name() {
    return this.map.names.includes(view.get("of")) ? view.get("of") : this.map.of;
  }

  get layer() {
    return layerOf(this.map);
  }

  async arrange() {
    const { map, name } = this;
    const tools = [choice("colour", map.names, name, (of) => view.set({ of }), { id: "choose-of" })];
    if (map.states.length > 1) {
      const states = map.states.map((state, i) => [String(i), state]);
      tools.push(choice("state", states, String(this.layer), (state) => this.changeState(state), { id: "choose-state" }));
    }
    tools.push(choice("as", ["auto", ...MAPS], view.get("mapcolours"), (chosen) => view.set({ mapcolours: chosen }), { id: "choose-mapcolours" }));
    refill(this.tools, ...tools);
    const wanted = name;
    await session.attempt("", async () => {
      const { values, kinds, damage } = await recall("values", { store: view.get("store"), name });
      if (!this.map || wanted !== this.name) return;
      Object.assign(this, { values, kinds });
      session.addDamage(damage);
    });
    this.due();
  }

  changeState(state) {
    view.set({ state });
    const [, i, j] = view.get("place").split(",");
    if (j !== undefined) session.choose(placeOf(this.map, state, i, j));
  }

  draw(width, height) {
    if (!this.map || !this.values) return;
    this.say("");
    const { x, y } = this.map;
    const [xs, ys] = [x.values, y.values];
    this.half = [(xs[1] - xs[0]) / 2, (ys[1] - ys[0]) / 2];
    const layer = this.axes({
      width, height, beyond: 1,
      x: [xs[0] - this.half[0], xs.at(-1) + this.half[0]], y: [ys[0] - this.half[1], ys.at(-1) + this.half[1]],
      xTitle: { name: x.key, ...session.quantity(x.key) }, yTitle: { name: y.key, ...session.quantity(y.key) },
    });
    this.paint(xs.length, ys.length);
    this.boundaries(layer);
    this.marker = make("g");
    this.pointer = make("g");
    this.overlay.append(this.marker, this.pointer);
    this.mark();
    session.tell("painted");
  }

  /** One pixel for each point, blown up by the browser. */
  paint(nx, ny) {
    const { left, right, top, bottom } = this.box;
    Object.assign(this.canvas, { width: nx, height: ny, hidden: false });
    Object.assign(this.canvas.style, {
      left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${bottom - top}px`,
    });
    const first = this.layer * nx * ny;
    const values = this.values.subarray(first, first + nx * ny);
    const codes = this.map.outcomes.subarray(first, first + nx * ny);
    let [low, high] = [Infinity, -Infinity];
    for (const value of this.values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    const { least } = session.quantity(this.name);
    const scale = low <= high ? scaleFor(low, high, view.get("mapcolours"), { name: this.name, least }) : null;
    const coloured = this.kinds ? kindColours(this.kinds) : scale && tableColours(scale);
    const image = new ImageData(nx, ny);
    const hatch = document.documentElement.dataset.theme === "dark" ? [62, 70, 82] : [214, 213, 207];
    for (let j = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++) {
        const k = j * nx + i;
        const to = 4 * ((ny - 1 - j) * nx + i);
        if (Number.isFinite(values[k])) {
          image.data.set(coloured(values[k]), to);
          image.data[to + 3] = 255;
        } else if (codes[k] !== NOT_COMPUTED) {
          for (let c = 0; c < 3; c++) image.data[to + c] = hatch[c];
          image.data[to + 3] = 255;
        }
      }
    }
    this.canvas.getContext("2d").putImageData(image, 0, 0);
    this.describe(scale, codes, values);
  }

  describe(scale, codes, values) {
    this.legend.replaceChildren(...(this.kinds ? this.kinds.map(sampleOf) : scale ? [this.bar(scale)] : []));
    const lacking = [
      codes.some((code) => code !== IS_STATE && code !== NOT_COMPUTED) && "no state",
      codes.some((code, k) => code === IS_STATE && !Number.isFinite(values[k])) && `no ${plain(this.name)}`,
    ].filter(Boolean);
    if (lacking.length) {
      const none = document.createElement("span");
      none.innerHTML = `<i class="bar none"></i> ${escaped(lacking.join(" or "))}`;
      this.legend.append(none);
    }
    if (codes.some((code) => code === NOT_COMPUTED)) {
      const none = document.createElement("span");
      none.textContent = "blank: not computed yet";
      this.legend.append(none);
    }
  }

  bar(scale) {
    const { symbol, unit } = session.quantity(this.name);
    const units = unit === "1" ? "" : html(unit);
    const bar = document.createElement("span");
    const range = scale.all === null
      ? `<b>${number(scale.low, 4)}</b><i class="bar" style="background:${gradient(scale)}"></i><b>${number(scale.high, 4)} ${units}</b>`
      : `<i class="bar kind" style="background:${colourOf(scale.all, scale)}"></i><b>${number(scale.all, 4)} ${units} everywhere</b>`;
    bar.innerHTML = `<b>${safe(this.name)} ${html(symbol)}</b> ${range}`;
    return bar;
  }

  boundaries(layer) {
    const named = [];
    this.lines = (this.map.boundaries ?? []).map(({ of, x: first, y: second, keys, labels }) => {
      const isTurned = keys[0] === this.map.y.key;
      const [x, y] = isTurned ? [second, first] : [first, second];
      // Dark on a pale rim in both themes, as the colours of a map are the same in both.
      layer.append(this.path(x, y, { class: "boundary rim" }), this.path(x, y, { class: `boundary ${of}` }));
      for (const [text, kind, a, b] of labels) named.push({ text, kind, x: this.x(isTurned ? b : a), y: this.y(isTurned ? a : b) });
      return { of, points: Array.from(x, (value, k) => [this.x(value), this.y(y[k])]) };
    });
    // Curves may go beyond the map.
    const { left, right, top, bottom } = this.box;
    const wanted = named.filter(({ x, y }) => x >= left - 1 && x <= right + 1 && y >= top - 1 && y <= bottom + 1);
    for (const { text, kind, x, y } of wanted) layer.append(mark(kind, x, y, { label: text }));
    placeLabels(wanted, this.lines.map(({ points }) => points), this.box, this.overlay);
    for (const of of new Set(this.lines.map((line) => line.of))) {
      const drawing = ["rim", of].map((kind) => make("path", { class: `boundary ${kind}`, d: "M0 5H26" }));
      this.legend.append(sample(drawing, `${plain(of)}s`));
    }
  }

  /** What a boundary under the pointer consists of; empty where there is none. */
  boundaryAt(event) {
    const { left, top } = this.host.getBoundingClientRect();
    const isNear = ([x, y]) => Math.hypot(x - event.clientX + left, y - event.clientY + top) < NEAR;
    return this.lines.find(({ points }) => dense(points).some(isNear))?.of ?? "";
  }

  mark() {
    if (!this.marker) return;
    const [, i, j] = (session.state?.place ?? "").split(",").map(Number);
    this.marker.replaceChildren();
    if (!Number.isFinite(j)) return;
    const [px, py] = [this.x(this.map.x.values[i]), this.y(this.map.y.values[j])];
    const { left, right, top, bottom } = this.box;
    this.marker.append(
      make("line", { class: "cross", x1: px, x2: px, y1: top, y2: bottom }),
      make("line", { class: "cross", x1: left, x2: right, y1: py, y2: py }),
      make("circle", { class: "here", cx: px, cy: py, r: 6 }),
    );
  }

  /** Numbers of the point under the pointer, null outside. */
  point(event) {
    const box = this.host.getBoundingClientRect();
    const found = [[this.x, event.clientX - box.left, this.map.x.values], [this.y, event.clientY - box.top, this.map.y.values]]
      .map(([scale, pixel, values], k) => Math.round((scale.inverse(pixel) - values[0]) / (2 * this.half[k])));
    return found[0] >= 0 && found[1] >= 0 && found[0] < this.map.x.values.length && found[1] < this.map.y.values.length ? found : null;
  }

  hover(event) {
    if (!this.map || !this.pointer || event.pointerType === "touch") return;
    const at = this.point(event);
    if (!at) {
      this.leave();
      return;
    }
    const { x, y, outcomes, meanings } = this.map;
    const [i, j] = at;
    const k = (this.layer * y.values.length + j) * x.values.length + i;
    const { unit } = session.quantity(this.name);
    const isCount = this.name === "n_unstable";
    const kind = this.kinds?.find(([code]) => code === this.values[k]);
    const value = outcomes[k] !== IS_STATE ? `<b>${meanings[outcomes[k]]?.[0] ?? "not computed"}</b>`
      : kind ? `<b>${escaped(kind[1])}</b>`
      : isCount ? `<b>${stabilityWords(Number.isFinite(this.values[k]) ? this.values[k] : null)}</b>`
      : `<b>${safe(this.name)} ${number(this.values[k])}</b> ${unit === "1" ? "" : html(unit)}`;
    const boundary = this.boundaryAt(event);
    const crossed = boundary ? `<br>boundary: ${safe(boundary)}s` : "";
    showTip(event, `${value}<br>${safe(x.key)} ${number(x.values[i])}<br>${safe(y.key)} ${number(y.values[j])}${crossed}`);
  }

  leave() {
    hideTip();
  }
}
