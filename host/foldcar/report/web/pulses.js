// The pulses that the firmware sends to each wheel's servo at a time, as bars from standstill.

import { INK, RUN_COLOUR, freshContext } from "./canvas.js";

export function drawPulses(canvas, car, t) {
  const line = 17;
  const rows = [...car.wheels].sort((a, b) => b.x_m - a.x_m || (a.side > b.side ? 1 : -1));
  const context = freshContext(canvas, 22 + rows.length * line);
  const width = canvas.clientWidth || 200;
  let now = car.pulses[0];
  for (const change of car.pulses) if (change[0] <= t) now = change;
  context.textBaseline = "middle";
  context.fillStyle = INK;
  context.textAlign = "left";
  context.fillText("servo pulses (µs)", 6, 11);
  const axles = [...new Set(rows.map((wheel) => wheel.x_m))];
  const middle = Math.max(104, width * 0.5);
  const reach = Math.max(10, width - middle - 42);
  rows.forEach((wheel, index) => {
    const y = 22 + index * line + line / 2;
    const pulse = now[1 + wheel.channel];
    const forward = pulse ? Math.max(-1, Math.min(1, ((pulse - wheel.neutral_us) * wheel.direction) / 500)) : 0;
    const axle = axles.length === 2 ? ["front", "rear"][axles.indexOf(wheel.x_m)] : `axle ${axles.indexOf(wheel.x_m) + 1}`;
    context.fillStyle = INK;
    context.textAlign = "left";
    context.fillText(`${axle} ${wheel.side}`, 6, y);
    context.fillStyle = RUN_COLOUR;
    const share = reach * forward;
    context.fillRect(Math.min(middle, middle + share), y - 5, Math.max(1, Math.abs(share)), 10);
    context.fillStyle = INK;
    context.fillText(pulse ? String(Math.round(pulse)) : "none", width - 36, y);
  });
}
