// Labels beside points, where they cover least of the lines and none of each other.

import { make } from "./svg.js";

const HEIGHT = 13;
const PER_LETTER = 5.9;
const NEAR = [9, 20];

/** Write {text, x, y} beside each point. drawn: pixels of what is there already. */
export function place(wanted, drawn, box, layer) {
  const taken = [];
  const between = dense(drawn);
  for (const { text, x, y } of wanted) {
    const width = PER_LETTER * text.length + 4;
    let best = null;
    for (const distance of NEAR) {
      for (const [right, up] of [[1, 1], [1, -1], [-1, 1], [-1, -1], [0, 1], [0, -1]]) {
        const left = x + right * distance - (right < 0 ? width : right ? 0 : width / 2);
        const top = y - up * (distance - 3) - (up > 0 ? HEIGHT : 0);
        const spot = { left, top, right: left + width, bottom: top + HEIGHT };
        const cost = covered(spot, between) + 60 * taken.filter((one) => meet(spot, one)).length
          + 100 * outside(spot, box) + distance / 10;
        if (!best || cost < best.cost) best = { cost, spot };
      }
    }
    taken.push(best.spot);
    layer.append(make("text", { class: "special-label", x: best.spot.left + 2, y: best.spot.bottom - 3 }, text));
  }
}

/** Points along the lines between given ones, a few pixels apart. */
function dense(points) {
  const found = [];
  for (let i = 0; i + 1 < points.length; i++) {
    const [[a, b], [c, d]] = [points[i], points[i + 1]];
    const steps = Math.min(60, Math.ceil(Math.hypot(c - a, d - b) / 4)) || 1;
    for (let k = 0; k < steps; k++) found.push([a + ((c - a) * k) / steps, b + ((d - b) * k) / steps]);
  }
  return found;
}

function covered(spot, points) {
  return points.filter(([x, y]) => x > spot.left && x < spot.right && y > spot.top && y < spot.bottom).length;
}

function meet(one, other) {
  return one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
}

function outside(spot, box) {
  return spot.left < box.left || spot.right > box.right + 8 || spot.top < box.top - 4 || spot.bottom > box.bottom ? 1 : 0;
}
