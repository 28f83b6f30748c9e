// A car that drives: its parts on rigid bodies, and where these are at a state of a path. Metres, radians.

import * as THREE from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";
import { matt } from "./paint.js";

const MM = 0.001;
const COLOURS = { film: 0xede8d9, tyre: 0x33363a, servo: 0x29599e, board: 0x1a6b40, battery: 0xbf8c33, other: 0x8c8c8c };
const EDGE = 0x55524a;

// Poses of the segments at a state, as matrices by index. A hinge's angle is positive with the front segment's nose up.
export function segmentPoses(body, at) {
  const gaps = body.segments.map(one => Math.max(0, Math.abs(one.x_m) - one.length_m / 2));
  const main = gaps.indexOf(Math.min(...gaps)), poses = [];
  poses[main] = new THREE.Matrix4().makeTranslation(at.x, at.y, at.z)
    .multiply(new THREE.Matrix4().makeRotationZ(at.heading))
    .multiply(new THREE.Matrix4().makeRotationY(-at.pitch))
    .multiply(new THREE.Matrix4().makeRotationX(at.roll));
  const fold = hinge => at.folds[hinge] ?? 0;
  for (let k = main; k + 1 < body.segments.length; k++) poses[k + 1] = turned(poses[k], body.hinges[k], fold(k));
  for (let k = main; k > 0; k--) poses[k - 1] = turned(poses[k], body.hinges[k - 1], -fold(k - 1));
  return poses;
}

// A pose turned about the car's y axis through a point.
function turned(pose, { x_m, z_m }, angle) {
  return pose.clone().multiply(new THREE.Matrix4().makeTranslation(x_m, 0, z_m))
    .multiply(new THREE.Matrix4().makeRotationY(angle)).multiply(new THREE.Matrix4().makeTranslation(-x_m, 0, -z_m));
}

export const axleOf = (body, wheel) => [wheel.x_m, (wheel.side === "left" ? 0.5 : -0.5) * body.track_m, 0];

export class DrivenCar {
  // car: {body, shape}; body is carsim's, shape that of scene_shape.py or null: then boxes and cylinders stand for the car.
  // ghost: a colour in which the car is shown transparent.
  constructor({ body, shape = null }, ghost = null) {
    this.body = body;
    this.group = new THREE.Group();
    this.segments = body.segments.map(() => new THREE.Group());
    this.wheels = body.wheels.map(() => new THREE.Group());
    const named = new Map([...this.segments.map((one, k) => [`segment${k}`, one]), ...this.wheels.map((one, k) => [`wheel${body.wheels[k].channel}`, one])]);
    for (const one of named.values()) {
      one.matrixAutoUpdate = false;
      this.group.add(one);
    }
    const materials = ghost === null
      ? [matt(), new THREE.LineBasicMaterial({ color: EDGE })]
      : [new THREE.MeshBasicMaterial({ color: ghost, transparent: true, opacity: 0.22, depthWrite: false }), new THREE.LineBasicMaterial({ color: ghost, transparent: true, opacity: 0.7 })];
    const parts = shape ? shapeParts(shape) : bodyParts(body);
    for (const [name, group] of named) {
      const own = parts.filter(part => part.body === name);
      const solids = own.map(part => part.geometry).filter(Boolean), lines = own.flatMap(part => part.edges ?? []);
      if (solids.length) group.add(new THREE.Mesh(mergeGeometries(solids), materials[0]));
      if (lines.length) group.add(new THREE.LineSegments(new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(lines, 3)), materials[1]));
      for (const one of solids) one.dispose();
    }
  }

  // Places the car; wheels turn as if they did not slip, which a path does not tell.
  drive(at) {
    const poses = segmentPoses(this.body, at);
    this.segments.forEach((one, k) => one.matrix.copy(poses[k]));
    this.body.wheels.forEach((wheel, k) => {
      const [x, y, z] = axleOf(this.body, wheel), way = at.s - (wheel.side === "left" ? 1 : -1) * this.body.track_m / 2 * at.heading;
      this.wheels[k].matrix.copy(poses[wheel.segment]).multiply(new THREE.Matrix4().makeTranslation(x, y, z))
        .multiply(new THREE.Matrix4().makeRotationY(way / wheel.radius_m)).multiply(new THREE.Matrix4().makeTranslation(-x, -y, -z));
    });
    this.poses = poses;
  }

  // Points of the car that are within reach of the ground: undersides of tyres and bellies.
  contacts(ground, reach_m = 0.003) {
    const found = [], { body, poses } = this;
    const test = (point, kind) => {
      if (point.z - ground.height(point.x, point.y) < reach_m) found.push({ kind, point });
    };
    body.segments.forEach((one, k) => {
      for (const i of [-1, -0.5, 0, 0.5, 1]) for (const j of [-1, 0, 1]) for (const up of [-1, 1]) {
        const local = [one.x_m + i * one.length_m / 2, j * one.width_m / 2, one.center_z_m + up * one.height_m / 2];
        test(new THREE.Vector3(...local).applyMatrix4(poses[k]), "belly");
      }
    });
    for (const wheel of body.wheels) {
      const pose = poses[wheel.segment], [x, y, z] = axleOf(body, wheel);
      let lowest = null;
      for (let k = 0; k < 36; k++) for (const j of [-0.5, 0.5]) {
        const turn = k * Math.PI / 18;
        const point = new THREE.Vector3(x + wheel.radius_m * Math.cos(turn), y + j * wheel.width_m, z + wheel.radius_m * Math.sin(turn)).applyMatrix4(pose);
        const gap = point.z - ground.height(point.x, point.y);
        if (!lowest || gap < lowest.gap) lowest = { gap, point };
      }
      if (lowest.gap < reach_m) found.push({ kind: "tyre", point: lowest.point });
    }
    return found;
  }
}

