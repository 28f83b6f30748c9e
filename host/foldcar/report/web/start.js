// Starts the page: every experiment's grid at once, pictures and paths when the browser has time.

const outcomes = JSON.parse(document.getElementById("outcomes").textContent);
const replays = [...document.querySelectorAll("section.replay")].map((section) => new Replay(section, outcomes));
document.documentElement.dataset.readyMs = String(Math.round(performance.now()));

// #run=EXPERIMENT.DESIGN.ROW&t=SECONDS shows that moment, counted from 0 as on the page.
const wanted = new URLSearchParams(location.hash.slice(1));
const [number, design, row] = (wanted.get("run") ?? "").split(".").map(Number);

async function showFirst() {
  for (const [index, replay] of replays.entries()) {
    const named = wanted.has("run") && index === number;
    const cell = named ? [design, row] : replay.grid.chosen;
    await replay.choose(...cell, false, named ? Number(wanted.get("t") ?? 0) : 0);
  }
  document.documentElement.dataset.state = "ready";
}

(window.requestIdleCallback ?? setTimeout)(() => showFirst());
