// The first screen: which car works, what to do to learn most, what both rest on, remarks, and the design that is chosen or pointed at. The last
// ones: trials of cars, and where all numbers come from.

import { plainTable } from "./charts.js";
import { counted, evidence, isSuccess, number, percent, thresholdText, valueText } from "./data.js";
import { notes } from "./markdown.js";
import { byId, make } from "../../figures/web/dom.js";

// Remarks that are longer are opened by who wants them (characters).
const LONG = 180;

export function showSummary(model) {
  const { e, study } = model;
  byId("title").textContent = study.title;
  byId("notes").replaceChildren(...notes(study.notes));
  byId("headline").replaceChildren(...question(e.headline));
  byId("learn").replaceChildren(...question(e.next.text));
  byId("grounds").textContent = e.grounds;
  byId("steps").replaceChildren(...steps(model, e.next));
  byId("ranges").replaceChildren(...e.ranges.map(text => make("li", { text })));
  byId("remarks").replaceChildren(...[...study.engine_notes, ...e.remarks].map(remark));
  for (const id of ["ranges", "remarks"]) byId(id).hidden = !byId(id).children.length;
  byId("fixed").replaceChildren(...facts(e).map(([label, text]) => make("li", {}, make("span", { class: "of", text: `${label} ` }), text)));
}

function remark(text) {
  const start = text.length > LONG ? text.slice(0, text.indexOf(": ", 10)) : text;
  return make("li", {}, ...(start === text || start.length > LONG || !start ? coded(text) : [make("details", {}, make("summary", {}, ...coded(`${start} …`)), ...coded(text))]));
}

// Commands stand between backticks.
const coded = text => text.split("`").map((part, k) => (k % 2 ? make("code", { text: part }) : part));

function facts({ count, environments, runs, designs, trials, fixed }) {
  const all = designs.runs.reduce((sum, count) => sum + count, 0), passed = designs.passed.reduce((sum, count) => sum + (count ?? 0), 0);
  const rows = [["designs", count.toLocaleString("en")], ["environments", environments.toLocaleString("en")],
    ["runs", `${all.toLocaleString("en")}, ${passed.toLocaleString("en")} passed`]];
  const built = trials.filter(trial => trial.standing === "built" && trial.passed !== null);
  if (built.length) rows.push(["trials", `${built.length}, ${built.filter(trial => trial.passed).length} passed`]);
  return [...rows, ...fixed];
}

// A line with the question that it answers in bold letters.
function question(text) {
  const [, before, asked, answer] = /^(.*?)(Want [^?]*\?)(.*)$/.exec(text) ?? [null, text, "", ""];
  return [before, ...(asked ? [make("b", { text: asked })] : []), answer];
}

// The steps that were weighed: what each is expected to gain and to take, with its design as a button.
function steps(model, { steps: weighed }) {
  if (weighed.length < 2) return [];
  const line = ({ text, design, gain, minutes }) => {
    const cost = ` (+${(100 * gain).toFixed(1)} points, ${minutes} min)`;
    if (design === null) return [text, cost];
    const name = model.e.designs.name[design], [before, ...after] = text.split(name);
    return [before, designButton(model, design), after.join(name), cost];
  };
  return [make("p", { class: "of", text: "Steps that were weighed, the greatest expected gain for an hour first:" }),
    make("ol", { class: "named" }, ...weighed.map(step => make("li", {}, ...line(step))))];
}

export function designButton(model, design, text = model.e.designs.name[design]) {
  return make("button", { type: "button", class: "design", text, title: "its runs", onclick: () => model.open(design), ...pointed(model, design) });
}

const pointed = (model, design) => ({
  onmouseenter: () => model.hover(design), onmouseleave: () => model.hover(null), onfocus: () => model.hover(design), onblur: () => model.hover(null),
});

