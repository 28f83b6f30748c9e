// What film, bought parts and lines look like.

import * as THREE from "three";

const COLOURS = {
  film: [0xfbf5e6, 0xc3d3e4], tyre: [0x54585f, 0x3d4046], servo: [0x3d77b8, 0x3d77b8], board: [0x2f7d4f, 0x2f7d4f],
  battery: [0xd2a04a, 0xd2a04a], other: [0x9a9a9a, 0x9a9a9a],
};
const LINES = { cut: 0x2a2a2a, mountain: 0xc2272d, valley: 0x0b62a8 };
const POINTED_AT = 0x7a3b00;

// Front and back of a material.
function paintOf(name, emissive = 0) {
  return COLOURS[name].map((color, back) => new THREE.MeshLambertMaterial({
    color, emissive, side: back ? THREE.BackSide : THREE.FrontSide, polygonOffset: true, polygonOffsetFactor: 0.1, polygonOffsetUnits: 1,
  }));
}

export const PAINTS = {}, LIT = {}, INKS = {};
for (const name of Object.keys(COLOURS)) {
  PAINTS[name] = paintOf(name);
  LIT[name] = paintOf(name, POINTED_AT);
}
for (const [name, color] of Object.entries(LINES)) INKS[name] = new THREE.LineBasicMaterial({ color });

// Whether one sees through film.
export function seeThrough(wanted) {
  for (const paint of [...PAINTS.film, ...PAINTS.tyre]) {
    paint.transparent = wanted;
    paint.opacity = wanted ? 0.35 : 1;
    paint.depthWrite = !wanted;
    paint.needsUpdate = true;
  }
}
