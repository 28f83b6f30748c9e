// What the trials have taught: each unknown of the simulator before and after them, in a small picture, and in sentences.

import { number, shownUnit, unknownLabel } from "./data.js";
import { byId, make } from "../../figures/web/dom.js";

// Space beside the widest bar, as a share of it.
const MARGIN = 0.05;

export function showTaught({ e }) {
  const place = byId("taught"), { realities } = e;
  place.hidden = !realities;
  place.replaceChildren(...(realities ? [make("h3", { text: "What the trials have taught" }), ...(realities.driven ? driven(realities) : [undriven(realities)])] : []));
}

function undriven({ unknowns }) {
  const names = unknowns.map(({ name }) => unknownLabel(name)), measured = unknowns.filter(unknown => unknown.measured !== null).map(({ name }) => unknownLabel(name));
  const known = measured.length ? `Only ${measured.join("; ")} ${measured.length > 1 ? "were" : "was"} measured` : "Of each, only a likely range is known";
  return make("p", { text: `No trial counts yet. The simulator does not know ${names.slice(0, -1).join("; ")}; and ${names.at(-1)}. ${known}.` });
}

function driven({ unknowns, taught }) {
  const key = (kind, text) => make("span", {}, make("i", { class: `key ${kind}` }), text);
  const measured = unknowns.some(unknown => unknown.measured !== null);
  // Those of which the trials say something come first.
  const rows = [...unknowns].sort((a, b) => Number(b.taught) - Number(a.taught));
  return [
    taught.length ? make("ul", { class: "ranges" }, ...taught.map(text => make("li", { text }))) : make("p", { text: "The trials say little of any unknown by itself." }),
    make("p", { class: "legend" }, key("before", "likely before the trials (95 %)"), key("after", "after them"), key("median", "median"), ...(measured ? [key("trials", "measured")] : [])),
    make("div", { class: "unknowns" }, ...rows.map(row)),
  ];
}

function row({ name, unit: siUnit, meaning, before, after, measured, taught }) {
  const [unit, scale] = shownUnit(siUnit), values = [...before, ...after, ...(measured === null ? [] : [measured])];
  const least = Math.min(...values), most = Math.max(...values), space = MARGIN * (most - least || 1);
  const place = value => 100 * (value - least + space) / (most - least + 2 * space), shown = value => number(scale * value);
  const bar = (kind, [low, median, high]) => [make("i", { class: kind, style: `left:${place(low)}%;width:${place(high) - place(low)}%` }), make("i", { class: `median ${kind}`, style: `left:${place(median)}%` })];
  const text = ([low, median, high]) => `${shown(median)} (${shown(low)} to ${shown(high)})`;
  const mark = measured === null ? [] : [make("i", { class: "measured", style: `left:${place(measured)}%` })];
  return make("div", { class: taught ? "unknown taught" : "unknown", title: meaning },
    make("span", { class: "name", text: unknownLabel(name) }),
    make("span", { class: "bars-of", "aria-hidden": "true" }, ...bar("before", before), ...bar("after", after), ...mark,
      make("span", { class: "end", style: `left:${place(least)}%`, text: shown(least) }), make("span", { class: "end", style: `right:${place(least)}%`, text: `${shown(most)} ${unit}` })),
    make("span", { class: "of", text: `${text(before)} → ${text(after)} ${unit}${measured === null ? "" : `; measured ${shown(measured)}`}` }));
}
