// A worker of drives.js: one simulator. Messages in: {module, engine} first, then {lines}; out: {build} first, then {answers}.

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
