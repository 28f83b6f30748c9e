// The trial that `foldcar log` drives now: where things stand, then the car's state as it tells it.

import { number } from "./data.js";
import { byId, make } from "./dom.js";

let picture = "", drawn = "";

// The name of the picture of the placement that the page has.
export const shownPicture = () => encodeURIComponent(picture);

// trial: what foldcar log says (running.py), or null.
export function showRunning(trial) {
  const place = byId("running");
  place.hidden = !trial;
  if (!trial) { picture = drawn = ""; return; }
  const { number: n, sample, car, places, telemetry, picture_png: png } = trial;
  if (drawn !== `${n} ${sample}`) {
    place.replaceChildren(make("h2", { text: `Trial ${n}: sample ${sample}, ${car}` }), make("p", { class: "now", role: "status" }),
      make("ul", { class: "facts-row", "aria-label": "The car's state" }), make("details", {}, make("summary", { text: "where to put things" }), make("div", { class: "placement" })));
    place.querySelector(".placement").append(placeTable(places));
    [picture, drawn] = ["", `${n} ${sample}`];
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
}

function stage({ placed, ended, telemetry }) {
  if (ended) return [`Ended: ${ended}. What was the outcome?`, "ended"];
  if (telemetry && telemetry.driving) return ["Driving", "driving"];
  return placed ? ["Armed: stand clear", "armed"] : ["Put car and obstacles in place", "place"];
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

function placeTable(places) {
  const head = ["place", "x (mm)", "y (mm)", "turned (°)", ""];
  return make("div", { class: "wide" }, make("table", {}, make("thead", {}, make("tr", {}, ...head.map(text => make("th", { scope: "col", text })))),
    make("tbody", {}, ...places.map(([name, ...rest]) => make("tr", {}, make("th", { scope: "row", text: name }), ...rest.map(text => make("td", { text })))))));
}
