// The study's data as page_data.py describes it, with its arrays decoded, and what charts ask of it.

const ARRAYS = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array };
export const BELIEF = "success";

// A typed array of {type, data: base64}. Little-endian, as every machine that has a browser.
function decoded({ type, data }) {
  const text = atob(data), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new ARRAYS[type](bytes.buffer);
}

export class Experiment {
  constructor(raw) {
    Object.assign(this, raw);
    this.count = raw.designs.name.length;
    this.threshold = raw.thresholds[raw.thresholds.length - 1];
    this.axes = [...raw.parameters.map((one, k) => parameterAxis(raw, one, k)), beliefAxis(raw), ...raw.designs.measures.map(measureAxis)];
    this.axis = Object.fromEntries(this.axes.map(axis => [axis.key, axis]));
    const { runs } = raw;
    this.runs = runs && { n: runs.n, design: decoded(runs.design), environment: decoded(runs.environment), outcome: decoded(runs.outcome), time_s: decoded(runs.time_s) };
    if (this.runs) this.indexRuns();
    this.replay = new Map(raw.replays.map(one => [`${one.design}/${one.environment}`, one]));
    this.replayed = raw.replay;
    this.place = new Map(raw.designs.name.map((name, design) => [name, design]));

  }

  // Runs by design and environment, -1 where there is none; environments in the order of their difficulty.
  indexRuns() {
    const { n, design, environment, outcome } = this.runs;
    this.runAt = new Int32Array(this.count * this.environments).fill(-1);
    this.passedIn = new Uint32Array(this.environments);
    this.runsIn = new Uint32Array(this.environments);
    for (let run = 0; run < n; run++) {
      this.runAt[design[run] * this.environments + environment[run]] = run;
      this.runsIn[environment[run]] += 1;
      this.passedIn[environment[run]] += outcome[run] === 0;
    }
  }

  run(design, environment) {
    return this.runs && design !== null && environment !== null ? this.runAt[design * this.environments + environment] : -1;
  }

  // Environments that have runs, by number or the hardest first.
  environmentsIn(order) {
    const rows = [...this.runsIn.keys()].filter(row => this.runsIn[row]);
    const share = row => this.passedIn[row] / this.runsIn[row];
    return order === "difficulty" ? rows.sort((a, b) => share(a) - share(b) || a - b) : rows;
  }
}

function parameterAxis(raw, { name, label, unit, values, numeric }, k) {
  const indices = raw.designs.value.map(one => one[k]);
  const at = index => (index === null ? null : numeric ? values[index] : index);
  return { key: name, label, unit, parameter: k, numeric, categories: numeric ? null : values.map(String), values: indices.map(at), indices };
}

function beliefAxis({ designs }) {
  return { key: BELIEF, label: "success", unit: "%", numeric: true, values: designs.belief.map(share => share === null ? null : 100 * share), better: "more" };
}

function measureAxis({ key, label, unit, better, value }) {
  return { key, label, unit, better, numeric: true, values: value };
}

export const withUnit = ({ label, unit }) => (unit ? `${label} (${unit})` : label);

// 0.875 as "88 %".
export const carsText = (designs, design) => `${designs.cars[design]} car${designs.cars[design] > 1 ? "s" : ""}`;
export const percent = share => (share === null || share === undefined ? "–" : `${Math.round(100 * share)} %`);

// As many digits as a reader wants.
export function number(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  return String(Number(value.toPrecision(Math.abs(value) >= 1000 ? 4 : 3)));
}

export const valueText = (axis, value) =>
  value === null ? "–" : axis.categories ? axis.categories[value] : `${number(value)}${axis.unit ? ` ${axis.unit}` : ""}`;
