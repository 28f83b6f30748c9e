// Trials of cars, and where all numbers come from.

import { plainTable } from "./charts.js";
import { number } from "./data.js";
import { byId, make } from "./dom.js";
import { designButton } from "./summary.js";

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
