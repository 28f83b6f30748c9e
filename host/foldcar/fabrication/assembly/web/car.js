// The car at a moment of its assembly: t = 0 is all pieces flat on a table, step k goes from t = k - 1 to k.
//
// In a step what is new is folded, then goes in along its way; then what was there already is folded further.

import * as THREE from "three";
import { Bought } from "./bought.js";
import { APART_MM, Film, matrix } from "./film.js";

export const smooth = t => t * t * (3 - 2 * t);

export class Car {
  constructor(data, scene) {
    this.data = data;
    this.steps = data.steps.length;
    this.bodies = new Map();
    this.parts = data.parts.map(part => (part.solids ? new Bought(part) : new Film(part, data.pieces[part.piece])));
    for (const one of this.parts) {
      one.first = one.part.ways[0][0];
      one.group.matrixAutoUpdate = false;
      if (!this.bodies.has(one.part.body)) {
        const body = new THREE.Group();
        body.matrixAutoUpdate = false;
        this.bodies.set(one.part.body, body);
        scene.add(body);
      }
      this.bodies.get(one.part.body).add(one.group);
    }
    const depth = one => (one.part.rides ? 1 + depth(this.parts[one.part.rides[0]]) : 0);
    this.inOrder = [...this.parts].sort((a, b) => depth(a) - depth(b));
    this.phases = Array.from({ length: this.steps + 1 }, (_, step) => this.phasesOf(step));
    this.frames = [];
  }

  // What happens in a step, one after the other: "new" folds, "move", "old" folds.
  phasesOf(step) {
    const folds = one => one instanceof Film && one.piece.faces.some(face => face.fold && face.fold.closing.some(([at]) => at === step));
    const moves = one => one.part.ways.some(([at, way]) => at === step && way.length);
    const found = [];
    if (this.parts.some(one => one.first === step && folds(one))) found.push("new");
    if (this.parts.some(moves)) found.push("move");
    if (this.parts.some(one => one.first < step && folds(one))) found.push("old");
    return found;
  }

  // How much of a phase of a step, or of a part of it, is done at t.
  done(step, phase, t, begin = 0, end = 1) {
    const phases = this.phases[step], share = (t - step + 1) * phases.length - phases.indexOf(phase);
    return smooth(Math.min(1, Math.max(0, (share - begin) / (end - begin))));
  }

  // Shows t; explode: 0 to 1; open: how far the lid is opened, 0 to 1; bought: whether bought parts are shown.
  show(t, { explode = 0, open = 0, bought = true } = {}) {
    for (const body of this.bodies.values()) body.matrix.identity();
    // What rides on a piece is placed after it.
    for (const one of this.inOrder) {
      one.group.visible = (bought || one instanceof Film) && (t <= 0 || one.first < t + 1);
      if (!one.group.visible) continue;
      if (t <= 0) this.lay(one);
      else this.place(one, t, explode, open);
    }
  }

  // Flat on the table.
  lay(one) {
    if (one instanceof Film) one.fold(one.piece.faces.map(() => 0));
    const [x, y, turn] = one.part.flat;
    one.group.matrix.makeRotationZ(turn).setPosition(x, y, this.data.ground - one.box.min.z);
  }

  place(one, t, explode, open) {
    if (one instanceof Film) {
      const opened = this.data.lid[one.part.piece] || [];
      one.fold(one.piece.faces.map((face, f) => (face.fold ? this.share(one, face, t) * (opened.includes(f) ? 1 - open : 1) : 0)));
    }
    const offset = new THREE.Vector3(...one.part.exploded).multiplyScalar(explode);
    for (const [step, way, begin, end] of one.part.ways) {
      if (step > t - 1) offset.add(along(way, 1 - this.done(step, "move", t, begin, end)));
    }
    one.group.matrix.makeTranslation(offset.x, offset.y, offset.z);
    if (one.part.rides) one.group.matrix.multiply(this.ridden(...one.part.rides));
    one.group.matrix.multiply(matrix(one.part.pose));
    if (one.part.layer) one.group.matrix.multiply(new THREE.Matrix4().makeTranslation(0, 0, APART_MM));
  }

  // The motion of a piece's face from its place in the finished car.
  ridden(index, face) {
    const host = this.parts[index], pose = matrix(host.part.pose), then = host.finished[face].clone().invert();
    const above = host.part.rides ? this.ridden(...host.part.rides) : new THREE.Matrix4();
    return above.multiply(pose).multiply(host.poses[face]).multiply(then).multiply(matrix(host.part.pose).invert());
  }

  // How far a face of a part is folded at t.
  share(one, face, t) {
    let share = 0;
    for (const [step, aim] of face.fold.closing) {
      if (step - 1 > t) break;
      share += (aim - share) * this.done(step, one.first >= step ? "new" : "old", t);
    }
    return share;
  }

  box(filmOnly = false) {
    const box = new THREE.Box3();
    for (const one of this.parts) if (one.group.visible && !(filmOnly && !(one instanceof Film))) box.union(one.extent());
    return box;
  }

  // All that is seen during a step; of step 0, the table.
  frame(step) {
    if (!this.frames[step]) {
      const box = new THREE.Box3();
      for (const t of step ? [step - 0.99, step - 0.5, step] : [0]) {
        this.show(t);
        box.union(this.box());
      }
      this.frames[step] = box;
    }
    return this.frames[step];
  }

  light(part) {
    for (const one of this.parts) one.light(one === part);
  }
}

// Where a part is that has gone this share of its way out.
function along(way, share) {
  const at = new THREE.Vector3(), motions = way.map(motion => new THREE.Vector3(...motion));
  let left = share * motions.reduce((sum, motion) => sum + motion.length(), 0);
  for (const motion of motions) {
    const length = motion.length();
    if (length > 0) at.addScaledVector(motion, Math.min(1, Math.max(0, left / length)));
    left -= length;
  }
  return at;
}
