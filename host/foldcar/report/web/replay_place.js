// Where the chosen run drives, simulated by the page, with other designs and trials of its environment laid over it.

import { mountScene, pathOfRows } from "../../figures/web/scene.js";
import { make } from "../../figures/web/dom.js";
import { URGENT, readBlob } from "./drives.js";

const COLOUR = "#0072b2";
const GHOSTS = ["#cc79a7", "#009e73", "#e69f00", "#56b4e9", "#d55e00"];
const CALM = matchMedia("(prefers-reduced-motion: reduce)").matches;

export class ReplayPlace {
  // model: {e: the experiment, drives: of drives.js, state, write()}.
  constructor(element, model) {
    Object.assign(this, { element, model, over: new Set(), scene: null });
    this.note = make("p", { class: "note" });
    this.verdict = make("p", { class: "note verified" });
    this.add = make("select", { onchange: () => this.lay(this.add.value) });
    this.label = make("label", { class: "ghost" }, "lay over ", this.add);
    this.whatIf = make("input", { type: "checkbox", onchange: () => this.load(this.scene.now()) });
    this.switch = make("label", { class: "ghost" }, this.whatIf, " with the values of “What if”");
    this.place = make("div");
    element.replaceChildren(this.note, this.verdict, this.place, this.label, " ", this.switch);
  }

  // The run of a design in an environment, by their indices, at t; play: at once, unless motion is unwanted.
  async show(design, environment, t = 0, play = false) {
    const { e, drives } = this.model, key = `${e.id} ${design}/${environment}`;
    if (this.shown === key) {
      if (this.scene && !this.busy) this.scene.time(t);
      return;
    }
    this.shown = key;
    Object.assign(this, { design, environment });
    this.element.hidden = design === null || environment === null;
    if (this.element.hidden) {
      this.scene?.pause();
      return;
    }
    await drives.ready();
    if (this.shown !== key) return;
    const found = drives.has(design, environment);
    this.place.hidden = this.label.hidden = this.switch.hidden = !found;
    this.verdict.textContent = "";
    this.note.textContent = found ? "" : "The page cannot simulate this run.";
    if (!found) {
      this.scene?.pause();
      return;
    }
    const trials = this.trials();
    this.over = new Set([...this.over].filter(one => one.startsWith("d") && one !== `d${design}`));
    if (trials.length) this.over.add(`t${trials.at(-1).number}`);
    await this.load(t);
    if (play && !CALM && this.shown === key) this.scene.play();
  }

  trials() { return this.model.e.trials.filter(one => one.design === this.design && one.environment === this.environment); }

  // Lays another run over this one, or takes it away.
  lay(name) {
    if (name === "none") this.over.clear();
    else if (this.over.has(name)) this.over.delete(name);
    else if (name) this.over.add(name);
    this.load(this.scene.now());
  }

  async load(t) {
    const asked = (this.asked = {}), { design, environment, model: { drives, state } } = this, begun = performance.now();
    this.busy = true;
    const overs = [...this.over].slice(-GHOSTS.length), changed = Object.keys(state.reality).length > 0;
    this.switch.hidden = !changed;
    const values = changed && this.whatIf.checked ? { ...Object.fromEntries(drives.sliders.map(one => [one.name, one.nominal])), ...state.reality } : null;
    const [ground, first, ...others] = await Promise.all([
      drives.ground(environment, values?.obstacle_height ?? 1), this.run(design, environment, values),
      ...overs.map((one, index) => (one.startsWith("d") ? this.run(Number(one.slice(1)), environment, values, GHOSTS[index]) : this.trial(Number(one.slice(1)), GHOSTS[index]))),
    ]);
    // Another run was chosen meanwhile.
    if (asked !== this.asked) return;
    if (overs.some(one => one.startsWith("t"))) first.label += ", simulated";
    const runs = [first, ...others.filter(one => one && (one.path || one.attitude?.length))];
    this.note.textContent = others.map(one => one?.note).filter(Boolean).join(" ");
    this.verdict.textContent = values ? `With these values: ${first.ended}.` : drives.verdict(design, environment, first.answer);
    if (this.scene) this.scene.setGround(ground, runs);
    else this.scene = mountScene(this.place, { ground, runs, onTime: (at, playing) => this.told(at, playing) });
    this.offer();
    this.busy = false;
    this.element.dataset.readyMs = (performance.now() - begun).toFixed(0);
    this.scene.time(t);
  }

