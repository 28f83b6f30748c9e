// Success of this simulator and of built cars: a curve over one parameter, a map over two of several, a search's front.

import { Chart, axisStyle, band, fadedColour, intervals, keysOf, scaleKeys, successAxis, successColour, tooltip } from "./charts.js";
import { columnName, designNumbers } from "./csv.js";
import { evidence, percent, shownSuccess, thresholdText, withUnit } from "./data.js";
import { RealityLine, realityCurves } from "./realities.js";
import { byId, legend, make, select } from "../../figures/web/dom.js";

// Values of a parameter that have cells of their own in the map.
const MAX_CELLS = 40;
const CURVE_HEIGHT = 400;

const table = model => () => {
  const { e } = model, { designs } = e, pair = (low, high) => (low === null ? "–" : `${percent(low)} to ${percent(high)}`);
  return {
    head: ["design", "built cars", "95 %", e.simulation, "95 %", ...e.engines.map(({ name }) => name), "trials", "of cars", "95 % of these"],
    rows: designs.name.map((name, i) => [name, percent(designs.belief[i]), pair(designs.belief_low[i], designs.belief_high[i]),
      designs.runs[i] ? `${designs.passed[i]} of ${designs.runs[i]}` : "–", pair(designs.low[i], designs.high[i]),
      ...e.engines.map(({ passed, runs }) => (runs[i] ? `${passed[i]} of ${runs[i]}` : "–")), designs.trials[i] ? `${designs.trials_passed[i]} of ${designs.trials[i]}` : "–", designs.cars[i] || "–", pair(designs.trials_low[i], designs.trials_high[i])]),
  };
};

// A tooltip of marks that have a design or a reality. more(design): lines below what is known of its success.
export const designTip = ({ e }, theme, more = () => []) => tooltip(theme, ({ data }) => {
  if (data?.reality !== undefined) return ["one way in which reality may differ: press it for its values"];
  return data?.design === undefined ? [] : [make("b", { text: e.designs.name[data.design] }), ...evidence(e, data.design).map(row => row.join(" ")), ...more(data.design)];
});

// Pointing at and pressing a mark of a chart; of: the design of an event, or null.
export function linked(model, chart, of) {
  chart.on("mouseover", event => { const design = of(event); if (design !== null) model.hover(design); });
  chart.on("mouseout", () => model.hover(null));
  chart.on("click", event => { const design = of(event); if (design !== null) model.open(design); });
}

export class Belief {
  constructor(model) { this.model = model; this.charts = []; }

  use() {
    for (const chart of this.charts) chart.dispose();
    const { e } = this.model, place = byId("belief-charts");
    this.charts = [];
    this.line = null;
    place.replaceChildren();
    byId("belief-note").textContent = "";
    if (!e.count) return;
    if (e.front?.objectives.length > 1) this.add(place, "front", frontFigure(this.model));
    if (e.parameters.length > 1) this.add(place, "map", mapFigure(this.model));
    else this.addCurve(place);
    byId("belief-note").textContent = note(this.model);
  }

  add(place, kind, { title, controls = [], of, ...options }) {
    const figure = make("figure", { "data-chart": kind }), head = make("div", { class: "controls" }, ...controls);
    if (title) place.append(make("h3", { text: title }));
    if (controls.length) place.append(head);
    place.append(figure);
    const chart = new Chart(figure, options);
    linked(this.model, chart, of);
    this.charts.push(chart);
    return chart;
  }

  addCurve(place) {
    const { model } = this;
    this.curve = this.add(place, "curve", curveFigure(model));
    if (!model.e.realities) return;
    this.curve.on("click", ({ data }) => { if (data?.reality !== undefined) model.chooseReality(data.reality === model.reality ? null : data.reality); });
    this.line = new RealityLine(model, place);
  }

  mark() {
    for (const chart of this.charts) chart.draw();
    this.marked = this.model.reality;
    this.line?.mark();
  }

