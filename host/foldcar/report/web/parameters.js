// What matters of the parameters, and the designs by all their numbers: parallel coordinates with brushes, a scatter.

import { designTip, linked, scale } from "./belief.js";
import { Chart, axisBetween, axisStyle, band, fadedColour, scaleKeys, successAxis, successColour, tooltip } from "./charts.js";
import { designNumbers } from "./csv.js";
import { BELIEF, SIMULATED, hasValues, isSuccess, number, percent, shownSuccess, valueText, withUnit } from "./data.js";
import { designColumns, MAX_ROWS } from "./design_table.js";
import { byId, context2d, make, select } from "../../figures/web/dom.js";

// Sides of the parallel axes, height of a line of their headings, space between two headings, size of their letters (px).
const SIDES = 92, LINE = 14, SPACE = 16, HEADING = 12;
const BANDS = "Bands hold the differences between values, with 95 %: how far success at a value is above or below the mean over all values. All values were run in the same environments, so the level of a whole curve is less sure than its shape.";

export class Parameters {
  constructor(model) { this.model = model; this.charts = []; }

  use() {
    for (const chart of this.charts) chart.dispose();
    this.charts = [];
    const { model } = this, { e } = model;
    const several = e.parameters.length > 1;
    byId("importance").replaceChildren(...(several && e.importance.length ? importance(e) : []));
    byId("effects").replaceChildren();
    byId("effects-note").textContent = several && e.effects.length ? BANDS : "";
    if (several) for (const effect of e.effects) {
      const place = byId("effects").appendChild(make("div"));
      this.charts.push(new Chart(place.appendChild(make("figure")), effectFigure(e, effect)));
      place.append(make("p", { class: "note", text: `In ${e.simulation} by ${e.parameters[effect.parameter].label}: ${effect.over}. Level of the whole curve: ${effect.level.map(percent).join(" to ")}.` }));
    }
    const place = byId("designs");
    place.replaceChildren();
    if (e.count > 1) {
      this.parallel = new Parallel(model, place);
      this.charts.push(this.parallel.chart);
      this.scatter(place);
    } else {
      this.parallel = this.points = null;
    }
    byId("parameters").hidden = !e.count || (e.count < 2 && !several);
    for (const chart of this.charts) if (chart !== this.points) chart.draw();
  }

  mark() {
    if (this.points) this.points.draw();
    if (this.parallel) this.parallel.mark();
  }

  hover() { if (this.parallel) this.parallel.hover(); }

  scatter(place) {
    const { model } = this, { e } = model, usable = e.axes.filter(hasValues);
    const named = key => usable.find(axis => axis.key === key), { state } = model;
    // An axis that is not chosen is another one than the chosen.
    const x = named(state.x) ?? [named("time"), ...usable].find(axis => axis && axis.key !== state.y), y = named(state.y) ?? [named(BELIEF), named(SIMULATED), ...usable].find(axis => axis && axis !== x) ?? x;
    const options = usable.map(axis => [axis.key, axis.label]), pick = key => value => { model.set({ x: x.key, y: y.key, [key]: value }); this.use(); this.mark(); };
    const figure = make("figure", { "data-chart": "scatter" });
    place.append(make("div", { class: "controls" }, select("→", options, x.key, pick("x")), select("↑", options, y.key, pick("y")), scale()), figure);
    const axisOf = (theme, axis, up) => (isSuccess(axis.key) && up ? successAxis(theme) : axisStyle(theme, withUnit(axis), { type: "value", scale: true, nameGap: up ? 46 : 26 }));
    this.points = new Chart(figure, {
      label: `${y.label} by ${x.label} of every design`, table: () => designTable(model), keys: scaleKeys, numbers: () => shownDesigns(model),
      option: theme => ({
        height: 340, grid: { left: 64, right: 18, top: 14, bottom: 48 },
        tooltip: designTip(model, theme, design => [x, y].map(axis => `${axis.label} ${valueText(axis, axis.values[design])}`)),
        xAxis: axisOf(theme, x, false), yAxis: axisOf(theme, y, true),
        series: [{ type: "scatter", cursor: "pointer", symbolSize: 11, data: [...Array(e.count).keys()].filter(k => x.values[k] !== null && y.values[k] !== null).map(k => ({
          value: [x.values[k], y.values[k]], design: k, symbol: e.designs.trials[k] ? "diamond" : "circle",
          itemStyle: { color: fadedColour(shownSuccess(e, k), theme).colour, opacity: model.within[k] ? 1 : 0.1, borderColor: k === model.design ? theme.ink : theme.soft, borderWidth: k === model.design ? 3 : 0.7 } })) }],
      }),
    });
    linked(model, this.points, ({ data }) => data?.design ?? null);
    this.charts.push(this.points);
  }
}

