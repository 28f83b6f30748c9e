// The page while its store is written: asks the server how far things are, and takes new data without losing its place.

import { byId } from "../../figures/web/dom.js";

const PAUSE_MS = 1000;
const STATES = {
  waiting: "Waiting for the first runs", running: "Running", killed: "Killed: the same command resumes it",
  stopped: "Stopped: the same command resumes it", done: "Nothing is running; all that was planned is here",
};

// Polls for as long as the page is open; take(study) shows data.
export async function follow(take) {
  let version = "", last = null, fresh = null;
  for (;;) {
    try {
      const answer = await fetch(`/study.json?${version}`, { cache: "no-store" });
      if (!answer.ok) throw new Error(answer.statusText);
      const { study, ...progress } = await answer.json();
      [version, last, fresh] = [progress.version, progress, study ?? fresh];
      showProgress(progress);
    } catch {
      showEnded(last);
    }
    if (fresh && !isBusy()) {
      const restore = keepPlace();
      take(fresh);
      restore();
      fresh = null;
    }
    await new Promise(go => setTimeout(go, PAUSE_MS));
  }
}

function showProgress({ state, done, planned, left_s, designs, decided, changed_s, error }) {
  const count = number => number.toLocaleString("en"), share = planned ? done / planned : null;
  const parts = [planned === null ? `${count(done)} runs` : `${count(done)} of ${designs === null ? "" : "at most "}${count(planned)} runs`];
  if (designs !== null) parts.push(`${count(decided)} of ${count(designs)} designs decided`);
  if (state === "running" && left_s !== null && done < planned) parts.push(`about ${span(left_s)} left`);
  if (changed_s !== null) parts.push(`changed ${changed_s < 3 ? "just now" : `${span(changed_s)} ago`}`);
  show(error ? "error" : state, error || STATES[state], share, state === "waiting" ? "" : parts.join(" · "));
  const percents = share !== null && state === "running" ? `${Math.floor(100 * share)} % · ` : "";
  document.title = `${percents}${document.title.replace(/^\d+ % · /, "")}`;
}

function showEnded(last) {
  const before = last && ["killed", "stopped", "done"].includes(last.state) ? `${STATES[last.state]}. ` : "";
  show("gone", `${before}The server has ended`, last && last.planned ? last.done / last.planned : null,
    `${last && last.planned !== null ? `${last.done.toLocaleString("en")} of ${last.planned.toLocaleString("en")} runs are here; ` : ""}the page goes on when it is started again`);
}

function show(state, text, share, details) {
  const [word, bar, rest] = byId("live").children;
  byId("live").hidden = false;
  byId("live").dataset.state = state;
  // Read aloud when it changes only.
  if (word.textContent !== text) word.textContent = text;
  bar.hidden = share === null;
  bar.value = share ?? 0;
  rest.textContent = details;
}

const span = seconds => (seconds < 90 ? `${Math.max(1, Math.round(seconds))} s` : seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`);

// A range is being dragged or typed: a page that is drawn anew would end that.
let pressed = false;
for (const [event, down] of [["pointerdown", true], ["pointerup", false], ["pointercancel", false]]) window.addEventListener(event, () => { pressed = down; }, true);
const isBusy = () => pressed || document.activeElement?.matches("main input[type=number]");

// Remembers what is open, focused and in sight. Returns a function that restores it.
function keepPlace() {
  const main = document.querySelector("main"), named = element => `${element.closest("section")?.id} ${element.tagName} ${element.getAttribute("aria-label") || element.dataset.outcome || element.textContent}`;
  const heading = details => `${details.closest("section")?.id} ${details.querySelector("summary").textContent.replace(/[\d,]+/g, "")}`;
  const open = new Map();
  const each = act => { const seen = new Map(); for (const details of main.querySelectorAll("details")) { const name = heading(details), n = seen.get(name) ?? 0; seen.set(name, n + 1); act(details, `${name} ${n}`); } };
  each((details, name) => open.set(name, details.open));
  const active = main.contains(document.activeElement) ? named(document.activeElement) : null, { scrollY } = window;
  main.style.minHeight = `${main.offsetHeight}px`;
  return () => {
    each((details, name) => { if (open.has(name)) details.open = open.get(name); });
    if (active !== null && !main.contains(document.activeElement)) [...main.querySelectorAll("button, a, select, input, [tabindex], summary")].find(element => named(element) === active)?.focus({ preventScroll: true });
    window.scrollTo(0, scrollY);
    main.style.minHeight = "";
  };
}
