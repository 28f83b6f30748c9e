// Charts by ECharts, of which only what the page uses is bundled: theme, size, print, and a table behind each chart.

import { BarChart, CustomChart, HeatmapChart, LineChart, ParallelChart, ScatterChart } from "echarts/charts";
import { GridComponent, MarkAreaComponent, MarkLineComponent, ParallelComponent, TooltipComponent } from "echarts/components";
import * as echarts from "echarts/core";
import { CanvasRenderer, SVGRenderer } from "echarts/renderers";
import { FONT, chartButtons } from "./downloads.js";
import { context2d, make } from "../../figures/web/dom.js";

echarts.use([BarChart, CustomChart, HeatmapChart, LineChart, ParallelChart, ScatterChart, GridComponent, MarkAreaComponent,
  MarkLineComponent, ParallelComponent, TooltipComponent, CanvasRenderer, SVGRenderer]);

// Of the colour of a design of which nothing is known.
const MIN_OPACITY = 0.1;
const SCALE = [[0xb3, 0x40, 0x00], [0xe8, 0xa8, 0x6b], [0xe4, 0xe0, 0xd4], [0x6b, 0xb8, 0x9e], [0x00, 0x70, 0x52]];
// Colours of the endings of runs: Okabe and Ito's, as in figures/style.py.
export const OUTCOMES = { passed: "#009e73", tipped: "#d55e00", stuck: "#56b4e9", off_course: "#cc79a7", timeout: "#f0e442", fault: "#777", terminated: "#0072b2", rejected: "#e69f00", failed: "#999" };
export const outcomeKey = name => make("i", { class: "key", style: `background:${OUTCOMES[name]}` });
const all = new Set();

export function colours() {
  const style = getComputedStyle(document.documentElement), of = name => style.getPropertyValue(`--${name}`).trim();
  return Object.fromEntries(["ink", "soft", "line", "ground", "paper", "accent", "good", "bad", "open", "trial"].map(name => [name, of(name)]));
}

// On paper, also while the page is dark.
function paperColours() {
  const { classList } = document.documentElement, printed = classList.contains("print");
  classList.add("print");
  const theme = colours();
  classList.toggle("print", printed);
  return theme;
}

// Kinds of keys (classes of study.css), as shapes and names of colours of a saved picture.
const KEYS = { reality: ["line", "accent"], belief: ["dot", "accent"], simulation: ["frame", "soft"], engine: ["dashed", "ink"], "engine dotted": ["dotted", "ink"], driven: ["frame", "trial"], whatif: ["dot", "bad"], trials: ["diamond", "trial"] };
export const keysOf = entries => theme => entries.map(([kind, text]) => ({ shape: KEYS[kind][0], colour: theme[KEYS[kind][1]], text }));
// Of the outcomes, by index, that occur.
export const outcomeKeys = ({ outcomes, outcome_labels }, occurs) => outcomes.map((name, k) => ({ shape: "box", colour: OUTCOMES[name], text: outcome_labels[k] })).filter((_, k) => occurs(k));
export const scaleKeys = () => [0, 0.25, 0.5, 0.75, 1].map(share => ({ shape: "box", colour: successColour(share), text: `${100 * share} %${share === 1 ? " success; pale: uncertain" : ""}` }));

// Success, 0 to 1, from brown over grey to green: told apart by colour-blind readers, too.
export const successColour = share => `rgb(${successParts(share).join()})`;

function successParts(share) {
  if (share === null) return [0x9a, 0x9a, 0x9a];
  const place = Math.min(0.9999, Math.max(0, share)) * (SCALE.length - 1), low = SCALE[Math.floor(place)], high = SCALE[Math.floor(place) + 1];
  return low.map((part, k) => Math.round(part + (place % 1) * (high[k] - part)));
}

// The colour of success on paper, the paler the wider its interval (0 to 1) is, and the colour of letters on it.
export function fadedColour({ share, width }, { paper }) {
  const hex = paper.length === 4 ? [...paper.slice(1)].map(digit => digit + digit) : paper.slice(1).match(/../g);
  const ground = hex.map(pair => parseInt(pair, 16)), opacity = share === null ? 1 : Math.max(MIN_OPACITY, 1 - width);
  const parts = successParts(share).map((part, k) => Math.round(ground[k] + opacity * (part - ground[k])));
  // Relative luminance, roughly.
  const isLight = 0.299 * parts[0] + 0.587 * parts[1] + 0.114 * parts[2] > 130;
  return { colour: `rgb(${parts.join()})`, letters: isLight ? "#111" : "#fff" };
}

