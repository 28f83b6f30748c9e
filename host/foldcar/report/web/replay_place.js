// Where the chosen run is shown as it moved, with other designs in the same environment or a trial laid over it.
//
// The experiment's replay, {key, places: {design: number of its blobs}, cars, ground, units, trials}, is replay.py's.

import { GHOST_COLOUR, RUN_COLOUR } from "./canvas.js";
import { number } from "./data.js";
import { make } from "./dom.js";
import { readGround } from "./ground.js";
import { readPaths } from "./path.js";
import { Player } from "./player.js";
import { drawPulses } from "./pulses.js";
import { drawRear } from "./rear_view.js";
import { mountScene } from "./scene.js";
import { drawStrip, stripTime } from "./strip_chart.js";

const CALM = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

export class ReplayPlace {
  constructor(element, model) { Object.assign(this, { element, model, shown: null, scene: null }); }

  // The run of a design in an environment at a time; nothing where one is not chosen, or the experiment has no replays.
  async show(design, environment, t) {
    const { e } = this.model, { replay } = e, key = `${e.id} ${design} ${environment}`;
    if (!replay || design === null || environment === null) return this.clear();
    if (key === this.shown) {
      if (this.player && !this.player.playing && Math.abs(this.player.t - t) > 0.02) this.player.seek(t);
      return undefined;
    }
    this.shown = key;
    const place = replay.places[design];
    const [paths, ground] = await Promise.all([readPaths(`${replay.key}-runs-${place}`, replay.units), readGround(`${replay.key}-scene-${environment}`, replay.ground, replay.units)]);
    // Another run was chosen meanwhile.
    if (key !== this.shown) return undefined;
    const path = paths.get(environment);
    if (!path || !ground) {
      this.clear();
      this.shown = key;
      this.element.replaceChildren(make("p", { class: "note", text: "This run has no replay." }));
      return undefined;
    }
    this.drive = { path, car: replay.cars[place], label: e.designs.name[design], ghost: false };
    this.ground = ground;
    this.build(replay, design, environment);
    await this.lay(this.over.value);
    this.player.seek(t);
    if (!t && !CALM && document.body.dataset.state === "ready") this.player.play();
    return undefined;
  }

  clear() {
    if (this.player) this.player.stop();
    if (this.scene) this.scene.dispose();
    Object.assign(this, { shown: null, scene: null, player: null });
    this.element.replaceChildren();
  }

  build(replay, design, environment) {
    if (this.player) this.player.stop();
    if (this.scene) this.scene.dispose();
    const play = make("button", { type: "button", text: "▶ play" }), clock = make("output");
    const scrub = make("input", { type: "range", min: 0, max: 1, step: 0.001, value: 0, "aria-label": "time in the run" });
    const speed = make("select", { "aria-label": "speed" }, ...SPEEDS.map(one => new Option(`${one} ×`, one, false, one === 1)));
    this.over = make("select", {}, ...this.offers(replay, design, environment));
    this.over.addEventListener("change", () => this.lay(this.over.value));
    this.stage = make("div", { class: "stage" });
    this.strip = make("canvas", { role: "img", "aria-label": "Roll and pitch over time" });
    this.rear = make("canvas", { role: "img", "aria-label": "The car from behind, with its roll" });
    this.pulses = make("canvas", { role: "img", "aria-label": "Pulses that the firmware sends to the servos" });
    this.note = make("p", { class: "note" });
    this.element.replaceChildren(
      make("div", { class: "controls" }, play, scrub, clock, speed, make("label", {}, "laid over ", this.over)), this.stage,
      make("p", { class: "note" }, make("span", { style: `color:${RUN_COLOUR}`, text: "roll" }), " (left side up) and ", make("span", { style: "color:#009e73", text: "pitch" }), " (nose up); press or drag to go there."),
      this.strip, make("div", { class: "instruments" }, this.rear, this.pulses), this.note);
    this.scene = mountScene(this.stage, { car: this.drive.car, ground: this.ground, runs: [this.drive], camera: "chase" });
    this.player = new Player({ play, scrub, speed, clock }, t => this.draw(t));
    const press = event => this.player.seek(stripTime(this.strip, event, this.player.end_s));
    this.strip.addEventListener("pointerdown", event => { this.strip.setPointerCapture(event.pointerId); this.player.stop(); press(event); });
    this.strip.addEventListener("pointermove", event => { if (event.buttons) press(event); });
  }

