// What is open now: the overview of a store, the chosen state, its mode; told to whoever draws it.

import { ask, forget, isFile, recall } from "./data.js";
import { view } from "./view.js";

export const session = new (class extends EventTarget {
  stores = [];
  overview = null;
  state = null;
  mode = null;
  trouble = "";
  damage = new Set();
  doing = [];
  opened = 0;
  asked = 0;
  wanted = "";

  tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  on(name, listener) {
    this.addEventListener(name, (event) => listener(event.detail));
  }

  /** Quantity of a name: symbol, meaning, unit, and the least change that is drawn as one. */
  quantity(name) {
    const [symbol, meaning, unit, least] = this.overview?.quantities[name] ?? ["", name.replaceAll("_", " "), "1", 0];
    return { symbol, meaning, unit, least };
  }

  /** Places of all states in their order; of a map none. */
  get places() {
    return this.overview?.table?.places ?? [];
  }

  async open() {
    await Promise.all([this.openStore(), this.attempt("", async () => {
      this.stores = (await ask("stores")).stores;
      if (!(Number(view.get("store")) < this.stores.length)) view.changeStore("0");
      this.tell("stores");
    })]);
  }

  /** Show the store that is looked at; one that is opened later wins. */
  async openStore() {
    const number = ++this.opened;
    this.asked++;
    forget();
    Object.assign(this, { overview: null, state: null, mode: null, wanted: "", trouble: "", damage: new Set() });
    this.tell("closed");
    await this.attempt("reading the store", async () => {
      const overview = await ask("overview", { store: view.get("store") });
      if (number !== this.opened) return;
      this.overview = overview;
      this.addDamage(overview.damage);
      this.tell("overview");
      await this.follow();
    });
  }

  /** Show the state and the mode that the address names; the first state where it names none. */
  async follow() {
    if (!this.overview) return;
    const place = knownPlace(this.overview, view.get("place")) || firstPlace(this.overview);
    const mode = view.get("mode");
    if (place && place !== this.wanted) await this.choose(place);
    else if (mode === "" && this.mode) this.stopMode();
    else if (mode !== "" && this.state?.fields && !this.state.isComing && this.mode?.index !== Number(mode)) await this.animate(Number(mode));
  }

  /** Show the state at a place; one that is asked for later wins. */
  async choose(place) {
    const number = ++this.asked;
    const store = view.get("store");
    this.wanted = place;
    if (this.mode) {
      this.mode = null;
      this.tell("mode");
    }
    // A mode belongs to its state: only an address names both.
    view.set(this.state && place !== view.get("place") ? { place, mode: "" } : { place });
    await this.attempt("", async () => {
      // A shape that must be computed is asked for at once, and its numbers are there before it.
      if (hasShape(this.overview, place)) recall("shape", { store, place }).catch(() => {});
      const state = await recall("state", { store, place });
      if (number !== this.asked) return;
      const settled = state.fields || state.missing ? state : { ...state, fields: this.state?.fields, isComing: true };
      this.state = settled;
      this.tell("state");
      if (settled.isComing) await this.shape(number, store, place, state);
      if (view.get("mode") && !this.mode && this.state.fields) await this.animate(Number(view.get("mode")));
    }, (error) => {
      if (number !== this.asked) return;
      this.state = { place, title: "not readable", observables: {}, missing: ["not-readable", error.message] };
      this.tell("state");
    });
  }

  /** The shape of a state that the store has as numbers only. */
  async shape(number, store, place, state) {
    await this.attempt("computing the shape again …", async () => {
      const shape = await recall("shape", { store, place });
      if (number !== this.asked) return;
      this.state = { ...shape, ...state, fields: shape.fields };
      this.tell("state");
    }, () => {
      if (number !== this.asked) return;
      this.state = { ...state, fields: null };
      this.tell("state");
    });
  }

  /** Growth rates of a state that has none stored. */
  async compute() {
    const { state } = this;
    await this.attempt("computing growth rates …", async () => {
      const rates = await recall("spectrum", { store: view.get("store"), place: state.place });
      if (state !== this.state) return;
      this.state = { ...state, rates, unstable: state.unstable ?? rates.unstable };
      this.tell("state");
    });
  }

  /** Set the surface swinging along a mode. */
  async animate(index) {
    const { state, opened } = this;
    if (state.rates ? !(index < state.rates.values.length) : !state.can_compute) {
      view.set({ mode: "" });
      return;
    }
    await this.attempt(state.can_compute ? "computing the mode …" : "", async () => {
      const mode = await recall("mode", { store: view.get("store"), place: state.place, index });
      if (opened !== this.opened || state.place !== this.state?.place) return;
      this.mode = mode;
      view.set({ mode: index });
      this.tell("mode");
    }, () => view.set({ mode: "" }));
  }

  stopMode() {
    this.mode = null;
    view.set({ mode: "" });
    this.tell("mode");
  }

  /** What cannot be read of the store is told as long as it is open. */
  addDamage(damage) {
    for (const one of damage) this.damage.add(one);
    this.tell("trouble");
  }

  /** Do something that may fail, and say so until something else is tried. Words say what is waited for. */
  async attempt(words, act, failed) {
    if (!this.doing.length) this.trouble = "";
    const [one, { opened }] = [{ words }, this];
    this.doing.push(one);
    this.report();
    try {
      await act();
    } catch (error) {
      // What was asked of a store that is no longer looked at is of no interest.
      if (opened === this.opened) {
        this.trouble = error.message;
        failed?.(error);
      }
    } finally {
      this.doing.splice(this.doing.indexOf(one), 1);
      this.report();
    }
  }

  get waiting() {
    return this.doing.map(({ words }) => words).filter(Boolean).at(-1) ?? "";
  }

  report() {
    document.body.dataset.busy = String(this.doing.length > 0);
    this.tell("waiting");
    this.tell("trouble");
  }
})();