const redraw = () => { for (const chart of all) chart.draw(); };
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
window.addEventListener("beforeprint", () => {
  document.documentElement.classList.add("print");
  for (const chart of all) chart.draw(true);
  for (const { chart } of all) chart?.getZr().flush();
});
window.addEventListener("afterprint", () => { document.documentElement.classList.remove("print"); redraw(); });
// A chart is drawn when it comes near the window (px): the page answers at once, however many there are.
const NEAR = 300;
const isNear = ({ place }) => {
  const { top, bottom } = place.getBoundingClientRect();
  return top < window.innerHeight + NEAR && bottom > -NEAR;
};
const drawStale = () => { for (const chart of all) if (chart.stale && isNear(chart)) chart.draw(); };
for (const event of ["scroll", "resize"]) window.addEventListener(event, drawStale, { passive: true });

// Text browsers have no canvas, and some readers block it.
let canvas = null;
const hasCanvas = () => (canvas ??= context2d(make("canvas")) !== null);

// zrender paints a large canvas over several frames, and a frame to come does not notice that the chart is gone: another
// id of the drawing ends them.
function disposeOf(chart) {
  if (!chart) return;
  chart.getZr().painter._redrawId = null;
  chart.dispose();
}

export class Chart {
  // option(colours, width): of ECharts; table(): {head, rows} of the same numbers, for readers of tables and of screens. Of saved files:
  // name, numbers(): {head, rows} for CSV, keys(colours): those of downloads.js, complete(picture): adds what the option lacks.
  constructor(figure, { label, option, table, numbers, name = figure.dataset.chart ?? label, keys = () => [], complete = () => {}, renderer = "svg", drawn = () => {} }) {
    Object.assign(this, { figure, label, option, table, numbers, name, keys, complete, drawn });
    this.place = make("div", { class: "chart", role: "img", "aria-label": `${label}. The numbers are in the table below.` });
    const caption = figure.querySelector("figcaption");
    if (caption) caption.after(this.place);
    else figure.prepend(this.place);
    figure.append(chartButtons(this, paperColours));
    if (table) figure.append((this.behind = tableBehind(table)));
    this.renderer = renderer;
    this.handlers = [];
    this.width = this.place.clientWidth;
    // In the next frame, because drawing changes sizes, which an observer may not do.
    this.seen = new ResizeObserver(() => requestAnimationFrame(() => {
      if (this.place.clientWidth === this.width) return;
      this.width = this.place.clientWidth;
      this.draw();
    }));
    this.seen.observe(this.place);
    all.add(this);
  }

  // What a mouse does to the chart's marks: of ECharts.
  on(event, act) { this.handlers.push([event, act]); }

  // always: although it is not in sight.
  draw(always = false) {
    if (this.disposed) return;
    if (this.behind) fillTable(this.behind, this.table);
    const theme = colours(), { height, ...option } = this.option(theme, this.place.clientWidth);
    if (height) this.place.style.height = `${height}px`;
    this.stale = !always && !isNear(this);
    if (this.stale) return;
    // On paper all charts are SVG: browsers print a canvas as it was some frames ago, without what is still to be painted.
    const renderer = document.documentElement.classList.contains("print") || !hasCanvas() ? "svg" : this.renderer;
    try {
      this.paint(renderer, option, theme);
    } catch ({ message }) {
      // The page stays readable in a browser that cannot draw. The next drawing begins anew.
      try { disposeOf(this.chart); } catch { /* It was never complete. */ }
      const text = `This browser cannot draw this chart (${message}). Its numbers are in the table below.`;
      this.place.textContent = text;
      this.place.style.height = "auto";
      this.place.setAttribute("aria-label", `${this.label}. ${text}`);
      Object.assign(this, { chart: null, drawnBy: null });
    }
  }

  paint(renderer, option, theme) {
    if (this.drawnBy !== renderer) {
      disposeOf(this.chart);
      this.chart = echarts.init(this.place, null, { renderer });
      this.drawnBy = renderer;
      for (const handler of this.handlers) this.chart.on(...handler);
    }
    // A resize draws the whole chart once more.
    const { chart, place } = this;
    if (chart.getWidth() !== place.clientWidth || chart.getHeight() !== place.clientHeight) chart.resize();
    chart.setOption({ animation: false, textStyle: { fontFamily: FONT, color: theme.ink }, ...option }, { notMerge: true });
    this.drawn();
  }

  // A frame or an answer may still come that draws it.
  dispose() {
    this.disposed = true;
    all.delete(this);
    this.seen.disconnect();
    disposeOf(this.chart);
  }
}