  // A slider moves often and the chosen curve changes rarely.
  markReality() {
    if (!this.line || this.marked === this.model.reality) return;
    this.marked = this.model.reality;
    this.curve.draw();
    this.line.mark();
  }
}

function note({ e }) {
  const driven = e.designs.trials.some(count => count), { realities } = e, single = e.parameters.length < 2, parts = [];
  if (realities) parts.push(`Built cars: what ${realities.driven ? "simulation and trials together say" : "simulation says, and how far it may be wrong"}, of a further built car of a design (mean).`);
  else if (e.next.text) parts.push(e.next.text);
  if (e.judged && single) parts.push(`${e.simulation[0].toUpperCase()}${e.simulation.slice(1)}: squares count runs.`);
  if (realities && single) parts.push(`Thin curves: ${realities.rates.length} realities, drawn by how probable they are${realities.driven ? " after the trials" : ""}. Press a curve for its values. A curve has an error that no unknown explains, so the simulation of its values may differ from it.`);
  if (driven) parts.push("Intervals of trials are of the cars that drove.");
  parts.push("Bands and intervals hold at 95 % for each design by itself.");
  return parts.join(" ");
}

function curveFigure(model) {
  const { e } = model, axis = e.axes[0].parameter === undefined ? null : e.axes[0];
  const x = axis ? axis.values : e.designs.name.map((_, k) => k);
  const order = [...x.keys()].filter(k => x[k] !== null).sort((a, b) => x[a] - x[b]);
  const percents = values => values.map(value => (value === null ? null : 100 * value));
  const { belief, belief_low, belief_high, rate, low, high, trials, trials_passed, trials_low, trials_high } = e.designs;
  const [b, bl, bh, s, sl, sh, tl, th] = [belief, belief_low, belief_high, rate, low, high, trials_low, trials_high].map(percents);
  const triple = (lows, highs) => order.filter(k => lows[k] !== null).map(k => [x[k], lows[k], highs[k]]);
  const option = theme => {
    const [least, most] = [x[order[0]], x[order[order.length - 1]]], margin = (most - least) * 0.02 || 1;
    const driven = order.filter(k => trials[k]), at = model.design;
    const lines = e.thresholds.map(limit => ({ yAxis: 100 * limit, lineStyle: { color: theme.soft, type: "dashed", width: 1 }, label: { formatter: thresholdText(limit), position: "insideEndTop", color: theme.soft } }));
    if (at !== null && x[at] !== null) lines.push({ xAxis: x[at], lineStyle: { color: theme.accent, width: 2, type: "solid" }, label: { formatter: () => e.designs.name[at], position: "end", color: theme.accent } });
    const dim = k => (model.within[k] ? 1 : 0.2);
    return {
      height: CURVE_HEIGHT,
      grid: { left: 58, right: 18, top: 24, bottom: 48 },
      tooltip: designTip(model, theme),
      xAxis: axisStyle(theme, axis ? withUnit(axis) : "", { type: "value", min: least - margin, max: most + margin,
        axisLabel: { color: theme.soft, fontSize: 11, hideOverlap: true, ...(axis ? { formatter: "{value}", showMinLabel: false, showMaxLabel: false } : { formatter: k => e.designs.name[k] ?? "" }) },
        ...(axis ? {} : { minInterval: 1 }) }),
      yAxis: successAxis(theme),
      series: [
        ...(e.realities ? [...realityCurves(model, x, order, theme), band(triple(bl, bh), theme.accent, 0.2)] : [band(triple(sl, sh), theme.soft, 0.2)]),
        { name: "belief", type: "line", data: order.filter(k => b[k] !== null || !e.realities).map(k => ({ value: [x[k], b[k]], design: k, itemStyle: { opacity: dim(k) } })), symbol: "circle", symbolSize: 9, lineStyle: { width: 0 }, itemStyle: { color: theme.accent }, z: 5, cursor: "pointer",
          markLine: { silent: true, symbol: "none", data: lines } },
        { name: "simulation", type: "scatter", data: order.filter(k => s[k] !== null).map(k => ({ value: [x[k], s[k]], design: k, itemStyle: { color: theme.paper, borderColor: theme.soft, borderWidth: 1.2, opacity: dim(k) } })), symbol: "rect", symbolSize: 6, z: 4 },
        ...e.engines.map(({ name, passed, runs }, n) => ({ name, type: "line", symbol: "triangle", symbolSize: 7, z: 4, silent: true,
          lineStyle: { color: theme.ink, width: 1.5, type: n ? "dotted" : "dashed" }, itemStyle: { color: theme.ink },
          data: order.filter(k => runs[k]).map(k => [x[k], 100 * passed[k] / runs[k]]) })),
        intervals("trials", driven.map(k => [x[k], tl[k], th[k]]), theme.trial, 2.5, 0.8),
        { name: "trials", type: "scatter", data: driven.map(k => ({ value: [x[k], 100 * trials_passed[k] / trials[k]], design: k })), symbol: "diamond", symbolSize: 13, itemStyle: { color: theme.trial, borderColor: theme.paper }, z: 6 },
      ],
    };
  };
  return {
    title: e.realities && !e.realities.driven ? "A guess from simulation: no trial counts yet" : "",
    label: `Success by ${axis ? axis.label : "design"}: ${e.realities ? "realities, built cars with 95 % bands, simulation" : "simulation with 95 % bands"}, trials`, table: table(model), option,
    keys: keysOf(legendEntries(e)), numbers: () => designNumbers(e, order, (e.realities?.rates ?? []).map((rates, n) => [`reality_${n + 1}_success`, k => rates[k]])),
    controls: [legend(legendEntries(e))], of: ({ data }) => data?.design ?? null,
  };
}

