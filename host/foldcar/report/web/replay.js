// One experiment's replay: a run is chosen in the grid or the lists and is shown as it moved.

class Replay {
  constructor(section, outcomes) {
    this.section = section;
    this.data = JSON.parse(section.querySelector("script[type='application/json']").textContent);
    this.outcomes = outcomes;
    this.key = section.dataset.key;
    this.labels = this.data.designs.map((design) => designLabel(design, this.data.varied));
    const part = (name) => section.querySelector(`[data-part='${name}']`);
    this.parts = Object.fromEntries(
      ["grid", "told", "design", "sample", "hardest", "stage"].map(
        (name) => [name, part(name)],
      ),
    );
    this.fillLists();
    this.grid = new HeatGrid(
      this.parts.grid,
      this.data,
      outcomes,
      this.labels,
      (design, row) => this.choose(design, row, true),
      (text) => (this.parts.told.textContent = text || this.grid.text(...this.grid.chosen)),
    );
    this.parts.hardest?.addEventListener("change", () => this.grid.sort(this.parts.hardest.checked));
    this.grid.chosen = this.firstCell();
    this.grid.draw();
    this.parts.told.textContent = this.grid.text(...this.grid.chosen);
    addEventListener("resize", () => this.grid.draw());
    if (this.parts.stage) this.place = new ReplayPlace(this.parts.stage, this.model());
  }

  // The experiment as replay_place.js takes it.
  model() {
    const { places, runs, units, trials } = this.data, name = [];
    places.forEach((place, index) => { name[place] = this.labels[index]; });
    const replay = new Map(runs.map((one) => [`${one.design}/${one.environment}`, one]));
    return { e: { id: this.key, designs: { name }, replay, replayed: { key: this.key, units, trials } }, state: {}, write() {} };
  }

  fillLists() {
    const { design, sample } = this.parts;
    this.labels.forEach((text, index) => design.add(new Option(text, index)));
    this.data.samples.forEach((number, row) => sample.add(new Option(number, row)));
    for (const list of [design, sample])
      list.addEventListener("change", () => this.choose(Number(design.value), Number(sample.value), true));
    for (const button of this.section.querySelectorAll("[data-outcome]"))
      button.addEventListener("click", () => this.choose(...this.exampleOf(Number(button.dataset.outcome)), true));
  }

  // A run that did not pass where most do: it says most about the designs. Else the first run.
  firstCell() {
    let best = [0, 0];
    let least = Infinity;
    this.data.cells.forEach((column, design) => {
      const passed = [...column].filter((cell) => cell === "1").length / column.length;
      const row = [...column].findIndex((cell) => cell > "1");
      if (row >= 0 && passed < 1 && Math.abs(passed - 0.75) < least) [best, least] = [[design, row], Math.abs(passed - 0.75)];
    });
    return best;
  }

  // The next run that ended so, after the one that is shown.
  exampleOf(code) {
    const rows = this.data.samples.length;
    const all = this.data.designs.length * rows;
    const from = this.grid.chosen[0] * rows + this.grid.chosen[1];
    // A stride that meets every cell and leads through the designs.
    for (let step = 1; step <= all; step++) {
      const at = (from + step) % all;
      const cell = [Math.floor(at / rows), at % rows];
      if (this.grid.code(...cell) === code) return cell;
    }
    return this.grid.chosen;
  }

  // Shows a run; play: at once, unless motion is unwanted.
  async choose(design, row, play = false, t = 0) {
    this.grid.select(design, row);
    this.parts.design.value = design;
    this.parts.sample.value = row;
    this.parts.told.textContent = this.grid.text(design, row);
    await this.place?.show(this.data.places[design], this.data.samples[row], t, play);
  }
}

// "width 95 mm" from {width_mm: 95}; only what varies.
function designLabel(design, varied) {
  const named = varied.map((name) => {
    const unit = name.match(/_(mm|m|deg|rad|kg|g|s)$/);
    return `${name.slice(0, unit ? unit.index : undefined).replaceAll("_", " ")} ${design[name]}${unit ? ` ${unit[1]}` : ""}`;
  });
  return named.join(", ") || "the design";
}
