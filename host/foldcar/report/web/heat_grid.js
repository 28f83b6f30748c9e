// The grid of all runs: a column for each design, a row for each environment, coloured by how the run ended.

class HeatGrid {
  // data: an experiment's object (replay.py); outcomes: [{label, colour}] by code; choose(design, row) is called on a choice.
  constructor(canvas, data, outcomes, labels, choose, told) {
    Object.assign(this, { canvas, data, outcomes, labels, choose, told });
    this.order = data.samples.map((_, row) => row);
    this.chosen = [0, 0];
    this.trials = new Map();
    for (const trial of data.trials ?? []) {
      const row = data.samples.indexOf(trial.environment);
      if (trial.design !== null && row >= 0) this.trials.set(`${data.places.indexOf(trial.design)} ${row}`, trial);
    }
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("click", (event) => {
      const cell = this.cellAt(event);
      if (cell) this.choose(...cell);
    });
    canvas.addEventListener("pointermove", (event) => {
      const cell = this.cellAt(event);
      this.told(cell ? this.text(...cell) : "");
    });
    canvas.addEventListener("pointerleave", () => this.told(""));
  }

  code(design, row) {
    return this.data.cells[design].charCodeAt(row) - 48;
  }

  // A run in words, with its time if it is known.
  text(design, row, end_s = null) {
    const code = this.code(design, row);
    const ended = (code ? this.outcomes[code - 1].label : "no run") + (end_s === null ? "" : ` after ${end_s.toFixed(2)} s`);
    const trial = this.trials.get(`${design} ${row}`);
    return `${this.labels[design]}, environment ${this.data.samples[row]}: ${ended}${trial ? `; trial ${trial.number}: ${trial.outcome.replace("_", " ")}` : ""}`;
  }

  // Hardest environments first, or as they were sampled.
  sort(hardest) {
    const passed = this.data.samples.map((_, row) => this.data.cells.reduce((sum, column) => sum + (column[row] === "1"), 0));
    this.order = this.data.samples.map((_, row) => row);
    if (hardest) this.order.sort((a, b) => passed[a] - passed[b] || a - b);
    this.draw();
  }

  select(design, row) {
    this.chosen = [design, row];
    this.draw();
  }

  measure() {
    const width = this.canvas.clientWidth || 320;
    const left = 34;
    const rows = this.data.samples.length;
    const column = (width - left - 2) / this.data.designs.length;
    const row = Math.max(3, Math.min(22, Math.floor(470 / rows)));
    return { width, left, column, row, height: rows * row + 2, foot: 22 };
  }

  draw() {
    const at = this.measure();
    const context = freshContext(this.canvas, at.height + at.foot);
    const gap = at.column > 5 && at.row > 3 ? 1 : 0;
    this.order.forEach((row, line) => {
      for (let design = 0; design < this.data.designs.length; design++) {
        const code = this.code(design, row);
        context.fillStyle = code ? this.outcomes[code - 1].colour : "#ffffff";
        context.fillRect(at.left + design * at.column, 1 + line * at.row, at.column - gap, at.row - gap);
        if (this.trials.has(`${design} ${row}`)) this.mark(context, at, design, line);
      }
    });
    this.axes(context, at);
    const [design, row] = this.chosen;
    const line = this.order.indexOf(row);
    for (const [colour, width] of [["#ffffff", 4], [INK, 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.strokeRect(at.left + design * at.column - 1, line * at.row, at.column + 2 - gap, at.row + 2 - gap);
    }
  }

  mark(context, at, design, line) {
    const [x, y] = [at.left + (design + 0.5) * at.column, 1 + (line + 0.5) * at.row];
    context.lineWidth = 1;
    polygon(context, [[x, y - 4], [x + 4, y], [x, y + 4], [x - 4, y]], "#ffffff", INK);
  }

  axes(context, at) {
    context.fillStyle = INK;
    context.textBaseline = "middle";
    context.textAlign = "right";
    const every = roundStep(Math.max(1, 24 / at.row));
    this.order.forEach((row, line) => {
      if (line % every === 0) context.fillText(String(this.data.samples[row]), at.left - 5, 1 + (line + 0.5) * at.row);
    });
    context.textAlign = "center";
    const [name] = this.data.varied;
    if (this.data.varied.length !== 1) return;
    let free = -Infinity;
    this.data.designs.forEach((design, index) => {
      const x = at.left + (index + 0.5) * at.column;
      const text = String(design[name]);
      const half = context.measureText(text).width / 2;
      if (x - half < free + 6 || x + half > at.width + 1) return;
      context.fillText(text, x, at.height + 11);
      free = x + half;
    });
  }

  cellAt(event) {
    const at = this.measure();
    const box = this.canvas.getBoundingClientRect();
    const design = Math.floor((event.clientX - box.left - at.left) / at.column);
    const line = Math.floor((event.clientY - box.top - 1) / at.row);
    return design >= 0 && design < this.data.designs.length && line >= 0 && line < this.order.length ? [design, this.order[line]] : null;
  }

  key(event) {
    const [design, row] = this.chosen;
    const line = this.order.indexOf(row);
    const designs = this.data.designs.length;
    const lines = this.order.length;
    const to = {
      ArrowLeft: [design - 1, line],
      ArrowRight: [design + 1, line],
      ArrowUp: [design, line - 1],
      ArrowDown: [design, line + 1],
      Home: [0, line],
      End: [designs - 1, line],
      PageUp: [design, line - 10],
      PageDown: [design, line + 10],
    }[event.key];
    if (!to) return;
    event.preventDefault();
    this.choose(Math.min(designs - 1, Math.max(0, to[0])), this.order[Math.min(lines - 1, Math.max(0, to[1]))]);
  }
}