function legendEntries(e) {
  const built = [["reality", "each thin curve: one way in which reality may differ"], ["belief", "built cars, 95 % band"]];
  const keys = [...(e.realities ? built : []), ["simulation", e.realities ? "runs that passed" : "runs that passed, 95 % band"], ...e.engines.map(({ name }, n) => [n ? "engine dotted" : "engine", name])];
  if (e.designs.trials.some(count => count)) keys.push(["trials", "trials"]);
  return keys;
}

// Where a design stands in the map: its cell, and in it a place of its own among those that differ in what is not drawn.
function mapPlaces(e, kx, ky) {
  const cells = new Map(), [x, y] = [e.axes[kx], e.axes[ky]];
  for (let design = 0; design < e.count; design++) {
    const key = `${x.values[design]} ${y.values[design]}`;
    if (x.values[design] === null || y.values[design] === null) continue;
    if (!cells.has(key)) cells.set(key, []);
    cells.get(key).push(design);
  }
  const most = Math.max(1, ...[...cells.values()].map(cell => cell.length)), side = Math.ceil(Math.sqrt(most));
  return { cells, side, rows: Math.ceil(most / side) };
}

function mapFigure(model) {
  const { e } = model, count = e.parameters.length;
  const byShare = [...e.importance].sort((a, b) => b.share - a.share).map(({ parameter }) => parameter);
  const ranked = [...new Set([...byShare, ...Array(count).keys()])];
  const chosen = key => e.axes.find(axis => axis.key === key)?.parameter ?? null;
  // An axis that is not chosen is another one than the chosen.
  const kx = chosen(model.state.mx) ?? ranked.find(k => k !== chosen(model.state.my)), ky = chosen(model.state.my) ?? ranked.find(k => k !== kx);
  const axes = [e.axes[kx], e.axes[ky]];
  const apart = axes.every(axis => new Set(axis.values).size <= MAX_CELLS);
  const levels = axes.map(axis => [...new Set(axis.values)].filter(value => value !== null).sort((a, b) => a - b));
  const { cells, side, rows } = apart ? mapPlaces(e, kx, ky) : { cells: null };
  // Designs that stand in one cell stand together.
  const points = [], inside = side > 1 ? 0.9 : 1;
  if (apart) {
    for (const designs of cells.values()) designs.forEach((design, n) => {
      const at = axes.map((axis, k) => levels[k].indexOf(axis.values[design]));
      points.push({ value: [at[0] + inside * (((n % side) + 0.5) / side - 0.5), at[1] - inside * ((Math.floor(n / side) + 0.5) / rows - 0.5)], design });
    });
  } else {
    for (let design = 0; design < e.count; design++) if (axes.every(axis => axis.values[design] !== null)) points.push({ value: axes.map(axis => axis.values[design]), design });
  }
  const option = (theme, width) => {
    const height = Math.max(300, Math.min(560, apart ? 90 + levels[1].length * (width / Math.max(4, levels[0].length)) * 0.6 : 440));
    const cell = apart ? [inside * (width - 90) / levels[0].length / side, inside * (height - 64) / levels[1].length / rows] : [13, 13];
    const size = apart ? cell.map(sidePx => Math.max(3, sidePx * (side * rows > 1 ? 0.9 : 0.97) - (side > 1 ? 1 : 0))) : cell;
    const named = apart && size[0] > 30 && size[1] > 14;
    const axisOf = (k, more) => (apart
      ? axisStyle(theme, withUnit(axes[k]), { type: "value", min: -0.5, max: levels[k].length - 0.5, interval: 1, axisLabel: { show: false }, axisTick: { show: false }, splitLine: { show: false }, ...more })
      : axisStyle(theme, withUnit(axes[k]), { type: "value", scale: true, ...more }));
    // Labels stand in the middle of the cells: an axis of texts beside the axis of places.
    const labels = k => axisStyle(theme, withUnit(axes[k]), { type: "category", data: levels[k].map(String), position: k ? "left" : "bottom", nameGap: k ? 40 : 26, axisTick: { show: false }, splitLine: { show: false } });
    return {
      height,
      grid: { left: 64, right: 14, top: 12, bottom: 50 },
      tooltip: designTip(model, theme),
      xAxis: apart ? [labels(0), { ...axisOf(0), show: false }] : axisOf(0),
      yAxis: apart ? [labels(1), { ...axisOf(1), show: false }] : axisOf(1, { nameGap: 44 }),
      series: [{
        type: "scatter", xAxisIndex: apart ? 1 : 0, yAxisIndex: apart ? 1 : 0, symbol: apart ? "rect" : "circle", symbolSize: size, cursor: "pointer",
        data: points.map(point => [point, fadedColour(shownSuccess(e, point.design), theme)]).map(([point, { colour, letters }]) => ({
          ...point, label: { color: letters }, symbol: e.designs.trials[point.design] && !apart ? "diamond" : undefined,
          itemStyle: { color: colour, opacity: model.within[point.design] ? 1 : 0.12,
            borderColor: point.design === model.design ? theme.ink : e.designs.trials[point.design] ? theme.trial : apart ? theme.paper : theme.soft, borderWidth: point.design === model.design ? 3 : e.designs.trials[point.design] ? 2 : 0.5 },
        })),
        label: named ? { show: true, formatter: ({ data }) => percent(shownSuccess(e, data.design).share).replace(" %", ""), fontSize: 11 } : { show: false },
        emphasis: { scale: false, itemStyle: { borderColor: theme.ink, borderWidth: 2 } },
      }],
    };
  };
  const rest = e.parameters.map((_, k) => k).filter(k => k !== kx && k !== ky).map(k => e.parameters[k].label);
  const options = e.parameters.map((parameter, k) => [e.axes[k].key, parameter.label]);
  const pick = key => value => { model.set({ mx: axes[0].key, my: axes[1].key, [key]: value }); model.notify("data"); };
  return {
    title: mapTitle(e), label: `Success over ${axes[0].label} and ${axes[1].label}`, table: table(model), option,
    keys: theme => [...scaleKeys(), ...keysOf(e.designs.trials.some(Boolean) ? [["driven", "driven"]] : [])(theme)], numbers: () => designNumbers(e),
    controls: [select("→", options, axes[0].key, pick("mx")), select("↑", options, axes[1].key, pick("my")), scale(),
      legend([["driven", "driven"]]),
      make("span", { class: "note", text: rest.length && apart && side > 1 ? `In a cell: every ${rest.join(", ")}.` : "" })],
    of: ({ data }) => data?.design ?? null,
  };
}

