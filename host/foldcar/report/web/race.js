// The recommended car drives at the top of the page, and designs that the reader presses race it: transparent, in the same environment
// at the same time. Until it drives, a still picture of it stands there.

import { MAX_RIVALS } from "./address.js";
import { GHOST_COLOURS } from "./drives.js";
import { cannotSimulate } from "./simulators.js";
import { byId, make, PREFERS_NO_MOTION, select } from "../../figures/web/dom.js";
import { mountScene } from "../../figures/web/scene.js";

// How often it drives by itself, and the rest between.
const DRIVES = 2, REST_MS = 1200;

export class Race {
  constructor(model) {
    Object.assign(this, { model, scene: null, shown: null, left: 0, visible: true });
    this.element = byId("race");
    this.note = make("p", { class: "note", role: "status" });
    this.choices = make("p", { class: "controls" });
    this.place = make("div");
    byId("drive").replaceChildren(this.place, this.choices);
    byId("drive").after(this.note);
    // It does not drive on while nobody sees it.
    new IntersectionObserver(([{ isIntersecting }]) => {
      this.visible = isIntersecting;
      if (!isIntersecting) this.stop();
      else this.start();
    }).observe(this.element);
  }

  // Another experiment.
  use() {
    const { e, state } = this.model;
    this.joined = state.design;
    for (const still of this.element.querySelectorAll(".still")) still.hidden = still.dataset.experiment !== e.id;
    this.follow();
  }

  // What is chosen may have changed: a design that was pressed joins the race, and the one that joined first leaves it when it is full.
  follow() {
    const { model } = this, { state } = model;
    if (state.design !== this.joined) {
      this.joined = state.design;
      if (model.design !== null) this.join(model.design);
    }
    const { designs, environment } = this, shown = JSON.stringify([model.e.id, designs, environment]);
    if (shown === this.shown) return;
    this.shown = shown;
    this.load(shown, designs, environment);
  }

  join(design) {
    const { model } = this, { e, drives, state } = model, name = e.designs.name[design];
    if (design === e.recommended || !drives?.canDrive.has(design)) return;
    state.race = [...state.race.filter(other => other !== name), name].slice(-MAX_RIVALS);
    model.write();
  }

  change(change) {
    Object.assign(this.model.state, change);
    this.model.write();
    this.follow();
  }

  // The recommended design first; none if the page cannot simulate it.
  get designs() {
    const { e, drives, state } = this.model;
    if (!drives || e.recommended === null || !drives.canDrive.has(e.recommended)) return [];
    return [e.recommended, ...state.race.map(name => e.place.get(name)).filter(design => design !== e.recommended && drives.canDrive.has(design))];
  }

  // The environment of the race: the chosen one, else that in which the designs differ most, if possible one that the recommended
  // design passes.
  get environment() {
    const { e, drives, state } = this.model;
    if (state.course !== null) return state.course;
    const merit = environment => {
      const run = e.run(e.recommended, environment), share = e.runsIn?.[environment] ? e.passedIn[environment] / e.runsIn[environment] : 0;
      return (run >= 0 && e.runs.outcome[run] === 0 ? 1 : 0) - Math.abs(share - 0.5);
    };
    const [first, ...others] = drives?.environments ?? [];
    return others.reduce((best, environment) => (merit(environment) > merit(best) ? environment : best), first ?? null);
  }

