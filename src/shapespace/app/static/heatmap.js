// A diagram as colours over the plane of two keys, with its boundaries drawn over.

import { Chart } from "./chart.js";
import { choice } from "./choices.js";
import { gradient, MAPS, row, scaleFor, table } from "./colours.js";
import { recall } from "./data.js";
import { stabilityWords } from "./diagram.js";
import { place as placeLabels } from "./labels.js";
import { placeOf, session } from "./session.js";
import { make } from "./svg.js";
import { hideTip, showTip } from "./tip.js";
import { view } from "./view.js";
import { escaped, html, number, safe } from "./words.js";

const IS_STATE = 1;
const NOT_COMPUTED = 0;

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
    return Math.min(Number(view.get("state")) || 0, this.map.states.length - 1);
  }

  async arrange() {
    const { map, name } = this;
    const tools = [choice("colour", map.names, name, (of) => view.set({ of }), { id: "choose-of" })];
    if (map.states.length > 1) {
      const states = map.states.map((state, i) => [String(i), state]);
      tools.push(choice("state", states, String(this.layer), (state) => this.changeState(state), { id: "choose-state" }));
    }
    tools.push(choice("as", ["auto", ...MAPS], view.get("mapcolours"), (chosen) => view.set({ mapcolours: chosen })));
    this.tools.replaceChildren(...tools);
    const wanted = name;
    await session.attempt("", async () => {
      const { values, kinds } = await recall("values", { store: view.get("store"), name });
      if (this.map && wanted === this.name) Object.assign(this, { values, kinds });
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
      width, height,
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
    const scale = scaleFor(low, high, view.get("mapcolours"), this.name);
    const colourOf = this.kinds ? kindColours(this.kinds) : tableColours(scale);
    const image = new ImageData(nx, ny);
    const hatch = document.documentElement.dataset.theme === "dark" ? [62, 70, 82] : [214, 213, 207];
    for (let j = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++) {
        const k = j * nx + i;
        const to = 4 * ((ny - 1 - j) * nx + i);
        if (Number.isFinite(values[k])) {
          image.data.set(colourOf(values[k]), to);
          image.data[to + 3] = 255;
        } else if (codes[k] !== NOT_COMPUTED) {
          for (let c = 0; c < 3; c++) image.data[to + c] = hatch[c];
          image.data[to + 3] = 255;
        }
      }
    }
    this.canvas.getContext("2d").putImageData(image, 0, 0);
    this.describe(scale, codes);
  }

  describe(scale, codes) {
    const { symbol, unit } = session.quantity(this.name);
    const bar = document.createElement("span");
    bar.innerHTML = `<b>${safe(this.name)} ${html(symbol)}</b> <b>${number(scale.low, 4)}</b>`
      + `<i class="bar" style="background:${gradient(scale)}"></i><b>${number(scale.high, 4)} ${unit === "1" ? "" : html(unit)}</b>`;
    this.legend.replaceChildren(...(this.kinds ? this.kinds.map(sampleOf) : [bar]));
    if (codes.some((code) => code !== IS_STATE && code !== NOT_COMPUTED)) {
      const none = document.createElement("span");
      none.innerHTML = '<i class="bar none"></i> no state';
      this.legend.append(none);
    }
    if (codes.some((code) => code === NOT_COMPUTED)) {
      const none = document.createElement("span");
      none.textContent = "blank: not computed yet";
      this.legend.append(none);
    }
  }

  boundaries(layer) {
    const wanted = [];
    const drawn = [];
    for (const { of, x: first, y: second, keys, labels } of this.map.boundaries ?? []) {
      const isTurned = keys[0] === this.map.y.key;
      const [x, y] = isTurned ? [second, first] : [first, second];
      // A rim in the colour of the page, as the line must show on every colour of the map.
      layer.append(this.path(x, y, { class: "boundary rim" }), this.path(x, y, { class: `boundary ${of}` }));
      for (let k = 0; k < x.length; k++) drawn.push([this.x(x[k]), this.y(y[k])]);
      for (const [text, a, b] of labels) {
        const [px, py] = isTurned ? [this.x(b), this.y(a)] : [this.x(a), this.y(b)];
        layer.append(make("circle", { class: "special", cx: px, cy: py, r: 4 }));
        wanted.push({ text, x: px, y: py });
      }
    }
    placeLabels(wanted, drawn, this.box, layer);
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
    showTip(event, `${value}<br>${safe(x.key)} ${number(x.values[i])}<br>${safe(y.key)} ${number(y.values[j])}`);
  }

  leave() {
    hideTip();
  }
}
