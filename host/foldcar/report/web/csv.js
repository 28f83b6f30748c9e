// Tables as CSV: of designs and of runs with the columns of `foldcar export --csv`, and what the numbers of charts have in common.
//
// Names of columns end in their unit (width_mm). Rates are fractions of 0 to 1. Unknown values are empty.

// Units of the page, as the export writes them.
const SUFFIXES = { "°": "deg", "cm²": "cm2", "µs": "us", "%": "percent" };
// Beginnings of formulas, as spreadsheet_cell of shown_text.py has them, with Python's meanings of space, digit and end.
const FORMULA = /^(?:(?!\ufeff)\s|[\x1c-\x1f\x85])*(?:[=@\uff1d\uff20]|[+\-\uff0b\uff0d](?!(?:\p{Nd}+\.?\p{Nd}*|\.\p{Nd}+)(?:[eE][+-]?\p{Nd}+)?\n?$|inf\n?$|nan\n?$))/u;

// "step height" in mm as step_height_mm.
export function columnName(label, unit) {
  const stem = label.toLowerCase().replace(/[^\p{L}\p{N}.]+/gu, "_").replace(/^_|_$/g, ""), suffix = unit && (SUFFIXES[unit] ?? unit.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "_"));
  return suffix ? `${stem}_${suffix}` : stem;
}

export function csvText({ head, rows }) {
  return [head, ...rows].map(row => `${row.map(cellText).join(",")}\n`).join("");
}

function cellText(cell) {
  if (cell === null || cell === undefined || Number.isNaN(cell)) return "";
  const text = String(cell), safe = typeof cell === "string" && FORMULA.test(text.replace(/^'+/, "")) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

// A design's parameters, those that all designs share, too, in the order of the export.
function parameterColumns({ exported, axis }) {
  return exported.parameters.map(name => [name, name in exported.fixed ? () => exported.fixed[name] : k => axis[name]?.values[k] ?? null]);
}

const tableOf = (columns, keys) => ({ head: columns.map(([name]) => name), rows: keys.map(key => columns.map(([, value]) => value(key))) });

// Runs: those columns of the export that the page has. Times are to the millisecond.
export function runNumbers(e, runs = e.runs.design.keys()) {
  const { design, environment, outcome, time_s } = e.runs, { vehicle, environment: name } = e.exported, ending = run => e.outcomes[outcome[run]];
  return tableOf([
    ["experiment", () => e.id], ["vehicle", () => vehicle], ["environment", () => name], ["sample", run => environment[run]], ["outcome", ending],
    ["passed", run => (e.judged && ending(run) !== "rejected" ? ending(run) === "passed" : null)], ["elapsed_time_s", run => time_s[run]],
    ...parameterColumns(e).map(([column, value]) => [column, run => value(design[run])]),
  ], [...runs]);
}

// Designs, with more columns: [name, value(k)].
export function designNumbers(e, designs = [...Array(e.count).keys()], more = []) {
  const { exported: { vehicle, environment }, designs: { measures } } = e, of = name => k => e.designs[name][k];
  const engines = e.engines.flatMap(({ name, passed, runs }) => [[columnName(`runs in ${name}`), k => runs[k]], [columnName(`passed in ${name}`), k => passed[k]]]);
  return tableOf([
    ["experiment", () => e.id], ["vehicle", () => vehicle], ["environment", () => environment], ...parameterColumns(e),
    ["runs", of("runs")], ["passed", of("passed")], ["success", of("rate")], ["success_low", of("low")], ["success_high", of("high")],
    ["built_cars_success", of("belief")], ["built_cars_success_low", of("belief_low")], ["built_cars_success_high", of("belief_high")], ...engines,
    ["trials", of("trials")], ["trials_passed", of("trials_passed")], ["cars", of("cars")], ["trials_success_low", of("trials_low")], ["trials_success_high", of("trials_high")],
    ...measures.map(({ key, unit, value }) => [columnName(key, unit), k => value[k]]), ...more,
  ], designs);
}