function importance(e) {
  const rows = [...e.importance].sort((a, b) => b.share - a.share).map(({ parameter, share, low, high }) => make("tr", {},
    make("th", { scope: "row", text: e.parameters[parameter].label }),
    make("td", { class: "bar" }, make("i", { style: `width:${100 * share}%` }), ...(low === null || low === undefined ? [] : [make("b", { style: `left:${100 * low}%;width:${100 * (high - low)}%` })])),
    make("td", { text: low === null || low === undefined ? percent(share) : `${percent(share)} (${percent(low)} to ${percent(high)})` })));
  return [make("h3", { text: "What success depends on" }), make("table", { class: "bars" }, make("tbody", {}, ...rows)),
    make("p", { class: "note", text: `Share of the differences in success in ${e.simulation} that a parameter accounts for, alone and with others, by a smooth model of all of them; 95 % intervals.` })];
}

function effectFigure(e, { parameter, grid, mean, low, high, curves, over }) {
  const axis = e.axes[parameter], hundred = value => 100 * value, level = mean.reduce((sum, value) => sum + value, 0) / mean.length;
  const points = value => `${value < level ? "−" : "+"}${Math.abs(Math.round(100 * (value - level)))}`, difference = k => `${points(low[k])} to ${points(high[k])} points`;
  return {
    label: `Success by ${axis.label}, ${over}`, name: `effect of ${axis.label}`,
    // The band is of differences from the mean over all values, as drawn.
    numbers: () => ({
      head: [e.parameters[parameter].name, "success", "success_low", "success_high", ...curves.map((_, n) => `combination_${n + 1}_success`)],
      rows: grid.map((value, k) => [value, mean[k], low[k], high[k], ...curves.map(curve => curve[k])]),
    }),
    table: () => ({ head: [withUnit(axis), "success", "to the mean over all values (95 %)"], rows: grid.map((value, k) => [String(value), percent(mean[k]), difference(k)]) }),
    option: theme => ({
      height: 210, grid: { left: 52, right: 12, top: 12, bottom: 42 },
      tooltip: tooltip(theme, ([point]) => [`${axis.label} ${number(point.value[0])} ${axis.unit}`, `${percent(mean[point.dataIndex])}, to the mean over all values ${difference(point.dataIndex)}`], { trigger: "axis" }),
      xAxis: axisStyle(theme, withUnit(axis), axisBetween(theme, grid[0], grid[grid.length - 1])),
      yAxis: successAxis(theme),
      series: [
        { type: "line", data: grid.map((at, k) => [at, hundred(mean[k])]), symbol: "none", lineStyle: { color: theme.accent, width: 3 }, z: 4 },
        band(grid.map((at, k) => [at, Math.max(0, hundred(low[k])), Math.min(100, hundred(high[k]))]), theme.accent, 0.22),
        ...curves.map(curve => ({ type: "line", data: grid.map((at, k) => [at, hundred(curve[k])]), symbol: "none", silent: true, lineStyle: { color: theme.soft, width: 1, opacity: 0.35 }, z: 2, tooltip: { show: false } })),
      ],
    }),
  };
}

const shownDesigns = ({ e, within }) => designNumbers(e, [...Array(e.count).keys()].filter(k => within[k]));

function designTable({ e, within }) {
  const columns = designColumns(e), shown = [...Array(e.count).keys()].filter(k => within[k]).slice(0, MAX_ROWS);
  return { head: columns.map(({ head }) => head), rows: shown.map(k => columns.map(({ cell }) => cell(k))) };
}

// Axes of which something is known.
const drawable = e => e.axes.filter(axis => hasValues(axis) && (axis.parameter !== undefined || isSuccess(axis.key) || new Set(axis.values).size > 1));

