// Where the chosen run drives, simulated by the page, with other designs and trials of its environment laid over it.

import { mountScene, pathOfRows } from "../../figures/web/scene.js";
import { byId, make, PREFERS_NO_MOTION } from "../../figures/web/dom.js";
import { number } from "./data.js";
import { GHOST_COLOURS } from "./drives.js";
import { cannotSimulate, readBlob } from "./simulators.js";

// Times in the address have two decimals.
const ROUNDING_S = 0.006;

export class ReplayPlace {
  // model: {e: the experiment, drives: of drives.js, state, write()}. A run that is laid over is named d<design> or t<trial>.
  constructor(element, model) {
    Object.assign(this, { element, model, overlays: new Set(), scene: null });
    this.note = make("p", { class: "note" });
    this.verdict = make("p", { class: "note verified" });
    this.overlayList = make("select", { onchange: () => this.toggleOverlay(this.overlayList.value) });
    this.overlayLabel = make("label", { class: "ghost" }, "lay over ", this.overlayList);
    this.whatIf = make("input", { type: "checkbox", onchange: () => this.load(this.scene.now()) });
    this.whatIfLabel = make("label", { class: "ghost" }, this.whatIf, " with the values of “What if”");
    this.place = make("div", { hidden: true });
    this.overlayLabel.hidden = this.whatIfLabel.hidden = true;
    element.replaceChildren(this.note, this.verdict, this.place, this.overlayLabel, " ", this.whatIfLabel);
    this.prepareWhenNear(byId("runs"));
  }

  // When a reader comes near the runs, the simulators start and the scene is drawn once, hidden: the first run then drives at once.
  prepareWhenNear(section) {
    const idle = window.requestIdleCallback ?? setTimeout;
    const watch = new IntersectionObserver(entries => {
      if (!this.model.drives || !entries.some(entry => entry.isIntersecting)) return;
      watch.disconnect();
      idle(() => this.prepare().catch(error => { if (!this.chosen) this.showError(error); }));
    }, { rootMargin: "100%" });
    watch.observe(section);
  }

  async prepare() {
    if (this.scene || this.chosen) return;
    const { drives } = this.model, [design] = drives.designs, [environment] = drives.environments;
    if (design === undefined || environment === undefined) return;
    const [ground, run] = await Promise.all([drives.ground(environment), drives.drive(design, environment)]);
    if (run?.path) this.scene ??= this.mounted(ground, [run]);
  }

  mounted(ground, runs) { return mountScene(this.place, { ground, runs, onTime: (t, playing) => this.keepTime(t, playing) }); }

  // The run of a design in an environment, by their indices, at t; play: at once, unless motion is unwanted.
  async show(design, environment, t = 0, play = false) {
    const { e, drives } = this.model, key = `${e.id} ${design}/${environment}`;
    if (this.shown === key) {
      if (this.scene && !this.loading) this.showTime(t);
      return;
    }
    this.shown = key;
    Object.assign(this, { design, environment, chosen_ms: performance.now() });
    const chosen = (this.chosen = design !== null && environment !== null);
    try {
      if (chosen) await drives.ready();
    } catch (error) {
      if (this.shown === key) this.showError(error);
      return;
    }
    if (this.shown !== key) return;
    const available = chosen && drives.has(design, environment);
    this.place.hidden = this.overlayLabel.hidden = this.whatIfLabel.hidden = !available;
    this.verdict.textContent = "";
    this.note.textContent = available ? "" : chosen ? "The page cannot simulate this run." : "The run that you choose drives here.";
    if (!available) {
      this.scene?.pause();
      return;
    }
    const trials = this.trials();
    this.overlays = new Set([...this.overlays].filter(name => name.startsWith("d") && name !== `d${design}`));
    if (trials.length) this.overlays.add(`t${trials.at(-1).number}`);
    await this.load(t, true);
    if (play && !PREFERS_NO_MOTION && this.shown === key && !this.place.hidden) this.scene.play();
  }

  // Where the run would be.
  showError(error) {
    this.place.hidden = this.overlayLabel.hidden = this.whatIfLabel.hidden = true;
    this.scene?.pause();
    this.verdict.textContent = "";
    this.note.textContent = cannotSimulate(error);
  }

  trials() { return this.model.e.trials.filter(trial => trial.design === this.design && trial.environment === this.environment); }