  told(t, playing) {
    Object.assign(this.element.dataset, { t: t.toFixed(3), end: this.scene?.end_s ?? "" });
    if (playing || this.busy) return;
    clearTimeout(this.writing);
    this.writing = setTimeout(() => {
      this.model.state.t = t ? Number(t.toFixed(2)) : null;
      this.model.write();
    }, 300);
  }

  // A run as the scene takes it; a ghost has a colour of its own. Null if the page cannot simulate it.
  async run(design, environment, values, ghost = null) {
    const { drives, e } = this.model;
    if (!drives.has(design, environment)) return null;
    const [[answer], car, pulses] = await Promise.all([drives.simulate([design], environment, { values, path: true, priority: URGENT }), this.car(design), drives.pulses(design)]);
    const name = e.designs.name[design];
    if (answer.error) return { design, answer, ended: answer.error.message, label: name, colour: ghost ?? COLOUR, path: null, car, pulses };
    const ended = `${e.outcome_labels[e.outcomes.indexOf(answer.outcome)]} after ${answer.elapsed_time_s.toFixed(2)} s`;
    return { design, answer, ended, label: name, colour: ghost ?? COLOUR, ghost: ghost !== null, outcome: answer.outcome, path: pathOfRows(answer.path), car, pulses };
  }

  // A design as car.js takes it.
  async car(design) {
    const { key } = this.model.drives, [pieces, car] = await Promise.all([readBlob(`${key}-pieces`), readBlob(`${key}-car-${design}`)]);
    const { body, parts } = car.head;
    return { body, shape: parts && { pieces: pieces.head, parts } };
  }

  async trial(number, colour) {
    const { key } = this.model.drives, trial = this.model.e.trials.find(one => one.number === number), drawn = trial.replay;
    const moved = drawn.moved ? " Obstacles or car stood elsewhere than planned." : "", film = drawn.film_error;
    const label = `trial ${number}, ${film ? "filmed" : `${trial.standing} car`}`;
    if (drawn.attitude.length) return { label, colour, ghost: true, attitude: drawn.attitude, note: `Trial ${number}: roll and pitch as its sensor felt them.${moved}` };
    if (!drawn.path) return { note: `Trial ${number} is not drawn: ${drawn.missing}.` };
    const [blob, car] = await Promise.all([readBlob(`${key}-trial-${number}`), this.car(this.design)]);
    const source = film ? `as filmed: place known to ${(1000 * film[0]).toFixed(0)} mm, start to ${(1000 * film[1]).toFixed(0)} ms` : "from its log";
    return { label, colour, ghost: true, path: pathOfRows(blob.head), car, note: `Trial ${number} of a ${trial.standing} car, ${source}.${moved}` };
  }

  // What can be laid over: trials of this run, then the other designs in the same environment.
  offer() {
    const sign = name => (this.over.has(name) ? "✓ " : ""), { e, drives } = this.model;
    this.add.replaceChildren(new Option("…", ""), new Option("nothing", "none"),
      ...this.trials().map(({ number, outcome }) => new Option(`${sign(`t${number}`)}trial ${number}: ${outcome}`, `t${number}`)),
      ...e.designs.name.flatMap((name, design) => (design !== this.design && drives.has(design, this.environment) ? [new Option(`${sign(`d${design}`)}${name}`, `d${design}`)] : [])));
  }
}
