// @ts-check
// An experiment of the page's data (page_types.py), and what charts ask of it.

// The axes of success: of built cars, and of runs.
export const BELIEF = "success", SIMULATED = "simulated";
export const isSuccess = key => key === BELIEF || key === SIMULATED;

/** @typedef {import("./page_types").PageExperiment} PageExperiment */
// So that TypeScript knows the fields that the constructor copies.
const Fields = /** @type {new () => PageExperiment} */ (/** @type {unknown} */ (Object));

export class Experiment extends Fields {
  /** @param {PageExperiment} raw */
  constructor(raw) {
    super();
    Object.assign(this, raw);
    this.count = raw.designs.name.length;
    this.threshold = raw.thresholds[raw.thresholds.length - 1];
    this.sliders = (raw.judged && raw.drives?.sliders) || [];
    this.axes = [...raw.parameters.map((parameter, k) => parameterAxis(raw, parameter, k)), ...(raw.judged ? [successAxis(BELIEF, "built cars, success", raw.designs.belief), successAxis(SIMULATED, `success in ${raw.simulation}`, raw.designs.rate)] : []), ...raw.designs.measures.map(measureAxis)];
    // Without a prototype, because a link may name any key.
    this.axis = Object.assign(Object.create(null), Object.fromEntries(this.axes.map(axis => [axis.key, axis])));
    if (this.runs) this.indexRuns();
    this.place = new Map(raw.designs.name.map((name, design) => [name, design]));
  }

  // Runs by design and environment, -1 without a run.
  indexRuns() {
    const { design, environment, outcome } = this.runs;
    this.runAt = new Int32Array(this.count * this.environments).fill(-1);
    this.passedIn = new Uint32Array(this.environments);
    this.runsIn = new Uint32Array(this.environments);
    for (let run = 0; run < design.length; run++) {
      this.runAt[design[run] * this.environments + environment[run]] = run;
      this.runsIn[environment[run]] += 1;
      this.passedIn[environment[run]] += Number(outcome[run] === 0);
    }
  }

  run(design, environment) {
    return this.runs && design !== null && environment !== null ? this.runAt[design * this.environments + environment] : -1;
  }

  // Environments that have runs.
  get environmentsRun() { return [...this.runsIn.keys()].filter(row => this.runsIn[row]); }
}

function parameterAxis(raw, { name, label, unit, values }, k) {
  return { key: name, label, unit, parameter: k, values: raw.designs.value.map(places => values[places[k]] ?? null) };
}

const successAxis = (key, label, shares) => ({ key, label, unit: "%", values: shares.map(share => (share === null ? null : 100 * share)), better: "more" });

/** @param {import("./page_types").Measure} measure */
const measureAxis = ({ value, ...named }) => ({ ...named, values: value });

export const hasValues = ({ values }) => values.some(value => value !== null);

export const withUnit = ({ label, unit }) => (unit ? `${label} (${unit})` : label);

// 0.875 as "88 %", as in statistics/words.py. Only 0 is 0 %, and only 1 is 100 %.
export function percent(share) {
  if (share === null || share === undefined) return "–";
  // Python rounds a half to the even number.
  const up = Math.round(100 * share), whole = up - 100 * share === 0.5 && up % 2 ? up - 1 : up;
  return `${whole === 0 && share > 0 ? "<1" : whole === 100 && share < 1 ? ">99" : whole} %`;
}

// Wilson's interval of a rate, 95 %, as in statistics/rate.py: [low, high], 0 to 1.
export function wilson(passed, runs) {
  const z2 = 1.959963984540054 ** 2, rate = passed / runs, scale = 1 + z2 / runs;
  const middle = (rate + z2 / (2 * runs)) / scale, half = Math.sqrt(z2 * (rate * (1 - rate) / runs + z2 / (4 * runs ** 2))) / scale;
  return [passed ? middle - half : 0, passed < runs ? middle + half : 1];
}

// A threshold is not rounded: 0.745 as "74.5 %".
export const thresholdText = threshold => `${Number((100 * threshold).toPrecision(6))} %`;

// 1 as "1 run", 2 as "2 runs".
export const counted = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;

// As many digits as a reader wants.
export function number(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  return String(Number(value.toPrecision(Math.abs(value) >= 1000 ? 4 : 3)));
}

export const valueText = (axis, value) =>
  value === null ? "–" : `${number(value)}${axis.unit ? ` ${axis.unit}` : ""}`;

// What is known of a design's success: [source, text].
export function evidence({ designs, engines, simulation }, k) {
  const span = (low, high) => (low[k] === null ? "" : ` (${percent(low[k])} to ${percent(high[k])})`), rows = [];
  if (designs.belief[k] !== null) rows.push(["built cars (belief)", percent(designs.belief[k]) + span(designs.belief_low, designs.belief_high)]);
  if (designs.runs[k]) rows.push([simulation, `${designs.passed[k] ?? "–"} of ${designs.runs[k]}${span(designs.low, designs.high)}`]);
  for (const { name, passed, runs } of engines) if (runs[k]) rows.push([name, `${passed[k]} of ${runs[k]}`]);
  if (designs.trials[k]) rows.push(["trials", `${designs.trials_passed[k]} of ${designs.trials[k]}, ${designs.cars[k]} car${designs.cars[k] > 1 ? "s" : ""}${span(designs.trials_low, designs.trials_high)}`]);
  return rows;
}

const UNKNOWN_LABELS = {
  friction: "friction", servo_torque: "servo torque", servo_speed: "servo speed", obstacle_height: "obstacle height", com_height_m: "centre of mass, raised",
  track_m: "track, widened", start_position_sd_m: "start scatter, position", start_heading_sd_rad: "start scatter, heading", wheel_spread: "differences between wheels", supply_resistance_ohm: "supply resistance",
};
export const unknownLabel = name => UNKNOWN_LABELS[name] ?? name;

// What a design's colour shows: success as a built car, else in simulation, else in trials, and how wide its interval is.
export function shownSuccess({ designs, realities }, k) {
  if (realities) return { share: designs.belief[k], width: designs.belief_high[k] - designs.belief_low[k] };
  if (designs.runs[k]) return { share: designs.rate[k], width: designs.high[k] - designs.low[k] };
  return { share: designs.trials[k] ? designs.trials_passed[k] / designs.trials[k] : null, width: designs.trials_high[k] - designs.trials_low[k] };
}

// A shown unit and its factor from SI.
const SHOWN = { m: ["mm", 1000], rad: ["°", 180 / Math.PI] };
export const shownUnit = unit => SHOWN[unit] ?? [unit, 1];

// A value of an unknown of the simulator as a text in its shown unit.
export function unknownText(siUnit, si) {
  const [unit, scale] = shownUnit(siUnit);
  return `${number(scale * si)} ${unit}`.trim();
}
