// Growth rates of small perturbations in the complex plane; a click sets the surface swinging along a mode.

import { Chart } from "./chart.js";
import { isFile } from "./data.js";
import { session } from "./session.js";
import { limits, make } from "./svg.js";
import { hideTip, showTip } from "./tip.js";
import { escaped, html, number } from "./words.js";

const REACH = 18;

export class Spectrum extends Chart {
  constructor(host) {
    super(host, "Growth rates in the complex plane");
    this.button = document.createElement("button");
    Object.assign(this.button, { id: "compute", textContent: "Compute growth rates" });
    this.button.addEventListener("click", () => session.waiting || session.compute());
    host.addEventListener("click", (event) => this.choose(this.nearest(event)));
    host.addEventListener("pointermove", (event) => this.hover(event));
    host.addEventListener("pointerleave", hideTip);
    session.on("state", () => this.due());
    session.on("mode", () => this.due());
    session.on("waiting", () => this.due());
  }

  /** The keyboard stays at the rate that it is at; from the button that computes them it goes to the first. */
  draw(width, height) {
    const { activeElement } = document;
    const index = this.host.contains(activeElement) ? activeElement.dataset.index ?? 0 : null;
    this.fill(width, height);
    if (index !== null && !this.host.contains(document.activeElement)) {
      this.svg.querySelector(`[data-index="${index}"]`)?.focus({ preventScroll: true });
    }
  }

  fill(width, height) {
    const rates = session.state?.rates;
    if (!rates?.values.length) {
      this.offer();
      return;
    }
    this.say("");
    const { values } = rates;
    const unit = session.quantity("turnover_rate").unit;
    const xs = limits([0, ...values.map(([re]) => re)], 0.14);
    const most = Math.max(...values.map(([, im]) => Math.abs(im)));
    const ys = most > 0 ? [-1.25 * most, 1.25 * most] : [-1, 1];
    const layer = this.axes({
      width, height, x: xs, y: ys, left: 44,
      xTitle: { name: "", symbol: "Re s", unit }, yTitle: { name: "", symbol: "Im s", unit },
    });
    const zero = this.x(0);
    const { top, bottom, right } = this.box;
    layer.append(
      make("rect", { class: "side", x: zero, y: top, width: Math.max(0, right - zero), height: bottom - top }),
      make("line", { class: "axis", x1: zero, x2: zero, y1: top, y2: bottom, style: "stroke: var(--soft)" }),
    );
    values.forEach((rate, i) => layer.append(this.dot(rate, i, rates)));
  }

  dot([re, im], i, { errors, neutral }) {
    const kind = i in neutral ? "neutral" : re > 0 ? "growing" : "";
    const chosen = session.mode?.index === i ? " chosen" : "";
    const [px, py] = [this.x(re), this.y(im)];
    const words = this.words(i);
    const dot = make("g", { class: `rate ${kind}${chosen}`, tabindex: 0, role: "button", "aria-label": words, "data-index": i, "data-real": re, "data-imaginary": im });
    const width = this.x(re + (errors[i] ?? 0)) - px;
    if (width > 3) dot.append(make("line", { class: "error", x1: px - width, x2: px + width, y1: py, y2: py }));
    dot.append(make("circle", { class: "dot", r: 5.5, cx: px, cy: py }));
    dot.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      event.stopPropagation();
      this.choose(i);
    });
    return dot;
  }

  choose(i) {
    if (i === null) return;
    if (session.mode?.index === i) session.stopMode();
    else session.animate(i);
  }

  /** The growth rate next to the pointer, as they often lie close together. */
  nearest(event) {
    const values = this.x ? session.state?.rates?.values ?? [] : [];
    const box = this.host.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    let [best, least] = [null, REACH];
    values.forEach(([re, im], i) => {
      const distance = Math.hypot(this.x(re) - px, this.y(im) - py);
      if (distance < least) [best, least] = [i, distance];
    });
    return best;
  }

  hover(event) {
    const i = this.nearest(event);
    if (i === null) {
      hideTip();
      return;
    }
    const { parities, neutral } = session.state.rates;
    const kinds = [parities[i], i in neutral ? `neutral: ${neutral[i]}` : ""].filter(Boolean).map(escaped).join(", ");
    showTip(event, `<b>${this.words(i)}</b>${kinds ? `<br>${kinds}` : ""}<br>click: swing along mode ${i + 1}`);
  }

  words(i) {
    const { values, errors } = session.state.rates;
    const [re, im] = values[i];
    const unit = session.quantity("turnover_rate").unit;
    const pair = im ? ` ${im < 0 ? "−" : "+"} ${number(Math.abs(im))} i` : "";
    return `s = ${number(re)}${pair} ${unit === "1" ? "" : html(unit)} ± ${number(errors[i], 2)}`;
  }

  offer() {
    if (!session.state) {
      this.say("");
      this.svg.replaceChildren();
      return;
    }
    if (!session.state.can_compute) {
      this.say(session.overview.noun === "run" ? "This surface moves: growth rates belong to states at rest." : "Not known for this state.");
      return;
    }
    if (isFile) {
      this.say("Not in this file.");
      return;
    }
    this.button.setAttribute("aria-disabled", session.waiting !== "");
    if (!this.message.contains(this.button)) this.say("Not stored for this state.", this.button);
  }
}
