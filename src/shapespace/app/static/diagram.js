// States of a run, a branch, a curve or a search as a line or as points in a plane of two of their numbers.

import { Chart } from "./chart.js";
import { choice, refill } from "./choices.js";
import { place as placeLabels } from "./labels.js";
import { mark } from "./marks.js";
import { session } from "./session.js";
import { limits, make } from "./svg.js";
import { hideTip, showTip } from "./tip.js";
import { view } from "./view.js";
import { escaped, html, number, plain, safe, stabilityWords } from "./words.js";

const REACH = 40;

export class Diagram extends Chart {
  constructor(host, tools, legend) {
    super(host, "Diagram of all states");
    Object.assign(this, { tools, legend });
    host.addEventListener("pointermove", (event) => this.hover(event));
    host.addEventListener("pointerleave", () => this.leave());
    host.addEventListener("click", (event) => {
      const i = this.table && this.x ? this.nearest(event) : null;
      if (i !== null) session.choose(this.table.places[i]);
    });
    session.on("state", () => this.table && this.mark());
    view.on(["x", "y"], () => this.table && this.arrange());
  }

  get table() {
    return session.overview?.table;
  }

  get names() {
    const known = (axis) => (Object.hasOwn(this.table.columns, view.get(axis)) ? view.get(axis) : this.table[axis]);
    return { x: known("x"), y: known("y") };
  }

  arrange() {
    const options = Object.keys(this.table.columns);
    const { x, y } = this.names;
    refill(this.tools,
      choice("up", options, y, (name) => view.set({ y: name }), { id: "choose-y" }),
      choice("across", options, x, (name) => view.set({ x: name }), { id: "choose-x" }),
    );
    this.describe();
    this.due();
  }

  draw(width, height) {
    if (!this.table) return;
    const { columns, places } = this.table;
    if (places.length < 2 && session.overview.noun === "run") {
      this.say(places.length ? "One state, which `steady` stored." : "This run holds no state yet.");
      return;
    }
    if (!places.length) {
      this.say(`This ${session.overview.noun} holds no state yet.`);
      return;
    }
    this.say("");
    const { x, y } = this.names;
    const [xs, ys] = [columns[x], columns[y]];
    const [across, up] = [session.quantity(x), session.quantity(y)];
    const layer = this.axes({
      width, height, whole: x === "state",
      x: limits(xs.filter(Number.isFinite), 0.05, across.least), y: limits(ys.filter(Number.isFinite), 0.08, up.least),
      xTitle: { name: x, ...across }, yTitle: { name: y, ...up },
    });
    this.lines(layer, xs, ys);
    this.specials(layer, xs, ys);
    this.marker = make("g");
    this.pointer = make("g");
    this.overlay.append(this.marker, this.pointer);
    this.mark();
  }

  lines(layer, xs, ys) {
    const { segments, line, outline, x, y } = this.table;
    if (!line) return;
    if (outline && this.names.x === x && this.names.y === y) {
      layer.append(this.path(outline.x, outline.y, { class: "stable" }));
      return;
    }
    if (!segments) {
      layer.append(this.path(xs, ys, { class: session.overview.noun === "curve" ? "stable" : "first" }));
      return;
    }
    for (let i = 0; i < segments.length;) {
      let end = i + 1;
      while (end < segments.length && kindOf(segments[end]) === kindOf(segments[i])) end++;
      layer.append(this.path(xs.slice(i, end + 1), ys.slice(i, end + 1), { class: kindOf(segments[i]) }));
      i = end;
    }
  }

  specials(layer, xs, ys) {
    const { labels, kinds, unstable, line } = this.table;
    if (!labels) return;
    const [wanted, unnamed] = [[], []];
    labels.forEach((label, i) => {
      if (!label || !Number.isFinite(xs[i]) || !Number.isFinite(ys[i])) return;
      const [px, py] = [this.x(xs[i]), this.y(ys[i])];
      layer.append(mark(kinds[i], px, py, { label, more: line ? "" : kindOf(unstable[i]) }));
      if (kinds[i] === "end") unnamed.push([px, py]);
      else wanted.push({ text: label, x: px, y: py });
    });
    const drawn = Array.from(xs, (value, i) => [this.x(value), this.y(ys[i])]).filter((one) => one.every(Number.isFinite));
    placeLabels(wanted, line ? [drawn] : [], this.box, this.overlay, unnamed);
  }

  mark() {
    if (!this.marker) return;
    this.marker.replaceChildren();
    const i = this.table.places.indexOf(session.state?.place);
    const { x, y } = this.names;
    const [px, py] = [this.x(this.table.columns[x][i]), this.y(this.table.columns[y][i])];
    if (Number.isFinite(px) && Number.isFinite(py)) this.marker.append(make("circle", { class: "here", cx: px, cy: py, r: 6 }));
  }

  nearest(event) {
    const box = this.host.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    const { x, y } = this.names;
    const [xs, ys] = [this.table.columns[x], this.table.columns[y]];
    let [best, least] = [null, REACH];
    for (let i = 0; i < xs.length; i++) {
      // A named point is easier to hit than its neighbours.
      const distance = Math.hypot(this.x(xs[i]) - px, this.y(ys[i]) - py) - (this.table.labels?.[i] ? 6 : 0);
      if (distance < least) [best, least] = [i, distance];
    }
    return best;
  }

  hover(event) {
    if (!this.table || !this.pointer || event.pointerType === "touch") return;
    const i = this.nearest(event);
    this.pointer.replaceChildren();
    if (i === null) {
      hideTip();
      return;
    }
    const { x, y } = this.names;
    const { columns, labels, unstable, marginal } = this.table;
    this.pointer.append(make("circle", { class: "near", cx: this.x(columns[x][i]), cy: this.y(columns[y][i]), r: 8 }));
    const told = [x, y].map((name) => `${safe(name)} ${number(columns[name][i])} ${html(unit(name))}`);
    const head = labels?.[i] ? `<b>${escaped(labels[i])}</b><br>` : "";
    showTip(event, `${head}${told.join("<br>")}${unstable ? `<br>${stabilityWords(unstable[i], marginal[i])}` : ""}`);
  }

  leave() {
    this.pointer?.replaceChildren();
    hideTip();
  }

  describe() {
    const { segments, of, line, unstable } = this.table;
    const known = new Set((line ? segments ?? [] : unstable).map(kindOf));
    const words = { stable: "stable", unstable: "unstable", unknown: "stability not known" };
    const samples = Object.keys(words).filter((kind) => known.has(kind)).map((kind) => sample(line ? lineOf(kind) : dotOf(kind), words[kind]));
    this.legend.replaceChildren(...samples);
    if (of) this.legend.append(sample(lineOf("stable"), `${plain(of)}s`));
  }
}

function kindOf(growing) {
  return growing === null ? "unknown" : growing ? "unstable" : "stable";
}

function unit(name) {
  const { unit: text } = session.quantity(name);
  return text === "1" ? "" : text;
}

/** Drawings of 26 by 10 pixels for a legend. */
const lineOf = (kind) => [make("path", { class: kind, d: "M0 5H26" })];
const dotOf = (kind) => [mark("state", 13, 5, { more: kind })];

/** What a drawing means, for a legend. */
export function sample(drawing, words) {
  const span = document.createElement("span");
  span.append(make("svg", { viewBox: "0 0 26 10", "aria-hidden": "true" }, ...drawing), words);
  return span;
}
