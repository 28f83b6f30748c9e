// Names the part under the pointer, or the one that is tapped.

import * as THREE from "three";

export class Names {
  constructor(stage, car, canvas, tip) {
    Object.assign(this, { stage, car, canvas, tip, named: null });
    let pressed = null;
    canvas.addEventListener("pointermove", event => { if (!event.buttons && event.pointerType === "mouse") this.point(event); });
    canvas.addEventListener("pointerleave", event => { if (event.pointerType === "mouse") this.name(null); });
    canvas.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", event => {
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 6) this.point(event);
    });
  }

  point(event) {
    const { canvas, tip } = this, box = canvas.getBoundingClientRect();
    const x = event.clientX - box.left, y = event.clientY - box.top;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * x / box.width - 1, 1 - 2 * y / box.height), this.stage.camera);
    const shown = this.car.parts.filter(one => one.group.visible);
    const hit = ray.intersectObjects(shown.flatMap(one => one.meshes))[0];
    const part = hit ? shown.find(one => one.meshes.includes(hit.object)) : null;
    this.name(part);
    if (!part) return;
    tip.style.left = `${Math.min(x + 14, canvas.clientWidth - tip.offsetWidth - 4)}px`;
    tip.style.top = `${Math.max(4, y - tip.offsetHeight - 6)}px`;
  }

  name(part) {
    if (part === this.named) return;
    this.named = part;
    this.tip.hidden = !part;
    this.tip.textContent = document.body.dataset.named = part ? part.part.name : "";
    this.car.light(part);
    this.stage.draw();
  }
}
