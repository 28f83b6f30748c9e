// The height maps of ground_maps.py: heights, and their picture seen from above.

import { integerReader, readBlob } from "./blobs.js";

class Ground {
  // frame: the rectangle of cells; heights in metres, row by row from the lowest y, or null where all is level.
  constructor(frame, heights, scene) {
    Object.assign(this, frame);
    this.heights = heights;
    this.scene = scene;
    this.x_max_m = this.x_min_m + this.columns * this.cell_m;
    this.y_max_m = this.y_min_m + this.rows * this.cell_m;
  }

  // Beyond the map the ground is drawn as at its edge.
  height(x, y) {
    if (!this.heights) return 0;
    const column = Math.min(this.columns - 1, Math.max(0, Math.floor((x - this.x_min_m) / this.cell_m)));
    const row = Math.min(this.rows - 1, Math.max(0, Math.floor((y - this.y_min_m) / this.cell_m)));
    return this.heights[row * this.columns + column];
  }

  // A canvas with a pixel for each cell, north up.
  picture() {
    if (this.drawn) return this.drawn;
    this.drawn = document.createElement("canvas");
    this.drawn.width = this.columns;
    this.drawn.height = this.rows;
    const context = this.drawn.getContext("2d");
    const image = context.createImageData(this.columns, this.rows);
    const highest = this.heights ? this.heights.reduce((most, z) => Math.max(most, Math.abs(z)), 0.001) : 0.001;
    for (let row = 0; row < this.rows; row++) {
      for (let column = 0; column < this.columns; column++) {
        const z = this.heights ? this.heights[row * this.columns + column] : 0;
        const shade = this.heights ? this.shade(row, column) : 1;
        const colour = groundColour(z / highest);
        const at = 4 * ((this.rows - 1 - row) * this.columns + column);
        for (let part = 0; part < 3; part++) image.data[at + part] = Math.max(0, Math.min(255, colour[part] * shade));
        image.data[at + 3] = 255;
      }
    }
    context.putImageData(image, 0, 0);
    return this.drawn;
  }

  // Light from the upper left on slopes.
  shade(row, column) {
    const here = row * this.columns + column;
    const left = this.heights[column ? here - 1 : here];
    const above = this.heights[row + 1 < this.rows ? here + this.columns : here];
    const slope = (this.heights[here] - left + (this.heights[here] - above)) / this.cell_m;
    return 1 + 0.22 * Math.max(-1, Math.min(1, slope));
  }
}

const ABOVE = [[246, 244, 238], [240, 223, 184], [207, 166, 91], [138, 90, 28]];
const BELOW = [[246, 244, 238], [169, 201, 222], [58, 124, 168], [18, 63, 95]];

// Brown above the floor, blue below it; share of the greatest height, -1 to 1.
function groundColour(share) {
  const scale = share >= 0 ? ABOVE : BELOW;
  const place = Math.min(0.999, Math.abs(share)) * (scale.length - 1);
  const low = scale[Math.floor(place)];
  const high = scale[Math.floor(place) + 1];
  return low.map((part, index) => part + (place % 1) * (high[index] - part));
}

// The ground and the scene of a sample; null if the page has none.
export async function readGround(name, frame, units) {
  const blob = await readBlob(name);
  if (!blob) return null;
  if (!blob.head.ground) {
    let heights = null;
    if (blob.bytes.length) {
      heights = new Float32Array(frame.columns * frame.rows);
      const next = integerReader(blob.bytes);
      let sum = 0;
      for (let cell = 0; cell < heights.length; cell++) {
        sum += next();
        heights[cell] = sum * units.height_m;
      }
    }
    blob.head.ground = new Ground(frame, heights, blob.head);
  }
  return blob.head.ground;
}
