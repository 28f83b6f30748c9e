// What if the world differed: sliders for the simulator's parameters; each change simulates all designs in all environments.
//
// Parameters and their limits: `drives.sliders` of page_data.py; what is known of them: `realities.unknowns`. Results: success by design beside the stored runs, how
// probable the trials are, and success of one design over each slider.

import { Chart, axisBetween, axisStyle, band, intervals, keysOf, successAxis, tooltip } from "./charts.js";
import { columnName, designNumbers } from "./csv.js";
import { counted, number, percent, shownUnit, unknownLabel, wilson, withUnit } from "./data.js";
import { LATER, SOON } from "./drives.js";
import { cannotSimulate } from "./simulators.js";
import { byId, legend, make } from "../../figures/web/dom.js";

const NOTE = "Each slider is a property that the simulator does not know. The mark below it is the simulated value. Moving it simulates all designs again, in this page.";
const REDRAW_MS = 250, WAIT_MS = 120;
// Values of each slider in its small picture, and environments of these.
const STEPS = 11, STEP_ENVIRONMENTS = 40;

export class WhatIf {
  constructor(model) { Object.assign(this, { model, charts: [], group: null }); }

  use() {
    for (const chart of this.charts) chart.dispose();
    this.stop();
    this.stopMarginals();
    Object.assign(this, { charts: [], rates: null });
    const { e } = this.model, place = byId("whatif");
    place.hidden = !e.sliders.length;
    if (place.hidden) return;
    this.sliders = e.sliders;
    this.unknowns = new Map((e.realities?.unknowns ?? []).map(unknown => [unknown.name, unknown]));
    byId("whatif-note").textContent = NOTE + (this.unknowns.size ? ` The grey bar below it is its likely range before any trial${e.realities.driven ? ", the coloured one that after the trials" : ""} (95 %).` : "");
    this.values = Object.fromEntries(this.sliders.map(({ name, nominal }) => [name, nominal]));
    this.fields = new Map();
    const figure = make("figure", {});
    byId("whatif-sliders").replaceChildren(...this.sliders.map(slider => this.row(slider)), this.buttons());
    byId("whatif-chart").replaceChildren(legend(this.legendEntries()), figure);
    byId("whatif-single").replaceChildren();
    this.chart = new Chart(figure, this.figure());
    this.charts.push(this.chart);
    this.show(this.model.state.reality);
    if (this.different.length) this.plan();
    else this.chart.draw();
  }

  // One slider, with bars for what is known of its value before and after the trials.
  row(slider) {
    const { name, low, high, nominal, meaning } = slider;
    const [unit, scale] = shownUnit(slider.unit), label = unknownLabel(name), step = (high - low) / 200;
    const range = make("input", { type: "range", min: low, max: high, step, value: nominal, "aria-label": `${label} (${unit})`, title: meaning });
    const output = make("output");
    const show = () => { output.textContent = this.shown(slider); range.setAttribute("aria-valuetext", output.textContent); };
    range.addEventListener("input", () => { this.values[name] = snapped(slider, Number(range.value), step); show(); this.changed(); });
    this.fields.set(name, { range, show });
    show();
    const percentOf = value => 100 * (Math.min(high, Math.max(low, value)) - low) / (high - low);
    const bars = this.spans(name).map(([kind, [least, , most]]) => make("i", { class: kind, style: `left:${percentOf(least)}%;width:${percentOf(most) - percentOf(least)}%`, title: `${kind} the trials, 95 %: ${number(scale * least)} to ${number(scale * most)} ${unit}` }));
    const mark = make("i", { class: "nominal", style: `left:${percentOf(nominal)}%`, title: `as simulated: ${number(scale * nominal)} ${unit}` });
    const marks = make("span", { class: "marks" }, ...bars, mark);
    return make("label", { class: "slider" }, make("span", { text: label }), make("span", { class: "track" }, range, marks), output);
  }

  // A slider's value with its unit.
  shown({ name, unit }) {
    const [symbol, scale] = shownUnit(unit);
    return `${number(scale * this.values[name])} ${symbol}`;
  }

  // What is known of an unknown: [kind, [low, median, high]], the most recent last.
  spans(name) {
    const unknown = this.unknowns.get(name);
    if (!unknown) return [];
    return [["before", unknown.before], ...(this.model.e.realities.driven ? [["after", unknown.after]] : [])];
  }

  buttons() {
    this.status = make("span", { class: "note", role: "status" });
    this.copied = make("button", { type: "button", text: "copy as reality.json", onclick: () => this.copy() });
    return make("p", { class: "controls" },
      make("button", { type: "button", text: "as simulated", onclick: () => this.reset() }), this.copied,
      make("button", { type: "button", id: "marginals", text: "which unknown matters most?", onclick: () => this.marginals() }), this.status);
  }

