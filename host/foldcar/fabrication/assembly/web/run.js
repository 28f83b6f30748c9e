// The run of scene_shape.py in the scene that all pages show runs in.

import { integerReader, mountScene, pathOfRows, readGround } from "../../../figures/web/scene.js";

const COLOUR = "#0072b2";

// data: of scene_shape.py; onTime: called with the time that is shown.
export function sceneOfRun(element, { ground, car, rows, outcome }, onTime) {
  const place = readGround(ground, integerReader(Uint8Array.from(atob(ground.heights), letter => letter.charCodeAt(0))));
  const runs = [{ label: "", colour: COLOUR, path: pathOfRows(rows), car, outcome }];
  return mountScene(element, { ground: place, runs, onTime });
}
