// The run of recorded_run.py in the scene that all pages show runs in.

import { integerReader, mountScene, pathOfRows, readGround } from "../../../figures/web/scene.js";

const COLOUR = "#0072b2";

export class Run {
  constructor(element, show) { Object.assign(this, { element, show, scene: null }); }

  // data: of recorded_run.py.
  use({ ground, car, rows, outcome }) {
    // In the same environment the camera stays.
    const text = JSON.stringify(ground);
    if (text !== this.text) {
      this.text = text;
      this.place = readGround(ground, integerReader(Uint8Array.from(atob(ground.heights), letter => letter.charCodeAt(0))));
    }
    const runs = [{ label: "", colour: COLOUR, path: pathOfRows(rows), car, outcome }];
    if (this.scene) this.scene.setGround(this.place, runs);
    else this.scene = mountScene(this.element, { ground: this.place, runs, onTime: this.show });
  }
}
