// Numbers, symbols and units as text.

const GREEK = {
  alpha: "α", beta: "β", gamma: "γ", delta: "δ", epsilon: "ε", eps: "ε", zeta: "ζ", eta: "η", theta: "θ", kappa: "κ", lambda: "λ",
  mu: "μ", nu: "ν", xi: "ξ", pi: "π", rho: "ρ", sigma: "σ", tau: "τ", phi: "φ", chi: "χ", psi: "ψ", omega: "ω",
  Gamma: "Γ", Delta: "Δ", Omega: "Ω", Dmu: "Δμ",
};
const GREEK_WORD = new RegExp(`(?<![A-Za-z])(${Object.keys(GREEK).join("|")})(?![a-z])`, "g");

/** Pieces [text, level] of a symbol or a unit as stored: level 1 stands high, -1 low. */
export function pieces(text) {
  const found = [];
  const greek = text.replace(GREEK_WORD, (word) => GREEK[word]).replace(/\*/g, " ");
  const parts = greek.matchAll(/([_^])(\{[^}]*\}|\([^)]*\)|-?\d+|[^\s/()|^_]+)|(?<=[A-Za-z])(\d+)|([^_^0-9]+|\d+|[_^])/gu);
  for (const [, mark, index, digits, plain] of parts) {
    if (mark) found.push([index.replace(/[{}]/g, ""), mark === "^" ? 1 : -1]);
    else found.push(digits ? [digits, -1] : [plain, 0]);
  }
  return found;
}

/** A symbol or unit as HTML. */
export function html(text) {
  return pieces(text).map(([part, level]) => {
    const safe = escaped(part);
    return level ? (level > 0 ? `<sup>${safe}</sup>` : `<sub>${safe}</sub>`) : safe;
  }).join("");
}

export function escaped(text) {
  return String(text).replace(/[&<>"']/g, (letter) => `&#${letter.charCodeAt(0)};`);
}

/** A number with so many digits, with a true minus and powers of ten. */
export function number(value, digits = 6) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (!Number.isFinite(size)) return value > 0 ? "∞" : "−∞";
  const text = size >= 1e6 || size < 1e-4 ? value.toExponential(Math.min(digits - 1, 3)) : value.toPrecision(digits);
  const [mantissa, power] = text.split("e");
  const short = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  const ten = power ? `10${raised(Number(power))}` : "";
  return (ten && /^-?1$/.test(short) ? short.replace("1", ten) : [short, ten].filter(Boolean).join("·")).replace("-", "−");
}

function raised(power) {
  return String(power).replace(/./g, (letter) => ({ "-": "⁻" })[letter] ?? "⁰¹²³⁴⁵⁶⁷⁸⁹"[letter]);
}

export function plain(name) {
  return name.replaceAll("_", " ");
}

/** A name as HTML: names come from stores, which may come from anywhere. */
export function safe(name) {
  return escaped(plain(name));
}

export const unitless = (unit) => !unit || unit === "1";

const NAMED = 3;

/** What cannot be read of a store that is shown without it, in lines. */
export function damageWords(damage) {
  if (!damage.length) return [];
  const more = damage.length > NAMED ? [`and ${damage.length - NAMED} more.`] : [];
  return [`Shown without what cannot be read of this store:`, ...damage.slice(0, NAMED), ...more];
}

/** Of a number of growing modes; marginal: stability changes here, as a rate vanishes within its error. */
export function stabilityWords(growing, isMarginal = false) {
  if (growing === null || growing === undefined) return "stability not known";
  if (growing === 0) return isMarginal ? "marginal" : "stable";
  return `${growing} growing mode${growing === 1 ? "" : "s"}${isMarginal ? ", one marginal" : ""}`;
}
