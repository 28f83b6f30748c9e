// Without WebGL: the cars from the right side along the line that the first one drove, on the ground under its wheels.

import { segmentPoses } from "./car.js";
import { roundStep } from "./strips.js";

const STEP_M = 0.004, AXIS = 22;

export class SideDrawing {
  constructor(element) {
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "The car from the right side on the ground under its wheels");
    this.canvas.style.cssText = "display:block;width:100%";
    element.append(this.canvas);
  }

  load(ground, runs) {
    this.runs = runs.filter(one => one.path);
    const [first] = this.runs;
    this.profile = first ? profile(first.path, first.car.body, ground) : null;
  }

  camera() {}

  draw(t) {
    if (!this.profile) return;
    const { canvas, profile } = this, [{ path }] = this.runs, width = canvas.clientWidth || 320, ratio = window.devicePixelRatio || 1;
    const length = profile.last - profile.first, shown = Math.min(length, Math.max(1, width / 360)), scale = width / shown;
    // Long ways are followed, so that the car stays large enough.
    const from = Math.min(Math.max(profile.first, path.at(t).s - 0.45 * shown), profile.last - shown);
    const lowest = Math.min(0, ...profile.left, ...profile.right) - 0.015;
    const height = Math.round(Math.min(300, scale * (Math.max(...path.columns[2]) + profile.reach - lowest))) + AXIS;
    canvas.style.height = `${height}px`;
    Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = '12px "DejaVu Sans", Arial, Helvetica, sans-serif';
    const place = (s, z) => [(s - from) * scale, height - AXIS - (z - lowest) * scale];
    for (const [name, fill, dash] of [["left", "#d9cdb0", [4, 3]], ["right", "#bfa878", []]]) {
      const line = profile[name].map((z, index) => place(profile.first + index * STEP_M, z));
      outline(context, [...line, [line[line.length - 1][0], height], [line[0][0], height]], fill, null);
      outline(context, line, null, "#6b4a17", dash, false);
    }
    for (const run of [...this.runs].reverse()) drawCar(context, run, t, place, scale);
    context.fillStyle = getComputedStyle(canvas).backgroundColor;
    context.clearRect(0, height - AXIS, width, AXIS);
    context.fillStyle = getComputedStyle(canvas).color;
    context.textAlign = "center";
    const step = roundStep(shown * 90 / width);
    for (let s = Math.ceil(from / step) * step; s <= from + shown; s += step) {
      const x = (s - from) * scale;
      if (x > 24 && x < width - 24) context.fillText(`${Number(s.toFixed(3))} m`, x, height - 6);
    }
  }

  dispose() { this.canvas.remove(); }
}

// The ground under the left and the right wheels along the driven line; s in m from first to last.
function profile(path, body, ground) {
  const rows = [];
  // Rolling back does not lengthen the line.
  for (let row = 0, furthest = -Infinity; row < path.rows; row++) {
    if (path.travelled[row] > furthest) rows.push(row);
    furthest = Math.max(furthest, path.travelled[row]);
  }
  const reach = Math.max(...body.wheels.map(wheel => Math.abs(wheel.x_m) + wheel.radius_m));
  const line = rows.map(row => [path.travelled[row], ...[0, 1, 3].map(column => path.columns[column][row])]);
  const first = Math.min(...path.travelled) - reach - 0.1, last = line[line.length - 1][0] + reach + 0.1;
  const found = { first, last, reach, left: [], right: [] };
  let at = 0;
  for (let s = first; s <= last; s += STEP_M) {
    while (at + 2 < line.length && line[at + 1][0] < s) at++;
    const a = line[at], b = line[Math.min(at + 1, line.length - 1)];
    const share = b[0] > a[0] ? Math.min(1, Math.max(0, (s - a[0]) / (b[0] - a[0]))) : 0;
    const [, x0, y0, heading] = a.map((value, k) => value + share * (b[k] - value));
    const beyond = Math.min(0, s - line[0][0]) + Math.max(0, s - line[line.length - 1][0]);
    const x = x0 + beyond * Math.cos(heading), y = y0 + beyond * Math.sin(heading);
    for (const side of ["left", "right"]) {
      const tyre = body.wheels.find(wheel => wheel.side === side).width_m;
      found[side].push(Math.max(...[-0.5, -0.25, 0, 0.25, 0.5].map(across => {
        const offset = (side === "left" ? 0.5 : -0.5) * body.track_m + across * tyre;
        return ground.height(x - offset * Math.sin(heading), y + offset * Math.cos(heading));
      })));
    }
  }
  return found;
}

function drawCar(context, { path, car: { body }, colour, ghost }, t, place, scale) {
  const at = path.at(t), dash = ghost ? [4, 3] : [];
  // Seen from the right: a pose without heading, roll and place.
  const poses = segmentPoses(body, { ...at, x: 0, y: 0, z: 0, heading: 0, roll: 0 });
  const point = (pose, x, z, lift = 0) => {
    const m = pose.elements;
    return place(at.s + m[0] * x + m[8] * z + m[12], at.z + m[2] * x + m[10] * z + m[14] + lift);
  };
  for (const side of ["left", "right"]) for (const wheel of body.wheels.filter(one => one.side === side)) {
    context.beginPath();
    context.arc(...point(poses[wheel.segment], wheel.x_m, 0, body.track_m / 2 * Math.sin(at.roll) * (side === "left" ? 1 : -1)), wheel.radius_m * scale, 0, 7);
    Object.assign(context, { lineWidth: side === "right" ? 2 : 1, strokeStyle: colour, fillStyle: "rgba(255,255,255,.6)" });
    context.setLineDash(dash);
    if (side === "right" && !ghost) context.fill();
    context.stroke();
  }
  body.segments.forEach((one, k) => {
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => point(poses[k], one.x_m + i * one.length_m / 2, one.center_z_m + j * one.height_m / 2));
    outline(context, corners, ghost ? null : "rgba(0,114,178,.35)", colour, dash);
  });
  context.setLineDash([]);
}

function outline(context, points, fill, stroke, dash = [], closed = true) {
  context.beginPath();
  points.forEach(([x, y], index) => context[index ? "lineTo" : "moveTo"](x, y));
  if (closed) context.closePath();
  context.setLineDash(dash);
  if (fill) { context.fillStyle = fill; context.fill(); }
  if (stroke) { Object.assign(context, { strokeStyle: stroke, lineWidth: 1.5 }); context.stroke(); }
  context.setLineDash([]);
}
