// A bought part: its boxes and cylinders.

import * as THREE from "three";
import { matrix } from "./film.js";
import { INKS, LIT, PAINTS } from "./paints.js";

const MAX_APART = 12;

export class Bought {
  constructor(part) {
    this.part = part;
    this.group = new THREE.Group();
    // A ring of many solids is meant to be round.
    const apart = part.solids.length <= MAX_APART;
    this.meshes = part.solids.map(solid => {
      const mesh = new THREE.Mesh(shape(solid, apart ? 1 : 0), PAINTS[part.material][0]);
      mesh.applyMatrix4(matrix(solid.pose));
      Object.assign(mesh, { castShadow: true, receiveShadow: true });
      if (apart) mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry, 30), INKS.cut));
      this.group.add(mesh);
      return mesh;
    });
    this.box = new THREE.Box3();
    for (const mesh of this.meshes) this.box.expandByObject(mesh);
  }

  fold() {}

  extent() { return this.box.clone().applyMatrix4(this.group.matrix); }

  light(on) {
    for (const mesh of this.meshes) mesh.material = (on ? LIT : PAINTS)[this.part.material][0];
  }
}

// A little (mm) smaller than the part: its edges must not show through film that it lies against.
function shape({ kind, size }, little) {
  const [x, y, z] = size.map(side => side - Math.min(little, 0.1 * side));
  if (kind === "box") return new THREE.BoxGeometry(x, y, z);
  return new THREE.CylinderGeometry(x / 2, x / 2, z, 32).rotateX(Math.PI / 2);
}