class Parallel {
  constructor(model, place) {
    this.model = model;
    const { e } = model;
    this.axes = drawable(e);
    const figure = make("figure", { "data-chart": "parallel" });
    place.append(make("h3", { text: "Designs by all their numbers" }), make("p", { class: "note", text: "Drag along an axis to keep a range of it. Less is better where the numbers fall." }), this.kept = make("p", { class: "kept", role: "status" }), figure, this.fields());
    this.chart = new Chart(figure, { label: "Every design as a line over its parameters and results", renderer: e.count > 300 ? "canvas" : "svg", option: (theme, width) => this.option(theme, width), table: () => designTable(model), drawn: () => this.restore(), keys: scaleKeys, numbers: () => shownDesigns(model), complete: picture => this.brush(picture) });
    this.chart.on("axisareaselected", event => {
      const { parallelAxisId: key, intervals } = event;
      if (this.restoring || !e.axis[key]) return;
      const limits = this.limits(e.axis[key]);
      const wanted = (intervals || []).map(([low, high]) => [Math.max(limits[0], round(low)), Math.min(limits[1], round(high))]);
      if (JSON.stringify(wanted) !== JSON.stringify(model.state.brushes[key] || [])) model.brush(key, wanted);
    });
    linked(model, this.chart, event => (event.componentType === "series" && event.seriesIndex === 0 ? event.dataIndex : null));
  }

  option(theme, width) {
    const { e } = this.model, headings = headingLines(this.axes, (width - SIDES) / (this.axes.length - 1) - SPACE), upright = headings === null;
    const head = upright ? 0 : Math.max(0, ...headings.map(lines => lines.length));
    const dims = this.axes.map((axis, dim) => {
      const [least, most] = this.limits(axis);
      return {
        dim, id: axis.key, name: upright ? withUnit(axis) : headings[dim].join("\n"), realtime: false, ...withGround(axisBetween(theme, least, most, upright ? 5 : 6), theme), inverse: turned(axis, upright), nameLocation: turned(axis, upright) || upright ? "start" : "end",
      };
    });
    const data = [...Array(e.count).keys()].map(k => ({ value: this.valuesOf(k), lineStyle: { color: successColour(shownSuccess(e, k).share) } }));
    const many = e.count > 300;
    return {
      height: upright ? 64 * this.axes.length + 40 : 302 + LINE * head,
      parallel: { left: upright ? 20 : SIDES / 2, right: upright ? 24 : SIDES / 2, top: upright ? 34 : 18 + LINE * head, bottom: upright ? 30 : 24, layout: upright ? "vertical" : "horizontal",
        parallelAxisDefault: {
          z: 5, nameGap: upright ? 4 : 14, nameTextStyle: { color: theme.ink, fontSize: HEADING, lineHeight: LINE, ...(upright ? { align: "left", verticalAlign: "bottom", padding: [0, 3, 2, 3], backgroundColor: theme.paper } : {}) },
          axisLine: { lineStyle: { color: theme.soft } },
          areaSelectStyle: { width: upright ? 26 : 18, borderColor: theme.accent, borderWidth: 1.5, color: theme.accent, opacity: 0.25 },
        } },
      parallelAxis: dims,
      series: [
        { id: "all", type: "parallel", data, lineStyle: { width: many ? 1 : 1.8, opacity: many ? 0.35 : 0.75 }, inactiveOpacity: 0.06, activeOpacity: many ? 0.6 : 0.95, emphasis: { lineStyle: { width: 4, opacity: 1 } }, progressive: 0, smooth: false, z: 2 },
        { id: "chosen", type: "parallel", data: this.line(), lineStyle: { width: 4, color: theme.ink, opacity: 1 }, inactiveOpacity: 0.9, activeOpacity: 1, silent: true, z: 4 },
      ],
    };
  }

  // Round numbers that hold all values.
  limits(axis) {
    if (isSuccess(axis.key)) return [0, 100];
    const known = axis.values.filter(value => value !== null), least = Math.min(...known), most = Math.max(...known);
    if (axis.parameter !== undefined) return least < most ? [least, most] : [least - 1, most + 1];
    const step = 10 ** Math.floor(Math.log10((most - least) / 4 || 1)), at = [1, 2, 5, 10].map(k => k * step).find(k => (most - least) / k <= 8);
    return [round(Math.floor(least / at) * at), round(Math.ceil(most / at) * at)];
  }

  valuesOf(k) { return this.axes.map(axis => axis.values[k] ?? "-"); }

  line() {
    const k = this.model.design;
    return k === null ? [] : [{ value: this.valuesOf(k) }];
  }

