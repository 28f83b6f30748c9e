// A scene with cars that drive in it, as recorded: mountScene is all that pages need.
//
// ground: a Ground of ground.js. A run is {design, label, colour, path, car, ghost, outcome, attitude, pulses}: path of path.js or
// null, car {body, shape} of car.js, ghost: whether it is shown transparent, outcome: contact marks at its end show where a
// stuck car hangs and on what a tipped one lies, attitude: rows of time, pitch, roll of a trial without a path, pulses: rows
// of time and eight widths. Metres, seconds, radians, microseconds.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { DrivenCar } from "./car.js";
import { make } from "./dom.js";
import { Strips } from "./strips.js";
import { softwareOnly } from "./paint.js";
import { groundGroup, lineOver } from "./surface.js";

export { readGround } from "./ground.js";
export { integerReader, pathOfRows } from "./path.js";

const BACKS = { light: 0xf3f2ee, dark: 0x22252a };
const CAMERAS = { orbit: "around", chase: "chase", side: "side" };
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const MARK = 0xd55e00, MARK_M = 0.006;
const SEEN_M = 0.62, SIDE_M = 1.15;

// Builds the picture, its controls and strips inside element; onTime(t_s, playing) is called after every picture and at every
// stop. Pages use setGround, time, play, pause, now and end_s. plain: with the button and the clock alone.
export const mountScene = (element, options) => new Mounted(element, options);

class Mounted {
  constructor(element, { ground, runs = [], plain = false, onTime = () => {} }) {
    Object.assign(this, { element, onTime, t: 0, end_s: 0, playing: false });
    this.controls();
    try {
      this.view = new View(this.picture);
    } catch {
      this.view = NO_VIEW;
      this.picture.textContent = "Without WebGL a browser draws no car.";
    }
    this.cameras.hidden = plain || this.view === NO_VIEW;
    this.speed.hidden = plain;
    this.strips = plain ? NO_STRIPS : new Strips(element, t => { this.pause(); this.time(t); });
    // In the next frame, because the picture's height follows its width, and an observer may not change what it observes.
    new ResizeObserver(() => requestAnimationFrame(() => this.show())).observe(element);
    this.setGround(ground, runs);
    this.view.camera("orbit");
  }

  // Of the picture, for tests.
  cars() { return this.view.cars; }
  lens() { return this.view.lens; }

  now() { return this.t; }

  controls() {
    this.picture = make("div", { class: "scene-picture" });
    this.button = make("button", { type: "button", onclick: () => (this.playing ? this.pause() : this.play()) });
    this.clock = make("output");
    this.speed = make("select", { "aria-label": "speed" });
    for (const one of SPEEDS) this.speed.add(new Option(`${one}×`, one, one === 1, one === 1));
    this.cameras = make("select", { "aria-label": "camera", onchange: () => this.choose(this.cameras.value) });
    for (const [name, text] of Object.entries(CAMERAS)) this.cameras.add(new Option(text, name));
    this.legend = make("span", { class: "scene-legend" });
    this.element.replaceChildren(this.picture, make("p", { class: "controls scene-controls" }, this.button, this.clock, this.speed, this.cameras, this.legend));
    this.say();
  }

  // Another environment, with the cars that drive in it.
  setGround(ground, runs) {
    this.pause();
    this.runs = runs;
    this.end_s = Math.max(0.05, ...this.runs.map(one => one.path?.end_s ?? one.attitude?.at(-1)?.[0] ?? 0));
    this.legend.replaceChildren(...this.runs.map(({ label, colour, ghost }) => {
      const style = `display:inline-block;width:1.4em;border-top:3px ${ghost ? "dashed" : "solid"} ${colour};margin:0 .35em .25em .8em`;
      return make("span", {}, make("i", { style }), label ?? "");
    }));
    this.view.load(ground, runs);
    this.strips.load(this.runs.filter(one => one.path || one.attitude?.length), this.end_s);
    this.time(this.t);
  }

  time(t) {
    this.t = Math.min(this.end_s, Math.max(0, t));
    this.show();
  }

