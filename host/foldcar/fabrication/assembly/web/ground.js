// The ground of a run: a height map as a surface, the course, the goal, patches of other friction.

import * as THREE from "three";

const ABOVE = [[0.93, 0.92, 0.88], [0.94, 0.87, 0.72], [0.81, 0.65, 0.36], [0.54, 0.35, 0.11]];
const BELOW = [[0.93, 0.92, 0.88], [0.66, 0.79, 0.87], [0.23, 0.49, 0.66], [0.07, 0.25, 0.37]];
const OVER_MM = 2;
const LINE_STEP_MM = 10;

export class Ground {
  constructor(data) {
    Object.assign(this, data.ground);
    this.z = null;
    if (data.ground.heights) {
      let sum = 0;
      this.z = data.ground.heights.map(difference => (sum += difference) * data.ground.height_mm);
    }
    this.group = new THREE.Group();
    this.group.add(this.surface());
    const { course } = data, goal = data.goal;
    this.line([[course[0], course[1]], [course[2], course[1]], [course[2], course[3]], [course[0], course[3]], [course[0], course[1]]], 0x777777);
    for (const outline of goal) this.line(outline, 0xd55e00);
    for (const patch of data.patches) this.line(patch, 0x5b4a9c);
  }

  // Beyond the map the ground is drawn as level.
  height(x, y) {
    if (!this.z) return 0;
    const column = Math.floor((x - this.x_mm) / this.cell_mm), row = Math.floor((y - this.y_mm) / this.cell_mm);
    if (column < 0 || row < 0 || column >= this.columns || row >= this.rows) return 0;
    return this.z[row * this.columns + column];
  }

  surface() {
    const columns = this.z ? this.columns : 2, rows = this.z ? this.rows : 2;
    const [wide, high] = [this.columns * this.cell_mm, this.rows * this.cell_mm];
    const highest = this.z ? this.z.reduce((most, z) => Math.max(most, Math.abs(z)), 1) : 1;
    const positions = new Float32Array(3 * rows * columns), colours = new Float32Array(3 * rows * columns), cells = [];
    for (let row = 0; row < rows; row++) for (let column = 0; column < columns; column++) {
      const at = row * columns + column, z = this.z ? this.z[at] : 0;
      const x = this.z ? this.x_mm + (column + 0.5) * this.cell_mm : this.x_mm + column * wide;
      const y = this.z ? this.y_mm + (row + 0.5) * this.cell_mm : this.y_mm + row * high;
      positions.set([x, y, z], 3 * at);
      colours.set(groundColour(z / highest), 3 * at);
      if (row && column) cells.push(at - columns - 1, at - columns, at, at - columns - 1, at, at - 1);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    geometry.setIndex(cells);
    geometry.computeVertexNormals();
    const mesh = new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({ vertexColors: true, flatShading: true, shininess: 0, specular: 0 }));
    mesh.receiveShadow = true;
    return mesh;
  }

  // A line over the ground, which follows it.
  line(corners, color) {
    const points = [];
    for (let i = 1; i < corners.length; i++) {
      const [a, b] = [corners[i - 1], corners[i]], steps = Math.max(1, Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1]) / LINE_STEP_MM));
      for (let step = i > 1 ? 1 : 0; step <= steps; step++) {
        const x = a[0] + (b[0] - a[0]) * step / steps, y = a[1] + (b[1] - a[1]) * step / steps;
        points.push(new THREE.Vector3(x, y, this.height(x, y) + OVER_MM));
      }
    }
    this.group.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color })));
  }

  dispose() {
    for (const one of this.group.children) {
      one.geometry.dispose();
      one.material.dispose();
    }
  }
}

// Brown above the floor, blue below it; share of the greatest height, -1 to 1.
function groundColour(share) {
  const scale = share >= 0 ? ABOVE : BELOW, place = Math.min(0.999, Math.abs(share)) * (scale.length - 1);
  const low = scale[Math.floor(place)], high = scale[Math.floor(place) + 1];
  const [red, green, blue] = low.map((part, index) => part + (place % 1) * (high[index] - part));
  return new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace).toArray();
}
