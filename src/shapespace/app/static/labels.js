// Labels beside points: each nearer to its own point than to any other, or tied to it by a line; they cover least of what is drawn.

import { make, widthOf } from "./svg.js";

const HEIGHT = 13;
const NEAR = 9;
const DISTANCES = [NEAR, 20, 34, 50, 70, 95];
const DIRECTIONS = Array.from({ length: 16 }, (_, k) => [Math.cos((k * Math.PI) / 8), Math.sin((k * Math.PI) / 8)]);
const PASSES = 6;
/** How much nearer, in pixels, its own point must be than any other for a label to need no line. */
const CLEAR = 6;
/** How far from its point a label may stand without a line. */
const ALONE = 24;
const COST = { line: 1, label: 80, mark: 40, outside: 200, tied: 12, crossed: 40, perPixel: 0.15 };

/** Write {text, x, y} beside each point. drawn: lines there already, each of points [x, y]; marks: points that have no label. */
export function place(wanted, drawn, box, layer, marks = []) {
  const points = [...wanted.map(({ x, y }) => [x, y]), ...marks];
  const lines = drawn.flatMap(dense);
  const choices = wanted.map((one, k) => candidates(one, points.filter((_, i) => i !== k), lines, box));
  const chosen = choices.map(() => null);
  // One after the other, and again with all others where they are, until none moves.
  for (let pass = 0; pass < PASSES; pass++) {
    let isMoved = false;
    choices.forEach((spots, k) => {
      const others = chosen.filter((one, i) => one && i !== k);
      const best = least(spots, (spot) => spot.cost + others.reduce((sum, other) => sum + between(spot, other), 0));
      isMoved ||= best !== chosen[k];
      chosen[k] = best;
    });
    if (!isMoved) break;
  }
  const path = (points) => `M${points.map((one) => one.join(" ")).join("L")}`;
  const ties = chosen.map(({ tie }, k) => tie && make("path", { class: "tie", "data-label": wanted[k].text, d: path(tie) }));
  layer.append(...ties.filter(Boolean));
  layer.append(...chosen.map(({ left, bottom }, k) => make("text", { class: "special-label", x: left + 2, y: bottom - 3 }, wanted[k].text)));
}

/** Where a label may stand, each with what it covers there, and the line to its point where another point is as near. */
function candidates({ text, x, y }, others, lines, box) {
  const half = [(widthOf(text) + 4) / 2, HEIGHT / 2];
  return DISTANCES.flatMap((distance) => DIRECTIONS.map(([across, up]) => {
    // The nearest point of the label is so far away.
    const [middle, centre] = [x + across * distance + Math.sign(round(across)) * half[0], y - up * distance - Math.sign(round(up)) * half[1]];
    const spot = { left: middle - half[0], right: middle + half[0], top: centre - half[1], bottom: centre + half[1] };
    const own = away(spot, [x, y]);
    const nearest = Math.min(Infinity, ...others.map((other) => away(spot, other)));
    const isTied = own > ALONE || own + CLEAR > nearest;
    if (isTied) spot.tie = [[x, y], nearestOf(spot, [x, y])];
    const covered = COST.line * lines.filter((one) => isWithin(one, spot)).length
      + COST.mark * others.filter((other) => away(spot, other) < 6).length + COST.outside * isOutside(spot, box)
      + (isTied ? COST.tied + COST.crossed * others.filter((other) => apart(spot.tie, other) < 6).length : 0);
    return { ...spot, cost: covered + COST.perPixel * distance };
  }));
}

const round = (value) => (Math.abs(value) < 1e-9 ? 0 : value);

function least(spots, cost) {
  let [best, lowest] = [null, Infinity];
  for (const spot of spots) {
    const value = cost(spot);
    if (value < lowest) [best, lowest] = [spot, value];
  }
  return best;
}

/** What two labels cost where they, or their lines, meet. */
function between(one, other) {
  const isMet = one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
  return COST.label * isMet + COST.crossed * (isCrossed(one.tie, other) + isCrossed(other.tie, one) + areCrossed(one.tie, other.tie));
}

function isCrossed(tie, spot) {
  return Boolean(tie) && along(tie).some((point) => isWithin(point, spot));
}

function areCrossed(one, other) {
  if (!one || !other) return false;
  const side = ([[a, b], [c, d]], [x, y]) => Math.sign((c - a) * (y - b) - (d - b) * (x - a));
  return side(one, other[0]) !== side(one, other[1]) && side(other, one[0]) !== side(other, one[1]);
}

function along([[a, b], [c, d]]) {
  return Array.from({ length: 9 }, (_, k) => [a + ((c - a) * k) / 8, b + ((d - b) * k) / 8]);
}

/** Points along the lines between given ones, a few pixels apart. */
export function dense(points) {
  const found = [];
  for (let i = 0; i + 1 < points.length; i++) {
    const [[a, b], [c, d]] = [points[i], points[i + 1]];
    const steps = Math.min(60, Math.ceil(Math.hypot(c - a, d - b) / 4)) || 1;
    for (let k = 0; k < steps; k++) found.push([a + ((c - a) * k) / steps, b + ((d - b) * k) / steps]);
  }
  return found;
}

function nearestOf({ left, right, top, bottom }, [x, y]) {
  return [Math.max(left, Math.min(right, x)), Math.max(top, Math.min(bottom, y))];
}

function away(spot, point) {
  const [x, y] = nearestOf(spot, point);
  return Math.hypot(x - point[0], y - point[1]);
}

/** Distance of a point from a line between two others. */
function apart([[a, b], [c, d]], [x, y]) {
  const share = Math.max(0, Math.min(1, ((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2 || 1)));
  return Math.hypot(a + share * (c - a) - x, b + share * (d - b) - y);
}

function isWithin([x, y], { left, right, top, bottom }) {
  return x > left && x < right && y > top && y < bottom;
}

function isOutside({ left, right, top, bottom }, box) {
  return left < box.left || right > box.right + 8 || top < box.top - 4 || bottom > box.bottom;
}
