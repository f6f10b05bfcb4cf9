// How special points look, by kind.

import { make } from "./svg.js";

const SQUARE = "M-4 -4H4V4H-4Z";
const DIAMOND = "M0 -5.5L5.5 0L0 5.5L-5.5 0Z";
const disc = (radius) => `M${radius} 0A${radius} ${radius} 0 1 1 -${radius} 0A${radius} ${radius} 0 1 1 ${radius} 0Z`;
const CROSS = "M-4 -6L0 -2L4 -6L6 -4L2 0L6 4L4 6L0 2L-4 6L-6 4L-2 0L-6 -4Z";
const SHAPES = {
  fold: SQUARE, turn: SQUARE, pitchfork: DIAMOND, transcritical: DIAMOND, "branch-point": DIAMOND, "fold-pitchfork": DIAMOND,
  "degenerate-pitchfork": DIAMOND, cusp: "M0 -5L5 4H-5Z", hopf: disc(4.5), "bogdanov-takens": disc(4.5), state: disc(5),
  user: "M-2 -7H2V7H-2Z", end: disc(2.5),
};

/** The mark of a kind of point; ends of other kinds are crosses. */
export function mark(kind, x, y, { label = "", more = "" } = {}) {
  return make("path", { class: `special ${more}`, d: SHAPES[kind] ?? CROSS, transform: `translate(${x} ${y})`, "data-label": label });
}
