// A scene from above: ground, course, goal, a car with the tracks of its wheels.

import { INK, freshContext, polygon, polyline, label } from "./canvas.js";

// The window of the plane to show: the ground's map and the paths, in the course's proportions.
export function topWindow(ground, paths) {
  const view = { x_min: ground.x_min_m, x_max: ground.x_max_m, y_min: ground.y_min_m, y_max: ground.y_max_m };
  for (const path of paths) {
    const [x, y] = path.columns;
    for (let row = 0; row < path.rows; row++) {
      view.x_min = Math.min(view.x_min, x[row] - 0.15);
      view.x_max = Math.max(view.x_max, x[row] + 0.15);
      view.y_min = Math.min(view.y_min, y[row] - 0.15);
      view.y_max = Math.max(view.y_max, y[row] + 0.15);
    }
  }
  return view;
}

// Draws the ground into the canvas; returns how a point of the plane (m) becomes one of the canvas.
export function drawScene(canvas, ground, view, most_height, legend = true) {
  const width = canvas.clientWidth || 320;
  const scale = Math.min(width / (view.x_max - view.x_min), most_height / (view.y_max - view.y_min));
  const height = Math.round(scale * (view.y_max - view.y_min));
  const context = freshContext(canvas, height);
  const left = (width - scale * (view.x_max - view.x_min)) / 2;
  const place = (x, y) => [left + (x - view.x_min) * scale, height - (y - view.y_min) * scale];
  context.fillStyle = "rgb(246,244,238)";
  context.fillRect(0, 0, width, height);
  const [x, y] = place(ground.x_min_m, ground.y_max_m);
  context.imageSmoothingEnabled = true;
  context.drawImage(ground.picture(), x, y, ground.columns * ground.cell_m * scale, ground.rows * ground.cell_m * scale);
  const scene = ground.scene;
  for (const piece of scene.terrain) drawPiece(context, piece, place);
  drawCourse(context, scene.course, place);
  if (scene.goal) drawGoal(context, scene, place, scale, legend);
  const start = place(scene.start.x_m, scene.start.y_m);
  context.fillStyle = INK;
  context.beginPath();
  context.arc(...start, 3, 0, 7);
  context.fill();
  if (legend) label(context, "start", start[0], start[1] + 14, "center");
  return { context, place, scale };
}

function corners(x, y, heading, length, width) {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([along, across]) => {
    const [a, b] = [(along * length) / 2, (across * width) / 2];
    return [x + a * cos - b * sin, y + a * sin + b * cos];
  });
}

// Edges of blocks and outlines of patches of other friction.
function drawPiece(context, piece, place) {
  if (piece.length_m === undefined || piece.kind === "rough") return;
  const patch = piece.kind === "patch";
  context.lineWidth = patch ? 1.2 : 0.6;
  context.setLineDash(patch ? [4, 3] : []);
  const outline = corners(piece.x_m, piece.y_m, piece.heading_rad, piece.length_m, piece.width_m);
  polygon(context, outline.map(([x, y]) => place(x, y)), patch ? "rgba(91,74,156,.12)" : null, patch ? "#5b4a9c" : "rgba(0,0,0,.4)");
  context.setLineDash([]);
}

function drawCourse(context, course, place) {
  const edge = [[course.x_min_m, course.y_min_m], [course.x_max_m, course.y_min_m], [course.x_max_m, course.y_max_m], [course.x_min_m, course.y_max_m]];
  context.lineWidth = 1;
  polygon(context, edge.map(([x, y]) => place(x, y)), null, "#777777");
}

function drawGoal(context, scene, place, scale, legend) {
  const { goal } = scene;
  const at = place(goal.x_m, goal.y_m);
  if (goal.kind === "disc") {
    context.setLineDash([5, 4]);
    context.lineWidth = 1.5;
    context.strokeStyle = INK;
    context.beginPath();
    context.arc(...at, goal.radius_m * scale, 0, 7);
    context.stroke();
    context.setLineDash([]);
  } else {
    const [dx, dy] = [-Math.sin(goal.heading_rad) * 50, Math.cos(goal.heading_rad) * 50];
    polyline(context, [place(goal.x_m - dx, goal.y_m - dy), place(goal.x_m + dx, goal.y_m + dy)], INK, 1.5, [5, 4]);
  }
  if (legend) label(context, "goal", Math.max(16, Math.min((context.canvas.clientWidth || 320) - 16, at[0])), 12, "center");
}

// The car at time t: the tracks of its wheels so far, its boxes and wheels.
export function drawCarFromAbove(view, path, car, t, colour, ghost) {
  const { context, place } = view;
  const at = path.at(t);
  const [x, y, , heading] = path.columns;
  const [row] = path.place(t);
  for (const side of [0.5, -0.5]) {
    const offset = side * car.track_m;
    const track = [];
    for (let index = 0; index <= row; index++)
      track.push(place(x[index] - offset * Math.sin(heading[index]), y[index] + offset * Math.cos(heading[index])));
    track.push(place(at.x - offset * Math.sin(at.heading), at.y + offset * Math.cos(at.heading)));
    polyline(context, track, colour, ghost ? 1.2 : 1.8, ghost ? [4, 3] : []);
  }
  // A car that leans shows less of its width.
  const lean = Math.abs(Math.cos(at.roll));
  const [cos, sin] = [Math.cos(at.heading), Math.sin(at.heading)];
  const box = (along, across, length, width) =>
    corners(at.x + along * cos - across * sin, at.y + along * sin + across * cos, at.heading, length, width).map(([a, b]) => place(a, b));
  context.lineWidth = ghost ? 1.2 : 1.5;
  context.setLineDash(ghost ? [4, 3] : []);
  for (const wheel of car.wheels) {
    const across = (wheel.side === "left" ? 0.5 : -0.5) * car.track_m * lean;
    const width = Math.max(wheel.width_m * lean, 2 * wheel.radius_m * Math.abs(Math.sin(at.roll)));
    polygon(context, box(wheel.x_m, across, 2 * wheel.radius_m, width), ghost ? null : "rgba(34,34,34,.75)", ghost ? colour : null);
  }
  for (const one of car.segments)
    polygon(context, box(one.x_m, 0, one.length_m, one.width_m * lean), ghost ? null : "rgba(0,114,178,.35)", colour);
  context.setLineDash([]);
  const nose = [at.x + 0.06 * cos, at.y + 0.06 * sin];
  if (!ghost) polyline(context, [place(at.x, at.y), place(...nose)], "#ffffff", 2);
}
