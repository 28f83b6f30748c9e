// The drawn realities: a thin curve of success over the design for each, and the line that says what the chosen one is.

import { unknownLabel, unknownText } from "./data.js";
import { make } from "../../figures/web/dom.js";

const THIN = 0.9, THICK = 3;
// Half the length of the mark of a reality over a single design (px).
const MARK = 12;

// The series of all curves and that of the chosen one. x: the designs' places, order: their indices from left to right.
export function realityCurves({ e, reality }, x, order, theme) {
  const { rates } = e.realities;
  const points = (k, api) => {
    const places = order.filter(design => rates[k][design] !== null).map(design => api.coord([x[design], 100 * rates[k][design]]));
    return places.length === 1 ? [-MARK, MARK].map(dx => [places[0][0] + dx, places[0][1]]) : places;
  };
  const curve = (k, api, style) => ({ type: "polyline", shape: { points: points(k, api) }, style: { fill: "none", ...style } });
  // ECharts takes marks with values only: theirs is any place inside the axes.
  const value = [x[order[0]], 0];
  return [
    { name: "realities", type: "custom", z: 0, cursor: "pointer", data: rates.map((_, k) => ({ value, reality: k })),
      renderItem: ({ dataIndex }, api) => ({
        ...curve(dataIndex, api, { stroke: theme.accent, lineWidth: THIN, opacity: 0.3 }), emphasis: { style: { stroke: theme.ink, lineWidth: 2, opacity: 1 } },
      }) },
    { name: "chosen reality", type: "custom", z: 4, silent: true, data: reality === null ? [] : [value],
      renderItem: (params, api) => curve(reality, api, { stroke: theme.ink, lineWidth: THICK, opacity: 0.9 }) },
  ];
}

// A line below the chart: the chosen reality's values, and buttons to go from one to the next by their mean success.
export class RealityLine {
  constructor(model, place) {
    this.model = model;
    const { rates } = model.e.realities, mean = row => row.reduce((sum, rate) => sum + rate, 0);
    this.order = [...rates.keys()].sort((a, b) => mean(rates[a]) - mean(rates[b]));
    this.message = make("span", { class: "note", role: "status" });
    this.none = make("button", { type: "button", text: "choose none", onclick: () => model.chooseReality(null) });
    place.append(make("p", { class: "controls", id: "reality" },
      make("button", { type: "button", text: "‹ worse reality", onclick: () => this.step(-1) }), make("button", { type: "button", text: "better reality ›", onclick: () => this.step(1) }), this.none, this.message));
  }

  step(by) {
    const { model, order } = this, last = order.length - 1, at = model.reality === null ? Math.floor(last / 2) : order.indexOf(model.reality) + by;
    model.chooseReality(order[Math.max(0, Math.min(last, at))]);
  }

  mark() {
    const { e, reality } = this.model;
    this.none.hidden = reality === null;
    this.message.textContent = reality === null ? "" : `The chosen reality: ${realityText(e, reality)}.${e.sliders.length ? " The sliders of “What if” have its values." : ""}`;
  }
}

function realityText({ realities }, k) {
  const { names, values, unknowns } = realities, unit = new Map(unknowns.map(unknown => [unknown.name, unknown.unit]));
  return names.map((name, n) => `${unknownLabel(name)} ${unknownText(unit.get(name), values[k][n])}`).join("; ");
}
