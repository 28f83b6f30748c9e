// A run from the right side, along the line that the car drove: the ground under both tracks and the car on it.

import { INK, freshContext, polygon, polyline, roundStep } from "./canvas.js";

const STEP_M = 0.004;

// The ground under the left and the right wheels along the driven line; s in m from first to last.
export function groundProfile(path, car, ground) {
  const line = drivenLine(path);
  const reach = Math.max(...car.wheels.map((wheel) => Math.abs(wheel.x_m) + wheel.radius_m));
  const first = Math.min(0, ...path.travelled) - reach - 0.1;
  const last = line.s[line.s.length - 1] + reach + 0.1;
  const profile = { first, last, left: [], right: [], reach };
  let row = 0;
  for (let s = first; s <= last; s += STEP_M) {
    while (row + 2 < line.s.length && line.s[row + 1] < s) row++;
    const next = Math.min(row + 1, line.s.length - 1);
    const span = line.s[next] - line.s[row];
    const share = span > 0 ? Math.min(1, Math.max(0, (s - line.s[row]) / span)) : 0;
    const mix = (values) => values[row] + share * (values[next] - values[row]);
    const heading = mix(line.heading);
    const beyond = Math.min(0, s - line.s[0]) + Math.max(0, s - line.s[line.s.length - 1]);
    const x = mix(line.x) + beyond * Math.cos(heading);
    const y = mix(line.y) + beyond * Math.sin(heading);
    for (const [side, name] of [[0.5, "left"], [-0.5, "right"]]) {
      const tyre = car.wheels.find((wheel) => wheel.side === name).width_m;
      let highest = -Infinity;
      for (const across of [-0.5, -0.25, 0, 0.25, 0.5]) {
        const offset = side * car.track_m + across * tyre;
        highest = Math.max(highest, ground.height(x - offset * Math.sin(heading), y + offset * Math.cos(heading)));
      }
      profile[name].push(highest);
    }
  }
  return profile;
}

// The rows at which the car got further than before: rolling back does not lengthen the line.
function drivenLine(path) {
  const line = { s: [], x: [], y: [], heading: [] };
  let furthest = -Infinity;
  for (let row = 0; row < path.rows; row++) {
    if (path.travelled[row] <= furthest) continue;
    furthest = path.travelled[row];
    line.s.push(furthest);
    line.x.push(path.columns[0][row]);
    line.y.push(path.columns[1][row]);
    line.heading.push(path.columns[3][row]);
  }
  return line;
}

// Draws ground and cars; drives is [{path, car, colour, ghost}], the profile that of the first.
export function drawSide(canvas, profile, drives, t) {
  const width = canvas.clientWidth || 320;
  const [{ path }] = drives;
  const length = profile.last - profile.first;
  // Long ways are followed, so that the car stays large enough.
  const shown = Math.min(length, Math.max(1.0, width / 360));
  const scale = width / shown;
  const middle = path.at(t).s;
  const from = Math.min(Math.max(profile.first, middle - 0.45 * shown), profile.last - shown);
  const highest = Math.max(...path.columns[2]) + profile.reach;
  const lowest = Math.min(0, Math.min(...profile.left), Math.min(...profile.right)) - 0.015;
  const axis = 22;
  const height = Math.round(Math.min(300, scale * (highest - lowest))) + axis;
  const context = freshContext(canvas, height);
  const place = (s, z) => [(s - from) * scale, height - axis - (z - lowest) * scale];
  drawProfile(context, profile, "left", place, "#d9cdb0", "#8c7a5b", [4, 3]);
  drawProfile(context, profile, "right", place, "#bfa878", "#6b4a17", []);
  for (const drive of [...drives].reverse()) drawCarFromSide(context, drive, t, place, scale);
  drawDistances(context, from, shown, scale, height, width);
}

function drawProfile(context, profile, name, place, fill, stroke, dash) {
  const line = profile[name].map((z, index) => place(profile.first + index * STEP_M, z));
  const [, floor] = place(0, -10);
  polygon(context, [...line, [line[line.length - 1][0], floor], [line[0][0], floor]], fill, null);
  polyline(context, line, stroke, 1, dash);
}

function drawDistances(context, from, shown, scale, height, width) {
  context.fillStyle = "#ffffff";
  context.fillRect(0, height - 22, width, 22);
  const step = roundStep((shown * 90) / width);
  context.fillStyle = INK;
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (let s = Math.ceil(from / step) * step; s <= from + shown; s += step) {
    const x = (s - from) * scale;
    if (x < 24 || x > width - 24) continue;
    context.fillRect(x, height - 22, 1, 4);
    context.fillText(`${Number(s.toFixed(3))} m`, x, height - 9);
  }
}

// Poses of the segments at a state, seen from the right: functions of a point (x, z) of the car with flat hinges.
function segmentPoses(car, at) {
  const gaps = car.segments.map((one) => Math.max(0, Math.abs(one.x_m) - one.length_m / 2));
  const main = gaps.indexOf(Math.min(...gaps));
  const pitches = [];
  const poses = [];
  const pose = (pitch, x0, z0) => (x, z) => [x0 + x * Math.cos(pitch) - z * Math.sin(pitch), z0 + x * Math.sin(pitch) + z * Math.cos(pitch)];
  pitches[main] = at.pitch;
  poses[main] = pose(at.pitch, 0, 0);
  const join = (near, far, hinge) => {
    // A hinge angle is positive with the front segment's nose up.
    pitches[far] = pitches[near] + (far < near ? at.folds[hinge] : -at.folds[hinge]);
    const { x_m, z_m } = car.hinges[hinge];
    const joint = poses[near](x_m, z_m);
    const own = pose(pitches[far], 0, 0)(x_m, z_m);
    poses[far] = pose(pitches[far], joint[0] - own[0], joint[1] - own[1]);
  };
  for (let index = main; index + 1 < car.segments.length; index++) join(index, index + 1, index);
  for (let index = main; index > 0; index--) join(index, index - 1, index - 1);
  return poses;
}

function drawCarFromSide(context, { path, car, colour, ghost }, t, place, scale) {
  const at = path.at(t);
  const folds = car.hinges.map((_, hinge) => at.folds[hinge] ?? 0);
  const poses = segmentPoses(car, { ...at, folds });
  const point = ([x, z], lift = 0) => place(at.s + x, at.z + z + lift);
  context.setLineDash(ghost ? [4, 3] : []);
  // Left wheels first: they are behind.
  for (const side of ["left", "right"]) {
    const near = side === "right";
    for (const wheel of car.wheels.filter((one) => one.side === side)) {
      const lift = (car.track_m / 2) * Math.sin(at.roll) * (near ? -1 : 1);
      context.beginPath();
      context.arc(...point(poses[wheel.segment](wheel.x_m, 0), lift), wheel.radius_m * scale, 0, 7);
      context.lineWidth = near ? 2 : 1;
      context.strokeStyle = near || ghost ? colour : "#7fb2d1";
      if (near && !ghost) {
        context.fillStyle = "rgba(255,255,255,.6)";
        context.fill();
      }
      context.stroke();
    }
  }
  car.segments.forEach((one, index) => {
    const outline = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([along, up]) =>
      point(poses[index](one.x_m + (along * one.length_m) / 2, one.center_z_m + (up * one.height_m) / 2)),
    );
    context.lineWidth = 1.5;
    polygon(context, outline, ghost ? null : "rgba(0,114,178,.35)", colour);
  });
  context.setLineDash([]);
}
