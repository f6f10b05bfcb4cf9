// What is looked at: plain values, kept in the address so that a link brings the same view back.

import { MAPS } from "./colours.js";

const NAME = /^\w*$/;
const COUNT = /^\d{1,6}$/;
const COLOURS = new RegExp(`^(auto|${MAPS.join("|")})$`);

/** Of each value what it is at first, and what else it may be; whether a store has such a name or place is seen where it is used. */
const KNOWN = {
  store: ["0", COUNT], place: ["", /^[\d,]*$/], x: ["", NAME], y: ["", NAME], of: ["", NAME], state: ["0", COUNT], mapcolours: ["auto", COLOURS],
  colour: ["", NAME], colours: ["auto", COLOURS], arrows: ["1", /^[01]$/], first: ["", NAME], second: ["", NAME],
  mode: ["", /^\d$/], camera: ["", /^(-?\d+\.?\d*,){2}\d+\.?\d*$/], theme: ["", /^(light|dark)$/],
};
const OF_STORE = ["place", "mode", "x", "y", "of", "state"];

class View {
  constructor() {
    this.listeners = [];
    this.values = this.read();
    addEventListener("hashchange", () => {
      const before = this.values;
      this.values = this.read();
      this.tell(Object.keys(KNOWN).filter((name) => this.values[name] !== before[name]));
    });
  }

  /** The values that the address has, and what they are at first where it has none that makes sense. */
  read() {
    const asked = new URLSearchParams(location.hash.slice(1));
    return Object.fromEntries(Object.entries(KNOWN).map(([name, [first, known]]) => {
      const value = asked.get(name);
      return [name, value !== null && known.test(value) ? value : first];
    }));
  }

  get(name) {
    return this.values[name];
  }

  set(changes) {
    const changed = Object.keys(changes).filter((name) => this.values[name] !== String(changes[name]));
    if (!changed.length) return;
    for (const name of changed) this.values[name] = String(changes[name]);
    // On a page from disk some browsers do not let the address be replaced; the view works without.
    try {
      history.replaceState(null, "", `#${this.text()}`);
    } catch { /* the address stays as it was */ }
    this.tell(changed);
  }

  /** Go to another store; what belongs to the one before is left there. */
  changeStore(store) {
    this.set({ ...Object.fromEntries(OF_STORE.map((name) => [name, KNOWN[name][0]])), store });
  }

  text() {
    const told = Object.entries(this.values).filter(([name, value]) => value !== KNOWN[name][0]);
    return new URLSearchParams(told).toString();
  }

  /** Call `listener` whenever one of the names changes. */
  on(names, listener) {
    this.listeners.push([names, listener]);
  }

  tell(changed) {
    for (const [names, listener] of this.listeners) {
      if (names.some((name) => changed.includes(name))) listener(changed);
    }
  }
}

export const view = new View();
