// Roll and pitch over time as a canvas that is scrubbed, and the pulses that the servos get.

import { context2d, make } from "./dom.js";

const ANGLES = [5, 10, 15, 30, 45, 90, 180];
const LEFT = 40, FOOT = 20, HEIGHT = 128, PULSE_ROW = 12;

export class Strips {
  // seek(t) is called while a pointer is dragged or keys are pressed.
  constructor(element, seek) {
    Object.assign(this, { seek, series: [], pulses: null, end_s: 1, t: 0 });
    const label = "time; roll (solid) and pitch (dashed) in degrees", style = "display:block;width:100%;cursor:col-resize;touch-action:pan-y";
    this.canvas = element.appendChild(make("canvas", { tabindex: 0, class: "strips", role: "slider", "aria-label": label, style }));
    this.missing = element.appendChild(make("p", { class: "note", text: "Without a canvas a browser draws no roll and pitch.", hidden: true }));
    const drag = event => this.seek(this.timeAt(event));
    this.canvas.addEventListener("pointerdown", event => { this.canvas.setPointerCapture(event.pointerId); drag(event); });
    this.canvas.addEventListener("pointermove", event => { if (event.buttons) drag(event); });
    this.canvas.addEventListener("keydown", event => {
      const steps = { ArrowLeft: -0.05, ArrowRight: 0.05, PageDown: -0.5, PageUp: 0.5, Home: -Infinity, End: Infinity };
      if (!(event.key in steps)) return;
      event.preventDefault();
      this.seek(Math.min(this.end_s, Math.max(0, this.t + steps[event.key])));
    });
  }

  // runs: of scene.js; the first one's pulses are shown.
  load(runs, end_s) {
    this.end_s = Math.max(end_s, 0.05);
    this.series = runs.flatMap(({ path, attitude, colour }) => {
      const points = path
        ? [5, 4].map(column => Array.from(path.times_s, (time, row) => [time, path.columns[column][row]]))
        : [2, 1].map(column => attitude.map(row => [row[0], row[column]]));
      return points.map((one, index) => ({ colour, dash: index ? [4, 3] : [], points: one }));
    });
    this.pulses = runs[0]?.pulses?.length ? runs[0].pulses : null;
    this.canvas.setAttribute("aria-valuemax", this.end_s.toFixed(2));
  }

  timeAt(event) {
    const box = this.canvas.getBoundingClientRect();
    return Math.min(this.end_s, Math.max(0, (event.clientX - box.left - LEFT) / (box.width - LEFT - 8) * this.end_s));
  }

  draw(t) {
    this.t = t;
    this.canvas.setAttribute("aria-valuenow", t.toFixed(2));
    this.canvas.setAttribute("aria-valuetext", `${t.toFixed(2)} s of ${this.end_s.toFixed(2)} s`);
    const width = this.canvas.clientWidth || 320, ratio = window.devicePixelRatio || 1;
    const ink = getComputedStyle(this.canvas).color, rows = this.pulses ? this.pulsesRows().length : 0;
    const height = HEIGHT + rows * PULSE_ROW;
    this.canvas.style.height = `${height}px`;
    Object.assign(this.canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    const context = context2d(this.canvas);
    this.missing.hidden = context !== null;
    if (!context) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawAngles(context, width, ink);
    context.fillStyle = ink;
    context.fillRect(LEFT + t / this.end_s * (width - LEFT - 8) - 0.75, 2, 1.5, height - 2);
  }

  drawAngles(context, width, ink) {
    context.font = '12px "DejaVu Sans", Arial, Helvetica, sans-serif';
    const degrees = this.series.flatMap(one => one.points.map(point => Math.abs(point[1]) * 180 / Math.PI));
    const reach = Math.max(15, ...degrees.filter(Number.isFinite)) * 1.08, middle = (HEIGHT - FOOT) / 2;
    const x = t => LEFT + t / this.end_s * (width - LEFT - 8), y = angle => middle - angle * 180 / Math.PI / reach * (middle - 4);
    context.fillStyle = ink;
    context.textBaseline = "middle";
    const step = ANGLES.filter(one => one <= reach).at(-1);
    for (let mark = -Math.floor(reach / step) * step; mark <= reach; mark += step) {
      context.globalAlpha = mark === 0 ? 0.6 : 0.15;
      context.fillRect(LEFT, y(mark * Math.PI / 180) - 0.5, width - LEFT - 8, 1);
      context.globalAlpha = 1;
      context.textAlign = "right";
      context.fillText(`${mark}°`, LEFT - 4, y(mark * Math.PI / 180));
    }
    context.textAlign = "left";
    context.fillText("roll —   pitch - -", LEFT + 2, 8);
    context.textAlign = "center";
    const every = roundStep(this.end_s * 60 / (width - LEFT));
    for (let mark = 0; mark <= this.end_s; mark += every) context.fillText(`${Number(mark.toFixed(3))} s`, Math.min(width - 18, x(mark)), HEIGHT - FOOT / 2 + 2);
    for (const { colour, dash, points } of this.series) {
      context.beginPath();
      points.forEach(([time, angle], index) => context[index ? "lineTo" : "moveTo"](x(time), y(angle)));
      context.setLineDash(dash);
      Object.assign(context, { strokeStyle: colour, lineWidth: 1.5 });
      context.stroke();
    }
    context.setLineDash([]);
    if (this.pulses) this.drawPulses(context, x, ink);
  }

  // The servo outputs that ever have a pulse.
  pulsesRows() {
    return [...Array(8).keys()].filter(channel => this.pulses.some(row => row[channel + 1] > 0));
  }

  // A row for each servo output: above its middle more than 1500 µs.
  drawPulses(context, x, ink) {
    this.pulsesRows().forEach((channel, row) => {
      const middle = HEIGHT + row * PULSE_ROW + PULSE_ROW / 2;
      context.fillStyle = ink;
      context.textAlign = "right";
      context.fillText(`S${channel}`, LEFT - 4, middle);
      context.globalAlpha = 0.5;
      this.pulses.forEach((change, index) => {
        const from = Math.max(0, change[0]), to = Math.min(this.end_s, this.pulses[index + 1]?.[0] ?? Infinity), width_us = change[channel + 1];
        if (to <= from || !width_us) return;
        const high = Math.max(-5, Math.min(5, (width_us - 1500) / 100));
        context.fillRect(x(from), middle - Math.max(0, high) - 0.5, x(to) - x(from), Math.abs(high) + 1);
      });
      context.globalAlpha = 1;
    });
  }
}

// A round number of at least so much: 1, 2 or 5 times a power of ten.
export function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map(factor => factor * power).find(step => step >= least * 0.999);
}
