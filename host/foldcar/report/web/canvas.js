// Canvases that stay sharp: sized in CSS pixels, drawn in the screen's own.

export const INK = "#222222";
export const RUN_COLOUR = "#0072b2";
export const GHOST_COLOUR = "#d55e00";

// The 2d context of a canvas as wide as its place and so many CSS pixels high, cleared.
export function freshContext(canvas, height) {
  const width = canvas.clientWidth || 320;
  const ratio = window.devicePixelRatio || 1;
  if (canvas.style.height !== `${height}px`) canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = '12px "DejaVu Sans", Arial, Helvetica, sans-serif';
  context.lineJoin = "round";
  return context;
}

export function polygon(context, points, fill, stroke) {
  context.beginPath();
  points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.closePath();
  if (fill) {
    context.fillStyle = fill;
    context.fill();
  }
  if (stroke) {
    context.strokeStyle = stroke;
    context.stroke();
  }
}

export function polyline(context, points, stroke, width = 1.5, dash = []) {
  context.beginPath();
  points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.strokeStyle = stroke;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

// Text on a white ground, so that it is readable on anything.
export function label(context, text, x, y, align = "left", colour = INK) {
  context.textAlign = align;
  context.textBaseline = "middle";
  const width = context.measureText(text).width;
  const left = align === "left" ? x : align === "right" ? x - width : x - width / 2;
  context.fillStyle = "rgba(255,255,255,.8)";
  context.fillRect(left - 2, y - 8, width + 4, 16);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

// A round number of about so many: 1, 2 or 5 times a power of ten.
export function roundStep(about) {
  const power = 10 ** Math.floor(Math.log10(about));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= about * 0.999);
}
