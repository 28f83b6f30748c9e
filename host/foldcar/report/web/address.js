// The fragment of the page's address, which holds what is shown:
// #e=2&design=95 mm&env=17&t=1.2&outcome=tipped,stuck&b.width_mm=65..95&r.friction=0.8&at=runs
//
// e: experiment; env, t: environment and time of the run; x, y, mx, my: axes of the scatter plot and the map; b: ranges of an axis
// that are kept; r: values of the sliders; race: designs that race the recommended car, with ";" between them; course: the
// environment of the race; at: the section that is read.

import { hasValues, number, unknownLabel, unknownText } from "./data.js";

// Designs that race the recommended one: more cannot be told apart.
export const MAX_RIVALS = 3;
const AXES = ["x", "y", "mx", "my"];
const PLAIN = ["e", "design", "env", "t", "x", "y", "mx", "my", "at"];
export const SECTIONS = ["summary", "belief", "whatif", "parameters", "runs", "trials", "origin"];
// Browsers refuse more frequent writes over a longer time: Safari more than 100 in 30 s, Firefox more than 200 in 10 s.
const WRITE_INTERVAL_MS = 500;
// A page inside the text of another page (srcdoc) has no address that could be kept or sent.
export const hasAddress = () => /^(file|https?):$/.test(window.location.protocol);

export const emptyState = () => ({ ...Object.fromEntries(PLAIN.map(name => [name, null])), course: null, race: [], outcomes: [], brushes: Object.create(null), reality: Object.create(null) });

export function fragmentOf(state) {
  const parts = new URLSearchParams();
  for (const name of PLAIN) if (state[name] !== null) parts.set(name, state[name]);
  if (state.race.length) parts.set("race", state.race.join(";"));
  if (state.course !== null) parts.set("course", state.course);
  if (state.outcomes.length) parts.set("outcome", state.outcomes.join(","));
  for (const [key, intervals] of Object.entries(state.brushes)) parts.set(`b.${key}`, intervals.map(([low, high]) => `${low}..${high}`).join(";"));
  for (const [key, value] of Object.entries(state.reality)) parts.set(`r.${key}`, value);
  return `#${parts}`;
}

