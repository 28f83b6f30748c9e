// A run as drawings: from the right side and from above. setRuns, time, play, pause, camera and dispose are a scene's.

import { GHOST_COLOUR, RUN_COLOUR } from "./canvas.js";
import { make } from "./dom.js";
import { drawSide, groundProfile } from "./side_view.js";
import { drawCarFromAbove, drawScene, topWindow } from "./top_view.js";

const TOP_HEIGHT = 260;

// ground: of ground.js; runs: [{car, path, label, ghost}], the first is the one that is looked at.
export function mountScene(element, { ground, runs }) {
  const side = make("canvas", { role: "img", "aria-label": "The car from the right side on the ground under its wheels" });
  const top = make("canvas", { role: "img", "aria-label": "The car from above with the tracks of its wheels" });
  element.replaceChildren(side, top);
  let drives = [], profile = null, view = null, now = 0;
  const draw = () => {
    const placed = drawScene(top, ground, view, TOP_HEIGHT);
    for (const { path, car, colour, ghost } of [...drives].reverse()) drawCarFromAbove(placed, path, car, now, colour, ghost);
    drawSide(side, profile, drives, now);
  };
  const scene = {
    setRuns(some) {
      drives = some.map(one => ({ colour: one.ghost ? GHOST_COLOUR : RUN_COLOUR, ...one }));
      profile = groundProfile(drives[0].path, drives[0].car, ground);
      view = topWindow(ground, drives.map(one => one.path));
      draw();
    },
    time(t_s) { now = t_s; draw(); },
    play() {}, pause() {}, camera() {},
    dispose() { seen.disconnect(); element.replaceChildren(); },
  };
  let width = element.clientWidth;
  const seen = new ResizeObserver(() => {
    if (element.clientWidth === width) return;
    width = element.clientWidth;
    draw();
  });
  scene.setRuns(runs);
  seen.observe(element);
  return scene;
}
