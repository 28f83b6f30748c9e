// The ground of a scene of docs/carsim.md: blocks as they are, hills and rough ground as a grid. Metres.

// Blocks that adjoin have no slit between them, as in sim2d/lib/terrain/block.cpp.
const ROUNDING_M = 1e-7;

// grid: {x_min_m, y_min_m, x_step_m, y_step_m, columns, rows, z_m} of the smooth ground, row by row from the lowest y, or
// null without smooth ground.
export class Ground {
  constructor(scene, grid = null) {
    Object.assign(this, { scene, grid });
    this.blocks = scene.terrain.filter(piece => profileOf(piece)).map(piece => ({
      ...piece, cos: Math.cos(piece.heading_rad), sin: Math.sin(piece.heading_rad),
    }));
    this.patches = scene.terrain.filter(piece => piece.kind === "patch");
  }

  // Of blocks and the smooth ground the highest counts.
  height(x, y) {
    let z = this.grid ? smoothHeight(this.grid, x, y) : 0;
    for (const block of this.blocks) {
      const dx = x - block.x_m, dy = y - block.y_m;
      const along = dx * block.cos + dy * block.sin, across = dy * block.cos - dx * block.sin;
      if (Math.abs(along) > block.length_m / 2 + ROUNDING_M || Math.abs(across) > block.width_m / 2 + ROUNDING_M) continue;
      z = Math.max(z, topOf(block, along));
    }
    return z;
  }

  // Outlines of the plane that are drawn over the ground, each {points, kind}: course, goal, patch.
  outlines() {
    const { course, goal } = this.scene;
    const edge = [[course.x_min_m, course.y_min_m], [course.x_max_m, course.y_min_m], [course.x_max_m, course.y_max_m], [course.x_min_m, course.y_max_m]];
    const outlines = [{ kind: "course", points: [...edge, edge[0]] }];
    if (goal) outlines.push({ kind: "goal", points: goal.kind === "disc" ? circle(goal) : lineAcross(goal, course) });
    for (const { x_m, y_m, heading_rad, length_m, width_m } of this.patches) {
      const corners = rectangle(x_m, y_m, heading_rad, length_m, width_m);
      outlines.push({ kind: "patch", points: [...corners, corners[0]] });
    }
    return outlines;
  }
}

// The side of a block, [along, z] from its rear foot over its top to its front foot; null of a piece that is no block.
export function profileOf({ kind, length_m, height_m }) {
  const half = length_m / 2;
  if (kind === "box") return [[-half, 0], [-half, height_m], [half, height_m], [half, 0]];
  if (kind === "ramp") return [[-half, 0], [half, height_m], [half, 0]];
  if (kind !== "half_round") return null;
  const radius = (half * half + height_m * height_m) / (2 * height_m), steps = 16;
  return Array.from({ length: steps + 1 }, (_, step) => {
    const along = half * (2 * step / steps - 1);
    return [along, Math.sqrt(Math.max(0, radius * radius - along * along)) + height_m - radius];
  });
}

function topOf({ kind, length_m, height_m }, along) {
  if (kind === "box") return height_m;
  const half = length_m / 2;
  if (kind === "ramp") return height_m * (along / half + 1) / 2;
  const radius = (half * half + height_m * height_m) / (2 * height_m);
  return Math.sqrt(Math.max(0, radius * radius - along * along)) + height_m - radius;
}

function smoothHeight(grid, x, y) {
  const u = (x - grid.x_min_m) / grid.x_step_m, v = (y - grid.y_min_m) / grid.y_step_m;
  if (u < 0 || v < 0 || u > grid.columns - 1 || v > grid.rows - 1) return 0;
  const column = Math.min(Math.floor(u), grid.columns - 2), row = Math.min(Math.floor(v), grid.rows - 2);
  const at = row * grid.columns + column, s = u - column, t = v - row, z = grid.z_m;
  return (1 - t) * ((1 - s) * z[at] + s * z[at + 1]) + t * ((1 - s) * z[at + grid.columns] + s * z[at + grid.columns + 1]);
}

// The ground of a blob: its head is {scene, grid} with the grid's unit height_m, its bytes the differences of heights.
// height: of obstacles, relative to the scene's.
export function readGround({ scene: planned, grid }, read, height = 1) {
  const scene = height === 1 ? planned : { ...planned, terrain: planned.terrain.map(piece => raised(piece, height)) };
  if (!grid) return new Ground(scene);
  const z_m = new Float32Array(grid.columns * grid.rows);
  for (let cell = 0, sum = 0; cell < z_m.length; cell++) z_m[cell] = (sum += read()) * grid.height_m * height;
  return new Ground(scene, { ...grid, z_m });
}

// A block of another height; an arc is at most half as high as long.
function raised(piece, height) {
  if (piece.height_m === undefined) return piece;
  const height_m = piece.height_m * height;
  return { ...piece, height_m: piece.kind === "half_round" ? Math.min(height_m, piece.length_m / 2) : height_m };
}

export function rectangle(x, y, heading, length, width) {
  const cos = Math.cos(heading), sin = Math.sin(heading);
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => {
    const a = i * length / 2, b = j * width / 2;
    return [x + a * cos - b * sin, y + a * sin + b * cos];
  });
}

function circle({ x_m, y_m, radius_m }) {
  return Array.from({ length: 49 }, (_, k) => [x_m + radius_m * Math.cos(k * Math.PI / 24), y_m + radius_m * Math.sin(k * Math.PI / 24)]);
}

// A goal's line as far as the course goes.
function lineAcross(goal, course) {
  const along = [-Math.sin(goal.heading_rad), Math.cos(goal.heading_rad)];
  let low = -Infinity, high = Infinity;
  ["x", "y"].forEach((axis, index) => {
    if (Math.abs(along[index]) < 1e-9) return;
    const ends = ["min", "max"].map(end => (course[`${axis}_${end}_m`] - goal[`${axis}_m`]) / along[index]).sort((a, b) => a - b);
    [low, high] = [Math.max(low, ends[0]), Math.min(high, ends[1])];
  });
  return [low, high].map(s => [goal.x_m + s * along[0], goal.y_m + s * along[1]]);
}
