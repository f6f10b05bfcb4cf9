// The surface with its tools, colours and scale, and the smaller drawings that follow it.

import { choice, toggle } from "./choices.js";
import { gradient, MAPS, scaleFor } from "./colours.js";
import { momentOf, Swing, wordsOf } from "./motion.js";
import { Outline } from "./outline.js";
import { Profiles } from "./profiles.js";
import { session } from "./session.js";
import { view } from "./view.js";
import { escaped, html, number, safe } from "./words.js";

const EXCESS = 1.25;
const SHARE = 0.99;
const NO_COLOUR = ["mesh_coordinate"];
const REST = 1e-9;

export class Stage {
  constructor() {
    [this.host, this.tools, this.scale, this.note] = ["stage", "stage-tools", "scale", "note"].map((id) => document.getElementById(id));
    const pointed = (i) => this.point(i);
    this.outline = new Outline(document.getElementById("outline"), pointed);
    this.profiles = new Profiles(document.getElementById("profiles"), document.getElementById("profile-tools"), pointed);
    this.swing = new Swing((phase) => this.show(phase));
    session.on("closed", () => {
      this.surface?.reset();
      this.swing.stop();
    });
    session.on("state", () => this.changed());
    session.on("mode", () => this.changed());
    for (const name of ["waiting", "mode"]) session.on(name, () => this.wait());
    view.on(["colour", "colours", "arrows"], () => this.changed());
    view.on(["camera"], () => this.surface && view.get("camera") === "" && this.surface.orbit.home());
  }

  /** Three dimensions where the browser has them; the outline alone where it has not. */
  async start(isDark) {
    try {
      const { Surface } = await import("./surface.js");
      this.surface = new Surface(this.host, (camera) => view.set({ camera }));
      this.surface.orbit.read(view.get("camera"));
      this.surface.setTheme(isDark());
      if (session.state) this.changed();
      document.body.dataset.stage = "ready";
    } catch (error) {
      document.body.dataset.stage = "missing";
      this.host.innerHTML = `<div class="empty">This browser draws nothing in three dimensions (${escaped(error.message)}); the outline below shows the shape.</div>`;
    }
  }

  setTheme(isDark) {
    this.surface?.setTheme(isDark);
  }

  get colour() {
    const names = this.names;
    return [view.get("colour"), "concentration", "local_spontaneous_curvature", "meridional_curvature"].find((name) => names.includes(name)) ?? null;
  }

  get names() {
    return Object.keys(session.state?.fields ?? {}).filter((name) => !NO_COLOUR.includes(name));
  }

  changed() {
    if (session.state?.fields) this.arrange();
    if (session.mode && session.state?.fields) this.swing.start();
    else {
      this.swing.stop();
      this.show(0);
    }
  }

  arrange() {
    const { names, colour } = this;
    const told = names.join() + colour + view.get("colours") + view.get("arrows");
    if (told === this.arranged) return;
    this.arranged = told;
    this.tools.replaceChildren(
      choice("colour", names, colour, (name) => view.set({ colour: name }), { id: "choose-colour" }),
      choice("as", ["auto", ...MAPS], view.get("colours"), (map) => view.set({ colours: map }), { id: "choose-colours" }),
      toggle("flow", view.get("arrows") === "1", (isOn) => view.set({ arrows: isOn ? "1" : "0" }), "choose-arrows"),
    );
  }

  show(phase) {
    const { state, mode } = session;
    this.host.style.opacity = state?.isComing ? 0.45 : 1;
    // What is drawn stays, paler, until the shape is there.
    if (state?.isComing && state.fields) return;
    if (!state?.fields) {
      this.outline.show(null);
      this.profiles.show(null);
      if (this.surface) this.surface.skin.visible = false;
      this.scale.replaceChildren();
      return;
    }
    const moment = momentOf(state, mode, phase);
    this.moment = moment;
    this.outline.show(moment);
    this.profiles.show(moment);
    const { colour } = this;
    const values = moment.fields[colour];
    const span = colour ? this.span(state.fields[colour], moment, colour) : null;
    const { tangential_velocity: tangential, normal_velocity: normal } = state.fields;
    const fastest = tangential && normal ? Math.max(...tangential.map((v, i) => Math.hypot(v, normal[i]))) : 0;
    const isFlowing = view.get("arrows") === "1" && fastest > REST && !mode;
    this.describe(span, colour, isFlowing ? fastest : 0);
    if (!this.surface) return;
    this.surface.skin.visible = true;
    const speed = state.velocity ?? 0;
    this.surface.show({
      r: moment.r, z: moment.z, angle: moment.angle, values, scale: span, fastest,
      flow: isFlowing ? { tangential, normal } : null,
      speed: isFlowing && Math.abs(speed) > 1e-3 * fastest ? speed : 0,
      isOpen: session.overview.kind === "open-membrane",
    });
  }

  /** Limits of the colours; a peak on less than one part in a hundred of the area does not set them. */
  span(values, { u, still, r }, colour) {
    const area = (still?.r ?? r).map((one, i) => one * ((u[i + 1] ?? u[i]) - (u[i - 1] ?? u[i])));
    const order = [...values.keys()].sort((a, b) => values[a] - values[b]);
    const whole = area.reduce((sum, one) => sum + one, 0);
    let [sum, top] = [0, values[order.at(-1)]];
    for (const i of order) {
      sum += area[i];
      if (sum >= SHARE * whole) {
        top = values[i];
        break;
      }
    }
    const [low, high] = [values[order[0]], values[order.at(-1)]];
    const isBeyond = low >= 0 && high > EXCESS * top && top > low;
    const floor = low >= 0 && low < 0.5 * high ? 0 : low;
    return { ...scaleFor(floor, isBeyond ? top : high, view.get("colours"), colour), isBeyond };
  }

  describe(span, colour, fastest) {
    if (!span) {
      this.scale.replaceChildren();
      return;
    }
    const { symbol, unit } = session.quantity(colour);
    const units = unit === "1" ? "" : html(unit);
    const speed = session.quantity("tangential_velocity").unit;
    const arrows = fastest ? `<span>longest arrow ${number(fastest, 3)} ${speed === "1" ? "" : html(speed)}</span>` : "";
    const text = `${arrows}<span>${safe(colour)} ${html(symbol)}${units ? ` (${units})` : ""}</span>`
      + `<span class="bar" style="background:${gradient(span)}"></span>`
      + `<span class="ends"><span>${number(span.low, 3)}</span><span>${span.isBeyond ? "over " : ""}${number(span.high, 3)}</span></span>`;
    if (text !== this.described) this.scale.innerHTML = text;
    this.described = text;
  }

  wait() {
    const { mode } = session;
    const swinging = mode && session.state?.fields ? `swinging along mode ${mode.index + 1}${wordsOf(session.state, mode)}, drawn large; Esc stops` : "";
    this.note.textContent = session.waiting || swinging;
    this.note.classList.toggle("waiting", session.waiting !== "");
    this.note.hidden = this.note.textContent === "";
  }

  point(i) {
    this.outline.point(i);
    this.profiles.point(i);
    this.surface?.point(this.moment ? i : null);
  }
}
