// What is looked at: plain values, kept in the address so that a link brings the same view back.

const DEFAULTS = {
  store: "0", place: "", x: "", y: "", of: "", state: "0", mapcolours: "auto",
  colour: "", colours: "auto", arrows: "1", first: "", second: "", mode: "", camera: "", theme: "",
};

class View {
  constructor() {
    this.values = { ...DEFAULTS };
    this.listeners = [];
    this.read();
    addEventListener("hashchange", () => {
      if (location.hash.slice(1) !== this.text()) {
        this.read();
        this.tell(Object.keys(DEFAULTS));
      }
    });
  }

  read() {
    this.values = { ...DEFAULTS };
    for (const [name, value] of new URLSearchParams(location.hash.slice(1))) {
      if (name in DEFAULTS) this.values[name] = value;
    }
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

  text() {
    const told = Object.entries(this.values).filter(([name, value]) => value !== DEFAULTS[name]);
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
