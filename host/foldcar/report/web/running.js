// The trial that `foldcar log` drives now: where things stand, then the car's state as it tells it; buttons that answer.

import { plainTable } from "./charts.js";
import { number } from "./data.js";
import { byId, make } from "../../figures/web/dom.js";

let picture = "", drawn = "", asked = 0;

// The name of the picture of the placement that the page has.
export const shownPicture = () => encodeURIComponent(picture);

// trial: what foldcar log says (running.py), or null. tap(question, answer) answers it; null: the page only shows.
export function showRunning(trial, tap) {
  const place = byId("running");
  place.hidden = !trial;
  if (!trial) { picture = drawn = ""; return; }
  const { number: n, sample, car, places, moves, telemetry, picture_png: png } = trial;
  if (drawn !== `${n} ${sample}`) {
    place.replaceChildren(make("h2", { text: `Trial ${n}: sample ${sample}, ${car}` }), make("p", { class: "now", role: "status" }), make("div", { class: "taps" }),
      make("ul", { class: "facts-row", "aria-label": "The car's state" }), make("details", {}, make("summary", { text: "where to put things" }), make("div", { class: "placement" })));
    place.querySelector(".placement").append(...(moves ? [make("p", { class: "moves", text: moves })] : []), make("div", { class: "wide" }, plainTable(places[0], places.slice(1))));
    [picture, drawn, asked] = ["", `${n} ${sample}`, 0];
  }
  if (png) {
    picture = trial.picture;
    place.querySelector("img")?.remove();
    place.querySelector(".placement").append(make("img", { alt: "car and obstacles from above, with their places in mm", src: `data:image/png;base64,${png}` }));
  }
  const [word, state] = stage(trial), now = place.querySelector(".now");
  place.dataset.state = state;
  if (now.textContent !== word) now.textContent = word;
  // It closes when the drive begins, and opens with the next trial; a person may do otherwise.
  const details = place.querySelector("details");
  if (details.dataset.state !== state) { details.open = state === "place"; details.dataset.state = state; }
  place.querySelector(".facts-row").replaceChildren(...facts(telemetry, trial).map(([label, text]) => make("li", {}, `${label} `, make("b", { text }))));
  ask(place.querySelector(".taps"), tap && trial.question, tap);
}

// The buttons of a question stay until the next one: one that changes under a finger would be another answer.
function ask(place, question, tap) {
  const { number: n, text, buttons } = question || { number: 0, text: "", buttons: [] };
  if (n === asked) return;
  asked = n;
  const answer = async what => {
    for (const one of place.querySelectorAll("button, input")) one.disabled = n !== 0 && text !== "";
    const took = await tap(n, what).then(answered => answered.ok && answered.json(), () => false);
    if (!took) place.querySelector(".said").textContent = "It did not arrive: tap again, or use the keyboard";
    if (!took) for (const one of place.querySelectorAll("button, input")) one.disabled = false;
  };
  const typed = make("input", { type: "text", enterkeyhint: "send", "aria-label": "Another answer", placeholder: "or type" });
  place.replaceChildren(...buttons.map(([what, label]) => make("button", { type: "button", text: label, onclick: () => answer(what) })),
    ...(text ? [make("form", { onsubmit: event => { event.preventDefault(); answer(typed.value); } }, typed, make("button", { text: "Send" }))] : []),
    make("p", { class: "note said", role: "status", text }));
}

function stage({ placed, ended, outcome, number: n, countdown_s: left_s, telemetry }) {
  if (outcome) return [`Trial ${n}: ${outcome.replace("_", " ")}`, "ended"];
  if (ended) return [`Ended: ${ended}. What was the outcome?`, "ended"];
  if (telemetry && telemetry.driving) return [`Driving ${telemetry.elapsed_s.toFixed(1)} s`, "driving"];
  return placed ? [`Armed: stand clear${left_s ? `, ${left_s.toFixed(0)} s` : ""}`, "armed"] : ["Put car and obstacles in place", "place"];
}

function facts(now, { time_limit_s: limit_s }) {
  if (!now) return [["link", "no car"]];
  const degrees = angle => (angle === null ? "–" : `${(angle * 180 / Math.PI).toFixed(1).replace(/^-0\.0$/, "0.0")}°`);
  const pulses = Object.entries(now.pulses_us || {});
  return [
    ["time", `${now.elapsed_s.toFixed(1)} of ${number(limit_s)} s`],
    ["battery", now.battery_v === null ? "unreadable" : `${now.battery_v.toFixed(2)} V`],
    ["roll", degrees(now.roll_rad)], ["pitch", degrees(now.pitch_rad)],
    ["pulses", pulses.length ? `${pulses.map(([servo, width]) => `${servo}: ${width}`).join(" ")} µs` : "none"],
    ["link", `${(100 * now.lost).toFixed(1)} % lost of ${now.received.toLocaleString("en")} packets${now.silent_s > 1 ? `, silent for ${now.silent_s.toFixed(0)} s` : ""}`],
  ];
}