// The panel beside the belief: of the design pointed at, else of the chosen one, else of the likeliest.
export function showDesign(model) {
  const { e } = model, design = model.hovered ?? model.design ?? e.leader ?? 0, panel = byId("design");
  panel.hidden = !e.count;
  if (!e.count) return;
  const { designs } = e, rows = evidence(e, design);
  for (const axis of e.axes) if (!isSuccess(axis.key) && axis.values[design] !== null) rows.push([axis.label, valueText(axis, axis.values[design])]);
  const endings = e.outcomes.map((name, k) => [e.outcome_labels[k], designs.outcomes[k][design]]).filter(([, count]) => count);
  if (endings.length) rows.push(["runs ended", endings.map(([label, count]) => `${label} ${count}`).join(", ")]);
  panel.replaceChildren(
    make("h3", {}, designs.name[design], make("span", { class: `verdict ${designs.verdict[design]}`, text: verdict(e, design) })),
    ...(designs.refuted[design] ? [make("p", { class: "refuted", text: `Its trials contradict simulation, which is too ${designs.refuted[design]}.` })] : []),
    make("table", { class: "facts" }, make("tbody", {}, ...rows.map(([label, text]) => make("tr", {}, make("th", { scope: "row", text: label }), make("td", { text }))))),
    make("p", { class: "note", text: "Point at a design for its numbers; press it for its runs, and to let it race at the top." }),
  );
}

// Before a trial and without realities, verdicts are about simulation.
export function verdict({ designs, threshold, realities, simulation }, design) {
  const limit = thresholdText(threshold), where = realities?.driven ? "" : ` in ${simulation}`;
  return { good: `reaches ${limit}${where}`, bad: `below ${limit}${where}`, open: `${limit}${where}: undecided` }[designs.verdict[design]] ?? "";
}

// A photo or film of a trial. Browsers cannot show a format such as HEIC: then the link shows the name.
function picture({ kind, name, address }) {
  if (address === null) return `${name} (missing)`;
  if (kind === "film") return make("video", { src: address, controls: true, preload: "metadata", title: name, "aria-label": name });
  return make("a", { href: address }, make("img", { src: address, alt: name, title: name, loading: "lazy" }));
}

export function showTrials(model) {
  const { e } = model, place = byId("trials-table");
  const named = e.trials.some(trial => trial.car_name), hasMedia = e.trials.some(trial => trial.media.length);
  const rows = e.trials.map(trial => [
    String(trial.number), trial.design === null ? trial.car : designButton(model, trial.design, trial.car), ...(named ? [trial.car_name || "–"] : []), trial.standing,
    trial.environment === null || trial.design === null ? "–" : make("button", { type: "button", class: "design", text: String(trial.environment), title: "the simulated run", onclick: () => model.open(trial.design, trial.environment) }),
    trial.passed === null ? "aborted" : trial.passed ? "passed" : (trial.outcome || "not passed").replaceAll("_", " "),
    trial.time_s === null ? "–" : `${number(trial.time_s)} s`, trial.when || "–", ...(hasMedia ? [make("div", { class: "media" }, ...trial.media.map(picture))] : []), trial.note || "",
  ]);
  byId("trials").hidden = !rows.length;
  const head = ["trial", "car", ...(named ? ["name"] : []), "kind", "environment", "outcome", "after", "when", ...(hasMedia ? ["photos, films"] : []), "note"];
  place.replaceChildren(make("details", { open: rows.length <= 12 }, make("summary", { text: `${counted(rows.length, "trial")} one by one` }), make("div", { class: "wide" }, plainTable(head, rows))));
}

export function showOrigin({ e }) {
  byId("provenance").replaceChildren(make("table", { class: "facts" }, make("tbody", {}, ...e.provenance.map(([label, text]) => make("tr", {}, make("th", { scope: "row", text: label }), make("td", {}, text.includes("\n") ? make("pre", { text }) : text))))));
  byId("files").replaceChildren(...e.files.map(([label, address]) => make("li", {}, make("a", { href: address, text: label.split(/[.;:]( |$)/)[0] }))));
  byId("files").parentElement.hidden = !e.files.length;
}
