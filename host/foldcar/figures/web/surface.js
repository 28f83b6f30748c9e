// The ground of a scene as meshes and lines. Metres.

import * as THREE from "three";
import { profileOf } from "./ground.js";
import { matt } from "./paint.js";

const FLOOR = 0xece8dd, BLOCK = 0xcfa65b;
const ABOVE = [[0.93, 0.91, 0.87], [0.94, 0.87, 0.72], [0.81, 0.65, 0.36], [0.54, 0.35, 0.11]];
const BELOW = [[0.93, 0.91, 0.87], [0.66, 0.79, 0.87], [0.23, 0.49, 0.66], [0.07, 0.25, 0.37]];
const INKS = { course: 0x777777, goal: 0xd55e00, patch: 0x5b4a9c };
const OVER_M = 0.003, LINE_STEP_M = 0.01, AROUND_M = 0.6;

export function groundGroup(ground) {
  const group = new THREE.Group();
  group.add(floor(ground));
  if (ground.grid) group.add(smooth(ground.grid));
  for (const block of ground.blocks) group.add(solid(block));
  for (const { kind, points } of ground.outlines()) group.add(lineOver(ground, points, INKS[kind]));
  return group;
}

// A line of the plane that follows the ground.
export function lineOver(ground, corners, color, over = OVER_M) {
  const points = [];
  corners.slice(1).forEach((b, index) => {
    const a = corners[index], steps = Math.max(1, Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1]) / LINE_STEP_M));
    for (let step = index ? 1 : 0; step <= steps; step++) {
      const x = a[0] + (b[0] - a[0]) * step / steps, y = a[1] + (b[1] - a[1]) * step / steps;
      points.push(new THREE.Vector3(x, y, ground.height(x, y) + over));
    }
  });
  return new THREE.Line(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color }));
}

// The level floor a little beyond the course, with a hole where the smooth ground is.
function floor({ scene: { course }, grid }) {
  const shape = new THREE.Shape([
    [course.x_min_m - AROUND_M, course.y_min_m - AROUND_M], [course.x_max_m + AROUND_M, course.y_min_m - AROUND_M],
    [course.x_max_m + AROUND_M, course.y_max_m + AROUND_M], [course.x_min_m - AROUND_M, course.y_max_m + AROUND_M],
  ].map(([x, y]) => new THREE.Vector2(x, y)));
  if (grid) {
    const x1 = grid.x_min_m + (grid.columns - 1) * grid.x_step_m, y1 = grid.y_min_m + (grid.rows - 1) * grid.y_step_m;
    shape.holes.push(new THREE.Path([[grid.x_min_m, grid.y_min_m], [grid.x_min_m, y1], [x1, y1], [x1, grid.y_min_m]].map(([x, y]) => new THREE.Vector2(x, y))));
  }
  return new THREE.Mesh(new THREE.ShapeGeometry(shape), matt(FLOOR));
}

function smooth({ x_min_m, y_min_m, x_step_m, y_step_m, columns, rows, z_m }) {
  const highest = z_m.reduce((most, z) => Math.max(most, Math.abs(z)), 0.001), cells = [];
  const positions = new Float32Array(3 * columns * rows), colours = new Float32Array(3 * columns * rows);
  for (let row = 0; row < rows; row++) for (let column = 0; column < columns; column++) {
    const at = row * columns + column;
    positions.set([x_min_m + column * x_step_m, y_min_m + row * y_step_m, z_m[at]], 3 * at);
    colours.set(heightColour(z_m[at] / highest), 3 * at);
    if (row && column) cells.push(at - columns - 1, at - columns, at, at - columns - 1, at, at - 1);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  geometry.setIndex(cells);
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, matt());
}

// Brown above the floor, blue below it; share of the greatest height, -1 to 1.
function heightColour(share) {
  const scale = share >= 0 ? ABOVE : BELOW, place = Math.min(0.999, Math.abs(share)) * (scale.length - 1);
  const low = scale[Math.floor(place)], high = scale[Math.floor(place) + 1];
  return new THREE.Color().setRGB(...low.map((part, k) => part + (place % 1) * (high[k] - part)), THREE.SRGBColorSpace).toArray();
}

// A block: its side drawn out across.
function solid(block) {
  const side = new THREE.Shape(profileOf(block).map(([along, z]) => new THREE.Vector2(along, z)));
  const geometry = new THREE.ExtrudeGeometry(side, { depth: block.width_m, bevelEnabled: false });
  // The extrusion goes along z: up is its y.
  geometry.translate(0, 0, -block.width_m / 2).rotateX(Math.PI / 2).rotateZ(block.heading_rad).translate(block.x_m, block.y_m, 0);
  const mesh = new THREE.Mesh(geometry, matt(BLOCK));
  mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry, 20), new THREE.LineBasicMaterial({ color: 0x6b4a17 })));
  return mesh;
}