  get different() { return this.sliders.filter(({ name, nominal }) => this.values[name] !== nominal); }

  // Values of the address, the others as simulated.
  show(reality) {
    for (const { name, nominal } of this.sliders) {
      this.values[name] = reality[name] ?? nominal;
      const { range, show } = this.fields.get(name);
      range.value = this.values[name];
      show();
    }
  }

  reset() {
    this.show({});
    this.changed();
  }

  changed() {
    const reality = Object.fromEntries(this.different.map(({ name }) => [name, Number(this.values[name].toPrecision(6))]));
    Object.assign(this.values, reality);
    this.model.setReality(reality);
    this.plan();
  }

  // Another part of the page has set the reality.
  follow() {
    const { reality } = this.model.state;
    if (byId("whatif").hidden || this.sliders.every(({ name, nominal }) => this.values[name] === (reality[name] ?? nominal))) return;
    this.show(reality);
    this.plan();
  }

  // Simulates when the slider has rested for a moment.
  plan() {
    this.stop();
    this.waiting = setTimeout(() => this.simulate(), WAIT_MS);
  }

  stop() {
    clearTimeout(this.waiting);
    this.group?.drives.drop(this.group);
    this.group = null;
  }

  async simulate() {
    if (!this.different.length) {
      this.clear("");
      return;
    }
    const group = (this.group = { drives: this.model.drives });
    this.status.textContent = "simulating …";
    try {
      await this.simulateAll(group);
    } catch (error) {
      if (group !== this.group) return;
      this.stop();
      // Rates of other values may not stand beside these.
      this.clear(cannotSimulate(error));
    }
  }

  clear(text) {
    this.rates = null;
    this.status.textContent = text;
    this.chart.draw();
  }

  async simulateAll(group) {
    const { e, drives } = this.model, values = { ...this.values }, begun = performance.now();
    const rates = { passed: new Uint32Array(e.count), runs: new Uint32Array(e.count) };
    let done = 0, drawn = 0;
    const environments = drives.environments.filter(k => e.runsIn ? e.runsIn[k] : true);
    await Promise.all(environments.map(async environment => {
      const answers = await drives.simulate(drives.designs, environment, { values, priority: SOON, group });
      if (group !== this.group) return;
      answers.forEach((answer, k) => {
        rates.runs[drives.designs[k]] += 1;
        rates.passed[drives.designs[k]] += answer.outcome === "passed";
      });
      done += 1;
      this.rates = rates;
      if (performance.now() - drawn > REDRAW_MS || done === environments.length) {
        drawn = performance.now();
        this.chart.draw();
        this.report(done, environments.length, (drawn - begun) / 1000);
      }
    }));
    if (group === this.group) byId("whatif").dataset.done = String(done);
  }

  // How far it is, and how probable the trials are.
  report(done, all, seconds) {
    const { e } = this.model, driven = [...e.designs.trials.keys()].filter(k => e.designs.trials[k] && this.rates.runs[k] && e.designs.runs[k]);
    const score = (passed, runs) => driven.reduce((sum, k) => {
      const rate = (passed[k] + 0.5) / (runs[k] + 1), failed = e.designs.trials[k] - e.designs.trials_passed[k];
      return sum + e.designs.trials_passed[k] * Math.log(rate) + failed * Math.log(1 - rate);
    }, 0);
    const ratio = driven.length ? Math.exp(score(this.rates.passed, this.rates.runs) - score(e.designs.passed, e.designs.runs)) : null;
    const trials = ratio === null ? "" : ` The trials are ${ratio >= 1 ? `${factor(ratio)} times as probable as` : `${factor(1 / ratio)} times less probable than`} with the simulated values.`;
    this.status.textContent = `${done} of ${all} environments, ${seconds.toFixed(1)} s.${trials}`;
  }

