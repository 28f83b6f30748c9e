// The study page; its data stand in the element #study.

import { SECTIONS, hasAddress } from "./address.js";
import { Belief } from "./belief.js";
import { DesignTable } from "./design_table.js";
import { nameFiles } from "./downloads.js";
import { byId, make } from "../../figures/web/dom.js";
import { Model } from "./model.js";
import { Parameters } from "./parameters.js";
import { Race } from "./race.js";
import { ReplayPlace } from "./replay_place.js";
import { Runs } from "./runs.js";
import { showTaught } from "./taught.js";
import { showDesign, showOrigin, showSummary, showTrials } from "./summary.js";
import { Verify } from "./verify.js";
import { WhatIf } from "./whatif.js";

function chooser(model) {
  const several = model.study.experiments.length > 1;
  byId("experiment").hidden = !several;
  const list = byId("experiment").querySelector("select");
  list.replaceChildren(...model.study.experiments.map(experiment => new Option(`${experiment.id} ${scene(experiment)}`, experiment.id)));
  list.value = model.e.id;
  list.onchange = () => model.set({ e: list.value });
}

// The name of an experiment's program.
function scene({ provenance }) {
  const [, text] = provenance.find(([label]) => label === "environment") || ["", ""];
  return (/([^/ ]+)\.scenic/.exec(text) || ["", ""])[1].replaceAll("_", " ");
}

// What of a link the page cannot follow, until the reader chooses something else.
function showLinkRemarks({ linkRemarks }) {
  byId("link-remarks").replaceChildren(...linkRemarks.map(text => make("li", { text })));
  byId("link-remarks").hidden = !linkRemarks.length;
}

// The address keeps the part of the page that is read.
function follow(model) {
  const seen = new Map(), watch = new IntersectionObserver(entries => {
    for (const entry of entries) seen.set(entry.target.id, entry.intersectionRatio > 0 ? entry.intersectionRect.height : 0);
    const [most] = [...seen].sort((a, b) => b[1] - a[1]);
    if (!most || !most[1]) return;
    for (const link of document.querySelectorAll("nav a")) link.toggleAttribute("aria-current", link.hash === `#${most[0]}`);
    const at = most[0] === SECTIONS[0] ? null : most[0];
    if (at === model.state.at) return;
    model.state.at = at;
    model.write();
  }, { threshold: [0, 0.1, 0.25, 0.5, 0.75, 1] });
  for (const id of SECTIONS) watch.observe(byId(id));
  for (const link of document.querySelectorAll("nav a")) link.addEventListener("click", event => {
    event.preventDefault();
    byId(link.hash.slice(1)).scrollIntoView();
  });
}

function start() {
  const model = new Model(), belief = new Belief(model), designs = new DesignTable(model), parameters = new Parameters(model);
  const runs = new Runs(model, new ReplayPlace(byId("replay"), model)), verify = new Verify(model), whatif = new WhatIf(model);
  const race = new Race(model);
  model.on("data", () => {
    chooser(model);
    nameFiles(model);
    showSummary(model);
    race.use();
    belief.use();
    designs.use();
    showTaught(model);
    parameters.use();
    runs.use();
    verify.use();
    whatif.use();
    showTrials(model);
    showOrigin(model);
    byId("belief").hidden = !model.e.count;
    // What has nothing to say is not there.
    for (const link of document.querySelectorAll("nav a")) link.hidden = byId(link.hash.slice(1)).hidden;
  });
  model.on("state", () => { race.follow(); belief.mark(); designs.mark(); parameters.mark(); runs.mark(); showDesign(model); showLinkRemarks(model); });
  model.on("reality", () => { belief.markReality(); whatif.follow(); });
  model.on("remarks", () => showLinkRemarks(model));
  model.on("hover", () => { showDesign(model); parameters.hover(); });
  byId("copy").hidden = !hasAddress();
  byId("copy").addEventListener("click", async () => {
    const { link } = model;
    let said = "copied";
    try { await navigator.clipboard.writeText(link); } catch { window.prompt("The link:", link); said = "copy link"; }
    byId("copy").textContent = said;
    setTimeout(() => { byId("copy").textContent = "copy link"; }, 2000);
  });
  document.addEventListener("keydown", event => { if (event.key === "Escape" && model.state.design !== null) model.set({ design: null, env: null, t: null }); });
  window.study = model;
  model.use(JSON.parse(byId("study").textContent));
  if (model.state.at) model.scroll();
  follow(model);
  document.body.dataset.state = "ready";
  document.body.dataset.readyMs = performance.now().toFixed(0);
}

start();