  // Trials of this run, then the other designs that the filters keep.
  offers(replay, design, environment) {
    const { e, within } = this.model, offers = [new Option("nothing", "")];
    for (const one of replay.trials) {
      if (one.design === replay.places[design] && one.sample === environment) offers.push(new Option(`trial ${one.id}: ${one.outcome.replaceAll("_", " ")}`, `trial-${one.id}`, false, offers.length === 1));
    }
    e.designs.name.forEach((name, k) => { if (k !== design && within[k] && replay.cars[replay.places[k]]) offers.push(new Option(name, `design-${k}`)); });
    return offers;
  }

  async lay(wanted) {
    const { replay } = this.model.e, [kind, text] = wanted.split("-"), shown = this.shown, drives = [this.drive];
    this.attitude = [];
    this.note.textContent = "";
    if (kind === "design") {
      const place = replay.places[Number(text)], path = (await readPaths(`${replay.key}-runs-${place}`, replay.units)).get(this.model.env);
      if (path) drives.push({ path, car: replay.cars[place], label: this.model.e.designs.name[Number(text)], ghost: true });
      this.note.textContent = path ? `Dashed: ${this.model.e.designs.name[Number(text)]} in the same environment.` : "That run has no replay.";
    } else if (kind === "trial") {
      const trial = replay.trials.find(one => one.id === Number(text)), moved = trial.moved ? " Obstacles or car stood elsewhere than planned in the trial." : "";
      this.attitude = trial.attitude;
      const path = trial.path ? (await readPaths(`${replay.key}-trial-${trial.id}`, replay.units)).get(0) : null;
      if (path) drives.push({ path, car: this.drive.car, label: `trial ${trial.id}`, ghost: true });
      this.note.textContent = trial.attitude.length ? `Trial ${trial.id}: roll and pitch as its sensor felt them, dotted.${moved}` : path ? `Dashed: trial ${trial.id}, from its log.${moved}` : `Trial ${trial.id} is not drawn: ${trial.missing}.`;
    }
    if (shown !== this.shown) return;
    this.drives = drives;
    const t = this.player.t;
    this.scene.setRuns(drives);
    this.player.load(Math.max(...drives.map(one => one.path.end_s)));
    this.player.seek(t);
  }

  draw(t) {
    if (!this.drives) return;
    this.scene.time(t);
    drawRear(this.rear, this.ground, this.drives.map(one => ({ colour: one.ghost ? GHOST_COLOUR : RUN_COLOUR, ...one })), t);
    drawPulses(this.pulses, this.drive.car, Math.min(t, this.drive.path.end_s));
    drawStrip(this.strip, this.angles(), t, this.player.end_s);
    const at = this.drive.path.at(t);
    Object.assign(this.element.dataset, { t: t.toFixed(3), x: at.x.toFixed(4), y: at.y.toFixed(4), end: this.drive.path.end_s });
    if (!this.player.playing) {
      this.model.state.t = t ? Number(number(t)) : null;
      this.model.write();
    }
  }

  angles() {
    const series = [];
    for (const { path, ghost } of this.drives) for (const [column, colour] of [[5, ghost ? GHOST_COLOUR : RUN_COLOUR], [4, ghost ? "#e69f00" : "#009e73"]]) {
      series.push({ colour, dash: ghost ? [4, 3] : [], points: Array.from(path.columns[column], (angle, row) => [path.time(row), angle]) });
    }
    for (const [column, colour] of [[2, GHOST_COLOUR], [1, "#e69f00"]]) if (this.attitude.length) series.push({ colour, dash: [2, 2], points: this.attitude.map(row => [row[0], row[column]]) });
    return series;
  }
}
