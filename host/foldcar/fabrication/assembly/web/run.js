// The run of recorded_run.py in the scene that all pages show runs in.

import { integerReader, mountScene, pathOfRows, readGround } from "../../../figures/web/scene.js";

const COLOUR = "#0072b2";

export class Run {
  constructor(element, show) { Object.assign(this, { element, show, scene: null }); }

  // data: of recorded_run.py.
  use({ ground, car, rows, outcome }) {
    const bytes = Uint8Array.from(atob(ground.heights), letter => letter.charCodeAt(0));
    const place = readGround(ground, integerReader(bytes));
    const runs = [{ label: "", colour: COLOUR, path: pathOfRows(rows), car, outcome }];
    if (this.scene) this.scene.setGround(place, runs);
    else this.scene = mountScene(this.element, { ground: place, runs, onTime: this.show });
  }
}
