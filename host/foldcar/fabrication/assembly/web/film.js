// A copy of a piece of film: its faces turned about their folds.

import * as THREE from "three";
import { INKS, LIT, PAINTS } from "./paints.js";

// What lies on the inside of a wall stands off a little more than it does: lines must not show through the wall.
export const APART_MM = 1.0;

export function matrix(rows) { return new THREE.Matrix4().set(...rows); }

// The child's frame in its parent's: its edge runs against the parent's, the middles of the two meet.
function across(fold, angle) {
  const [ax, ay, bx, by] = fold.on, [cx, cy, dx, dy] = fold.own;
  const along = new THREE.Vector3(bx - ax, by - ay, 0).normalize();
  const middle = new THREE.Vector3((ax + bx) / 2, (ay + by) / 2, 0);
  const turn = Math.atan2(ay - by, ax - bx) - Math.atan2(dy - cy, dx - cx);
  // The child is on the right of the parent's edge: it rises when turned about the edge's reverse.
  const m = new THREE.Matrix4().makeTranslation(middle.x, middle.y, 0);
  m.multiply(new THREE.Matrix4().makeRotationAxis(along.negate(), angle));
  m.multiply(new THREE.Matrix4().makeRotationZ(turn));
  return m.multiply(new THREE.Matrix4().makeTranslation(-(cx + dx) / 2, -(cy + dy) / 2, 0));
}

export class Film {
  constructor(part, piece) {
    this.part = part;
    this.piece = piece;
    this.group = new THREE.Group();
    const triangles = piece.faces.reduce((n, face) => n + face.triangles.length, 0);
    this.surface = buffers(triangles, ["position", "normal"]);
    this.meshes = PAINTS[piece.material].map(paint => new THREE.Mesh(this.surface, paint));
    for (const mesh of this.meshes) Object.assign(mesh, { castShadow: true, receiveShadow: true, frustumCulled: false });
    this.segments = { cut: [], mountain: [], valley: [] };
    piece.faces.forEach((face, f) => this.outline(face, f));
    this.lines = {};
    for (const [kind, segments] of Object.entries(this.segments)) {
      this.lines[kind] = new THREE.LineSegments(buffers(2 * segments.length, ["position"]), INKS[kind]);
      this.lines[kind].frustumCulled = false;
    }
    this.group.add(...this.meshes, ...Object.values(this.lines));
    this.fold(piece.faces.map(() => 1));
    this.finished = this.poses;
  }

  // The lines of a face: [face, point, next point].
  outline(face, f) {
    let start = 0;
    face.rings.forEach((end, ring) => {
      for (let i = start; i < end; i++) {
        if (ring > 0 || !face.uncut.includes(i)) this.segments.cut.push([f, i, i + 1 < end ? i + 1 : start]);
      }
      start = end;
    });
    if (face.fold && face.fold.drawn) {
      const i = face.fold.edge;
      this.segments[face.fold.angle > 0 ? "valley" : "mountain"].push([f, i, (i + 1) % face.rings[0]]);
    }
  }

  // Shares of each face's fold, 0 flat to 1 folded.
  fold(shares) {
    const key = shares.join();
    if (key === this.key) return;
    this.key = key;
    const { faces } = this.piece, poses = [];
    faces.forEach((face, f) => {
      poses[f] = face.fold
        ? new THREE.Matrix4().multiplyMatrices(poses[face.fold.parent], across(face.fold, shares[f] * face.fold.angle))
        : new THREE.Matrix4();
    });
    this.poses = poses;
    this.corners = faces.map((face, f) => {
      const lift = (face.lifted || 0) * shares[f] * APART_MM, points = [];
      for (let i = 0; i < face.points.length; i += 2) {
        points.push(new THREE.Vector3(face.points[i], face.points[i + 1], lift).applyMatrix4(poses[f]));
      }
      return points;
    });
    this.box = new THREE.Box3().setFromPoints(this.corners.flat());
    this.fill(poses.map(pose => new THREE.Vector3().setFromMatrixColumn(pose, 2)));
  }

  fill(normals) {
    const { position, normal } = this.surface.attributes;
    let at = 0;
    this.piece.faces.forEach((face, f) => {
      const own = face.rings.length ? Array(face.points.length / 2).fill(normals[f]) : [];
      // On a smooth bend the light changes gradually.
      for (const [point, other] of face.smooth) own[point] = own[point].clone().add(normals[other]).normalize();
      for (const i of face.triangles) {
        const corner = this.corners[f][i];
        position.setXYZ(at, corner.x, corner.y, corner.z);
        normal.setXYZ(at++, own[i].x, own[i].y, own[i].z);
      }
    });
    position.needsUpdate = normal.needsUpdate = true;
    this.surface.boundingSphere = null;
    for (const [kind, segments] of Object.entries(this.segments)) {
      const line = this.lines[kind].geometry.attributes.position;
      segments.forEach(([f, i, j], n) => {
        const a = this.corners[f][i], b = this.corners[f][j];
        line.setXYZ(2 * n, a.x, a.y, a.z);
        line.setXYZ(2 * n + 1, b.x, b.y, b.z);
      });
      line.needsUpdate = true;
    }
  }

  // Its extent in the frame that its pose is in.
  extent() {
    const box = new THREE.Box3(), point = new THREE.Vector3();
    for (const face of this.corners) for (const corner of face) box.expandByPoint(point.copy(corner).applyMatrix4(this.group.matrix));
    return box;
  }

  light(on) {
    const paints = (on ? LIT : PAINTS)[this.piece.material];
    this.meshes.forEach((mesh, side) => { mesh.material = paints[side]; });
  }
}

function buffers(vertices, names) {
  const geometry = new THREE.BufferGeometry();
  for (const name of names) geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * vertices), 3));
  return geometry;
}