  chosen() { if (!this.chart.stale) this.chart.chart?.setOption({ series: [{ id: "all" }, { id: "chosen", data: this.line() }] }); }

  // Without setOption, which would end a brush that is being drawn.
  hover() {
    if (this.chart.stale || !this.chart.chart) return;
    const { chart } = this.chart, seriesId = "all";
    chart.dispatchAction({ type: "downplay", seriesId });
    if (this.model.hovered !== null) chart.dispatchAction({ type: "highlight", seriesId, dataIndex: this.model.hovered });
  }

  // Gives a picture of the chart the brushes of the state.
  brush(picture) {
    for (const [key, intervals] of Object.entries(this.model.state.brushes)) if (this.axes.some(axis => axis.key === key)) picture.dispatchAction({ type: "axisAreaSelect", parallelAxisId: key, intervals });
  }

  // The chart's brushes as the state has them.
  restore() {
    if (this.chart.stale || !this.chart.chart) return;
    this.restoring = true;
    for (const axis of this.axes) {
      const intervals = this.model.state.brushes[axis.key] || [];
      if (intervals.length || this.brushed?.has(axis.key)) this.chart.chart.dispatchAction({ type: "axisAreaSelect", parallelAxisId: axis.key, intervals });
    }
    this.brushed = new Set(Object.keys(this.model.state.brushes));
    this.restoring = false;
  }

  mark() {
    const { model } = this, { e } = model, brushes = Object.entries(model.state.brushes).filter(([key]) => e.axis[key]);
    this.restore();
    this.chosen();
    const kept = model.within.filter(Boolean).length;
    this.kept.replaceChildren(...(brushes.length ? [`${kept} of ${e.count} designs: `, ...brushes.map(([key, intervals]) => make("button", { type: "button", class: "chip", title: "let go", text: `${e.axis[key].label} ${intervals.map(one => one.map(number).join(" to ")).join(", ")} ✕`, onclick: () => model.brush(key, []) }))] : []));
    for (const input of this.inputs) {
      const [interval] = model.state.brushes[input.dataset.key] || [], value = interval ? interval[Number(input.dataset.end)] : "";
      if (document.activeElement !== input) input.value = value;
    }
  }

  // The same ranges as numbers, for the keyboard.
  fields() {
    const { model } = this;
    this.inputs = [];
    const rows = this.axes.map(axis => {
      const limits = this.limits(axis), ends = [0, 1].map(end => {
        const input = make("input", { type: "number", step: "any", "data-key": axis.key, "data-end": end, placeholder: number(limits[end]), "aria-label": `${axis.label} ${end ? "at most" : "at least"}` });
        this.inputs.push(input);
        return input;
      });
      for (const input of ends) input.addEventListener("change", () => {
        const [low, high] = ends.map((field, end) => (field.value === "" ? limits[end] : Number(field.value)));
        model.brush(axis.key, ends.every(field => field.value === "") || !(low <= high) ? [] : [[low, high]]);
      });
      return make("label", {}, `${withUnit(axis)} `, ends[0], " to ", ends[1]);
    });
    return make("details", { class: "behind" }, make("summary", { text: "ranges as numbers" }), make("div", { class: "fields" }, ...rows));
  }
}

// The lines of each axis's heading, none wider than `width` (px); null if a word is wider.
function headingLines(axes, width) {
  const ruler = context2d(make("canvas"));
  if (ruler) ruler.font = `${HEADING}px ${getComputedStyle(document.body).fontFamily}`;
  // Without a canvas: letters of an ordinary width.
  const fits = text => (ruler ? ruler.measureText(text).width : 0.55 * HEADING * text.length) <= width;
  const headings = axes.map(({ label, unit }) => {
    const lines = [];
    for (const word of label.split(" ")) {
      if (lines.length && fits(`${lines.at(-1)} ${word}`)) lines.push(`${lines.pop()} ${word}`);
      else lines.push(word);
    }
    return unit ? [...lines, unit] : lines;
  });
  return headings.flat().every(fits) ? headings : null;
}

// Labels of an axis stand on the ground's colour, so that no line runs through them.
const withGround = (axis, { paper }) => ({ ...axis, axisLabel: { ...axis.axisLabel, backgroundColor: paper, padding: [1, 1] } });

// Better is above.
const turned = (axis, upright) => !upright && axis.better === "less";
const round = value => Number(value.toPrecision(6));
