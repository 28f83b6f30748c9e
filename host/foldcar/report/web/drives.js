// Runs of an experiment that the page simulates itself: with bodies, scenes and realities of drives.py.
//
// A run answers as in docs/carsim.md: {outcome, elapsed_time_s, …, path}. Times in seconds, lengths in metres.

import { integerReader, pathOfRows, readGround } from "../../figures/web/scene.js";
import { poolOf, readBlob } from "./simulators.js";

export const URGENT = 2, SOON = 1, LATER = 0;
// Colours of the car that is looked at, and of those beside it (Okabe and Ito's).
const COLOUR = "#0072b2";
export const GHOST_COLOURS = ["#cc79a7", "#009e73", "#e69f00", "#56b4e9", "#d55e00"];

export class Drives {
  // e: the experiment of data.js, with `drives` of page_data.py.
  constructor(e) {
    Object.assign(this, { e, ...e.drives });
    this.canDrive = new Set(this.designs);
    this.canMeet = new Set(this.environments);
    this.grounds = new Map();
    this.pulsesOf = new Map();
  }

  has(design, environment) { return this.canDrive.has(design) && this.canMeet.has(environment) && this.check(design, environment) !== 0; }

  // Number of runs that the page can simulate and has a stored result of.
  get pairs() {
    return this.environments.flatMap(environment => this.designs.filter(design => this.e.run(design, environment) >= 0 && this.has(design, environment)).map(design => [design, environment]));
  }

  // Starts the simulators and reads the inputs. Rejects, as all that simulates, if the browser cannot.
  async ready() {
    if (!this.begun) {
      this.pool = poolOf(this.engine);
      this.begun = Promise.all([readBlob(`${this.key}-inputs`), readBlob(`${this.key}-checks`), this.pool.ready]).then(([inputs, checks]) => {
        this.inputs = inputs.head;
        this.checks = new DataView(checks.bytes.buffer, checks.bytes.byteOffset);
      });
    }
    await this.begun;
  }

  // The ground of an environment, with obstacles of a relative height.
  async ground(environment, height = 1) {
    const name = `${environment} ${height}`;
    if (!this.grounds.has(name)) this.grounds.set(name, readBlob(`${this.key}-scene-${environment}`).then(({ head, bytes }) => readGround(head, integerReader(bytes), height)));
    return this.grounds.get(name);
  }

  // Answers of runs of designs in an environment, in order. values: what-if values by name, null for the run as stored.
  async simulate(designs, environment, { values = null, path = false, priority = LATER, group = null } = {}) {
    await this.ready();
    const { inputs, key } = this, sceneName = `${key} s${environment}`, bodyName = number => `${key} b${number}`;
    const { head: { scene } } = await readBlob(`${key}-scene-${environment}`);
    const reality = realityOf(values, inputs.realities[environment], inputs.deviates[environment]);
    const definitions = new Map([[sceneName, () => JSON.stringify({ scene: { ...scene, id: sceneName } })]]);
    const lines = designs.map(design => {
      const [body, setting] = inputs.designs[design], id = bodyName(body);
      if (!definitions.has(id)) definitions.set(id, () => JSON.stringify({ body: { ...inputs.bodies[body], id } }));
      return JSON.stringify({ run: { ...inputs.settings[setting], id: String(design), body: id, scene: sceneName, reality, ...(path ? { path_interval_s: this.path_interval_s } : {}) } });
    });
    const limit_s = Math.max(0, ...designs.map(design => inputs.settings[inputs.designs[design][1]].time_limit_s));
    return this.pool.answers(definitions, lines, limit_s, priority, group);
  }

  // Forgets runs of a group that have not begun.
  drop(group) { this.pool?.drop(group); }

  // Rows of times and pulse widths of a design's servos; designs with equal settings share them.
  async pulses(design) {
    await this.ready();
    const setting = this.inputs.designs[design][1];
    if (!this.pulsesOf.has(setting)) {
      const { speed_m_s, yaw_rate_rad_s, time_limit_s, parameters } = this.inputs.settings[setting];
      const line = JSON.stringify({ pulses: { id: "pulses", speed_m_s, yaw_rate_rad_s, time_limit_s, parameters } });
      this.pulsesOf.set(setting, this.pool.answers(new Map(), [line], time_limit_s, URGENT).then(([{ changes }]) => changes));
    }
    return this.pulsesOf.get(setting);
  }

  // A design as car.js takes it.
  async car(design) {
    const [pieces, car] = await Promise.all([readBlob(`${this.key}-pieces`), readBlob(`${this.key}-car-${design}`)]);
    const { body, parts } = car.head;
    return { body, shape: parts && { pieces: pieces.head, parts } };
  }