  figure() {
    const { model } = this, { e } = model, { designs } = e, single = e.parameters.length === 1, axis = single ? e.axes[0] : null;
    const stored = k => (designs.runs[k] ? { passed: designs.passed[k], runs: designs.runs[k] } : null);
    // Before a slider moves, and until the first answers, it is as simulated: the first movement then shows a change.
    const now = k => (this.rates?.runs[k] ? { passed: this.rates.passed[k], runs: this.rates.runs[k] } : this.rates ? null : stored(k));
    const share = rate => (rate ? 100 * rate.passed / rate.runs : null), ends = rate => wilson(rate.passed, rate.runs).map(end => 100 * end);
    const order = () => (single ? [...axis.values.keys()].filter(k => axis.values[k] !== null).sort((a, b) => axis.values[a] - axis.values[b]) : [...Array(e.count).keys()]);
    const shown = () => order().filter(k => now(k) && stored(k));
    const text = rate => (rate ? `${percent(rate.passed / rate.runs)} (${wilson(rate.passed, rate.runs).map(percent).join(" to ")}), of ${counted(rate.runs, "environment")}` : "–");
    const tip = theme => tooltip(theme, ({ data }) => (data?.design === undefined ? [] : [make("b", { text: designs.name[data.design] }), `as simulated: ${text(stored(data.design))}`, `what if: ${text(now(data.design))}`]));
    const spans = (theme, at) => intervals("95 %", shown().map(k => [at(k), ...ends(now(k))]), theme.bad, 1.5, e.count > 100 ? 0.15 : 0.4);
    const trialRate = k => 100 * designs.trials_passed[k] / designs.trials[k];
    const option = theme => (single ? {
      height: 300, grid: { left: 58, right: 18, top: 16, bottom: 48 }, tooltip: tip(theme),
      xAxis: axisStyle(theme, withUnit(axis), { type: "value", scale: true }), yAxis: successAxis(theme),
      series: [
        { name: "as simulated", type: "line", symbol: "rect", symbolSize: 5, lineStyle: { color: theme.soft, width: 1, type: "dashed" }, itemStyle: { color: theme.soft }, data: order().map(k => ({ value: [axis.values[k], share(stored(k))], design: k })) },
        spans(theme, k => axis.values[k]),
        { name: "what if", type: "line", symbol: "circle", symbolSize: 6, lineStyle: { color: theme.bad, width: 2 }, itemStyle: { color: theme.bad }, z: 5, data: shown().map(k => ({ value: [axis.values[k], share(now(k))], design: k })) },
        { name: "trials", type: "scatter", symbol: "diamond", symbolSize: 13, z: 6, itemStyle: { color: theme.trial, borderColor: theme.paper }, data: order().filter(k => designs.trials[k]).map(k => ({ value: [axis.values[k], trialRate(k)], design: k })) },
      ],
    } : {
      height: 380, grid: { left: 58, right: 18, top: 16, bottom: 48 }, tooltip: tip(theme),
      xAxis: successAxis(theme, "as simulated", { nameGap: 26 }), yAxis: successAxis(theme, "what if"),
      series: [
        { type: "line", silent: true, symbol: "none", lineStyle: { color: theme.soft, type: "dashed", width: 1 }, data: [[0, 0], [100, 100]] },
        spans(theme, k => share(stored(k))),
        { name: "designs", type: "scatter", symbolSize: 9, cursor: "pointer", data: shown().map(k => ({ value: [share(stored(k)), share(now(k))], design: k, itemStyle: { color: designs.trials[k] ? theme.trial : theme.bad, opacity: model.within[k] ? 0.85 : 0.15 } })) },
      ],
    });
    const counts = rate => (rate ? `${rate.passed} of ${rate.runs}` : "–"), trialCounts = k => (designs.trials[k] ? `${designs.trials_passed[k]} of ${designs.trials[k]}` : "–");
    const table = () => ({ head: ["design", "as simulated", "what if", "what if, 95 %", "trials"], rows: order().map(k => [designs.name[k], counts(stored(k)), counts(now(k)), now(k) ? wilson(now(k).passed, now(k).runs).map(percent).join(" to ") : "–", trialCounts(k)]) });
    return { label: "Success of each design as simulated and with these values, with 95 % intervals", option, table, name: "what if", keys: keysOf(this.legendEntries()),
      numbers: () => designNumbers(e, order(), [["what_if_runs", k => now(k)?.runs ?? null], ["what_if_passed", k => now(k)?.passed ?? null]]) };
  }

  legendEntries() {
    return this.model.e.parameters.length === 1 ? [["engine", "as simulated"], ["whatif", "what if, with 95 % interval"], ["trials", "trials"]] : [["whatif", "a design, with 95 % interval"], ["trials", "a design with trials"]];
  }

  async copy() {
    const text = `${JSON.stringify(Object.fromEntries(this.different.map(({ name }) => [name, this.values[name]])), null, 1)}\n`;
    try { await navigator.clipboard.writeText(text); this.copied.textContent = "copied: foldcar sweep LISTING --reality reality.json"; } catch { window.prompt("reality.json:", text); }
    setTimeout(() => { this.copied.textContent = "copy as reality.json"; }, 4000);
  }

  stopMarginals() {
    this.single?.drives.drop(this.single);
    this.single = null;
  }

  // Success of the chosen design over each slider, all others as they are.
  async marginals() {
    this.stopMarginals();
    const group = (this.single = { drives: this.model.drives });
    try {
      await this.simulateMarginals(group);
    } catch (error) {
      if (group !== this.single) return;
      this.stopMarginals();
      byId("whatif-single").replaceChildren(make("p", { class: "note", role: "status", text: cannotSimulate(error) }));
    }
  }