// A table that is made when it is opened. A chart fills its own anew with each drawing.
export function tableBehind(table, title = "as a table") {
  const details = make("details", { class: "behind" }, make("summary", { text: title }));
  details.addEventListener("toggle", () => fillTable(details, table));
  return details;
}

// An equal table stays, and with it what is marked in it.
function fillTable(details, table) {
  if (!details.open) return;
  const { head, rows } = table(), filled = plainTable(head, rows), place = details.querySelector("div");
  if (!place) details.append(make("div", { class: "wide" }, filled));
  else if (!place.firstChild.isEqualNode(filled)) place.replaceChildren(filled);
}

export function plainTable(head, rows) {
  const line = row => make("tr", {}, ...row.map((cell, k) => (k ? make("td", {}, cell) : make("th", { scope: "row" }, cell))));
  return make("table", {}, make("thead", {}, make("tr", {}, ...head.map(text => make("th", { scope: "col", text })))), make("tbody", {}, ...rows.map(line)));
}

// What the charts have in common.
export function axisStyle(theme, name, more = {}) {
  return {
    name, nameLocation: "middle", nameTextStyle: { color: theme.soft, fontSize: 12 }, nameGap: 26,
    axisLine: { show: true, onZero: false, lineStyle: { color: theme.soft } }, axisTick: { lineStyle: { color: theme.soft } },
    axisLabel: { color: theme.soft, fontSize: 11, hideOverlap: true }, splitLine: { lineStyle: { color: theme.line } }, ...more,
  };
}

// The ends of a range and round numbers between them, none so near an end that their labels run together ("45 46").
export function ticksBetween(low, high, intervals = 5) {
  if (!(high > low)) return [low];
  const size = 10 ** Math.floor(Math.log10((high - low) / intervals)), step = [1, 2, 5, 10].map(k => k * size).find(k => (high - low) / k <= intervals + 1e-9), ticks = [low];
  for (let k = Math.ceil(low / step); k * step < high; k++) if (Math.min(k * step - low, high - k * step) >= 0.7 * step) ticks.push(Number((k * step).toPrecision(12)));
  return [...ticks, high];
}

// What an axis of numbers from low to high has instead of ECharts' ticks.
export const axisBetween = (theme, low, high, intervals) => {
  const customValues = ticksBetween(low, high, intervals);
  return { type: "value", min: low, max: high, axisTick: { lineStyle: { color: theme.soft }, customValues }, axisLabel: { color: theme.soft, fontSize: 11, hideOverlap: true, customValues } };
};

export function successAxis(theme, name = "success", more = {}) {
  return axisStyle(theme, name, { type: "value", min: 0, max: 100, nameGap: 36, ...more, axisLabel: { color: theme.soft, fontSize: 11, formatter: "{value} %" } });
}

// A chart's tooltip. lines(marks): its lines, texts or elements; none: no tooltip. Texts are never read as HTML, because names are
// whatever the author of a store wrote. more: of ECharts.
export const tooltip = (theme, lines, more = {}) => ({
  ...more, formatter: marks => lines(marks).map(line => make("div", {}, line)),
  backgroundColor: theme.paper, borderColor: theme.line, textStyle: { color: theme.ink, fontSize: 12 }, confine: true, transitionDuration: 0,
});

// Vertical intervals: data rows are [x, low, high]; lying ones are [y, low, high].
export function intervals(name, data, colour, width = 1.5, opacity = 1, lying = false) {
  return {
    name, type: "custom", data, silent: true, z: 3, encode: lying ? { x: [1, 2], y: 0 } : { x: 0, y: [1, 2] },
    renderItem(params, api) {
      const [at, low, high] = [0, 1, 2].map(k => api.value(k));
      const [[x1, y1], [x2, y2]] = [low, high].map(end => api.coord(lying ? [end, at] : [at, end]));
      if (Number.isNaN(low)) return null;
      return { type: "line", shape: { x1, y1, x2, y2 }, style: { stroke: colour, lineWidth: width, opacity } };
    },
  };
}

// A band between two lines: [x, low, high] rows, ascending in x.
export function band(rows, colour, opacity) {
  return {
    type: "custom", data: [0], silent: true, z: 1, tooltip: { show: false },
    renderItem(params, api) {
      const up = rows.map(([x, , high]) => api.coord([x, high])), down = rows.map(([x, low]) => api.coord([x, low])).reverse();
      return { type: "polygon", shape: { points: [...up, ...down] }, style: { fill: colour, opacity }, clip: true };
    },
  };
}
