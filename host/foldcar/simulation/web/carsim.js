// Loads carsim.wasm: the simulator with the cars' firmware, as a function from lines to answers (docs/carsim.md).
//
// `module` is a compiled WebAssembly.Module, `engineWord` "--side-view" or "" for multibody. The module calls only its own
// code and these few system functions: it reads no clock and no file, and writes nothing.
const system = {
  env: { emscripten_notify_memory_growth() {} },
  wasi_snapshot_preview1: {
    clock_time_get: () => 0,
    fd_write: () => 0,
    fd_close: () => 0,
    fd_seek: () => 0,
    proc_exit(code) {
      throw new Error(`carsim ended with exit code ${code}`);
    },
  },
};

export class Carsim {
  constructor(module, engineWord = "") {
    this.exports = new WebAssembly.Instance(module, system).exports;
    this.exports._initialize();
    this.line = 0;
    if (engineWord && !this.call("carsim_engine", engineWord)) throw new Error(`carsim: unknown engine ${engineWord}`);
  }

  // What `carsim NAME` prints: params, metrics, limits, --version. Null for another name.
  table(name) {
    return this.text(this.call("carsim_table", name));
  }

  // The answer to a line of `carsim batch`; null if the line has none.
  batch(line) {
    return this.text(this.call("carsim_batch", line, ++this.line));
  }

  // The answer to a line of `carsim step`; null if the line has none.
  step(line) {
    return this.text(this.call("carsim_step", line, ++this.line));
  }

  call(name, line, ...before) {
    const bytes = new TextEncoder().encode(line + "\0");
    const at = this.exports.malloc(bytes.length);
    try {
      new Uint8Array(this.exports.memory.buffer).set(bytes, at);
      return this.exports[name](...before, at);
    } finally {
      this.exports.free(at);
    }
  }

  text(at) {
    if (!at) return null;
    const memory = new Uint8Array(this.exports.memory.buffer);
    return new TextDecoder().decode(memory.subarray(at, memory.indexOf(0, at)));
  }
}