// Before anybody else is told: what is drawn belongs to the store that is open.
view.on(["store"], () => session.openStore());
view.on(["place", "mode"], () => session.follow());

/** Whether a place of a map has a state, whose shape the store does not hold. */
function hasShape({ map }, place) {
  if (!map) return false;
  const [state, i, j] = place.split(",").map(Number);
  return map.outcomes[(state * map.y.values.length + j) * map.x.values.length + i] === 1;
}

/** A place that the store has, empty for others. */
function knownPlace({ map, table }, place) {
  if (!map) return table.places.includes(place) ? place : "";
  const [numbers, counts] = [place.split(",").map(Number), [map.states.length, map.x.values.length, map.y.values.length]];
  return /^\d+,\d+,\d+$/.test(place) && numbers.every((number, k) => number < counts[k]) ? placeOf(map, ...numbers) : "";
}

/** The number of the chosen state of a map. */
export function layerOf(map) {
  const number = Number(view.get("state"));
  return number < map.states.length ? number : 0;
}

/** The place of a point of a map; in a file, of the nearest one that has its shape there. */
export function placeOf(map, state, i, j) {
  const [across, up] = isFile ? map.strides : [1, 1];
  const near = (value, stride, count) => stride * Math.min(Math.round(value / stride), Math.floor((count - 1) / stride));
  return [state, near(i, across, map.x.values.length), near(j, up, map.y.values.length)].join(",");
}

/** The state to show first: the end of a run, the first label of a branch, the middle of a map of the chosen state. */
function firstPlace(overview) {
  if (overview.map) {
    const { x, y, outcomes } = overview.map;
    const [nx, ny] = [x.values.length, y.values.length];
    const layer = layerOf(overview.map);
    let [nearest, at] = [Infinity, [0, 0]];
    for (let j = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++) {
        const distance = (i - nx / 2) ** 2 + (j - ny / 2) ** 2;
        if (distance < nearest && outcomes[(layer * ny + j) * nx + i] === 1) [nearest, at] = [distance, [i, j]];
      }
    }
    return placeOf(overview.map, layer, ...at);
  }
  const { places, labels } = overview.table;
  if (overview.noun === "run") return places.at(-1) ?? "";
  const i = labels?.findIndex((label) => label) ?? 0;
  return places[Math.max(i, 0)] ?? "";
}
