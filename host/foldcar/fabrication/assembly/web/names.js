// Names parts: under the pointer, by a tap, or chosen from a list by keyboard.

import * as THREE from "three";

export class Names {
  // controls: {canvas, tip, list}; lit: called when another part is named.
  constructor(stage, controls, lit) {
    Object.assign(this, { stage, controls, lit, car: null, named: null, sought: false });
    const { canvas, list } = controls;
    let pressed = null;
    canvas.addEventListener("pointermove", event => { if (!event.buttons && event.pointerType === "mouse") this.point(event); });
    canvas.addEventListener("pointerleave", event => { if (event.pointerType === "mouse") this.name(null); });
    canvas.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", event => {
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 6) this.point(event);
    });
    list.addEventListener("change", () => {
      const part = list.value === "" ? null : this.car.parts[Number(list.value)];
      this.name(part, part !== null);
      if (part) this.tipAt(part);
    });
  }

  use(car) {
    this.car = car;
    this.named = null;
    this.sought = false;
    this.controls.tip.hidden = true;
    const { list } = this.controls;
    list.replaceChildren(new Option("find a part …", ""));
    const names = car.parts.map((one, index) => [one.part.name, one.part.body, index]);
    const twice = name => names.filter(([other]) => other === name).length > 1;
    names.sort((a, b) => a[0].localeCompare(b[0], "en", { numeric: true }));
    for (const [name, body, index] of names) list.add(new Option(twice(name) ? `${name} (${body})` : name, index));
  }

  // Names the part that the list has under that name.
  find(name) {
    const { list } = this.controls, option = [...list.options].find(one => one.textContent === name);
    if (!option) return;
    list.value = option.value;
    list.dispatchEvent(new Event("change"));
  }

  point(event) {
    const box = this.controls.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.stage.camera);
    const shown = this.car.parts.filter(one => one.group.visible);
    const hit = ray.intersectObjects(shown.flatMap(one => one.meshes))[0];
    const part = hit ? shown.find(one => one.meshes.includes(hit.object)) : null;
    this.name(part);
    if (part) this.tip(part, event.clientX - box.left, event.clientY - box.top);
  }

  // sought: it may be inside, and is shown through film.
  name(part, sought = false) {
    if (!part) this.controls.tip.hidden = true;
    if (part === this.named && sought === this.sought) return;
    this.named = part;
    this.sought = sought;
    this.car.light(part);
    document.body.dataset.named = part ? part.part.name : "";
    this.lit();
  }

  tip(part, x, y) {
    const { tip, canvas } = this.controls;
    tip.textContent = part.part.name;
    tip.hidden = false;
    tip.style.left = `${Math.min(x + 14, canvas.clientWidth - tip.offsetWidth - 4)}px`;
    tip.style.top = `${Math.max(4, y - tip.offsetHeight - 6)}px`;
  }

  // Beside the middle of a part that was chosen by name; one that is not there yet is told of so.
  tipAt(part) {
    const middle = part.box.getCenter(new THREE.Vector3()).applyMatrix4(part.group.matrixWorld).project(this.stage.camera);
    const { canvas, tip } = this.controls;
    this.tip(part, (middle.x + 1) / 2 * canvas.clientWidth, (1 - middle.y) / 2 * canvas.clientHeight);
    if (!part.group.visible) tip.textContent = `${part.part.name}: not yet in. ${this.car.data.steps[part.first - 1]}`;
  }
}
