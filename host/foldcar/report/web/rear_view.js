// The car from behind on the ground across its middle: its roll.

import { freshContext, polygon, label } from "./canvas.js";

export function drawRear(canvas, ground, drives, t) {
  const height = 150;
  const width = canvas.clientWidth || 200;
  const context = freshContext(canvas, height);
  const [{ path, car }] = drives;
  const at = path.at(t);
  const reach = Math.hypot(car.track_m / 2 + 0.03, Math.max(...car.wheels.map((wheel) => wheel.radius_m)));
  const scale = Math.min(width / (2.6 * reach), (height - 24) / (2.2 * reach));
  const under = Math.min(at.z - 0.7 * reach, ground.height(at.x, at.y) - 0.02);
  const place = (across, z) => [width / 2 + across * scale, height - 18 - (z - under) * scale];
  const section = [];
  for (let x = 0; x <= width; x += 3) {
    const across = (x - width / 2) / scale;
    section.push([x, place(0, ground.height(at.x + across * Math.sin(at.heading), at.y - across * Math.cos(at.heading)))[1]]);
  }
  polygon(context, [...section, [width, height], [0, height]], "#bfa878", "#6b4a17");
  for (const drive of [...drives].reverse()) drawCarFromBehind(context, drive, t, at.z, place);
  label(context, `roll ${degrees(at.roll)}`, 6, 12);
}

// The ghost stands on the same middle, at its own height and roll.
function drawCarFromBehind(context, { path, car, colour, ghost }, t, z, place) {
  const at = path.at(t);
  const [cos, sin] = [Math.cos(at.roll), Math.sin(at.roll)];
  // Positive roll lifts the left side; across is to the right.
  const point = (across, up) => place(across * cos + up * sin, at.z - across * sin + up * cos);
  const box = (across, up, width, height) =>
    [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => point(across + (a * width) / 2, up + (b * height) / 2));
  context.setLineDash(ghost ? [4, 3] : []);
  context.lineWidth = 1.5;
  const rearmost = Math.min(...car.wheels.map((wheel) => wheel.x_m));
  for (const wheel of car.wheels.filter((one) => one.x_m === rearmost)) {
    const across = (wheel.side === "left" ? -0.5 : 0.5) * car.track_m;
    polygon(context, box(across, 0, wheel.width_m, 2 * wheel.radius_m), ghost ? null : "rgba(34,34,34,.75)", ghost ? colour : null);
  }
  const body = car.segments[car.segments.length - 1];
  polygon(context, box(0, body.center_z_m, body.width_m, body.height_m), ghost ? null : "rgba(0,114,178,.35)", colour);
  context.setLineDash([]);
}

function degrees(angle) {
  return `${((angle * 180) / Math.PI).toFixed(0)}°`;
}