  async simulateMarginals(group) {
    const { e, drives } = this.model, design = this.model.design ?? e.leader ?? drives.designs[0], place = byId("whatif-single"), environments = drives.environments.slice(0, STEP_ENVIRONMENTS), base = { ...this.values };
    const curves = this.sliders.map(slider => ({ ...slider, likely: this.spans(slider.name).at(-1)?.[1] ?? null, at: Array.from({ length: STEPS }, (_, k) => slider.low + (slider.high - slider.low) * k / (STEPS - 1)), passed: new Uint32Array(STEPS) }));
    const bar = make("progress", { max: "1" }), pictures = make("div", { class: "multiples" });
    // The sliders may move on; the pictures stay those of these values.
    const set = this.different.map(slider => `${unknownLabel(slider.name)} ${this.shown(slider)}`);
    const others = `the others as simulated${set.length ? `, except ${set.join(", ")}` : ""}`;
    place.replaceChildren(make("h3", { text: `Success of ${e.designs.name[design]} over each unknown, in ${environments.length} environments, ${others}` }), bar, pictures);
    let done = 0;
    const all = curves.length * STEPS * environments.length;
    await Promise.all(curves.flatMap(curve => curve.at.flatMap((value, k) => environments.map(async environment => {
      const [answer] = await drives.simulate([design], environment, { values: { ...base, [curve.name]: value }, priority: LATER, group });
      if (group !== this.single) return;
      curve.passed[k] += answer.outcome === "passed";
      done += 1;
      bar.value = done / all;
    }))));
    if (group !== this.single) return;
    bar.remove();
    // Difference of success over an interval of the values, or over all of them, as a share of 1.
    const change = ({ at, passed }, interval) => {
      const [low, , high] = interval ?? [at[0], null, at[STEPS - 1]];
      const counts = [interpolated(at, passed, low), ...[...passed].filter((_, k) => at[k] > low && at[k] < high), interpolated(at, passed, high)];
      return Math.max(0, Math.max(0, ...counts) - Math.min(environments.length, ...counts)) / environments.length;
    };
    const important = curve => change(curve, curve.likely);
    for (const curve of curves.sort((a, b) => important(b) - important(a))) {
      const [unit, scale] = shownUnit(curve.unit), label = unknownLabel(curve.name), points = interval => Math.round(100 * change(curve, interval));
      const range = curve.likely ? `${points(curve.likely)} points over its likely range` : `${points(null)} points`;
      const figure = make("figure", {}, make("figcaption", {}, make("b", { text: label }), ` changes success by ${range}`));
      pictures.append(figure);
      const chart = new Chart(figure, {
        label: `Success by ${label}`, name: `what if ${label}`, numbers: () => ({ head: [columnName(label, unit), "runs", "passed"], rows: curve.at.map((value, k) => [scale * value, environments.length, curve.passed[k]]) }), table: () => ({ head: [`${label} (${unit})`, "passed"], rows: curve.at.map((value, k) => [number(scale * value), `${curve.passed[k]} of ${environments.length}`]) }),
        option: theme => ({
          height: 150, grid: { left: 48, right: 10, top: 10, bottom: 40 }, xAxis: axisStyle(theme, `${label} (${unit})`, axisBetween(theme, scale * curve.low, scale * curve.high, 4)), yAxis: successAxis(theme, ""),
          series: [...(curve.likely ? [band([[scale * curve.likely[0], 0, 100], [scale * curve.likely[2], 0, 100]], theme.soft, 0.12)] : []), { type: "line", symbolSize: 4, lineStyle: { color: theme.bad }, itemStyle: { color: theme.bad }, data: curve.at.map((value, k) => [scale * value, 100 * curve.passed[k] / environments.length]),
            markLine: { silent: true, symbol: "none", label: { show: false }, lineStyle: { color: theme.soft, type: "dashed" }, data: [{ xAxis: scale * base[curve.name] }] } }],
        }),
      });
      this.charts.push(chart);
      chart.draw();
    }
    place.dataset.done = "1";
  }
}

// y at a value of x, between points with increasing x; beyond them the first or last y.
function interpolated(xs, ys, x) {
  const k = xs.findIndex(value => value >= x);
  if (k <= 0) return k < 0 ? ys[ys.length - 1] : ys[0];
  return ys[k - 1] + (ys[k] - ys[k - 1]) * (x - xs[k - 1]) / (xs[k] - xs[k - 1]);
}

// A slider's value near its nominal one is the nominal one.
const snapped = ({ nominal }, value, step) => (Math.abs(value - nominal) < 0.75 * step ? nominal : value);

const factor = ratio => (ratio > 1e6 ? "over a million" : ratio >= 100 ? Number(ratio.toPrecision(1)).toLocaleString("en") : number(Number(ratio.toPrecision(2))));