function mapTitle({ realities, simulation }) {
  if (!realities) return `Success in ${simulation}, by design`;
  return realities.driven ? "Success of built cars, by design" : "A guess from simulation: success of built cars, by design";
}

// The colours of fadedColour.
export function scale() {
  const stops = [0, 0.25, 0.5, 0.75, 1].map(successColour).join();
  return make("span", { class: "scale", role: "img", "aria-label": "colours from 0 to 100 % success, the paler the less certain" }, "0 ", make("i", { style: `background:linear-gradient(90deg,${stops})` }), " 100 % success; pale: uncertain");
}

// Designs of a search with two objectives or more, by the first two.
function frontFigure(model) {
  const { e } = model, { objectives, points } = e.front, [first, second] = objectives;
  const shown = points.filter(({ values }) => values[0] !== null && values[1] !== null);
  // Only what was checked may be called best.
  const isBest = ({ fresh, beaten }) => fresh && !beaten;
  const option = theme => ({
    height: 380,
    grid: { left: 64, right: 18, top: 16, bottom: 50 },
    tooltip: designTip(model, theme),
    xAxis: axisStyle(theme, withUnit(first), { type: "value", scale: true }),
    yAxis: axisStyle(theme, withUnit(second), { type: "value", scale: true, nameGap: 44 }),
    series: [
      ...[0, 1].map(k => intervals("fresh", shown.filter(({ fresh, low }) => fresh && low[k] !== null).map(({ values, low, high }) => [values[1 - k], low[k], high[k]]), theme.soft, 1.5, 1, k === 0)),
      { type: "scatter", cursor: "pointer", data: shown.map(point => ({
        value: point.values.slice(0, 2), design: point.design,
        symbolSize: point.fresh ? 13 : 8,
        itemStyle: { color: isBest(point) ? theme.accent : theme.soft, opacity: !model.within[point.design] ? 0.1 : isBest(point) ? 1 : 0.5, borderColor: point.design === model.design ? theme.ink : theme.paper, borderWidth: point.design === model.design ? 3 : 1 },
      })) },
    ],
  });
  const row = ({ design, values, fresh, beaten }) => [e.designs.name[design], ...values.map(String), fresh ? "yes" : "no", beaten ? "yes" : "no"];
  return {
    title: "Non-dominated designs", label: `The search's designs by ${objectives.map(({ label }) => label).join(" and ")}`, option,
    table: () => ({ head: ["design", ...objectives.map(withUnit), "checked in fresh environments", "dominated"], rows: shown.map(row) }),
    numbers: () => ({
      head: ["design", ...objectives.flatMap(({ label, unit }) => ["", " low", " high"].map(end => columnName(label + end, unit))), "fresh", "dominated"],
      rows: shown.map(({ design, values, low, high, fresh, beaten }) => [e.designs.name[design], ...objectives.flatMap((_, k) => [values[k], fresh ? low[k] : null, fresh ? high[k] : null]), Boolean(fresh), Boolean(beaten)]),
    }),
    keys: keysOf([["belief", "non-dominated in fresh environments; small: rates of the search, which are biased upwards"]]),
    controls: [legend([["belief", "non-dominated in fresh environments"]]), make("span", { class: "note", text: "large: checked in these, with 95 % intervals; small: rates of the search, which are biased upwards" })],
    of: ({ data }) => data?.design ?? null,
  };
}
