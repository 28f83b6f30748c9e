// Where runs that did not pass ended: a histogram along the way to the goal, with the obstacles under it, and a sentence.

import { Chart, OUTCOMES, axisBetween, axisStyle, outcomeKey, outcomeKeys, tooltip } from "./charts.js";
import { counted, number, percent } from "./data.js";
import { make } from "../../figures/web/dom.js";

// Room beside and above the plot, height of the histogram and of an obstacle's lane (px).
const LEFT = 52, RIGHT = 14, TOP = 12, BARS = 170, LANE = 28, BLOCK = 9;
// The width of a letter of a name (px).
const LETTER = 6.5;
// More obstacles have no names.
const MAX_NAMED = 16;
// Obstacles that the sentence names, and the least share of the runs for which it does.
const MAX_SAID = 3, MIN_SHARE = 0.05;

export class RunEnds {
  constructor(model, place) {
    Object.assign(this, { model, place, ends: model.e.ends });
    this.sentence = make("p", { role: "status" });
    this.figure = make("figure", { "data-chart": "ends" });
    place.append(make("h3", { text: "Where do they fail?" }), this.sentence, this.figure, make("p", { class: "note", text:
      "Progress at the end of a run: the distance from start to goal, less the distance left from the car's middle. Blocks under the axis are the obstacles' mean places, pale where they lie in nine of ten environments." }));
    this.chart = new Chart(this.figure, { label: "Failed runs by how far they came, with the obstacles", option: (theme, width) => this.option(theme, width), table: () => this.table(),
      name: "ends of failed runs", numbers: () => this.numbers(), keys: () => outcomeKeys(model.e, k => this.counts.bins[k].some(Boolean)) });
  }

  // Counts by outcome and bin, and by obstacle (the last: at none), of the runs that the filters keep.
  count() {
    const { e, state, within, design } = this.model, { ends } = this;
    const kept = new Set(state.outcomes.map(name => e.outcomes.indexOf(name)));
    const bins = e.outcomes.map(() => new Array(ends.bins).fill(0)), obstacles = new Array(ends.obstacles.length + 1).fill(0);
    let total = 0;
    ends.count.forEach((count, row) => {
      const of = ends.design[row], outcome = ends.outcome[row];
      if (!within[of] || (design !== null && of !== design) || (kept.size && !kept.has(outcome))) return;
      bins[outcome][ends.bin[row]] += count;
      obstacles[ends.obstacle[row] < 0 ? ends.obstacles.length : ends.obstacle[row]] += count;
      total += count;
    });
    return { bins, obstacles, total };
  }

  // "46 % of the 312 failures of 95 mm end at kerb1 and 20 % at kerb2."
  said({ obstacles, total }) {
    const { e, state, design } = this.model, { ends } = this;
    const labels = state.outcomes.map(name => e.outcome_labels[e.outcomes.indexOf(name)]);
    const noun = labels.length ? "run" : "failure", of = `${design === null ? "" : ` of ${e.designs.name[design]}`}${labels.length ? ` (${labels.join(", ")})` : ""}`;
    if (!total) return `There are no ${noun}s${of}.`;
    const shares = obstacles.slice(0, -1).map((count, k) => [count / total, ends.obstacles[k].name]).sort(([a], [b]) => b - a);
    const named = shares.filter(([share], rank) => share >= MIN_SHARE && rank < MAX_SAID), all = `the ${counted(total, noun)}${of}`;
    if (!ends.obstacles.length) return `Where ${all} ${total === 1 ? "ends" : "end"}:`;
    if (!named.length) return `Hardly any of ${all} ends at an obstacle.`;
    const [[share, name], ...rest] = named, more = rest.map(([other, where], k) => `${k < rest.length - 1 ? "," : " and"} ${percent(other)} at ${where}`);
    return `${percent(share)} of ${all} end at ${name}${more.join("")}.`;
  }

  edge(bin) { return this.ends.from_m + bin * this.ends.step_m; }

  span(bin) { return `${number(this.edge(bin))} to ${number(this.edge(bin + 1))} m`; }

  mark() {
    this.counts = this.count();
    this.sentence.textContent = this.said(this.counts);
    this.figure.hidden = !this.counts.total;
    this.place.hidden = !this.counts.total && this.model.state.outcomes.length > 0;
    if (this.counts.total) this.chart.draw();
  }

  table() {
    const { e } = this.model, { bins } = this.counts, seen = bins.map((column, k) => k).filter(k => bins[k].some(Boolean)), { obstacles } = this.ends;
    const rows = [...Array(this.ends.bins).keys()].filter(bin => seen.some(k => bins[k][bin]));
    const there = bin => obstacles.filter(obstacle => obstacle.from_m < this.edge(bin + 1) && obstacle.to_m > this.edge(bin)).map(obstacle => obstacle.name).join(", ");
    return { head: ["ended after", ...seen.map(k => e.outcome_labels[k]), "on the way there"], rows: rows.map(bin => [this.span(bin), ...seen.map(k => String(bins[k][bin])), there(bin)]) };
  }

