// What is shown, and listeners to its changes: data, state (also the address's fragment) and the design pointed at.

import { Experiment } from "./data.js";
import { Drives } from "./drives.js";

// Of the fragment: #e=2&design=95 mm&env=17&t=1.2&outcome=tipped,stuck&b.width_mm=65..95&r.friction=0.8&at=runs
const PLAIN = { e: "e", design: "design", env: "env", t: "t", x: "x", y: "y", mx: "mx", my: "my", at: "at" };
export const SECTIONS = ["summary", "belief", "whatif", "parameters", "runs", "trials"];

export class Model {
  constructor() {
    this.listeners = { data: [], state: [], hover: [] };
    this.state = { e: null, design: null, env: null, t: null, outcomes: [], brushes: {}, reality: {}, at: null, x: null, y: null, mx: null, my: null };
    this.hovered = null;
    this.read();
    window.addEventListener("hashchange", () => {
      const before = this.state.e;
      this.read();
      if (!this.study) return;
      this.choose();
      this.notify(before === this.state.e ? "state" : "data");
      this.scroll();
    });
  }

  on(kind, act) { this.listeners[kind].push(act); }

  notify(kind) {
    if (kind === "data") this.mask = null;
    for (const listener of this.listeners[kind]) listener();
    if (kind === "data") this.notify("state");
  }

  use(study) {
    this.study = study;
    this.experiments = new Map(study.experiments.map(raw => [raw.id, raw]));
    this.decoded = null;
    this.choose();
    this.notify("data");
  }

  // The experiment that the state names, or the first.
  choose() {
    const raw = this.experiments.get(this.state.e) || this.study.experiments[0];
    if (!this.decoded || this.decoded.raw !== raw) {
      this.decoded = Object.assign(new Experiment(raw), { raw });
      this.drives = raw.drives ? new Drives(this.decoded) : null;
    }
    this.e = this.decoded;
    this.mask = null;
  }

  // Indices of what the state names; null where it is not there.
  get design() { return this.e.place.get(this.state.design) ?? null; }
  get env() { return this.state.env !== null && this.state.env < this.e.environments ? this.state.env : null; }

  set(change) {
    const other = "e" in change && change.e !== this.state.e;
    if (other) Object.assign(this.state, { design: null, env: null, t: null, outcomes: [], brushes: {}, reality: {}, x: null, y: null, mx: null, my: null });
    Object.assign(this.state, change);
    this.mask = null;
    this.write();
    if (other) {
      this.choose();
      this.notify("data");
    } else {
      this.notify("state");
    }
  }

  // A design, by its index, and its runs.
  open(design, env = null) {
    this.set({ design: this.e.designs.name[design], env, t: null, at: "runs" });
    this.scroll();
  }

  hover(design) {
    if (design === this.hovered) return;
    this.hovered = design;
    this.notify("hover");
  }

  brush(key, intervals) {
    const brushes = { ...this.state.brushes };
    if (intervals.length) brushes[key] = intervals;
    else delete brushes[key];
    this.set({ brushes });
  }

  // Whether each design is in every brush.
  get within() {
    if (!this.mask) {
      const brushes = Object.entries(this.state.brushes).filter(([key]) => this.e.axis[key]);
      this.mask = Array.from({ length: this.e.count }, (_, design) => brushes.every(([key, intervals]) => {
        const value = this.e.axis[key].values[design];
        return value !== null && intervals.some(([low, high]) => value >= low && value <= high);
      }));
    }
    return this.mask;
  }

  read() {
    const asked = new URLSearchParams(window.location.hash.slice(1)), { state } = this;
    for (const [name, key] of Object.entries(PLAIN)) state[key] = asked.get(name) || null;
    for (const key of ["env", "t"]) state[key] = state[key] !== null && Number.isFinite(Number(state[key])) ? Number(state[key]) : null;
    state.env = state.env === null ? null : Math.max(0, Math.round(state.env));
    if (!SECTIONS.includes(state.at)) state.at = null;
    state.outcomes = (asked.get("outcome") || "").split(",").filter(Boolean);
    state.brushes = {};
    state.reality = {};
    for (const [name, text] of asked) {
      if (name.startsWith("r.") && Number.isFinite(Number(text))) state.reality[name.slice(2)] = Number(text);
      const intervals = text.split(";").map(part => part.split("..").map(Number)).filter(([low, high]) => low <= high);
      if (name.startsWith("b.") && intervals.length) state.brushes[name.slice(2)] = intervals;
    }
  }

  get address() {
    const { state } = this, parts = new URLSearchParams();
    for (const [name, key] of Object.entries(PLAIN)) {
      if (state[key] !== null) parts.set(name, state[key]);
    }
    if (state.outcomes.length) parts.set("outcome", state.outcomes.join(","));
    for (const [key, intervals] of Object.entries(state.brushes)) parts.set(`b.${key}`, intervals.map(([low, high]) => `${low}..${high}`).join(";"));
    for (const [key, value] of Object.entries(state.reality)) parts.set(`r.${key}`, value);
    return `#${parts}`;
  }

  write() { window.history.replaceState(null, "", this.address === "#" ? window.location.pathname + window.location.search : this.address); }

  scroll() {
    const part = this.state.at && document.getElementById(this.state.at);
    if (part) part.scrollIntoView();
  }
}
