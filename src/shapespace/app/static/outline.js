// The cut through the axis: the surface's outline, and where a mode or the pointer takes it.

import { Chart } from "./chart.js";
import { session } from "./session.js";
import { limits, make } from "./svg.js";

export class Outline extends Chart {
  constructor(host, pointed) {
    super(host, "Outline of the surface");
    this.pointed = null;
    host.addEventListener("pointermove", (event) => this.moment && this.x && pointed(this.nearest(event)));
    host.addEventListener("pointerleave", () => pointed(null));
  }

  show(moment) {
    this.moment = moment;
    this.due();
  }

  draw(width, height) {
    if (!this.moment) {
      this.say("No shape.");
      return;
    }
    this.say("");
    const { r, z, still = this.moment } = this.moment;
    const both = [...still.r, ...Array.from(still.r, (value) => -value)];
    const length = session.quantity("axial_position").unit;
    const layer = this.axes({
      width, height, equal: true, left: 38, x: limits(both, 0.12), y: limits(still.z, 0.12),
      xTitle: { name: "", symbol: "r", unit: length }, yTitle: { name: "", symbol: "z", unit: length },
    });
    for (const side of [1, -1]) {
      layer.append(this.path(still.r.map((value) => side * value), still.z, { class: "shape" }));
      if (this.moment.still) layer.append(this.path(r.map((value) => side * value), z, { class: "moved" }));
    }
    this.dots = make("g");
    layer.append(this.dots);
    this.point(this.pointed);
  }

  point(i) {
    this.pointed = i;
    if (!this.dots || !this.moment) return;
    const { r, z } = this.moment;
    const dot = (side) => make("circle", { class: "here", r: 4, cx: this.x(side * r[i]), cy: this.y(z[i]) });
    this.dots.replaceChildren(...(i === null ? [] : [dot(1), dot(-1)]));
  }

  nearest(event) {
    const box = this.host.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    const { r, z } = this.moment;
    let [best, least] = [null, 30];
    for (let i = 0; i < r.length; i++) {
      const distance = Math.min(...[1, -1].map((side) => Math.hypot(this.x(side * r[i]) - px, this.y(z[i]) - py)));
      if (distance < least) [best, least] = [i, distance];
    }
    return best;
  }
}
