// The first screen: the headline, the two lines of advice, remarks, and the design that is chosen or pointed at. The last
// one: trials of cars, and where all numbers come from.

import { plainTable } from "./charts.js";
import { BELIEF, evidence, number, percent, valueText } from "./data.js";
import { byId, make } from "../../figures/web/dom.js";

const MOST_NAMED = 6;
// Remarks that are longer are opened by who wants them (characters).
const LONG = 180;

export function showSummary(model) {
  const { e, study } = model;
  byId("title").textContent = study.title;
  byId("headline").textContent = e.headline;
  byId("advice").replaceChildren(...[["likely", "Most likely to work"], ["learn", "To learn most"]].map(([key, title]) => advice(model, title, e[key])).filter(Boolean));
  byId("edge").replaceChildren(...e.edge.map(text => make("li", { text })));
  byId("remarks").replaceChildren(...[...study.engine_notes, ...e.remarks].map(remark));
  for (const id of ["edge", "remarks"]) byId(id).hidden = !byId(id).children.length;
  byId("fixed").replaceChildren(...facts(e).map(([label, text]) => make("li", {}, make("span", { class: "of", text: `${label} ` }), text)));
}

function remark(text) {
  const start = text.length > LONG ? text.slice(0, text.indexOf(": ", 10)) : text;
  return make("li", {}, start === text || start.length > LONG || !start ? text : make("details", {}, make("summary", { text: `${start} …` }), text));
}

function facts({ count, environments, runs, designs, trials, fixed }) {
  const all = designs.runs.reduce((sum, one) => sum + one, 0), passed = designs.passed.reduce((sum, one) => sum + (one ?? 0), 0);
  const rows = [["designs", count.toLocaleString("en")], ["environments", environments.toLocaleString("en")],
    ["runs", `${all.toLocaleString("en")}, ${passed.toLocaleString("en")} passed`]];
  const counted = trials.filter(one => one.standing === "built" && one.passed !== null);
  if (counted.length) rows.push(["trials", `${counted.length}, ${counted.filter(one => one.passed).length} passed`]);
  return [...rows, ...fixed];
}

// Designs that the text names are pressed there; those that it does not name follow.
function advice(model, title, { text, designs, why }) {
  if (!text && !designs.length) return null;
  const { e } = model, unnamed = [];
  let parts = [text];
  designs.slice(0, MOST_NAMED).forEach((design, k) => {
    const name = e.designs.name[design], at = parts.findIndex(part => typeof part === "string" && part.includes(name));
    if (at < 0) {
      unnamed.push(make("li", {}, designButton(model, design), ` ${why[k]}`));
      return;
    }
    const start = parts[at].indexOf(name);
    parts = [...parts.slice(0, at), parts[at].slice(0, start), designLink(model, design), parts[at].slice(start + name.length), ...parts.slice(at + 1)];
  });
  return make("section", { class: "card" }, make("h2", { text: title }), make("p", {}, ...parts), ...(unnamed.length ? [make("ul", { class: "named" }, ...unnamed)] : []));
}

export function designButton(model, design, text = model.e.designs.name[design]) {
  return make("button", { type: "button", class: "design", text, title: "its runs", onclick: () => model.open(design), ...pointed(model, design) });
}

// In a sentence, where it breaks over lines as words do.
function designLink(model, design) {
  const text = model.e.designs.name[design], onclick = event => { event.preventDefault(); model.open(design); };
  return make("a", { href: `#${new URLSearchParams({ e: model.e.id, design: text, at: "runs" })}`, text, onclick, ...pointed(model, design) });
}

const pointed = (model, design) => ({
  onmouseenter: () => model.hover(design), onmouseleave: () => model.hover(null), onfocus: () => model.hover(design), onblur: () => model.hover(null),
});

// The panel beside the belief: of the design pointed at, else of the chosen one, else of the likeliest.
export function showDesign(model) {
  const { e } = model, design = model.hovered ?? model.design ?? e.likely.designs[0] ?? 0, panel = byId("design");
  panel.hidden = !e.count;
  if (!e.count) return;
  const { designs } = e, rows = evidence(e, design);
  for (const axis of e.axes) if (axis.key !== BELIEF && axis.values[design] !== null) rows.push([axis.label, valueText(axis, axis.values[design])]);
  const endings = e.outcomes.map((name, k) => [e.outcome_labels[k], designs.outcomes[k][design]]).filter(([, count]) => count);
  if (endings.length) rows.push(["runs ended", endings.map(([label, count]) => `${label} ${count}`).join(", ")]);
  panel.replaceChildren(
    make("h3", {}, designs.name[design], make("span", { class: `verdict ${designs.verdict[design]}`, text: verdict(e, design) })),
    ...(designs.refuted[design] ? [make("p", { class: "refuted", text: `Its trials contradict simulation, which is too ${designs.refuted[design]}.` })] : []),
    make("table", { class: "facts" }, make("tbody", {}, ...rows.map(([label, text]) => make("tr", {}, make("th", { scope: "row", text: label }), make("td", { text }))))),
    make("p", { class: "note", text: "Point at a design for its numbers; press it for its runs." }),
  );
}

export function verdict({ designs, threshold }, design) {
  const limit = percent(threshold);
  return { good: `above ${limit}`, bad: `below ${limit}`, open: `${limit}: undecided` }[designs.verdict[design]] ?? "";
}

export function showTrials(model) {
  const { e } = model, place = byId("trials-table");
  const named = e.trials.some(one => one.car_name);
  const rows = e.trials.map(one => [
    String(one.number), one.design === null ? one.car : designButton(model, one.design, one.car), ...(named ? [one.car_name || "–"] : []), one.standing,
    one.environment === null || one.design === null ? "–" : make("button", { type: "button", class: "design", text: String(one.environment), title: "the simulated run", onclick: () => model.open(one.design, one.environment) }),
    one.passed === null ? "aborted" : one.passed ? "passed" : (one.outcome || "not passed").replaceAll("_", " "),
    one.time_s === null ? "–" : `${number(one.time_s)} s`, one.when || "–", one.note || "",
  ]);
  place.replaceChildren(...(rows.length
    ? [make("details", { open: rows.length <= 12 }, make("summary", { text: `${rows.length} trial${rows.length > 1 ? "s" : ""} one by one` }), make("div", { class: "wide" }, plainTable(["trial", "car", ...(named ? ["name"] : []), "kind", "environment", "outcome", "after", "when", "note"], rows)))]
    : [make("p", { class: "note" }, "No trial of this experiment is shown: ", make("code", { text: "foldcar log" }), " and ", make("code", { text: "foldcar trials import" }), " add them; what is left out stands above.")]));
  byId("provenance").replaceChildren(make("table", { class: "facts" }, make("tbody", {}, ...e.provenance.map(([label, text]) => make("tr", {}, make("th", { scope: "row", text: label }), make("td", {}, text.includes("\n") ? make("pre", { text }) : text))))));
  byId("files").replaceChildren(...e.files.map(([label, address]) => make("li", {}, make("a", { href: address, text: label.split(/[.;:]( |$)/)[0] }))));
  byId("files").parentElement.hidden = !e.files.length;
}
