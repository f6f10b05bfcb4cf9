// What is drawn of a state at a moment: its meridian and fields, swinging along a mode where one is chosen.

const SWING = 0.12;
const TINTED = 0.3;
const PERIOD = 2600;
const ROUND_OFF = 1e-5;

/** The meridian of a state and its fields; with a mode, displaced along it. phase: angle of the swing. */
export function momentOf(state, mode, phase) {
  const { fields } = state;
  const base = { u: fields.mesh_coordinate, r: fields.radius, z: fields.axial_position, angle: fields.tangent_angle, fields };
  if (!mode) return base;
  const [c, s] = [Math.cos(phase), Math.sin(phase)];
  const swing = (name) => (mode[`${name}_real`]
    ? resampled(base.u, mode.u, mode[`${name}_real`].map((value, i) => c * value - s * mode[`${name}_imaginary`][i]))
    : null);
  const { shift, shade } = amplitudes(state, mode);
  const [push, tint] = [swing("displacement"), swing("regulator")];
  const r = base.r.map((value, i) => Math.max(0, value + shift * push[i] * Math.sin(base.angle[i])));
  const z = base.z.map((value, i) => value + shift * push[i] * Math.cos(base.angle[i]));
  const moved = tint && fields.concentration ? { ...fields, concentration: fields.concentration.map((value, i) => value + shade * tint[i]) } : fields;
  return { ...base, r, z, fields: moved, still: base };
}

/** What a mode changes, in words. */
export function wordsOf(state, mode) {
  const { shift, shade } = amplitudes(state, mode);
  return shift && shade ? "" : shift ? ", of the shape alone" : ", of the concentration alone";
}

/** Displacement and change of concentration, each drawn large enough to be seen; a part that is round-off stays away. */
function amplitudes({ fields }, mode) {
  const most = largest(mode.displacement_real, mode.displacement_imaginary);
  const tint = mode.regulator_real ? largest(mode.regulator_real, mode.regulator_imaginary) : 0;
  const size = Math.max(largest(fields.radius), 0.5 * Math.abs(fields.axial_position[0] - fields.axial_position.at(-1)));
  const concentration = fields.concentration ? largest(fields.concentration) : 0;
  return {
    shift: most > ROUND_OFF * tint ? (SWING * size) / most : 0,
    shade: tint > ROUND_OFF * most ? (TINTED * concentration) / tint : 0,
  };
}

function largest(...parts) {
  let most = 0;
  for (const part of parts) for (const value of part) most = Math.max(most, Math.abs(value));
  return most;
}

function resampled(u, from, values) {
  let k = 0;
  return Float32Array.from(u, (at) => {
    while (k + 2 < from.length && from[k + 1] < at) k++;
    const share = Math.max(0, Math.min(1, (at - from[k]) / (from[k + 1] - from[k] || 1)));
    return values[k] + share * (values[k + 1] - values[k]);
  });
}

/** Calls back with the angle of the swing, frame by frame, until told to stop. */
export class Swing {
  constructor(moved) {
    this.moved = moved;
    this.isOn = false;
  }

  start() {
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.moved(0);
      return;
    }
    if (this.isOn) return;
    this.isOn = true;
    const began = performance.now();
    const step = (now) => {
      if (!this.isOn) return;
      this.moved((2 * Math.PI * (now - began)) / PERIOD);
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  stop() {
    this.isOn = false;
  }
}