  show() {
    if (!this.runs) return;
    this.view.draw(this.t);
    this.strips.draw(this.t);
    this.clock.textContent = `${this.t.toFixed(2)} / ${this.end_s.toFixed(2)} s`;
    this.onTime(this.t, this.playing);
  }

  choose(name) {
    this.cameras.value = name;
    this.view.camera(name);
    this.show();
  }

  play() {
    if (this.t >= this.end_s) this.t = 0;
    this.playing = true;
    this.say();
    let before = performance.now();
    const tick = now => {
      if (!this.playing) return;
      const passed = Math.max(0, now - before) / 1000;
      before = now;
      this.time(this.t + passed * Number(this.speed.value));
      if (this.t >= this.end_s) this.pause();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() {
    const wasPlaying = this.playing;
    this.playing = false;
    this.say();
    if (wasPlaying) this.onTime(this.t, false);
  }

  say() {
    this.button.textContent = this.playing ? "❚❚ pause" : "▶ play";
    this.button.setAttribute("aria-pressed", String(this.playing));
  }
}

const NO_STRIPS = { load() {}, draw() {} };
const NO_VIEW = { load() {}, draw() {}, camera() {} };

// The picture by WebGL. Throws an error in a browser without WebGL.
class View {
  constructor(element) {
    const label = "The car in its environment, in three dimensions; drag or use the arrow keys to turn it";
    this.canvas = make("canvas", { tabindex: 0, role: "img", "aria-label": label, style: "display:block;width:100%;touch-action:none" });
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: !softwareOnly() });
    // Reading a program's log would wait until it is compiled.
    this.renderer.debug.checkShaderErrors = false;
    element.append(this.canvas);
    this.scene = new THREE.Scene();
    this.lens = new THREE.PerspectiveCamera(32, 1, 0.02, 60);
    this.lens.up.set(0, 0, 1);
    this.orbit = new OrbitControls(this.lens, this.canvas);
    this.orbit.enableDamping = false;
    this.orbit.listenToKeyEvents(this.canvas);
    this.orbit.addEventListener("change", () => this.render());
    const theme = matchMedia("(prefers-color-scheme: dark)");
    const paint = () => { this.scene.background = new THREE.Color(BACKS[theme.matches ? "dark" : "light"]); this.render(); };
    theme.addEventListener("change", paint);
    this.held = [];
    paint();
  }

  load(ground, runs) {
    this.drop(this.held);
    this.held = [];
    const elsewhere = ground !== this.ground;
    if (elsewhere) {
      if (this.surface) this.drop([this.surface]);
      this.ground = ground;
      this.scene.add(this.surface = groundGroup(ground));
    }
    this.cars = runs.filter(one => one.path).map(one => {
      const car = new DrivenCar(one.car, one.ghost ? one.colour : null), { columns: [x, y] } = one.path;
      const track = lineOver(ground, Array.from(x, (_, row) => [x[row], y[row]]), one.colour, 0.004);
      this.add(car.group, track);
      return { run: one, car, ground, marks: this.marks(car, one, ground) };
    });
    if (this.name && elsewhere) this.camera(this.name);
  }

  add(...objects) {
    this.scene.add(...objects);
    this.held.push(...objects);
  }

  drop(objects) {
    for (const one of objects) {
      this.scene.remove(one);
      // Materials stay, because the next objects need their compiled programs.
      one.traverse(part => part.geometry?.dispose());
    }
  }

  // Where a stuck car touches the ground at its end, its belly before its tyres, or on what a tipped one lies.
  marks(car, { outcome, path }, ground) {
    if (outcome !== "stuck" && outcome !== "tipped") return null;
    car.drive(path.at(path.end_s));
    const found = car.contacts(ground), bellies = found.filter(one => one.kind === "belly");
    const group = new THREE.Group(), material = new THREE.MeshBasicMaterial({ color: MARK, depthTest: false, transparent: true });
    for (const { point } of outcome === "stuck" && bellies.length ? bellies : found) {
      const mark = new THREE.Mesh(new THREE.SphereGeometry(MARK_M, 16, 12), material);
      mark.renderOrder = 1;
      mark.position.copy(point);
      group.add(mark);
    }
    this.add(group);
    return group;
  }

