// The table of designs: sorted by a column, filtered by words and limits, with columns that can be hidden; and for print its ten best.

import { plainTable } from "./charts.js";
import { designNumbers } from "./csv.js";
import { hasValues, isSuccess, number, percent, withUnit } from "./data.js";
import { csvButton } from "./downloads.js";
import { designButton } from "./summary.js";
import { byId, make } from "../../figures/web/dom.js";

// Rows of a table on the screen, and on paper.
export const MAX_ROWS = 500;
const BEST = 10;
const LIMIT = /([^\s<>=]+)\s*(<=|>=|<|>|=)\s*(\S+)/g;
const HOLDS = { "<": (a, b) => a < b, "<=": (a, b) => a <= b, ">": (a, b) => a > b, ">=": (a, b) => a >= b, "=": (a, b) => a === b };
const shortName = text => text.toLowerCase().replaceAll(" ", "_");

// Columns: {id: its name in limits, head, value(k): a number or text, null if unknown, cell(k): what is shown, more: whether more is better}.
export function designColumns(e, nameCell = k => e.designs.name[k]) {
  const { designs } = e, known = counts => counts.some(count => count), columns = [];
  const interval = (low, high, k) => (low[k] === null ? "" : ` (${percent(low[k])} to ${percent(high[k])})`);
  const counted = (id, head, passed, all, value) => columns.push({ id, head, value, cell: k => (all[k] ? `${passed[k] ?? "–"} of ${all[k]}` : "–"), more: true });
  const axisColumn = (axis, id) => ({ id, key: axis.key, head: withUnit(axis), value: k => axis.values[k], cell: k => number(axis.values[k]) });
  columns.push({ id: "design", head: "design", value: k => designs.name[k], cell: nameCell });
  for (const axis of e.axes) if (axis.parameter !== undefined) columns.push(axisColumn(axis, shortName(axis.label)));
  if (known(designs.belief)) columns.push({ id: "success", head: "built cars, success", value: k => (designs.belief[k] === null ? null : 100 * designs.belief[k]), cell: k => percent(designs.belief[k]) + interval(designs.belief_low, designs.belief_high, k), more: true });
  if (known(designs.runs)) counted("simulated", `passed in ${e.simulation}`, designs.passed, designs.runs, k => (designs.rate[k] === null ? null : 100 * designs.rate[k]));
  if (known(designs.trials)) counted("trials", "trials passed", designs.trials_passed, designs.trials, k => designs.trials[k]);
  for (const axis of e.axes) if (axis.parameter === undefined && !isSuccess(axis.key) && hasValues(axis)) columns.push(axisColumn(axis, axis.key));
  return columns;
}

// Reads a filter: {keep(k): whether a design stays, problem: a sentence on what could not be read, or ""}.
export function readFilter(text, columns) {
  const limits = [], problems = [];
  const words = text.replace(LIMIT, (_, asked, sign, end) => {
    const name = shortName(asked), limit = Number(end), numeric = columns.filter(({ id }) => id !== "design");
    const begun = numeric.filter(({ id }) => id.startsWith(name));
    const column = numeric.find(({ id, key }) => id === name || key === name) ?? (begun.length === 1 ? begun[0] : null);
    if (!column) problems.push(`${asked}: no column has this name; there are ${numeric.map(({ id }) => id).join(", ")}.`);
    else if (Number.isNaN(limit)) problems.push(`${asked}${sign}${end}: ${end} is not a number.`);
    else limits.push(k => column.value(k) !== null && HOLDS[sign](column.value(k), limit));
    return " ";
  }).toLowerCase().split(/\s+/).filter(Boolean);
  const name = columns.find(({ id }) => id === "design");
  return { keep: k => words.every(word => name.value(k).toLowerCase().includes(word)) && limits.every(holds => holds(k)), problem: problems.join(" ") };
}

// The designs in the order of a column; those without a value come last, and equal ones stay as they were.
export function sorted(designs, { value }, descending) {
  const compare = (a, b) => (typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a - b);
  const known = designs.filter(k => value(k) !== null).sort((a, b) => (descending ? -1 : 1) * compare(value(a), value(b)));
  return [...known, ...designs.filter(k => value(k) === null)];
}

// The designs from the best: by success of built cars, then in simulation, then by time.
function bestFirst(e, columns) {
  const by = id => columns.find(column => column.id === id), order = ["time", "simulated", "success"].map(by).filter(Boolean);
  return order.reduce((designs, column) => sorted(designs, column, column.more), [...Array(e.count).keys()]);
}

export class DesignTable {
  constructor(model) { this.model = model; }

