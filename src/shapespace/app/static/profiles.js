// Two fields along the curve, from the upper pole to the lower one or the rim.

import { Chart, marginFor } from "./chart.js";
import { choice, refill } from "./choices.js";
import { session } from "./session.js";
import { limits, linear, make, title } from "./svg.js";
import { hideTip, showTip } from "./tip.js";
import { view } from "./view.js";
import { html, number, safe } from "./words.js";

const SECOND = { concentration: "tangential_velocity", local_spontaneous_curvature: "meridional_curvature" };

export class Profiles extends Chart {
  constructor(host, tools, pointed) {
    super(host, "Profiles along the curve");
    Object.assign(this, { tools, pointed: null });
    host.addEventListener("pointermove", (event) => {
      const i = this.moment ? this.nearest(event) : null;
      pointed(i);
      if (i !== null) showTip(event, this.told(i));
    });
    host.addEventListener("pointerleave", () => {
      pointed(null);
      hideTip();
    });
    view.on(["first", "second"], () => this.arrange());
  }

  get names() {
    return Object.keys(this.moment?.fields ?? {}).filter((name) => name !== "mesh_coordinate");
  }

  get first() {
    const { names } = this;
    const wanted = [view.get("first"), "concentration", "local_spontaneous_curvature", "meridional_curvature"];
    return wanted.find((name) => names.includes(name)) ?? names[0];
  }

  get second() {
    if (view.get("second") === "none") return null;
    const { names } = this;
    const wanted = [view.get("second"), SECOND[this.first], "tangential_velocity", "azimuthal_curvature"];
    return wanted.find((name) => names.includes(name) && name !== this.first) ?? null;
  }

  show(moment) {
    const before = this.names.join();
    this.moment = moment;
    if (this.names.join() !== before) this.arrange();
    this.due();
  }

  arrange() {
    if (!this.moment) return;
    refill(this.tools,
      choice("First profile", this.names, this.first, (first) => view.set({ first }), { swatch: "var(--accent)", id: "choose-first" }),
      choice("Second profile", [...this.names, "none"], this.second ?? "none", (second) => view.set({ second }), { swatch: "var(--warm)", id: "choose-second" }),
    );
    this.due();
  }

  draw(width, height) {
    if (!this.moment) {
      this.say("No shape.");
      return;
    }
    this.say("");
    const { u, fields } = this.moment;
    const { first, second } = this;
    const [told, other] = [first, second].map((name) => session.quantity(name ?? ""));
    const range = (name) => limits(fields[name], 0.08, session.quantity(name).least);
    const marks = second ? this.marks(range(second), height) : [];
    const layer = this.axes({
      width, height, x: [0, 1], y: range(first), right: second ? Math.max(20, marginFor(marks) - 12) : 0, left: 44,
      xTitle: { name: "", symbol: "u", unit: "1" }, yTitle: { name: "", symbol: told.symbol, unit: told.unit },
    });
    if (second) this.drawSecond(layer, u, fields[second], linear(range(second), [this.box.bottom, this.box.top]), marks, other, width);
    layer.append(this.path(u, fields[first], { class: "first" }));
    this.line = make("g");
    this.overlay.append(this.line);
    this.point(this.pointed);
  }

  drawSecond(layer, u, values, scale, marks, { symbol, unit }, width) {
    for (const [value, text] of marks) this.overlay.append(make("text", { x: this.box.right + 6, y: scale(value) + 4, class: "warm" }, text));
    this.overlay.append(title("", { symbol, unit }, { x: width - 8, y: 14, "text-anchor": "end", class: "warm" }));
    const y = this.y;
    this.y = scale;
    layer.append(this.path(u, values, { class: "second" }));
    this.y = y;
  }

  nearest(event) {
    if (!this.x) return null;
    const u = this.x.inverse(event.clientX - this.host.getBoundingClientRect().left);
    if (u < -0.05 || u > 1.05) return null;
    const { u: all } = this.moment;
    let best = 0;
    for (let i = 1; i < all.length; i++) if (Math.abs(all[i] - u) < Math.abs(all[best] - u)) best = i;
    return best;
  }

  told(i) {
    const { u, fields } = this.moment;
    const lines = [this.first, this.second].filter(Boolean).map((name) => {
      const { unit } = session.quantity(name);
      return `${safe(name)} <b>${number(fields[name][i], 5)}</b> ${unit === "1" ? "" : html(unit)}`;
    });
    return [`u = ${number(u[i], 4)}`, ...lines].join("<br>");
  }

  point(i) {
    this.pointed = i;
    if (!this.line || !this.moment) return;
    const at = this.x(this.moment.u[i]);
    this.line.replaceChildren(...(i === null ? [] : [make("line", { class: "cross", x1: at, x2: at, y1: this.box.top, y2: this.box.bottom })]));
  }
}
