// The surface with its tools, colours and scale, and the smaller drawings that follow it.

import { choice, refill, toggle } from "./choices.js";
import { colourOf, gradient, MAPS, scaleFor } from "./colours.js";
import { momentOf, Swing, wordsOf } from "./motion.js";
import { Outline } from "./outline.js";
import { Profiles } from "./profiles.js";
import { session } from "./session.js";
import { view } from "./view.js";
import { escaped, html, number, safe } from "./words.js";

const EXCESS = 1.25;
const SHARE = 0.99;
const NO_COLOUR = ["mesh_coordinate"];

export class Stage {
  constructor() {
    [this.host, this.tools, this.scale, this.note] = ["stage", "stage-tools", "scale", "note"].map((id) => document.getElementById(id));
    const pointed = (i) => this.point(i);
    this.outline = new Outline(document.getElementById("outline"), pointed);
    this.profiles = new Profiles(document.getElementById("profiles"), document.getElementById("profile-tools"), pointed);
    this.swing = new Swing((phase) => this.show(phase));
    session.on("closed", () => {
      this.surface?.reset();
      this.changed();
    });
    session.on("state", () => this.changed());
    session.on("mode", () => this.changed());
    for (const name of ["waiting", "mode"]) session.on(name, () => this.wait());
    view.on(["colour", "colours", "arrows"], () => this.changed());
    view.on(["camera"], () => this.surface?.orbit.read(view.get("camera")));
    this.host.addEventListener("pointermove", (event) => this.surface && event.pointerType !== "touch" && pointed(this.surface.rowAt(event)));
    this.host.addEventListener("pointerleave", () => pointed(null));
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
    refill(this.tools,
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
      this.moment = null;
      this.outline.show(null);
      this.profiles.show(null);
      this.surface?.hide();
      this.describe(null);
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
    const hasArrows = view.get("arrows") === "1" && !mode;
    const isFlowing = hasArrows && fastest > session.overview.at_rest;
    this.describe(span, colour, mode, isFlowing ? `longest arrow ${speedWords(fastest)}`
      : hasArrows && tangential ? `at rest: no flow above ${speedWords(session.overview.at_rest)}` : "");
    if (!this.surface) return;
    const speed = state.velocity ?? 0;
    this.surface.show({
      r: moment.r, z: moment.z, angle: moment.angle, values, scale: span, fastest,
      flow: isFlowing ? { tangential, normal } : null,
      speed: isFlowing && Math.abs(speed) > Math.max(session.overview.at_rest, 1e-3 * fastest) ? speed : 0,
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
    return { ...scaleFor(floor, isBeyond ? top : high, view.get("colours"), { name: colour, least: session.quantity(colour).least }), isBeyond };
  }

  describe(span, colour, mode, flow) {
    const text = span ? scaleWords(span, colour, mode, flow) : "";
    if (text !== this.described) this.scale.innerHTML = text;
    this.described = text;
  }

  wait() {
    const { mode } = session;
    const stops = matchMedia("(pointer: coarse)").matches ? "tap the growth rate again to stop" : "Esc stops";
    const swinging = mode && session.state?.fields ? `swinging along mode ${mode.index + 1}${wordsOf(session.state, mode)}, drawn large; ${stops}` : "";
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

function speedWords(speed) {
  const { unit } = session.quantity("tangential_velocity");
  return `${number(speed, 3)} ${unit === "1" ? "" : html(unit)}`;
}

/** What colours and arrows stand for. */
function scaleWords(span, colour, mode, flow) {
  const { symbol, unit } = session.quantity(colour);
  const units = unit === "1" ? "" : html(unit);
  const name = `${safe(colour)} ${html(symbol)}`;
  const bar = span.all !== null && !mode
    ? `${name} <span><i class="bar kind" style="background:${colourOf(span.all, span)}"></i><b>${number(span.all, 3)}</b> ${units} everywhere</span>`
    : `${name}${units ? ` (${units})` : ""} <span><b>${number(span.low, 3)}</b><i class="bar" style="background:${gradient(span)}"></i>`
      + `<b>${span.isBeyond ? "over " : ""}${number(span.high, 3)}</b></span>`;
  return `<span>${flow}</span><span>${bar}</span>`;
}
