// Single runs: what separates failed from passed, how they ended, the grid of designs and environments, one run.

import { Chart, OUTCOMES, axisStyle, outcomeKey, outcomeKeys, successAxis, tableBehind, tooltip } from "./charts.js";
import { columnName, runNumbers } from "./csv.js";
import { counted, number, percent, withUnit } from "./data.js";
import { csvButton } from "./downloads.js";
import { RunEnds } from "./run_ends.js";
import { byId, make } from "../../figures/web/dom.js";

const MAX_CAUSES = 6;
const MAX_LISTED = 200;
// Cells that are elements of their own, which print sharply but are slow to draw.
const MAX_SVG_CELLS = 1000;
// Height of a row, limits of the grid's height, width from which columns are labelled, width of a letter of a label, height of a label (px).
const ROW_HEIGHT = 4, MIN_HEIGHT = 260, MAX_HEIGHT = 520, NAMED_WIDTH = 11, LETTER_WIDTH = 6, LABEL_HEIGHT = 14;

export class Runs {
  constructor(model, replay) { Object.assign(this, { model, replay, charts: [] }); }

  use() {
    for (const chart of this.charts) chart.dispose();
    this.charts = [];
    const { model } = this, { e } = model;
    byId("causes").replaceChildren();
    const causes = [...e.causes].sort((a, b) => b.separation - a.separation);
    if (causes.length) this.causes(causes);
    byId("ends").replaceChildren();
    this.ends = e.ends ? new RunEnds(model, byId("ends")) : null;
    if (this.ends) this.charts.push(this.ends.chart);
    byId("grid").replaceChildren();
    this.grid = e.runs && e.count ? new Grid(model, byId("grid")) : null;
    if (this.grid) this.charts.push(this.grid.chart);
    byId("replay").hidden = !e.drives;
    byId("omitted").textContent = e.runs_omitted || "";
    byId("runs").hidden = !e.designs.runs.some(Boolean);
    for (const chart of this.charts) if (chart !== this.grid?.chart && chart !== this.ends?.chart) chart.draw();
  }

  // Pictures of those that tell something; the rest is in the table.
  causes(causes) {
    const place = byId("causes"), pictures = make("div", { class: "multiples" }), telling = causes.filter(cause => cause.low > 0).slice(0, MAX_CAUSES);
    const [strongest] = causes, interval = ({ separation, low, high }) => `${percent(separation)} (${percent(low)} to ${percent(high)})`;
    place.append(make("h3", { text: "Why do they fail?" }), make("p", { class: "note", text: telling.length
      ? "What the environments drew at random, by how well it separates failed from passed runs of the same design: 0 % not at all, 100 % wholly. Bars: success at such values."
      : `Of what the environments drew at random, nothing clearly separates failed from passed runs of the same design; most does ${strongest.label}: ${interval(strongest)}, where 0 % is not at all.` }), pictures);
    telling.forEach((cause, rank) => {
      const figure = make("figure", {}, make("figcaption", {}, make("b", { text: `${rank + 1}. ${cause.label}` }), ` separates ${interval(cause)}`));
      pictures.append(figure);
      this.charts.push(new Chart(figure, causeFigure(cause)));
    });
    if (causes.length > telling.length) place.append(tableBehind(() => ({ head: ["value", "separates (95 %)", "success"], rows: causes.map(cause => [cause.label, interval(cause), cause.rises ? "rises with it" : "falls with it"]) }), `all ${causes.length} values`));
  }

  mark() {
    const { model } = this;
    // First, because a worker simulates the run while the charts are drawn.
    if (model.e.drives) this.replay.show(model.design, model.env, model.state.t ?? 0, model.state.t === null && document.body.dataset.state === "ready");
    endings(model);
    if (this.ends) this.ends.mark();
    if (this.grid) this.grid.mark();
    listed(model);
  }
}

function causeFigure({ label, unit, bins }) {
  const share = bins.map(bin => (bin.runs ? 100 * bin.passed / bin.runs : null)), name = bin => (bin.from === bin.to ? number(bin.from) : `${number(bin.from)} to ${number(bin.to)}`);
  return {
    label: `Success by ${label}`, name: `failures by ${label}`,
    numbers: () => ({ head: [...["from", "to"].map(end => columnName(`${label} ${end}`, unit)), "runs", "passed", "success"], rows: bins.map(({ from, to, runs, passed }) => [from, to, runs, passed, runs ? passed / runs : null]) }),
    table: () => ({ head: [withUnit({ label, unit }), "runs", "passed", "success"], rows: bins.map((bin, k) => [name(bin), String(bin.runs), String(bin.passed), share[k] === null ? "–" : percent(share[k] / 100)]) }),
    option: theme => ({
      height: 170, grid: { left: 48, right: 10, top: 10, bottom: 42 },
      tooltip: tooltip(theme, ([{ dataIndex: k }]) => [`${label} ${name(bins[k])} ${unit || ""}`, `${bins[k].passed} of ${bins[k].runs} runs passed`], { trigger: "axis" }),
      xAxis: axisStyle(theme, withUnit({ label, unit }), { type: "category", data: bins.map(bin => number((bin.from + bin.to) / 2)), axisTick: { show: false } }),
      yAxis: successAxis(theme, ""),
      series: [{ type: "bar", data: share, barCategoryGap: "8%", itemStyle: { color: theme.accent }, showBackground: true, backgroundStyle: { color: theme.ground } }],
    }),
  };
}