  async load(shown, designs, environment) {
    this.stop();
    this.note.textContent = "";
    const possible = designs.length > 0 && environment !== null;
    this.showDrive(false);
    if (!possible) return;
    try {
      const { drives } = this.model;
      const [ground, ...runs] = await Promise.all([drives.ground(environment), ...designs.map((design, n) => drives.drive(design, environment, { ghost: n ? GHOST_COLOURS[n - 1] : null }))]);
      // Another race was chosen meanwhile.
      if (shown !== this.shown) return;
      const driven = runs.filter(run => run?.path).map(run => ({ ...run, label: `${run.label}: ${run.ended}` }));
      if (!driven.length) return;
      this.note.textContent = [...runs.filter(run => run && !run.path).map(run => `${run.label}: ${run.ended}.`), this.differences(runs, environment)].filter(Boolean).join(" ");
      this.showDrive(true);
      if (this.scene) this.scene.setGround(ground, driven);
      else this.scene = mountScene(this.place, { ground, runs: driven, plain: true, onTime: (t, playing) => this.onTime(t, playing) });
      this.scene.time(0);
      this.listChoices(designs, environment);
      this.element.dataset.readyMs ??= performance.now().toFixed(0);
      this.left = PREFERS_NO_MOTION ? 0 : DRIVES;
      this.start();
    } catch (error) {
      if (shown !== this.shown) return;
      this.showDrive(false);
      this.note.textContent = cannotSimulate(error);
    }
  }

  showDrive(visible) {
    byId("drive").hidden = !visible;
    this.element.classList.toggle("drives", visible);
  }

  // Why a run that this page computed is not the stored one.
  differences(runs, environment) {
    const { drives } = this.model;
    return runs.filter(run => run && drives.agrees(run.design, environment, run.answer) === false).map(run => `${run.label}: ${drives.verdict(run.design, environment, run.answer)}`).join(" ");
  }

  start() {
    if (this.left > 0 && this.visible && this.scene && !this.scene.playing) this.scene.play();
  }

  stop() {
    clearTimeout(this.resting);
    this.scene?.pause();
  }

  // It drives again after a rest, unless the reader stopped it.
  onTime(t, playing) {
    if (!playing && this.scene && this.visible && t > 0) {
      this.left = t < this.scene.end_s ? 0 : Math.max(0, this.left - 1);
      if (this.left) this.resting = setTimeout(() => this.start(), REST_MS);
    }
    Object.assign(this.element.dataset, { t: t.toFixed(3), playing, left: this.left });
  }

  // Who races where, and what can be changed.
  listChoices(designs, environment) {
    const { model } = this, { e, drives, state } = model;
    const outcome = design => { const run = e.run(design, environment); return run < 0 ? "" : e.outcome_labels[e.runs.outcome[run]]; };
    const passes = place => (e.runsIn?.[place] ? `${place}: ${e.passedIn[place]} of ${e.runsIn[place]} designs pass` : String(place));
    const rivals = designs.slice(1), choices = [select("environment", drives.environments.map(place => [place, passes(place)]), environment, value => this.change({ course: Number(value) }))];
    for (const design of rivals) {
      const name = e.designs.name[design];
      choices.push(make("button", { type: "button", text: `× ${name}`, "aria-label": `take ${name} out of the race`, onclick: () => this.change({ race: state.race.filter(other => other !== name) }) }));
    }
    const proposed = rivals.length ? null : this.contrast(environment);
    if (proposed !== null) choices.push(make("button", { type: "button", class: "add", text: `race ${e.designs.name[proposed]} (${outcome(proposed)})`, onclick: () => { this.join(proposed); this.follow(); } }));
    if (e.count > 1) choices.push(make("span", { class: "of", text: rivals.length < MAX_RIVALS ? "Press any design on this page, and it joins the race." : "Press any design on this page, and it takes the place of the one that joined first." }));
    this.choices.replaceChildren(...choices);
  }

  // The design that fails in this environment although it passes in most others.
  contrast(environment) {
    const { e, drives } = this.model, { passed, runs } = e.designs;
    const fails = [...drives.canDrive].filter(design => design !== e.recommended && e.run(design, environment) >= 0 && e.runs.outcome[e.run(design, environment)] !== 0 && drives.has(design, environment));
    if (!fails.length) return null;
    return fails.reduce((best, design) => (passed[design] / runs[design] > passed[best] / runs[best] ? design : best));
  }
}
