// Where a car was at any time of its run. SI units.

// columns: x, y, z, heading, pitch, roll, hinges, typed arrays; times_s: of the rows, increasing.
export class Path {
  constructor(columns, times_s) {
    Object.assign(this, { columns, times_s, rows: times_s.length, end_s: times_s[times_s.length - 1] ?? 0 });
    this.travelled = travelledDistance(columns);
  }

  // The row before t and the share of the way to the next one.
  place(t) {
    const { times_s } = this;
    let low = 0, high = this.rows - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times_s[middle] <= t) low = middle;
      else high = middle;
    }
    const span = times_s[high] - times_s[low];
    return [low, high, span > 0 ? Math.min(1, Math.max(0, (t - times_s[low]) / span)) : 1];
  }

  at(t) {
    const [low, high, share] = this.place(t);
    const value = column => column[low] + share * (column[high] - column[low]);
    const [x, y, z, heading, pitch, roll, ...folds] = this.columns.map(value);
    return { x, y, z, heading, pitch, roll, folds, s: value(this.travelled) };
  }
}

// Distance driven at each row (m); it decreases where the car rolls back. Uphill the way is longer than its projection.
function travelledDistance([x, y, z, heading]) {
  const travelled = new Float64Array(x.length);
  for (let row = 1; row < x.length; row++) {
    const middle = (heading[row] + heading[row - 1]) / 2;
    const level = (x[row] - x[row - 1]) * Math.cos(middle) + (y[row] - y[row - 1]) * Math.sin(middle);
    travelled[row] = travelled[row - 1] + Math.sign(level) * Math.hypot(level, z[row] - z[row - 1]);
  }
  return travelled;
}

// Of rows as carsim gives them: time, x, y, z, heading, pitch, roll, hinges.
export function pathOfRows(rows) {
  const columns = rows[0].slice(1).map((_, column) => Float64Array.from(rows, row => row[column + 1]));
  // A heading beyond a half turn goes on, so that there is no leap of a full turn.
  for (let row = 1, turn = 0; row < rows.length; row++) {
    turn -= 2 * Math.PI * Math.round((rows[row][4] - rows[row - 1][4]) / (2 * Math.PI));
    columns[3][row] += turn;
  }
  return new Path(columns, Float64Array.from(rows, row => row[0]));
}

// Reads zigzag LEB128 integers one after the other.
export function integerReader(bytes) {
  let at = 0;
  return () => {
    for (let value = 0, scale = 1; ; scale *= 128) {
      const byte = bytes[at++];
      value += (byte & 127) * scale;
      if (byte < 128) return value % 2 ? -(value + 1) / 2 : value / 2;
    }
  };
}
