// What is shown, and listeners to its changes: data, state (also the address's fragment), the sliders' reality, the design pointed at.

import { AddressWriter, emptyState, fitReality, fitState, fitted, fragmentOf, readFragment } from "./address.js";
import { Experiment } from "./data.js";
import { Drives } from "./drives.js";

export class Model {
  constructor() {
    this.listeners = { data: [], state: [], hover: [], remarks: [], reality: [] };
    this.writer = new AddressWriter(() => fragmentOf(this.state));
    this.hovered = null;
    this.read();
    window.addEventListener("hashchange", () => {
      this.read();
      this.choose();
      this.fit();
      this.notify("data");
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
    this.fit();
    this.notify("data");
  }

  // The experiment that the state names, or the first.
  choose() {
    const raw = this.experiments.get(this.state.e) || this.study.experiments[0];
    if (!this.decoded || this.decoded.raw !== raw) {
      this.decoded = Object.assign(new Experiment(raw), { raw });
      this.drives = raw.drives ? new Drives(this.decoded) : null;
      this.hovered = this.pressed = null;
    }
    this.e = this.decoded;
    this.mask = null;
  }

  // Indices of what the state names; null where it is not there.
  get design() { return this.e.place.get(this.state.design) ?? null; }
  get env() { return this.state.env !== null && this.state.env < this.e.environments ? this.state.env : null; }

  set(change) {
    const other = "e" in change && change.e !== this.state.e;
    if (other) this.state = { ...emptyState(), at: this.state.at };
    Object.assign(this.state, change);
    this.linkRemarks = [];
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

  // The state and, in linkRemarks, what of the address the page cannot follow.
  read() {
    const { state, remarks } = readFragment(window.location.hash);
    this.writer.known = window.location.hash;
    Object.assign(this, { state, linkRemarks: remarks });
  }

  // Adds to linkRemarks what shows itself later.
  remark(text) {
    this.linkRemarks.push(text);
    this.notify("remarks");
  }

  fit() { this.linkRemarks.push(...fitState(this.state, this.e)); }

  // The sliders' values that differ from the simulated ones, by name.
  setReality(reality) {
    this.state.reality = reality;
    this.linkRemarks = [];
    this.write();
    this.notify("reality");
  }

  // The index of the drawn reality that is chosen: the sliders have its values. Without sliders it is the one that was pressed.
  get reality() {
    const { e, state } = this;
    if (!e.realities) return null;
    if (!e.sliders.length) return this.pressed;
    const { names, values } = e.realities;
    const has = row => e.sliders.every(slider => {
      const n = names.indexOf(slider.name);
      return (state.reality[slider.name] ?? slider.nominal) === (n < 0 ? slider.nominal : fitted(slider, row[n]));
    });
    const k = values.findIndex(has);
    return k < 0 ? null : k;
  }

  // Chooses a drawn reality, null for none, and sets the sliders to its values.
  chooseReality(k) {
    const { names, values } = this.e.realities, { sliders } = this.e;
    this.pressed = k;
    const chosen = k === null ? [] : sliders.filter(({ name }) => names.includes(name)).map(slider => [slider, values[k][names.indexOf(slider.name)]]);
    const { reality, remarks } = fitReality(Object.fromEntries(chosen.filter(([{ nominal }, value]) => value !== nominal).map(([{ name }, value]) => [name, value])), this.e, "The reality");
    this.setReality(reality);
    this.linkRemarks = remarks;
    this.notify("remarks");
  }

  get link() { return new URL(fragmentOf(this.state), window.location.href).href.replace(/#$/, ""); }

  write() { this.writer.write(); }

  scroll() {
    const part = this.state.at && document.getElementById(this.state.at);
    if (part) part.scrollIntoView();
  }
}
