// Canvas, camera, light and floor. Lengths in millimetres, z up.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const THEMES = {
  light: { back: 0xf3f2ee, shadow: 0.16, sky: 2.1 },
  dark: { back: 0x22252a, shadow: 0.4, sky: 1.7 },
};
// From the front right: a lid that stands open on the left hides nothing.
const DIRECTION = new THREE.Vector3(0.95, -0.8, 0.85).normalize();
// What a surface square to the light reflects of its colour is a π-th of the light's intensity.
const SUN = 1.7;
const TURN_RAD = 0.12;
const ZOOM = 1.12;

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    // Whether somebody turned the camera, which then stays.
    this.held = false;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 10, 60000);
    this.camera.up.set(0, 0, 1);
    this.sky = new THREE.HemisphereLight(0xffffff, 0xb8b2a4);
    this.sun = new THREE.DirectionalLight(0xffffff, SUN);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.bias = -0.002;
    this.floor = new THREE.Mesh(new THREE.PlaneGeometry(20000, 20000), new THREE.ShadowMaterial());
    this.floor.receiveShadow = true;
    this.scene.add(this.sky, this.sun, this.sun.target, this.floor);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("start", () => { this.held = true; });
    this.controls.addEventListener("change", () => this.draw());
    canvas.addEventListener("keydown", event => this.key(event));
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => { this.paint(dark.matches); this.draw(); });
    this.paint(dark.matches);
  }

  paint(dark) {
    const theme = THEMES[dark ? "dark" : "light"];
    this.scene.background = new THREE.Color(theme.back);
    this.floor.material.opacity = theme.shadow;
    this.sky.intensity = theme.sky;
  }

  // The arrow keys turn the camera, plus and minus bring it nearer and take it away.
  key(event) {
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const away = new THREE.Vector3().subVectors(this.camera.position, this.controls.target);
    const around = new THREE.Spherical().setFromVector3(new THREE.Vector3(away.x, away.z, -away.y));
    if (turns[event.key]) {
      around.theta += TURN_RAD * turns[event.key][0];
      around.phi = Math.min(3.0, Math.max(0.05, around.phi + TURN_RAD * turns[event.key][1]));
    } else if (event.key === "+" || event.key === "-") {
      around.radius *= event.key === "-" ? ZOOM : 1 / ZOOM;
    } else {
      return;
    }
    event.preventDefault();
    this.held = true;
    const turned = new THREE.Vector3().setFromSpherical(around);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(turned.x, -turned.z, turned.y));
    this.controls.update();
    this.draw();
  }

  fit() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x === width && size.y === height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  // Looks at a box from just far enough for all its corners, unless the camera is held.
  look(box) {
    this.fit();
    const target = box.getCenter(new THREE.Vector3()), size = box.getSize(new THREE.Vector3());
    this.shine(target, Math.max(size.x, size.y, size.z));
    if (this.held) return;
    const right = new THREE.Vector3(0, 0, 1).cross(DIRECTION).normalize(), up = DIRECTION.clone().cross(right);
    const high = Math.tan(this.camera.fov * Math.PI / 360) * 0.94, wide = high * this.camera.aspect;
    let away = 0;
    for (const x of [-0.5, 0.5]) for (const y of [-0.5, 0.5]) for (const z of [-0.5, 0.5]) {
      const corner = new THREE.Vector3(x * size.x, y * size.y, z * size.z);
      const aside = Math.max(Math.abs(corner.dot(right)) / wide, Math.abs(corner.dot(up)) / high);
      away = Math.max(away, corner.dot(DIRECTION) + aside);
    }
    this.camera.position.copy(target).addScaledVector(DIRECTION, away);
    this.controls.target.copy(target);
    this.controls.update();
  }

  shine(target, reach) {
    this.sun.target.position.copy(target);
    this.sun.position.copy(target).add(new THREE.Vector3(0.25 * reach, -0.45 * reach, 1.2 * reach));
    Object.assign(this.sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 1, far: 4 * reach });
    this.sun.shadow.camera.updateProjectionMatrix();
  }

  draw() {
    this.fit();
    this.scene.updateMatrixWorld(true);
    this.renderer.render(this.scene, this.camera);
  }
}