// Buttons for the ways in which runs ended: those pressed are kept.
function endings(model) {
  const { e, state } = model, counts = e.outcomes.map(() => 0);
  e.designs.outcomes.forEach((column, k) => column.forEach((count, design) => { if (model.within[design]) counts[k] += count ?? 0; }));
  const shown = e.outcomes.map((name, k) => [name, k]).filter(([name, k]) => counts[k] || state.outcomes.includes(name));
  byId("endings").replaceChildren(...shown.map(([name, k]) => make("button", {
    type: "button", class: "chip", "aria-pressed": String(state.outcomes.includes(name)),
    onclick: () => { model.set({ outcomes: state.outcomes.includes(name) ? state.outcomes.filter(kept => kept !== name) : [...state.outcomes, name] }); byId("endings").querySelector(`[data-outcome=${name}]`)?.focus(); },
    "data-outcome": name,
  }, outcomeKey(name), `${e.outcome_labels[k]} ${counts[k].toLocaleString("en")}`)));
}

// Runs that the filters keep.
function* keptRuns({ e, state, within, design }) {
  const kept = new Set(state.outcomes.map(name => e.outcomes.indexOf(name))), { runs } = e;
  for (let run = 0; run < runs.design.length; run++) {
    if (within[runs.design[run]] && (!kept.size || kept.has(runs.outcome[run])) && (design === null || runs.design[run] === design)) yield run;
  }
}

function listed(model) {
  const { e } = model, place = byId("listed");
  if (!e.runs) { place.replaceChildren(); return; }
  const open = place.querySelector("details")?.open;
  const table = () => {
    const rows = [];
    for (const run of keptRuns(model)) {
      if (rows.length >= MAX_LISTED) break;
      const design = e.runs.design[run], environment = e.runs.environment[run];
      rows.push([make("button", { type: "button", class: "design", text: `${e.designs.name[design]}, environment ${environment}`, onclick: () => model.set({ design: e.designs.name[design], env: environment, t: null }) }),
        e.outcome_labels[e.runs.outcome[run]], `${number(e.runs.time_s[run])} s`]);
    }
    return { head: ["run", "ended", "after"], rows };
  };
  let count = 0;
  for (const _ of keptRuns(model)) count += 1;
  const of = model.design === null ? "" : ` of ${e.designs.name[model.design]}`;
  const name = `runs${model.design === null ? "" : ` of ${e.designs.name[model.design]}`}`;
  place.replaceChildren(make("span", { class: "save" }, csvButton(`the ${name} that the filters keep`, name, () => runNumbers(e, keptRuns(model)), `save the ${counted(count, "run")} as CSV`)), tableBehind(table, `${counted(count, "run")}${of} as a table${count > MAX_LISTED ? ` (the first ${MAX_LISTED})` : ""}`));
  if (open) place.querySelector("details").open = true;
}

// Columns are designs, rows environments; each cell is a run.
class Grid {
  constructor(model, place) {
    this.model = model;
    const { e } = model;
    this.status = make("p", { class: "told", role: "status", "aria-live": "polite" });
    const figure = make("figure", { "data-chart": "grid" });
    place.append(make("p", { class: "note", text: "Press a cell, or use the arrow keys: it is a run." }), figure, this.status);
    this.frames = ["column", "cell"].map(kind => make("i", { class: `frame ${kind}`, hidden: true }));
    this.chart = new Chart(figure, {
      label: "Outcome of every run: a column for each design, a row for each environment", renderer: e.runs.design.length > MAX_SVG_CELLS ? "canvas" : "svg",
      option: (theme, width) => this.option(theme, width), drawn: () => this.placeFrames(),
      name: "outcomes", numbers: () => runNumbers(e, keptRuns({ e, state: model.state, within: model.within, design: null })),
      keys: () => outcomeKeys(e, k => e.designs.outcomes[k].some(Boolean)),
    });
    this.chart.place.tabIndex = 0;
    this.chart.place.setAttribute("role", "application");
    this.chart.place.setAttribute("aria-label", "Outcomes: a column for each design, a row for each environment. Arrow keys move from run to run.");
    this.chart.place.addEventListener("keydown", event => this.key(event));
    const cell = ({ value }) => [this.columns[value[0]], this.rows[value[1]]];
    this.chart.on("click", event => { if (event.value) this.choose(...cell(event)); });
    this.chart.on("mouseover", event => { if (event.value) { model.hover(cell(event)[0]); this.tell(...cell(event)); } });
    this.chart.on("mouseout", () => { model.hover(null); this.tell(model.design, model.env); });
  }

  arrange() {
    const { model } = this, { e } = model;
    this.columns = [...Array(e.count).keys()].filter(design => e.designs.runs[design] && model.within[design]);
    this.rows = e.environmentsRun;
  }