// Returns {state, remarks}: what the fragment says, and a sentence for each part that cannot be read.
export function readFragment(fragment) {
  const asked = new URLSearchParams(fragment.slice(1)), state = emptyState(), remarks = [];
  // A decimal number: JavaScript also reads 0x10 and 0b1.
  const isNumber = text => /^\s*[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?\s*$/i.test(text) && Number.isFinite(Number(text));
  const refuse = (name, text, wanted) => { remarks.push(`The link's ${name}=${text} is not ${wanted}.`); };
  for (const name of new Set(asked.keys())) {
    const texts = asked.getAll(name), text = texts.at(-1);
    if (texts.length > 1) remarks.push(`The link gives ${name} ${texts.length} times: the last, ${text}, counts.`);
    if (name === "outcome") {
      state.outcomes = text.split(",").filter(Boolean);
    } else if (name.startsWith("r.")) {
      if (isNumber(text)) state.reality[name.slice(2)] = Number(text);
      else refuse(name, text, "a number");
    } else if (name.startsWith("b.")) {
      const intervals = text.split(";").map(part => part.split("..")), ordered = intervals.every(ends => ends.length === 2 && ends.every(isNumber) && Number(ends[0]) <= Number(ends[1]));
      if (ordered) state.brushes[name.slice(2)] = intervals.map(ends => ends.map(Number));
      else refuse(name, text, "a range such as 65..95");
    } else if (name === "race") {
      state.race = text.split(";").filter(Boolean);
    } else if (name === "env" || name === "course") {
      if (isNumber(text) && Number.isInteger(Number(text)) && Number(text) >= 0) state[name] = Number(text);
      else refuse(name, text, "an integer of 0 or more");
    } else if (name === "t") {
      if (isNumber(text) && Number(text) >= 0) state.t = Number(text);
      else refuse(name, text, "a number of 0 or more");
    } else if (name === "at" && !SECTIONS.includes(text)) {
      refuse(name, text, `one of ${SECTIONS.join(", ")}`);
    } else if (PLAIN.includes(name)) {
      state[name] = text || null;
    } else if (SECTIONS.includes(name) && !text) {
      state.at = name;
    } else {
      remarks.push(`The link's ${name}=${text} means nothing to this page.`);
    }
  }
  return { state, remarks };
}

// Takes out of `state` what experiment `e` does not have and moves values into their sliders' limits. Returns a sentence for each.
export function fitState(state, e) {
  const remarks = [], remark = text => { remarks.push(`${text}.`); };
  if (state.e !== null && state.e !== e.id) remark(`The link is of experiment ${state.e}, which this page does not have: this is experiment ${e.id}`);
  if (state.design !== null && !e.place.has(state.design)) remark(`The link's design ${state.design} is not in experiment ${e.id}`);
  if (state.env !== null && state.env >= e.environments) remark(`The link's environment ${state.env} does not exist: experiment ${e.id} has ${e.environments}`);
  for (const name of state.race.filter(design => !e.place.has(design))) remark(`The link's design ${name} cannot race, because it is not in experiment ${e.id}`);
  if (state.race.length > MAX_RIVALS) remark(`The link has ${state.race.length} designs that race the recommended one: the first ${MAX_RIVALS} do`);
  const courses = e.raw.drives?.environments ?? [];
  if (state.course !== null && !courses.includes(state.course)) remark(`The link's race is in environment ${state.course}, which this page cannot simulate`);
  for (const name of state.outcomes.filter(outcome => !e.outcomes.includes(outcome))) remark(`The link's outcome ${name} is not one of ${e.outcomes.join(", ")}`);
  for (const key of Object.keys(state.brushes).filter(axis => !e.axis[axis])) remark(`The link keeps a range of ${key}, which no design has`);
  for (const name of AXES) if (state[name] !== null && !canShow(e, name, state[name])) remark(`The link's axis ${name}=${state[name]} ${e.axis[state[name]] ? `cannot be an axis of the ${name.length > 1 ? "map" : "scatter plot"} of experiment ${e.id}` : "does not exist"}`);
  const { reality, remarks: moved } = fitReality(state.reality, e, "The link");
  remarks.push(...moved);
  Object.assign(state, {
    e: state.e === null ? null : e.id, design: e.place.has(state.design) ? state.design : null, env: state.env < e.environments ? state.env : null,
    race: state.race.filter(design => e.place.has(design)).slice(0, MAX_RIVALS), course: courses.includes(state.course) ? state.course : null,
    outcomes: state.outcomes.filter(outcome => e.outcomes.includes(outcome)), brushes: Object.fromEntries(Object.entries(state.brushes).filter(([key]) => e.axis[key])), reality,
  });
  for (const name of AXES) if (state[name] !== null && !canShow(e, name, state[name])) state[name] = null;
  const hasRun = state.design !== null && state.env !== null;
  if (state.env !== null && state.design === null) remark(`The link's environment ${state.env} is shown for a design only, and the link has none`);
  else if (hasRun && e.runs && e.run(e.place.get(state.design), state.env) < 0) remark(`The link's run of ${state.design} in environment ${state.env} is not in experiment ${e.id}`);
  if (state.t !== null && !hasRun) {
    remark(`The link's time, ${number(state.t)} s, is of no run that this page has`);
    state.t = null;
  }
  return remarks;
}

// Values by name, moved into their sliders' limits, and a sentence for each that was moved or has no slider. source: The link.
export function fitReality(values, { sliders }, source) {
  const reality = Object.create(null), remarks = [];
  for (const [name, value] of Object.entries(values)) {
    const slider = sliders.find(other => other.name === name);
    if (!slider) {
      remarks.push(`${source} has a value of ${name}, for which this page has no slider.`);
      continue;
    }
    const shown = si => unknownText(slider.unit, si);
    reality[name] = fitted(slider, value);
    if (reality[name] !== value) remarks.push(`${source}'s ${unknownLabel(name)}, ${shown(value)}, is outside the slider's limits, ${shown(slider.low)} to ${shown(slider.high)}: it is set to ${shown(reality[name])}.`);
  }
  return { reality, remarks };
}

// The value on a slider that is nearest to this one.
export const fitted = ({ low, high }, value) => Math.min(high, Math.max(low, value));

// Whether an axis of the scatter plot (x, y) or the map (mx, my) can be this one.
function canShow(e, name, key) {
  const axis = e.axis[key];
  if (!axis) return false;
  return name.length > 1 ? e.parameters.length > 1 && axis.parameter !== undefined : e.count > 1 && hasValues(axis);
}

// Writes the fragment into the address: at once, but at most twice a second, and what was last to be written in the end.
export class AddressWriter {
  constructor(fragment) { Object.assign(this, { fragment, planned: null, written_ms: -Infinity, known: window.location.hash }); }

  write() {
    if (this.planned !== null || !hasAddress()) return;
    const wait_ms = this.written_ms + WRITE_INTERVAL_MS - performance.now();
    if (wait_ms > 0) {
      this.planned = setTimeout(() => { this.planned = null; this.write(); }, wait_ms);
      return;
    }
    // A link that was followed in this moment is read before it is written over.
    if (window.location.hash !== this.known) return;
    this.written_ms = performance.now();
    const fragment = this.fragment();
    // A browser may refuse. The page does not need the address.
    try { window.history.replaceState(null, "", fragment === "#" ? window.location.pathname + window.location.search : fragment); } catch { /* as above */ }
    this.known = window.location.hash;
  }
}