  numbers() {
    const { e } = this.model, { bins } = this.counts;
    return { head: ["from_m", "to_m", ...e.outcomes], rows: [...Array(this.ends.bins).keys()].map(bin => [this.edge(bin), this.edge(bin + 1), ...bins.map(column => column[bin])]) };
  }

  option(theme, width) {
    const { e } = this.model, { ends } = this, { bins } = this.counts, low = this.edge(0), high = this.edge(ends.bins);
    const named = ends.obstacles.length <= MAX_NAMED, pixels = metres => (metres - low) / (high - low) * Math.max(1, width - LEFT - RIGHT);
    const lanes = named ? laneOf(ends.obstacles, pixels) : ends.obstacles.map(() => 0), below = ends.obstacles.length ? LANE * (Math.max(...lanes) + 1) : 0;
    const seen = bins.map((column, k) => k).filter(k => bins[k].some(Boolean));
    const obstacle = ({ dataIndex }, api) => {
      const { name, from_m, to_m, least_m, most_m } = ends.obstacles[dataIndex], { y } = api.coord([low, 0]), top = TOP + BARS + 8 + LANE * lanes[dataIndex];
      const block = (from, to, opacity) => {
        const [[left], [right]] = [from, to].map(at => api.coord([Math.min(high, Math.max(low, at)), 0]));
        return { type: "rect", shape: { x: left, y: top, width: Math.max(1, right - left), height: BLOCK, r: 1 }, style: { fill: theme.ink, opacity } };
      };
      const [middle] = api.coord([(from_m + to_m) / 2, y ?? 0]), half = LETTER * name.length / 2;
      const text = { type: "text", style: { text: name, x: Math.min(width - half, Math.max(half, middle)), y: top + BLOCK + 2, align: "center", fill: theme.soft, fontSize: 11 } };
      return { type: "group", children: [block(least_m, most_m, named ? 0.18 : 0.06), block(from_m, to_m, named ? 0.65 : 0.12), ...(named ? [text] : [])] };
    };
    return {
      height: TOP + BARS + below + 52,
      grid: [BARS, BARS + below + 8].map(height => ({ left: LEFT, right: RIGHT, top: TOP, height, outerBoundsMode: "none" })),
      tooltip: tooltip(theme, ([{ dataIndex: bin }]) => {
        const ended = seen.filter(k => bins[k][bin]).map(k => make("span", {}, outcomeKey(e.outcomes[k]), `${e.outcome_labels[k]} ${bins[k][bin]}`));
        return [this.span(bin), ...(ended.length ? ended : ["no run"])];
      }, { trigger: "axis", axisPointer: { type: "shadow" } }),
      xAxis: [
        { gridIndex: 0, type: "category", data: [...Array(ends.bins).keys()].map(bin => this.span(bin)), axisLabel: { show: false }, axisTick: { show: false }, axisLine: { lineStyle: { color: theme.soft } } },
        { gridIndex: 1, ...axisStyle(theme, "progress from the start (m)", { ...axisBetween(theme, low, high, 6), splitLine: { show: false }, axisPointer: { show: false } }) },
      ],
      yAxis: [{ gridIndex: 0, ...axisStyle(theme, "runs", { type: "value", minInterval: 1, nameGap: 34 }) }, { gridIndex: 1, type: "value", show: false, min: 0, max: 1 }],
      series: [
        ...seen.map(k => ({ type: "bar", name: e.outcome_labels[k], stack: "ends", barCategoryGap: "6%", data: bins[k], itemStyle: { color: OUTCOMES[e.outcomes[k]] } })),
        { type: "custom", xAxisIndex: 1, yAxisIndex: 1, silent: true, clip: false, tooltip: { show: false }, data: ends.obstacles.map(obstacle => [obstacle.from_m, 0]), renderItem: obstacle },
        { type: "line", xAxisIndex: 1, yAxisIndex: 1, silent: true, data: [], tooltip: { show: false },
          markLine: { silent: true, symbol: "none", animation: false, lineStyle: { color: theme.soft, type: "dashed" }, label: { formatter: "goal", color: theme.soft, fontSize: 11, position: "insideEndTop", distance: 4 }, data: [{ xAxis: ends.goal_m }] } },
      ],
    };
  }
}

// The lane of each obstacle, so that neither blocks nor names overlap.
function laneOf(obstacles, pixels) {
  const ends = [], found = new Array(obstacles.length).fill(0);
  const box = ({ name, least_m, most_m, from_m, to_m }) => {
    const middle = pixels((from_m + to_m) / 2), half = LETTER * name.length / 2 + 4;
    return [Math.min(pixels(least_m), middle - half), Math.max(pixels(most_m), middle + half)];
  };
  for (const [k, [left, right]] of obstacles.map((obstacle, k) => [k, box(obstacle)]).sort(([, [a]], [, [b]]) => a - b)) {
    const lane = ends.findIndex(end => end <= left);
    found[k] = lane < 0 ? ends.length : lane;
    ends[found[k]] = right;
  }
  return found;
}