  use() {
    const { model } = this, { e } = model, place = byId("design-table");
    Object.assign(this, { columns: designColumns(e, k => designButton(model, k)), hidden: new Set(), by: null, descending: false, text: "" });
    place.replaceChildren();
    place.hidden = e.count < 2;
    if (place.hidden) return;
    Object.assign(this, { message: make("p", { class: "note", role: "status" }), summary: make("summary"), body: make("div", { class: "wide" }) });
    this.details = make("details", { class: "behind" }, this.summary, this.controls(), this.message, this.body);
    this.details.addEventListener("toggle", () => { if (this.details.open) this.draw(); });
    place.append(this.details, this.paper());
  }

  controls() {
    const names = this.columns.filter(({ id }) => id !== "design").map(({ id }) => id);
    const example = `${names[0]}>100`, shares = names.filter(id => id === "success" || id === "simulated");
    const field = make("input", { type: "search", "aria-label": "filter designs", placeholder: `part of a name, or ${example}`, oninput: () => { this.text = field.value; this.draw(); } });
    const box = (column, k) => {
      const input = make("input", { type: "checkbox", checked: true, onchange: () => {
        if (input.checked) this.hidden.delete(k);
        else this.hidden.add(k);
        this.draw();
      } });
      return make("label", {}, input, ` ${column.head}`);
    };
    return make("div", { class: "table-controls" }, make("label", {}, "filter ", field),
      make("details", {}, make("summary", { text: "columns" }), make("div", { class: "chips", role: "group", "aria-label": "Columns that are shown" }, ...this.columns.slice(1).map((column, k) => box(column, k + 1)))),
      csvButton("the designs that the filter keeps", "designs", () => designNumbers(this.model.e, this.kept), "save as CSV"),
      make("p", { class: "note" }, "A filter keeps designs whose names contain all words, and that are within all limits, such as ", make("code", { text: example }), `. Limits are of ${names.join(", ")}${shares.length ? ` (${shares.join(" and ")} in per cent)` : ""}. Press a heading to sort.`));
  }

  // Designs that the ranges of the page and the table's filter keep, in the table's order.
  get kept() {
    const { e, within } = this.model, { keep } = readFilter(this.text, this.columns), designs = [...Array(e.count).keys()].filter(k => within[k] && keep(k));
    return this.by === null ? designs : sorted(designs, this.columns[this.by], this.descending);
  }

  mark() {
    if (!this.model.e.count || byId("design-table").hidden) return;
    this.draw();
  }

  draw() {
    const { e, design } = this.model, { kept } = this, { problem } = readFilter(this.text, this.columns);
    this.summary.textContent = `${kept.length < e.count ? `${kept.length} of ` : ""}${e.count.toLocaleString("en")} designs as a table`;
    if (!this.details.open) return;
    this.message.textContent = [problem, kept.length > MAX_ROWS ? `The first ${MAX_ROWS} of ${kept.length} designs are shown.` : "", kept.length ? "" : "No design is within these limits."].filter(Boolean).join(" ");
    const shown = this.columns.map((_, k) => k).filter(k => !this.hidden.has(k));
    const row = k => make("tr", { class: k === design ? "chosen" : null }, ...shown.map(n => make(n ? "td" : "th", n ? {} : { scope: "row" }, this.columns[n].cell(k))));
    const focused = document.activeElement?.dataset.column, { scrollTop = 0, scrollLeft = 0 } = this.body;
    this.body.replaceChildren(make("table", { class: "designs" }, make("thead", {}, make("tr", {}, ...shown.map(n => this.heading(n)))), make("tbody", {}, ...kept.slice(0, MAX_ROWS).map(row))));
    Object.assign(this.body, { scrollTop, scrollLeft });
    if (focused !== undefined) this.body.querySelector(`[data-column="${focused}"]`)?.focus();
  }

  heading(n) {
    const sort = n !== this.by ? "none" : this.descending ? "descending" : "ascending";
    return make("th", { scope: "col", "aria-sort": sort }, make("button", { type: "button", "data-column": n, text: this.columns[n].head, onclick: () => this.sort(n) }));
  }

  // The first press sorts the best first where more is better, the second the other way round.
  sort(n) {
    this.descending = n === this.by ? !this.descending : Boolean(this.columns[n].more);
    this.by = n;
    this.draw();
  }

  // The ten best designs, for print only.
  paper() {
    const { e } = this.model, columns = designColumns(e).filter(({ id }) => !e.parameters.some(({ label }) => shortName(label) === id));
    const judged = columns.some(({ id }) => id === "success" || id === "simulated"), count = Math.min(BEST, e.count), of = count < e.count ? ` of ${e.count.toLocaleString("en")}` : "";
    const title = `The ${judged ? "best" : "first"} ${count}${of} designs`;
    return make("div", { id: "best-designs", class: "paper" }, make("h3", { text: title }), plainTable(columns.map(({ head }) => head), bestFirst(e, columns).slice(0, BEST).map(k => columns.map(({ cell }) => cell(k)))));
  }
}
