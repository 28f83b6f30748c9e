// The paths of compact_path.py: where a car was at any time of its run.

import { integerReader, readBlob } from "./blobs.js";

class Path {
  // columns: x, y, z, heading, pitch, roll, hinges; SI units. The last row is at end_s, the others at equal intervals.
  constructor(columns, interval_s, end_s) {
    this.columns = columns;
    this.interval_s = interval_s;
    this.end_s = end_s;
    this.rows = columns[0].length;
    this.travelled = travelledDistance(this);
  }

  // The row before t and the share of the way to the next one.
  place(t) {
    const last = this.rows - 1;
    if (t >= this.end_s || last < 1) return [last, 0];
    const row = Math.min(Math.floor(Math.max(t, 0) / this.interval_s), last - 1);
    const from_s = row * this.interval_s;
    const to_s = row + 1 === last ? this.end_s : from_s + this.interval_s;
    return [row, to_s > from_s ? Math.min(1, (Math.max(t, 0) - from_s) / (to_s - from_s)) : 0];
  }

  at(t) {
    const [row, share] = this.place(t);
    const value = (column) => column[row] + share * ((column[row + 1] ?? column[row]) - column[row]);
    const [x, y, z, heading, pitch, roll, ...folds] = this.columns.map(value);
    return { x, y, z, heading, pitch, roll, folds, s: value(this.travelled) };
  }

  time(row) {
    return row === this.rows - 1 ? this.end_s : row * this.interval_s;
  }
}

// Distance driven at each row (m); it decreases where the car rolls back.
function travelledDistance(path) {
  const [x, y, , heading] = path.columns;
  const travelled = new Float64Array(path.rows);
  for (let row = 1; row < path.rows; row++) {
    const middle = (heading[row] + heading[row - 1]) / 2;
    const step = (x[row] - x[row - 1]) * Math.cos(middle) + (y[row] - y[row - 1]) * Math.sin(middle);
    travelled[row] = travelled[row - 1] + step;
  }
  return travelled;
}

// All paths of a blob by their first number: a run's sample.
export async function readPaths(name, units) {
  const blob = await readBlob(name);
  const paths = new Map();
  if (!blob) return paths;
  const next = integerReader(blob.bytes);
  for (const [sample, rows, end_s] of blob.head.runs) {
    const columns = [];
    for (let column = 0; column < 6 + blob.head.hinges; column++) {
      const unit = column < 3 ? units.place_m : units.angle_rad;
      const values = new Float64Array(rows);
      let sum = 0;
      let difference = 0;
      for (let row = 0; row < rows; row++) {
        difference += next();
        sum += difference;
        values[row] = sum * unit;
      }
      columns.push(values);
    }
    paths.set(sample, new Path(columns, units.interval_s, end_s));
  }
  return paths;
}
