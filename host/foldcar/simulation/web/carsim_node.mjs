// carsim for systems without a native one: `node carsim_node.mjs CARSIM.WASM [--side-view] COMMAND` answers as carsim does.
//
// Commands: batch, step (lines in, lines out), params, metrics, limits, --version.
import { readFileSync, readSync, writeSync } from "node:fs";

import { Carsim } from "./carsim.js";

function usageError(problem) {
  process.stderr.write(`carsim: ${problem}\n`);
  process.exit(2);
}

// The lines of standard input, read when they are wanted.
function* inputLines() {
  const buffer = Buffer.alloc(1 << 16);
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    let size = 0;
    try {
      size = readSync(0, buffer);
    } catch (error) {
      if (error.code === "EAGAIN") continue;
      if (error.code !== "EOF") throw error;
    }
    if (!size) break;
    const lines = (rest + decoder.decode(buffer.subarray(0, size), { stream: true })).split("\n");
    rest = lines.pop();
    yield* lines;
  }
  if (rest) yield rest;
}

function write(text) {
  const bytes = Buffer.from(text + "\n");
  for (let at = 0; at < bytes.length; ) {
    try {
      at += writeSync(1, bytes, at);
    } catch (error) {
      if (error.code !== "EAGAIN") throw error;
    }
  }
}

function serve(carsim, command) {
  let anyError = false;
  for (const line of inputLines()) {
    if (!line.trim()) {
      carsim.line++;
      continue;
    }
    const answer = carsim[command](line);
    if (answer === null) continue;
    anyError ||= answer.startsWith('{"error":');
    write(answer);
  }
  return anyError ? 2 : 0;
}

const [file, ...words] = process.argv.slice(2);
const engineWord = words[0] === "--side-view" ? words.shift() : "";
const carsim = new Carsim(new WebAssembly.Module(readFileSync(file)), engineWord);
const command = words[0] ?? usageError("no command");
try {
  if (command === "batch" || command === "step") {
    process.exitCode = serve(carsim, command);
  } else {
    write(carsim.table(command) ?? usageError(`unknown command ${command}`));
  }
} catch (error) {
  // The reader has gone.
  if (error.code === "EPIPE") process.exit(1);
  throw error;
}