  // Lays another run over this one, or takes it away.
  toggleOverlay(name) {
    if (name === "none") this.overlays.clear();
    else if (this.overlays.has(name)) this.overlays.delete(name);
    else if (name) this.overlays.add(name);
    this.chosen_ms = performance.now();
    this.load(this.scene.now());
  }

  async load(t, isAsked = false) {
    const request = (this.request = {});
    try {
      await this.simulateAndShow(request);
      if (request !== this.request) return;
      if (isAsked) this.showTime(t);
      else this.scene.time(t);
      this.element.dataset.readyMs = (performance.now() - this.chosen_ms).toFixed(0);
    } catch (error) {
      if (request === this.request) this.showError(error);
    }
  }

  async simulateAndShow(request) {
    const { design, environment, model: { drives, state } } = this;
    this.loading = true;
    const overlays = [...this.overlays].slice(-GHOST_COLOURS.length), changed = Object.keys(state.reality).length > 0;
    this.whatIfLabel.hidden = !changed;
    const values = changed && this.whatIf.checked ? { ...Object.fromEntries(drives.sliders.map(slider => [slider.name, slider.nominal])), ...state.reality } : null;
    const overlay = (name, index) => (name.startsWith("d") ? drives.drive(Number(name.slice(1)), environment, { values, ghost: GHOST_COLOURS[index] }) : this.trialRun(Number(name.slice(1)), GHOST_COLOURS[index]));
    const [ground, chosen, ...others] = await Promise.all([drives.ground(environment, values?.obstacle_height ?? 1), drives.drive(design, environment, { values }), ...overlays.map(overlay)]);
    // Another run was chosen meanwhile.
    if (request !== this.request) return;
    if (overlays.some(name => name.startsWith("t"))) chosen.label += ", simulated";
    const runs = [chosen, ...others.filter(run => run && (run.path || run.attitude?.length))];
    this.note.textContent = others.map(run => run?.note).filter(Boolean).join(" ");
    this.verdict.textContent = values ? `With these values: ${chosen.ended}.` : drives.verdict(design, environment, chosen.answer);
    if (this.scene) this.scene.setGround(ground, runs);
    else this.scene = this.mounted(ground, runs);
    this.listOverlays();
    this.loading = false;
  }

  // Only a link can ask for a time after the end.
  showTime(t) {
    const { end_s } = this.scene;
    if (t > end_s + ROUNDING_S) this.model.remark(`The link's time, ${number(t)} s, is after the end of the drive, ${end_s.toFixed(2)} s: the end is shown.`);
    this.scene.time(t);
  }

  // The time at which a reader stops the run stands in the address.
  keepTime(t, playing) {
    Object.assign(this.element.dataset, { t: t.toFixed(3), end: this.scene?.end_s ?? "" });
    if (playing || this.loading || this.place.hidden) return;
    this.model.state.t = t ? Number(t.toFixed(2)) : null;
    this.model.write();
  }

  async trialRun(number, colour) {
    const { drives } = this.model, trial = this.model.e.trials.find(row => row.number === number), { replay } = trial;
    const moved = replay.moved ? " Obstacles or car stood elsewhere than planned." : "";
    const label = `trial ${number}, ${trial.standing} car`;
    if (replay.attitude.length) return { label, colour, ghost: true, attitude: replay.attitude, note: `Trial ${number}: roll and pitch as its sensor measured them.${moved}` };
    if (!replay.path) return { note: `Trial ${number} is not drawn: ${replay.missing}.` };
    const [path, car] = await Promise.all([readBlob(`${drives.key}-trial-${number}`), drives.car(this.design)]);
    return { label, colour, ghost: true, path: pathOfRows(path.head), car, note: `Trial ${number} of a ${trial.standing} car, from its log.${moved}` };
  }

  // What can be laid over: trials of this run, then the other designs in the same environment.
  listOverlays() {
    const tick = name => (this.overlays.has(name) ? "✓ " : ""), { e, drives } = this.model;
    const option = (name, text) => new Option(`${tick(name)}${text}`, name);
    const others = [...e.designs.name.keys()].filter(design => design !== this.design && drives.has(design, this.environment));
    this.overlayList.replaceChildren(new Option("…", ""), new Option("nothing", "none"),
      ...this.trials().map(({ number, outcome }) => option(`t${number}`, `trial ${number}: ${outcome}`)), ...others.map(design => option(`d${design}`, e.designs.name[design])));
  }
}