function coloured(geometry, material) {
  const plain = geometry.index ? geometry.toNonIndexed() : geometry, count = plain.attributes.position.count;
  const { r, g, b } = new THREE.Color(COLOURS[material]), colours = new Float32Array(3 * count);
  for (let k = 0; k < count; k++) colours.set([r, g, b], 3 * k);
  plain.deleteAttribute("uv");
  plain.computeVertexNormals();
  return plain.setAttribute("color", new THREE.BufferAttribute(colours, 3));
}

// Pieces of film as they are folded, bought parts as boxes, cylinders and rings, of which the outside is seen.
function shapeParts({ pieces, parts }) {
  return parts.flatMap(({ piece: number, body, pose, beyond = {} }) => {
    const piece = pieces[number], place = matrixOf(pose);
    if (piece.solids) return piece.solids.map(solid => ({ body, geometry: coloured(solidOf(solid).applyMatrix4(place), piece.material) }));
    return piece.faces.map((rings, face) => {
      const points = rings.map(ring => Array.from({ length: ring.length / 3 }, (_, k) => new THREE.Vector3().fromArray(ring, 3 * k).multiplyScalar(0.1 * MM).applyMatrix4(place)));
      const edges = points.flatMap(ring => ring.flatMap((point, k) => [...point.toArray(), ...ring[(k + 1) % ring.length].toArray()]));
      return { body: beyond[face] ?? body, edges, geometry: coloured(flatFace(points), "film") };
    });
  });
}

function solidOf({ kind, size, pose }) {
  const [x, y, z] = size.map(side => side * MM);
  const geometry = kind === "box" ? new THREE.BoxGeometry(x, y, z) : new THREE.CylinderGeometry(x / 2, x / 2, z, 32, 1, kind === "ring").rotateX(Math.PI / 2);
  return geometry.applyMatrix4(matrixOf(pose));
}

// Of the first three rows of a matrix in millimetres.
function matrixOf([m00, m01, m02, x, m10, m11, m12, y, m20, m21, m22, z]) {
  return new THREE.Matrix4().set(m00, m01, m02, x * MM, m10, m11, m12, y * MM, m20, m21, m22, z * MM, 0, 0, 0, 1);
}

// Triangles of a flat face in space: its outline, then its holes.
function flatFace(rings) {
  const normal = new THREE.Vector3(), [outline] = rings;
  outline.forEach((a, k) => normal.add(new THREE.Vector3().crossVectors(a, outline[(k + 1) % outline.length])));
  normal.normalize();
  const u = new THREE.Vector3(Math.abs(normal.x) < 0.9 ? 1 : 0, Math.abs(normal.x) < 0.9 ? 0 : 1, 0).cross(normal).normalize();
  const v = new THREE.Vector3().crossVectors(normal, u);
  const [flat, ...holes] = rings.map(ring => ring.map(point => new THREE.Vector2(point.dot(u), point.dot(v))));
  const all = rings.flat(), positions = THREE.ShapeUtils.triangulateShape(flat, holes).flat().flatMap(index => all[index].toArray());
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
}

function bodyParts(body) {
  const parts = body.segments.map((one, k) => {
    const geometry = new THREE.BoxGeometry(one.length_m, one.width_m, one.height_m).translate(one.x_m, 0, one.center_z_m);
    return { body: `segment${k}`, geometry: coloured(geometry, "film"), edges: edgesOf(geometry) };
  });
  return parts.concat(body.wheels.map(wheel => {
    const geometry = new THREE.CylinderGeometry(wheel.radius_m, wheel.radius_m, wheel.width_m, 32).translate(...axleOf(body, wheel));
    return { body: `wheel${wheel.channel}`, geometry: coloured(geometry, "tyre"), edges: edgesOf(geometry) };
  }));
}

const edgesOf = geometry => Array.from(new THREE.EdgesGeometry(geometry, 30).attributes.position.array);
