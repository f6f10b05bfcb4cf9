// Turning the view by pointer, wheel, pinch and keys.

const START = { azimuth: 0.6, elevation: 0.32, zoom: 1 };
const TURN = 0.12;
const CLOSER = 1.15;
const KEYS = {
  ArrowLeft: [TURN, 0, 1], ArrowRight: [-TURN, 0, 1], ArrowUp: [0, TURN, 1], ArrowDown: [0, -TURN, 1],
  "+": [0, 0, CLOSER], "=": [0, 0, CLOSER], "-": [0, 0, 1 / CLOSER],
};

export class Orbit {
  constructor(host, changed) {
    Object.assign(this, START, { changed });
    this.pointers = new Map();
    host.addEventListener("pointerdown", (event) => {
      host.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    host.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) host.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    host.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.turn(0, 0, Math.exp(-0.0012 * event.deltaY));
    }, { passive: false });
    host.addEventListener("dblclick", () => this.home());
    host.addEventListener("keydown", (event) => this.press(event));
  }

  get isHeld() {
    return this.pointers.size > 0;
  }

  press(event) {
    const turn = KEYS[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey || (!turn && event.key !== "Home")) return;
    event.preventDefault();
    event.stopPropagation();
    if (turn) this.turn(...turn);
    else this.home();
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const apart = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]) || 1;
      this.turn(0, 0, apart(now) / apart(before));
    } else {
      this.turn(-0.008 * (now[0] - before[0]), 0.008 * (now[1] - before[1]), 1);
    }
    this.pointers.set(event.pointerId, now);
  }

  turn(across, up, zoom) {
    this.azimuth += across;
    this.elevation = Math.max(-1.55, Math.min(1.55, this.elevation + up));
    this.zoom = Math.max(0.3, Math.min(8, this.zoom * zoom));
    this.changed();
  }

  home() {
    Object.assign(this, START);
    this.changed();
  }

  place(camera, reach) {
    const distance = reach / this.zoom;
    camera.position.set(
      distance * Math.cos(this.elevation) * Math.sin(this.azimuth),
      distance * Math.sin(this.elevation),
      distance * Math.cos(this.elevation) * Math.cos(this.azimuth),
    );
    camera.up.set(0, 1, 0);
    camera.lookAt(0, 0, 0);
  }

  /** The view in numbers; empty for that at first. */
  text() {
    const [told, first] = [this, START].map((one) => [one.azimuth, one.elevation, one.zoom].map((value) => value.toFixed(3)).join(","));
    return told === first ? "" : told;
  }

  read(text) {
    if (text === this.text()) return;
    [this.azimuth, this.elevation, this.zoom] = text ? text.split(",").map(Number) : Object.values(START);
    this.turn(0, 0, 1);
  }
}
