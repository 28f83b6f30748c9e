// One experiment's replay: a run is chosen in the grid or the lists and is shown from above, from the side and from behind.

const CALM = matchMedia("(prefers-reduced-motion: reduce)").matches;

class Replay {
  constructor(section, outcomes) {
    this.section = section;
    this.data = JSON.parse(section.querySelector("script[type='application/json']").textContent);
    this.outcomes = outcomes;
    this.key = section.dataset.key;
    this.labels = this.data.designs.map((design) => designLabel(design, this.data.varied));
    const part = (name) => section.querySelector(`[data-part='${name}']`);
    this.parts = Object.fromEntries(
      ["grid", "told", "design", "sample", "ghost", "title", "top", "side", "rear", "strip", "pulses", "play", "scrub", "speed", "clock", "hardest", "trials", "stage"].map(
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
    if (this.parts.stage) this.prepareStage();
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

  prepareStage() {
    this.player = new Player(this.parts, (t) => this.show(t));
    this.parts.ghost.addEventListener("change", () => this.load(this.player.t, false));
    this.parts.strip.addEventListener("pointerdown", (event) => {
      this.parts.strip.setPointerCapture(event.pointerId);
      this.player.stop();
      this.player.seek(stripTime(this.parts.strip, event, this.player.end_s));
    });
    this.parts.strip.addEventListener("pointermove", (event) => {
      if (event.buttons) this.player.seek(stripTime(this.parts.strip, event, this.player.end_s));
    });
    addEventListener("resize", () => {
      this.grid.draw();
      if (this.drives) this.show(this.player.t);
    });
  }

  // Shows a run; play: at once, unless motion is unwanted.
  async choose(design, row, play = false, t = 0) {
    this.grid.select(design, row);
    this.parts.design.value = design;
    this.parts.sample.value = row;
    this.parts.told.textContent = this.grid.text(design, row);
    if (!this.parts.stage) return;
    this.offerGhosts(design, row);
    await this.load(t, play && !CALM);
  }

  // Trials of this cell, then the other designs in the same environment.
  offerGhosts(design, row) {
    const { ghost } = this.parts;
    const before = ghost.value;
    ghost.replaceChildren(new Option("nothing", ""));
    for (const trial of this.data.trials ?? [])
      if (trial.design === design && this.data.samples.indexOf(trial.sample) === row)
        ghost.add(new Option(`trial ${trial.id} (${trial.car}): ${trial.outcome.replace("_", " ")}`, `trial-${trial.id}`));
    this.labels.forEach((text, index) => {
      if (index !== design && this.data.cars[index]) ghost.add(new Option(text, `design-${index}`));
    });
    const trial = [...ghost.options].find((option) => option.value.startsWith("trial-"));
    const kept = [...ghost.options].find((option) => option.value === before && before.startsWith("design-"));
    ghost.value = (trial ?? kept)?.value ?? "";
  }

  async load(t, play) {
    const [design, row] = this.grid.chosen;
    const sample = this.data.samples[row];
    const asked = (this.asked = {});
    const [runs, ground, ghost] = await Promise.all([
      readPaths(`${this.key}-runs-${design}`, this.data.units),
      readGround(`${this.key}-scene-${sample}`, this.data.ground, this.data.units),
      this.readGhost(sample),
    ]);
    // Another run was chosen meanwhile.
    if (asked !== this.asked) return;
    const path = runs.get(sample);
    this.parts.stage.hidden = !path;
    this.parts.title.textContent = `${this.grid.text(design, row, path?.end_s)}. ${path ? ghost.note : "This run has no replay."}`;
    if (!path) {
      this.drives = null;
      this.player.stop();
      return;
    }
    const car = this.data.cars[design];
    this.drives = [{ path, car, colour: RUN_COLOUR, ghost: false }];
    if (ghost.path) this.drives.push({ path: ghost.path, car: ghost.car ?? car, colour: GHOST_COLOUR, ghost: true });
    this.attitude = ghost.attitude ?? [];
    this.ground = ground;
    this.window = topWindow(ground, this.drives.map((drive) => drive.path));
    this.profile = groundProfile(path, car, ground);
    this.player.load(Math.max(...this.drives.map((drive) => drive.path.end_s)));
    this.player.seek(t);
    if (play) this.player.play();
  }

  // {path, car, attitude, note} of what is laid over the run.
  async readGhost(sample) {
    const [kind, number] = this.parts.ghost.value.split("-");
    if (kind === "design") {
      const path = (await readPaths(`${this.key}-runs-${number}`, this.data.units)).get(sample);
      if (!path) return { note: `${this.labels[number]} has no replay in this environment.` };
      return { path, car: this.data.cars[number], note: `Dashed: ${this.labels[number]} in the same environment.` };
    }
    if (kind !== "trial") return { note: "" };
    const trial = this.data.trials.find((one) => one.id === Number(number));
    const moved = trial.moved ? " Obstacles or car stood elsewhere than planned in the trial." : "";
    if (trial.attitude.length) return { attitude: trial.attitude, note: `Trial ${number}: roll and pitch as its sensor felt them, dotted.${moved}` };
    if (!trial.path) return { note: `Trial ${number} is not drawn: ${trial.missing}.` };
    const path = (await readPaths(`${this.key}-trial-${number}`, this.data.units)).get(0);
    return { path, note: `Dashed: trial ${number} of a ${trial.car} car, from its log.${moved}` };
  }

  show(t) {
    if (!this.drives) return;
    const [{ path, car }] = this.drives;
    const view = drawScene(this.parts.top, this.ground, this.window, 340);
    for (const drive of [...this.drives].reverse()) drawCarFromAbove(view, drive.path, drive.car, t, drive.colour, drive.ghost);
    drawSide(this.parts.side, this.profile, this.drives, t);
    drawRear(this.parts.rear, this.ground, this.drives, t);
    drawStrip(this.parts.strip, this.angles(), t, this.player.end_s);
    drawPulses(this.parts.pulses, car, Math.min(t, path.end_s));
    const at = path.at(t);
    Object.assign(this.section.dataset, { t: t.toFixed(3), x: at.x.toFixed(4), y: at.y.toFixed(4), roll: at.roll.toFixed(4), end: path.end_s });
  }

  angles() {
    const series = [];
    for (const { path, ghost } of this.drives)
      for (const [column, colour] of [[5, ghost ? GHOST_COLOUR : RUN_COLOUR], [4, ghost ? "#e69f00" : "#009e73"]]) {
        const points = Array.from(path.columns[column], (angle, row) => [path.time(row), angle]);
        series.push({ colour, dash: ghost ? [4, 3] : [], points });
      }
    if (this.attitude.length) {
      series.push({ colour: GHOST_COLOUR, dash: [2, 2], points: this.attitude.map(([time, , roll]) => [time, roll]) });
      series.push({ colour: "#e69f00", dash: [2, 2], points: this.attitude.map(([time, pitch]) => [time, pitch]) });
    }
    return series;
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
