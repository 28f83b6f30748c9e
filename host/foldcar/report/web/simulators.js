// Simulators that run in this page: carsim.wasm in workers, and the page's packed data. Errors say what the browser lacks.

import { byId } from "../../figures/web/dom.js";

// What a reader is told in the place where an answer was to appear.
export const cannotSimulate = error => `The page cannot simulate: ${error.message}.`;

// Blobs of drives.py, decoded when they are first wanted: {head, bytes}; null if the page has none of that name.
const decoded = new Map();

export function readBlob(name) {
  if (!decoded.has(name)) {
    const element = byId(name);
    decoded.set(name, element ? inflate(element.textContent.trim()).then(split) : Promise.resolve(null));
  }
  return decoded.get(name);
}

async function inflate(base64) {
  const packed = Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(decompression());
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function decompression() {
  try {
    return new DecompressionStream("deflate-raw");
  } catch {
    throw new Error("this browser cannot unpack its data (DecompressionStream), which Chrome 103, Firefox 113, Safari 16.4 and later ones can");
  }
}

function split(whole) {
  const end = whole.indexOf(10);
  return { head: JSON.parse(new TextDecoder().decode(whole.subarray(0, end))), bytes: whole.subarray(end + 1) };
}

// The module is compiled once for all experiments.
let compiled = null;
const compileCarsim = () => (compiled ??= compile());

async function compile() {
  if (typeof WebAssembly === "undefined") throw new Error("this browser has no WebAssembly, or it is switched off (Safari's Lockdown Mode does so)");
  const bytes = await inflate(byId("carsim").textContent.trim());
  return WebAssembly.compile(bytes).catch(({ message }) => { throw new Error(`this browser refuses the simulator (${message})`); });
}

// Seconds that a worker may take for its start, or for a run beside its simulated time. A run is simulated many times faster than
// it would drive, on slow machines too: a worker that takes longer will not answer.
const START_S = 30;

// Simulators in workers, one for each thread of the machine. Tasks of a higher priority run first.
class Pool {
  // `ready` resolves when the first simulator has started; `build` is then its build. It rejects if none starts.
  constructor(engine) {
    Object.assign(this, { tasks: [], simulators: [], starting: 0, failure: null, waited: new Set(), clock: null });
    this.ready = this.start(engine);
  }

  async start(engine) {
    const module = await compileCarsim();
    const url = URL.createObjectURL(new Blob([byId("worker").textContent], { type: "text/javascript" }));
    this.starting = Math.max(1, navigator.hardwareConcurrency || 2);
    const starts = Array.from({ length: this.starting }, () => this.startWorker(url, module, engine).finally(() => { this.starting -= 1; this.startTasks(); }));
    Promise.allSettled(starts).then(() => URL.revokeObjectURL(url));
    await Promise.any(starts).catch(({ errors }) => { throw errors[0]; });
  }

  startWorker(url, module, engine) {
    return new Promise((resolve, reject) => {
      const simulator = { worker: null, known: new Set(), task: null, fail: null };
      try {
        simulator.worker = new Worker(url);
      } catch ({ message }) {
        this.failure = new Error(`this browser starts no worker here (${message})`);
        reject(this.failure);
        return;
      }
      simulator.fail = text => {
        this.failure = new Error(text);
        reject(this.failure);
        this.remove(simulator);
      };
      simulator.worker.onerror = event => {
        event.preventDefault();
        simulator.fail(`a worker failed (${event.message || "this browser refuses it"})`);
      };
      // Chromium has this event of a worker, but no property onmessageerror.
      simulator.worker.addEventListener("messageerror", () => simulator.fail("a worker's answer could not be read"));
      simulator.worker.onmessage = ({ data }) => {
        if (data.busy) {
          simulator.silent_s = 0;
          return;
        }
        this.waited.delete(simulator);
        if (data.build) {
          this.build = data.build;
          this.simulators.push(simulator);
          resolve();
        } else {
          const { task } = simulator;
          simulator.task = null;
          task.resolve(data.answers.map(text => JSON.parse(text)));
        }
        this.startTasks();
      };
      this.wait(simulator, START_S);
      simulator.worker.postMessage({ module, engine });
    });
  }

  // Gives up a simulator that is silent for longer than this. Seconds are ticks of this page, so that the sleep of a computer
  // does not count.
  wait(simulator, limit_s) {
    Object.assign(simulator, { silent_s: 0, limit_s });
    this.waited.add(simulator);
    this.clock ??= setInterval(() => {
      for (const late of [...this.waited].filter(waited => ++waited.silent_s > waited.limit_s)) late.fail(`a worker did not answer within ${late.limit_s.toFixed(0)} s`);
      if (this.waited.size) return;
      clearInterval(this.clock);
      this.clock = null;
    }, 1000);
  }

  // Answers to the run lines, each of which ends after limit_s of simulated time at the latest. definitions: by name of a body or
  // scene, a function that returns its line, which a simulator gets before the first run that uses it.
  answers(definitions, lines, limit_s, priority, group) {
    return new Promise((resolve, reject) => {
      this.tasks.push({ definitions, lines, limit_s, priority, group, resolve, reject, failed: false });
      this.tasks.sort((a, b) => b.priority - a.priority);
      this.startTasks();
    });
  }

  // Forgets tasks of a group that have not begun; their promises stay open.
  drop(group) { this.tasks = this.tasks.filter(task => task.group !== group); }

  // The others go on without a simulator that failed. Its task is tried once more, because the fault may be the task's own.
  remove(simulator) {
    const { worker, task } = simulator;
    worker.terminate();
    this.waited.delete(simulator);
    this.simulators = this.simulators.filter(other => other !== simulator);
    if (task?.failed) task.reject(this.failure);
    else if (task) this.tasks.unshift(Object.assign(task, { failed: true }));
    this.startTasks();
  }

  startTasks() {
    if (!this.simulators.length && !this.starting) for (const task of this.tasks.splice(0)) task.reject(this.failure);
    for (const simulator of this.simulators) {
      if (simulator.task || !this.tasks.length) continue;
      const task = (simulator.task = this.tasks.shift()), unknown = [...task.definitions].filter(([name]) => !simulator.known.has(name));
      for (const [name] of unknown) simulator.known.add(name);
      this.wait(simulator, START_S + task.limit_s);
      simulator.worker.postMessage({ lines: [...unknown.map(([, line]) => line()), ...task.lines] });
    }
  }
}

const pools = new Map();

export function poolOf(engine) {
  if (!pools.has(engine)) pools.set(engine, new Pool(engine));
  return pools.get(engine);
}