  // A run as scene.js takes it, with `answer` and, in words, how it `ended`; its path is null if the simulator failed. values: as in
  // simulate(). ghost: the colour of a car that is shown transparent. Null if the page cannot simulate the run.
  async drive(design, environment, { values = null, ghost = null } = {}) {
    await this.ready();
    if (!this.has(design, environment)) return null;
    const [[answer], car, pulses] = await Promise.all([this.simulate([design], environment, { values, path: true, priority: URGENT }), this.car(design), this.pulses(design)]);
    const run = { design, answer, label: this.e.designs.name[design], colour: ghost ?? COLOUR, car, pulses };
    if (answer.error) return { ...run, ended: answer.error.message, path: null };
    const ended = `${this.e.outcome_labels[this.e.outcomes.indexOf(answer.outcome)]} after ${answer.elapsed_time_s.toFixed(2)} s`;
    return { ...run, ended, ghost: ghost !== null, outcome: answer.outcome, path: pathOfRows(answer.path) };
  }

  check(design, environment) {
    const run = this.e.run(design, environment);
    return run < 0 || !this.checks ? null : this.checks.getUint32(4 * run, true);
  }

  // Whether an answer has the stored outcome and metrics, bit by bit; null without a stored result.
  agrees(design, environment, answer) {
    const stored = this.check(design, environment);
    return stored === null || stored === 0 ? null : stored === hashOf(this.e.outcomes, answer);
  }

  // What a reader must know of an answer beside its path.
  verdict(design, environment, answer) {
    const agrees = this.agrees(design, environment, answer);
    if (agrees === null) return "";
    if (agrees) return "✓ This page computed the stored outcome and numbers, bit by bit.";
    const run = this.e.run(design, environment), label = this.e.outcome_labels[this.e.runs.outcome[run]];
    return `✗ The stored run ${label} after ${this.e.runs.time_s[run]} s; this page computes: ${outcomeText(this.e, answer)}. ${this.reasonOfDifference()}`;
  }

  // Why a stored result and this page's differ, and what to do.
  reasonOfDifference() {
    if (this.build !== this.pool.build) return `The stored result is of carsim ${this.build}, this page has ${this.pool.build}: sweep and report again with one foldcar.`;
    return `Both are of carsim ${this.build}, which should compute the same bits everywhere: this is a fault of foldcar, not of your study. Please send its authors this page (index.html), this text, and the name of your system. Your browser: ${navigator.userAgent}.`;
  }
}

const outcomeText = (e, answer) => (answer.error ? `failed (${answer.error.message})` : `${e.outcome_labels[e.outcomes.indexOf(answer.outcome)]} after ${answer.elapsed_time_s} s`);

// FNV-1a over the outcome's number and the metrics as doubles, as result_hashes of drives.py.
function hashOf(outcomes, answer) {
  if (answer.error) return -1;
  const { run, outcome, path, recorded, ...metrics } = answer, numbers = Object.values(metrics);
  const bytes = new Uint8Array(1 + 8 * numbers.length), view = new DataView(bytes.buffer);
  bytes[0] = outcomes.indexOf(outcome);
  numbers.forEach((value, k) => view.setFloat64(1 + 8 * k, value ?? NaN, true));
  let hash = 0x811c9dc5;
  for (const byte of bytes) hash = Math.imul(hash ^ byte, 0x01000193) >>> 0;
  return hash;
}

const CHANNELS = 8;

// The reality of a run: how car and ground differ from design and scene. As drawn_reality of belief/reality.py.
export function realityOf(values, base, deviates) {
  if (values === null) return base;
  const reality = { ...base };
  for (const name of ["servo_torque", "servo_speed"]) {
    reality[name] = Array.from(base[name] ?? Array(CHANNELS).fill(0), deviation => values[name] * (1 + deviation) - 1);
  }
  reality.com_z_m = (base.com_z_m ?? 0) + values.com_height_m;
  reality.track_m = values.track_m;
  if (values.supply_resistance_ohm) reality.supply_resistance_ohm = (base.supply_resistance_ohm ?? 0) + values.supply_resistance_ohm;
  reality.friction = values.friction;
  reality.obstacle_height = values.obstacle_height;
  for (const [name, deviate] of Object.entries(deviates)) {
    reality[name] = (name === "start_heading_rad" ? values.start_heading_sd_rad : values.start_position_sd_m) * deviate;
  }
  return reality;
}
