// Roll and pitch over the time of a run, with the moment that is shown. A press or a drag on it goes there.

import { INK, freshContext, polyline, roundStep } from "./canvas.js";

const STRIP_HEIGHT = 130;
const STRIP_LEFT = 40;

// angles: [{name, colour, dash, points: [[time (s), angle (rad)], ...]}]
export function drawStrip(canvas, angles, t, end_s) {
  const context = freshContext(canvas, STRIP_HEIGHT);
  const width = canvas.clientWidth || 320;
  const bottom = STRIP_HEIGHT - 20;
  const all = angles.flatMap((one) => one.points.map(([, angle]) => Math.abs((angle * 180) / Math.PI)));
  const most = Math.max(10, ...all.map((one) => one * 1.1));
  const place = (time, angle) => [
    STRIP_LEFT + (time / end_s) * (width - STRIP_LEFT - 8),
    (bottom + 8) / 2 - ((angle * 180) / Math.PI / most) * ((bottom - 8) / 2),
  ];
  const step = roundStep(most / 2);
  context.textBaseline = "middle";
  for (let angle = -Math.floor(most / step) * step; angle <= most; angle += step) {
    const [, y] = place(0, (angle * Math.PI) / 180);
    polyline(context, [[STRIP_LEFT, y], [width - 8, y]], angle ? "#e2e2e2" : "#999999", 1);
    context.fillStyle = INK;
    context.textAlign = "right";
    context.fillText(`${Number(angle.toFixed(1))}°`, STRIP_LEFT - 5, y);
  }
  const seconds = roundStep((end_s * 80) / (width - STRIP_LEFT));
  context.textAlign = "center";
  for (let time = 0; time <= end_s + 1e-9; time += seconds) context.fillText(`${Number(time.toFixed(2))} s`, Math.min(place(time, 0)[0], width - 14), bottom + 11);
  for (const one of angles) polyline(context, one.points.map(([time, angle]) => place(time, angle)), one.colour, 1.6, one.dash);
  const [x] = place(t, 0);
  polyline(context, [[x, 4], [x, bottom]], INK, 1.5);
}

// The time at a place of the pointer on the chart.
export function stripTime(canvas, event, end_s) {
  const box = canvas.getBoundingClientRect();
  const share = (event.clientX - box.left - STRIP_LEFT) / (box.width - STRIP_LEFT - 8);
  return end_s * Math.min(1, Math.max(0, share));
}
