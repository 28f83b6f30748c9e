// The view page; the element #car has its data: {car, run}. The address's fragment sets what is shown: #step=3.5 (0 is all pieces flat),
// explode=0.5, lid=1, time=2.0 of a run. For tests, document.body.dataset tells what is shown: state, mode, step, named and
// the film's bounding box.

import { Car, smooth } from "./car.js";
import { Names } from "./names.js";
import { seeThrough } from "./paints.js";
import { sceneOfRun } from "./run.js";
import { Stage } from "./stage.js";

const STEP_S = 2.5;
const find = id => document.getElementById(id);

class View {
  constructor({ car, run }) {
    this.stage = new Stage(find("model"));
    this.mode = "build";
    this.t = Infinity;
    this.playing = null;
    this.car = new Car(car, this.stage.scene);
    new Names(this.stage, this.car, find("model"), find("tip"));
    if (run) {
      this.run = sceneOfRun(find("scene"), run, t => { document.body.dataset.time = t.toFixed(3); });
      find("told").textContent = run.told;
    }
    find("step").max = this.car.steps;
    find("lid").parentElement.hidden = !Object.keys(car.lid).length;
    find("steps").replaceChildren(...["All pieces, flat", ...car.steps].map((title, step) => {
      const item = document.createElement("li"), button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: title });
      button.addEventListener("click", () => { this.stop(); this.set(step); });
      item.append(button);
      return item;
    }));
    this.listen();
  }

  listen() {
    const on = (id, type, act) => { if (find(id)) find(id).addEventListener(type, act); };
    on("step", "input", () => { this.stop(); this.set(Number(find("step").value)); });
    on("back", "click", () => { this.stop(); this.set(Math.ceil(this.t) - 1); });
    on("forth", "click", () => { this.stop(); this.play(Math.floor(this.t) + 1); });
    on("play", "click", () => (this.playing ? this.stop() : this.play(this.car.steps)));
    on("reset", "click", () => { this.stage.held = false; this.show(); });
    on("through", "change", () => {
      seeThrough(find("through").checked);
      this.stage.draw();
    });
    for (const id of ["explode", "lid", "parts"]) on(id, "input", () => this.show());
    for (const radio of document.querySelectorAll("input[name=mode]")) {
      radio.addEventListener("change", () => { this.stop(); this.stage.held = false; this.turn(radio.value); });
    }
    window.addEventListener("resize", () => this.show());
    window.addEventListener("hashchange", () => this.start());
  }

  start() {
    const wanted = new URLSearchParams(window.location.hash.slice(1));
    const number = (name, otherwise) => (wanted.has(name) && Number.isFinite(Number(wanted.get(name))) ? Number(wanted.get(name)) : otherwise);
    find("explode").value = number("explode", 0);
    find("lid").value = number("lid", 0);
    if (this.run) this.run.time(number("time", 0));
    this.t = Math.max(0, number("step", Infinity));
    this.turn(this.run && !wanted.has("step") ? "run" : "build");
    document.body.dataset.state = "ready";
  }

  turn(mode) {
    this.mode = mode;
    document.body.dataset.mode = mode;
    for (const radio of document.querySelectorAll("input[name=mode]")) radio.checked = radio.value === mode;
    for (const part of document.querySelectorAll("[data-of]")) part.hidden = part.dataset.of !== mode;
    this.show();
  }

  set(t) {
    this.t = Math.min(this.car.steps, Math.max(0, t));
    this.show();
  }

  show() {
    if (this.mode === "run") {
      this.run.time(this.run.now());
      return;
    }
    this.showStep();
    this.stage.draw();
  }

  showStep() {
    const { car } = this, t = this.t = Math.min(this.t, car.steps);
    const explode = Number(find("explode").value), open = Number(find("lid").value);
    const step = Math.ceil(t), before = car.frame(Math.max(0, step - 1)), frame = car.frame(step).clone();
    car.show(t, { explode, open: Math.max(open, explode), bought: find("parts").checked });
    const box = car.box();
    // The camera goes on to the next step's frame in its first part, and to the built car at the end.
    const share = smooth(Math.min(1, (t - step + 1) * 4));
    if (step > 1) frame.set(before.min.clone().lerp(frame.min, share), before.max.clone().lerp(frame.max, share));
    const built = smooth(Math.max(0, 1 - (car.steps - t) * 4));
    frame.set(frame.min.lerp(box.min, built), frame.max.lerp(box.max, built));
    if (explode > 0) frame.union(box);
    this.stage.floor.position.z = box.min.z - 0.6;
    this.stage.look(frame);
    find("step").value = t;
    const title = step ? car.data.steps[step - 1] : "All pieces, flat";
    find("step").setAttribute("aria-valuetext", `step ${step} of ${car.steps}: ${title}`);
    find("now").textContent = title;
    [...find("steps").children].forEach((item, index) => {
      const button = item.firstChild;
      if (index !== step) button.removeAttribute("aria-current");
      else if (!button.hasAttribute("aria-current")) {
        button.setAttribute("aria-current", "step");
        find("steps").scrollTop = item.offsetTop - find("steps").clientHeight / 2;
      }
    });
    const film = car.box(true);
    document.body.dataset.step = t.toFixed(3);
    document.body.dataset.box = [...film.min.toArray(), ...film.max.toArray()].map(v => v.toFixed(3)).join(" ");
  }

  // Advances by shares of a second until step says that it is at its end.
  advance(step) {
    let before = performance.now();
    const tick = now => {
      if (this.playing !== tick) return;
      const more = step(Math.max(0, now - before) / 1000);
      before = now;
      this.show();
      if (more) requestAnimationFrame(tick);
      else this.stop();
    };
    this.playing = tick;
    find("play").textContent = "❚❚ pause";
    requestAnimationFrame(tick);
  }

  stop() {
    this.playing = null;
    find("play").textContent = "▶ play";
  }

  play(until) {
    if (this.t >= this.car.steps) this.t = 0;
    const end = Math.min(until, this.car.steps);
    this.advance(passed => (this.t = Math.min(end, this.t + passed / STEP_S)) < end);
  }
}

window.view = new View(JSON.parse(find("car").textContent));
window.view.start();