  // The first car, from its start: with the obstacle ahead in sight.
  camera(name) {
    this.name = name;
    this.orbit.enabled = name === "orbit";
    this.canvas.style.touchAction = name === "orbit" ? "none" : "auto";
    this.last = null;
    const first = this.cars?.[0];
    if (!first || name !== "orbit") return;
    const { columns: [x, y, z, heading], rows } = first.run.path, from = new THREE.Vector3(x[0], y[0], z[0]);
    this.last = from;
    const ahead = new THREE.Vector3(Math.cos(heading[0]), Math.sin(heading[0]), 0), right = new THREE.Vector3(ahead.y, -ahead.x, 0);
    const far = new THREE.Vector3(x[rows - 1], y[rows - 1], z[rows - 1]);
    // The car and the first obstacle on its way, at least a car's length ahead.
    const way = Math.min(1.6, Math.max(SEEN_M, this.firstObstacle(first) ?? from.distanceTo(far)));
    const middle = from.clone().addScaledVector(ahead, 0.45 * way);
    const away = 0.95 * way + 0.55;
    this.orbit.target.copy(middle);
    this.lens.position.copy(middle).addScaledVector(right, 0.85 * away).addScaledVector(ahead, -0.35 * away).add(new THREE.Vector3(0, 0, 0.55 * away));
    this.orbit.update();
  }

  // How far ahead of the start the ground under the path first rises or falls by a centimetre, with a car's length added (m).
  firstObstacle({ run: { path, car: { body } } }) {
    const { columns: [x, y, , heading], rows } = path;
    for (let row = 0; row < rows; row++) for (const side of [-0.5, 0, 0.5]) {
      const a = x[row] - side * body.track_m * Math.sin(heading[row]), b = y[row] + side * body.track_m * Math.cos(heading[row]);
      if (Math.abs(this.ground.height(a, b)) > 0.01) return Math.hypot(x[row] - x[0], y[row] - y[0]) + 0.3;
    }
    return null;
  }

  draw(t) {
    for (const { run, car, marks } of this.cars ?? []) {
      car.drive(run.path.at(t));
      if (marks) marks.visible = t > run.path.end_s - 1;
    }
    const width = this.canvas.clientWidth || 320, height = Math.round(Math.min(520, Math.max(240, width * 0.56)));
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    if (this.width !== width || this.height !== height || this.ratio !== ratio) {
      Object.assign(this, { width, height, ratio });
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.canvas.style.height = `${height}px`;
      this.lens.aspect = width / height;
      this.lens.updateProjectionMatrix();
    }
    const first = this.cars?.[0];
    if (first) this.follow(first.run.path.at(t));
    this.render();
  }

  follow({ x, y, z, heading }) {
    const at = new THREE.Vector3(x, y, z), narrow = Math.max(1, 1.3 / this.lens.aspect);
    if (this.name === "orbit") {
      // It goes along with the car once that is out of the middle of the picture.
      if (this.last) {
        const seen = at.clone().project(this.lens);
        const moved = at.clone().sub(this.last);
        if (Math.abs(seen.x) > 0.45 || Math.abs(seen.y) > 0.45) { this.orbit.target.add(moved); this.lens.position.add(moved); this.orbit.update(); }
      }
      this.last = at;
      return;
    }
    const ahead = new THREE.Vector3(Math.cos(heading), Math.sin(heading), 0), up = new THREE.Vector3(0, 0, 1);
    if (this.name === "chase") {
      this.lens.position.copy(at).addScaledVector(ahead, -0.75 * narrow).addScaledVector(up, 0.38 * narrow);
      this.lens.lookAt(at.clone().addScaledVector(ahead, 0.25));
    } else {
      const right = new THREE.Vector3(ahead.y, -ahead.x, 0);
      this.lens.position.copy(at).addScaledVector(right, SIDE_M * narrow).addScaledVector(up, 0.06);
      this.lens.lookAt(at);
    }
  }

  render() {
    if (!this.ratio) return;
    this.renderer.render(this.scene, this.lens);
  }
}