  choose(design, environment) { this.model.set({ design: this.model.e.designs.name[design], env: environment, t: null }); }

  key(event) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }, step = steps[event.key];
    if (!step || !this.columns.length) return;
    event.preventDefault();
    const { model } = this, column = this.columns.indexOf(model.design), row = this.rows.indexOf(model.env);
    const clamp = (value, length) => Math.max(0, Math.min(length - 1, value));
    this.choose(this.columns[column < 0 ? 0 : clamp(column + step[0], this.columns.length)], this.rows[row < 0 ? 0 : clamp(row + step[1], this.rows.length)]);
  }

  option(theme, width) {
    const { model } = this, { e, state } = model, kept = new Set(state.outcomes.map(name => e.outcomes.indexOf(name)));
    const data = [];
    this.columns.forEach((design, column) => this.rows.forEach((environment, row) => {
      const run = e.run(design, environment);
      if (run < 0) return;
      const outcome = e.runs.outcome[run];
      data.push({ value: [column, row, outcome], itemStyle: { color: OUTCOMES[e.outcomes[outcome]], opacity: kept.size && !kept.has(outcome) ? 0.1 : 1 } });
    }));
    const several = e.parameters.length > 1, height = Math.max(MIN_HEIGHT, Math.min(MAX_HEIGHT, 90 + ROW_HEIGHT * this.rows.length));
    const left = 52, right = 12, top = 10, below = 22;
    const cellWidth = (width - left - right) / Math.max(1, this.columns.length), cellHeight = (height - (several ? top + below : 58)) / Math.max(1, this.rows.length);
    this.cell = { width: cellWidth, height: cellHeight, left, top };
    const named = e.parameters.length < 2 || cellWidth > NAMED_WIDTH;
    const texts = this.columns.map(design => valuesOf(e, design)), gap = !several ? 26 : named ? 16 + LETTER_WIDTH * Math.max(...texts.map(text => text.length)) : 10;
    return {
      height: height + (several ? gap : 0), grid: { left, right, top, bottom: gap + below },
      xAxis: axisStyle(theme, several ? `${this.columns.length} designs${named ? `: ${e.parameters.map(withUnit).join(" · ")}` : ""}` : e.parameters.length ? withUnit(e.parameters[0]) : "", {
        type: "category", data: texts, nameGap: gap, axisTick: { show: false },
        axisLabel: { show: named, color: theme.soft, fontSize: 11, hideOverlap: true, rotate: several ? 90 : 0 },
      }),
      yAxis: axisStyle(theme, "environment", { type: "category", data: this.rows.map(String), nameGap: 36, axisTick: { show: false }, splitLine: { show: false },
        axisLabel: { color: theme.soft, fontSize: 11, interval: row => row % Math.ceil(LABEL_HEIGHT / cellHeight) === 0 } }),
      series: [{ type: "heatmap", data, progressive: 0, itemStyle: { borderWidth: cellWidth > 6 && cellHeight > 6 ? 0.5 : 0, borderColor: theme.paper }, emphasis: { itemStyle: { borderColor: theme.ink, borderWidth: 1.5 } } }],
    };
  }

  // Draws the cells anew only if others are kept: thousands of them take longer than a run.
  mark() {
    this.arrange();
    const kept = `${this.columns} ${this.model.state.outcomes}`;
    if (kept === this.kept && !this.chart.stale) this.placeFrames();
    else this.chart.draw();
    this.kept = kept;
    this.tell(this.model.design, this.model.env);
  }

  // Frames the chosen design's column and the chosen run's cell.
  placeFrames() {
    const [columnFrame, cellFrame] = this.frames;
    if (!columnFrame.isConnected) this.chart.place.append(columnFrame, cellFrame);
    const column = this.columns.indexOf(this.model.design), row = this.rows.indexOf(this.model.env);
    const { width, height, left, top } = this.cell, x = left + (column + 0.5) * width, rows = this.rows.length;
    columnFrame.hidden = column < 0;
    cellFrame.hidden = column < 0 || row < 0;
    frame(columnFrame, x, top + rows * height / 2, width, rows * height);
    frame(cellFrame, x, top + (rows - row - 0.5) * height, Math.max(8, width + 2), Math.max(8, height + 2));
  }

  tell(design, environment) {
    const { e } = this.model, run = e.run(design, environment);
    this.status.textContent = design === null ? "" : run < 0
      ? `${e.designs.name[design]}: ${e.designs.passed[design] ?? "–"} of ${e.designs.runs[design]} runs passed.`
      : `${e.designs.name[design]}, environment ${environment}: ${e.outcome_labels[e.runs.outcome[run]]} after ${number(e.runs.time_s[run])} s. ${e.passedIn[environment]} of ${e.runsIn[environment]} designs pass there.`;
  }
}

// Puts a frame around a centre; all in px.
function frame(element, x, y, width, height) {
  Object.assign(element.style, { left: `${x - width / 2}px`, top: `${y - height / 2}px`, width: `${width}px`, height: `${height}px` });
}

const valuesOf = (e, design) => e.parameters.map((_, k) => e.axes[k]).map(axis => String(axis.values[design] ?? "–")).join(" · ");
