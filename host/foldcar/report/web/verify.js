// Simulates all runs of an experiment again and compares them with the stored ones, bit by bit.

import { LATER } from "./drives.js";
import { cannotSimulate } from "./simulators.js";
import { byId, make } from "../../figures/web/dom.js";

const MAX_NAMED = 5;
const START = "simulate all runs again in this page";

export class Verify {
  constructor(model) { this.model = model; }

  use() {
    const { e } = this.model, place = byId("verify");
    this.stop();
    place.hidden = !e.drives || !e.runs;
    if (place.hidden) return;
    this.button = make("button", { type: "button", text: START, onclick: () => (this.group ? this.stop() : this.start()) });
    this.bar = make("progress", { max: "1", hidden: true });
    this.text = make("span", { role: "status" });
    place.replaceChildren(this.button, " ", this.bar, " ", this.text);
  }

  stop(text = "stopped") {
    if (!this.group) return;
    this.group.drives.drop(this.group);
    this.group = null;
    this.button.textContent = START;
    this.bar.hidden = true;
    this.text.textContent = text;
  }

  async start() {
    const group = (this.group = { drives: this.model.drives });
    this.button.textContent = "stop";
    this.text.textContent = "";
    this.bar.hidden = false;
    try {
      await this.simulate(group);
    } catch (error) {
      if (group === this.group) this.stop(cannotSimulate(error));
    }
  }

  async simulate(group) {
    const { e, drives } = this.model, begun = performance.now(), differing = [];
    await drives.ready();
    const pairs = drives.pairs, byEnvironment = new Map();
    for (const [design, environment] of pairs) byEnvironment.set(environment, [...(byEnvironment.get(environment) ?? []), design]);
    let done = 0;
    await Promise.all([...byEnvironment].map(async ([environment, designs]) => {
      const answers = await drives.simulate(designs, environment, { priority: LATER, group });
      if (group !== this.group) return;
      answers.forEach((answer, k) => { if (drives.agrees(designs[k], environment, answer) === false) differing.push([designs[k], environment, answer]); });
      done += designs.length;
      this.bar.value = done / pairs.length;
      this.text.textContent = `${done.toLocaleString("en")} of ${pairs.length.toLocaleString("en")}`;
    }));
    if (group !== this.group) return;
    const same = pairs.length - differing.length, seconds = (performance.now() - begun) / 1000;
    const named = differing.slice(0, MAX_NAMED).map(([design, environment]) => `${e.designs.name[design]} in environment ${environment}`).join(", ");
    const reason = differing.length ? ` These differ: ${named}${differing.length > MAX_NAMED ? ", …" : ""}. ${drives.reasonOfDifference()}` : "";
    this.stop(`${differing.length ? "✗" : "✓"} ${same.toLocaleString("en")} of ${pairs.length.toLocaleString("en")} runs reproduced by this page, bit by bit (carsim ${drives.pool.build}, ${seconds.toFixed(0)} s).${reason}`);
  }
}
