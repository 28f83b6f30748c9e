// A worker of simulators.js: one simulator. Messages in: {module, engine} first, then {lines}; out: {build} first, then {answers}.
// While it computes answers it sends {busy: true} after a run, about once a second, so that the page knows it has not stopped.

import { Carsim } from "../../simulation/web/carsim.js";

const BUSY_MS = 1000;
let carsim = null;

self.onmessage = ({ data }) => {
  if (data.module) {
    carsim = new Carsim(data.module, data.engine);
    self.postMessage({ build: JSON.parse(carsim.table("--version")).build });
    return;
  }
  let sent_ms = performance.now();
  const answers = data.lines.map(line => {
    const answer = carsim.batch(line);
    if (performance.now() - sent_ms > BUSY_MS) {
      self.postMessage({ busy: true });
      sent_ms = performance.now();
    }
    return answer;
  });
  self.postMessage({ answers: answers.filter(answer => answer !== null) });
};
// Else the page would wait for a simulator for ever.
self.onmessageerror = () => { throw new Error("the simulator did not reach it"); };
