// A worker of simulators.js: one simulator. Messages in: {module, engine} first, then {lines}; out: {build} first, then {answers}.

import { Carsim } from "../../simulation/web/carsim.js";

let carsim = null;

self.onmessage = ({ data }) => {
  if (data.module) {
    carsim = new Carsim(data.module, data.engine);
    self.postMessage({ build: JSON.parse(carsim.table("--version")).build });
    return;
  }
  self.postMessage({ answers: data.lines.map(line => carsim.batch(line)).filter(answer => answer !== null) });
};
// Else the page would wait for a simulator for ever.
self.onmessageerror = () => { throw new Error("the simulator did not reach it"); };
