// Where the chosen run is shown as it moved, with other designs and trials of its environment laid over it.
//
// Of an experiment: replays, rows {design, environment, outcome, blob}; replay, {key, units}, where key begins the names of its
// blobs: KEY-runs-DESIGN, KEY-car-DESIGN, KEY-pieces, KEY-scene-ENVIRONMENT, KEY-trial-NUMBER (replay.py).

import { compactPath, integerReader, mountScene, readGround } from "../../figures/web/scene.js";
import { byId, make } from "../../figures/web/dom.js";

const COLOUR = "#0072b2";
const GHOSTS = ["#cc79a7", "#009e73", "#e69f00", "#56b4e9", "#d55e00"];
const CALM = matchMedia("(prefers-reduced-motion: reduce)").matches;

export class ReplayPlace {
  // model: {e: the experiment, state, write()}; e.replay of data.js maps "DESIGN/ENVIRONMENT" to rows of replays.
  constructor(element, model) {
    Object.assign(this, { element, model, over: new Set(), grounds: new Map(), scene: null });
    this.note = make("p", { class: "note" });
    this.add = make("select", { onchange: () => this.lay(this.add.value) });
    this.label = make("label", { class: "ghost" }, "lay over ", this.add);
    this.place = make("div");
    element.replaceChildren(this.note, this.place, this.label);
  }

  // The run of a design in an environment, by their indices, at t; play: at once, unless motion is unwanted.
  async show(design, environment, t = 0, play = false) {
    const { e } = this.model, key = `${e.id} ${design}/${environment}`;
    if (this.shown === key) {
      if (this.scene && !this.busy) this.scene.time(t);
      return;
    }
    this.shown = key;
    const found = this.entry(design, environment);
    Object.assign(this, { design, environment });
    this.element.hidden = design === null || environment === null;
    this.place.hidden = this.label.hidden = !found;
    this.note.textContent = found ? "" : this.element.hidden ? "" : "This run has no replay.";
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

  entry(design, environment) { return this.model.e.replay.get(`${design}/${environment}`); }

  trials() { return this.model.e.trials.filter(one => one.design === this.design && one.environment === this.environment); }

  // Lays another run over this one, or takes it away.
  lay(name) {
    if (name === "none") this.over.clear();
    else if (this.over.has(name)) this.over.delete(name);
    else if (name) this.over.add(name);
    this.load(this.scene.now());
  }

  async load(t) {
    const asked = (this.asked = {}), { design, environment } = this, { key } = this.model.e.replayed;
    this.busy = true;
    const overs = [...this.over].slice(-GHOSTS.length);
    const [ground, first, ...others] = await Promise.all([
      this.ground(`${key}-scene-${environment}`), this.run(design, environment),
      ...overs.map((one, index) => (one.startsWith("d") ? this.run(Number(one.slice(1)), environment, GHOSTS[index]) : this.trial(Number(one.slice(1)), GHOSTS[index]))),
    ]);
    // Another run was chosen meanwhile.
    if (asked !== this.asked) return;
    if (first && overs.some(one => one.startsWith("t"))) first.label += ", simulated";
    const runs = [first, ...others.filter(one => one && (one.path || one.attitude?.length))];
    this.note.textContent = others.map(one => one?.note).filter(Boolean).join(" ");
    if (this.scene) this.scene.setGround(ground, runs);
    else this.scene = mountScene(this.place, { ground, runs, onTime: (at, playing) => this.told(at, playing) });
    this.offer();
    this.busy = false;
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

  ground(name) {
    if (!this.grounds.has(name)) this.grounds.set(name, readBlob(name).then(({ head, bytes }) => readGround(head, integerReader(bytes))));
    return this.grounds.get(name);
  }

  // A run as the scene takes it; a ghost has a colour of its own. Null without a replay.
  async run(design, environment, ghost = null) {
    const found = this.entry(design, environment), { key, units } = this.model.e.replayed;
    if (!found) return null;
    const [blob, car] = await Promise.all([readBlob(`${key}-${found.blob}`), this.car(design)]);
    const path = pathOf(blob, environment, units);
    return { design, label: this.model.e.designs.name[design], colour: ghost ?? COLOUR, ghost: ghost !== null, outcome: found.outcome, path, car, pulses: car.pulses };
  }

  // A design as car.js takes it, with its pulses.
  async car(design) {
    const { key } = this.model.e.replayed, [pieces, car] = await Promise.all([readBlob(`${key}-pieces`), readBlob(`${key}-car-${design}`)]);
    const { body, parts, pulses } = car.head;
    return { body, pulses, shape: parts && { pieces: pieces.head, parts } };
  }

  async trial(number, colour) {
    const { key, units } = this.model.e.replayed, trial = this.model.e.trials.find(one => one.number === number), drawn = trial.replay;
    const moved = drawn.moved ? " Obstacles or car stood elsewhere than planned." : "", film = drawn.film_error;
    const label = `trial ${number}, ${film ? "filmed" : `${trial.standing} car`}`;
    if (drawn.attitude.length) return { label, colour, ghost: true, attitude: drawn.attitude, note: `Trial ${number}: roll and pitch as its sensor felt them.${moved}` };
    if (!drawn.path) return { note: `Trial ${number} is not drawn: ${drawn.missing}.` };
    const [blob, car] = await Promise.all([readBlob(`${key}-trial-${number}`), this.car(this.design)]);
    const source = film ? `as filmed: place known to ${(1000 * film[0]).toFixed(0)} mm, start to ${(1000 * film[1]).toFixed(0)} ms` : "from its log";
    return { label, colour, ghost: true, path: pathOf(blob, 0, units), car, note: `Trial ${number} of a ${trial.standing} car, ${source}.${moved}` };
  }

  // What can be laid over: trials of this run, then the other designs in the same environment.
  offer() {
    const sign = name => (this.over.has(name) ? "✓ " : "");
    this.add.replaceChildren(new Option("…", ""), new Option("nothing", "none"),
      ...this.trials().map(({ number, outcome }) => new Option(`${sign(`t${number}`)}trial ${number}: ${outcome}`, `t${number}`)),
      ...this.model.e.designs.name.flatMap((name, design) => (design !== this.design && this.entry(design, this.environment) ? [new Option(`${sign(`d${design}`)}${name}`, `d${design}`)] : [])));
  }
}

function pathOf({ head, bytes }, sample, units) {
  const read = integerReader(bytes);
  for (const [number, rows, end_s] of head.runs) {
    if (number === sample) return compactPath(read, rows, head.hinges, end_s, units);
    for (let skipped = rows * (6 + head.hinges); skipped > 0; skipped--) read();
  }
  return null;
}

// Blobs of replay.py: base64 of a deflated JSON line and bytes, decoded when they are first wanted.
const decoded = new Map();

// {head, bytes} of a blob; null if the page has none of that name.
function readBlob(name) {
  if (!decoded.has(name)) {
    const element = byId(name);
    decoded.set(name, element ? inflate(element.textContent.trim()) : Promise.resolve(null));
  }
  return decoded.get(name);
}

async function inflate(base64) {
  const packed = Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  const whole = new Uint8Array(await new Response(stream).arrayBuffer());
  const end = whole.indexOf(10);
  return { head: JSON.parse(new TextDecoder().decode(whole.subarray(0, end))), bytes: whole.subarray(end + 1) };
}
