// The time of a run: a slider, and playing it.

import { recall } from "./data.js";
import { session } from "./session.js";
import { view } from "./view.js";
import { html, number } from "./words.js";

const SHORTEST = 5000;
const LONGEST = 14000;
const PER_FRAME = 60;
const AHEAD = 6;

export class Timeline {
  constructor(host) {
    this.host = host;
    [this.button, this.slider, this.clock] = ["play", "time", "clock"].map((id) => document.getElementById(id));
    this.button.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => {
      this.stop();
      session.choose(session.places[Number(this.slider.value)]);
    });
    session.on("overview", () => this.open());
    session.on("closed", () => this.stop());
    session.on("state", () => this.mark());
  }

  get isRun() {
    return session.overview?.noun === "run" && session.places.length > 1;
  }

  open() {
    this.host.hidden = !this.isRun;
    if (this.isRun) this.slider.max = session.places.length - 1;
  }

  mark() {
    if (!this.isRun) return;
    const i = session.places.indexOf(session.state.place);
    if (!this.isPlaying) this.slider.value = i;
    const { symbol, unit } = session.quantity("time");
    this.clock.innerHTML = `${html(symbol)} = ${number(session.state.time, 4)} ${unit === "1" ? "" : html(unit)}`;
  }

  toggle() {
    if (this.isPlaying) this.stop();
    else this.play();
  }

  stop() {
    this.isPlaying = false;
    this.button.textContent = "▶";
    this.button.setAttribute("aria-label", "Play");
  }

  /** Frames follow each other evenly: where much happens, time runs slowly, as in the computation. */
  async play() {
    if (!this.isRun) return;
    this.isPlaying = true;
    this.button.textContent = "❚❚";
    this.button.setAttribute("aria-label", "Pause");
    const { places } = session;
    const last = places.length - 1;
    const length = Math.min(LONGEST, Math.max(SHORTEST, PER_FRAME * last));
    let first = places.indexOf(session.state?.place);
    if (first >= last) first = 0;
    const began = performance.now() - (first / last) * length;
    while (this.isPlaying && session.places === places) {
      const at = Math.min(last, Math.round(((performance.now() - began) / length) * last));
      const store = view.get("store");
      for (let k = 1; k <= AHEAD && at + k <= last; k++) recall("state", { store, place: places[at + k] }).catch(() => {});
      this.slider.value = at;
      await session.choose(places[at]);
      if (at === last || session.trouble) break;
      await new Promise((resolve) => requestAnimationFrame(resolve));
    }
    this.stop();
    this.mark();
  }
}
