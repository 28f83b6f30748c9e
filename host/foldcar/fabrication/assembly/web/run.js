// A run of the simulator: the car's bodies where they were at any time of it, over its ground.

import * as THREE from "three";
import { Ground } from "./ground.js";

const SEEN_MM = 330;

export class Run {
  // data: of recorded_run.py; car: the data of the car that drives.
  constructor(data, car) {
    Object.assign(this, { data, axles: car.axles, hinges: car.hinges });
    this.ground = new Ground(data);
    this.end_s = data.rows[data.rows.length - 1][0];
  }

  // The row at a time, between two of the path's by their shares.
  at(t) {
    const { rows } = this.data;
    let low = 0, high = rows.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (rows[middle][0] <= t) low = middle;
      else high = middle;
    }
    const span = rows[high][0] - rows[low][0];
    const share = span > 0 ? Math.min(1, Math.max(0, (t - rows[low][0]) / span)) : 0;
    return rows[low].map((value, column) => value + share * (rows[high][column] - value));
  }

  // Moves the car to where it was, and tells where that is.
  drive(car, t) {
    const [, x, y, z, heading, pitch, roll, ...rest] = this.at(t);
    const folds = rest.slice(0, this.hinges.length), turns = rest.slice(this.hinges.length);
    const poses = new Map(), main = this.data.main;
    const own = new THREE.Matrix4().makeTranslation(x, y, z);
    own.multiply(new THREE.Matrix4().makeRotationZ(heading)).multiply(new THREE.Matrix4().makeRotationY(-pitch));
    poses.set(`segment${main}`, own.multiply(new THREE.Matrix4().makeRotationX(roll)));
    // A hinge's angle is positive with the front segment's nose up.
    for (let index = main; index < this.hinges.length; index++) {
      poses.set(`segment${index + 1}`, turned(poses.get(`segment${index}`), this.hinges[index].center, folds[index]));
    }
    for (let index = main; index > 0; index--) {
      poses.set(`segment${index - 1}`, turned(poses.get(`segment${index}`), this.hinges[index - 1].center, -folds[index - 1]));
    }
    this.axles.forEach((axle, index) => poses.set(axle.wheel, turned(poses.get(axle.body), axle.center, turns[index])));
    car.drive(poses, folds);
    return new THREE.Vector3(x, y, z);
  }

  box(point) {
    return new THREE.Box3().setFromCenterAndSize(point, new THREE.Vector3(SEEN_MM, SEEN_MM, SEEN_MM / 2));
  }
}

// A pose turned about the car's y axis through a point.
function turned(pose, [x, y, z], angle) {
  const m = pose.clone().multiply(new THREE.Matrix4().makeTranslation(x, y, z));
  return m.multiply(new THREE.Matrix4().makeRotationY(angle)).multiply(new THREE.Matrix4().makeTranslation(-x, -y, -z));
}
