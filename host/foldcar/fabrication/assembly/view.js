// Draws a folding car: pieces lie flat beside each other, fold up, and go to their places.
//
// Reads window.foldcar (view_data.py). The slider's first part folds, the rest assembles. The address's #fold=0.5 sets the
// slider. For tests, document.body.dataset tells what is shown: state, fold, and the film's bounding box.
"use strict";
(function () {
  const data = window.foldcar;
  const FOLDED_AT = 0.6;
  // What lies on the inside of a wall stands off a little more than it does: lines must not show through the wall.
  const APART_MM = 1.0;
  const COLOURS = {
    film: [0xfbf5e6, 0xc3d3e4], tyre: [0x54585f, 0x3d4046], servo: [0x3d77b8, 0x3d77b8], board: [0x2f7d4f, 0x2f7d4f],
    battery: [0xd2a04a, 0xd2a04a], other: [0x9a9a9a, 0x9a9a9a],
  };
  const LINES = {cut: 0x2a2a2a, mountain: 0xc2272d, valley: 0x0b62a8};

  const canvas = document.getElementById("model");
  const renderer = new THREE.WebGLRenderer({canvas, antialias: true, preserveDrawingBuffer: true});
  renderer.setPixelRatio(window.devicePixelRatio);
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFSoftShadowMap;
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xf3f2ee);
  const camera = new THREE.PerspectiveCamera(32, 1, 10, 6000);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.HemisphereLight(0xffffff, 0xb8b2a4, 0.62));
  const sun = new THREE.DirectionalLight(0xffffff, 0.55);
  scene.add(sun, sun.target);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.bias = -0.002;

  const floor = new THREE.Mesh(new THREE.PlaneGeometry(6000, 6000), new THREE.ShadowMaterial({opacity: 0.16}));
  floor.position.z = data.ground - 0.6;
  floor.receiveShadow = true;
  scene.add(floor);

  function materials(name) {
    return COLOURS[name].map((color, back) => new THREE.MeshLambertMaterial({
      color, side: back ? THREE.BackSide : THREE.FrontSide, polygonOffset: true, polygonOffsetFactor: 0.3, polygonOffsetUnits: 1,
    }));
  }
  const painted = {};
  for (const name of Object.keys(COLOURS)) painted[name] = materials(name);
  const inked = {};
  for (const [name, color] of Object.entries(LINES)) inked[name] = new THREE.LineBasicMaterial({color});

  function matrix(rows) { return new THREE.Matrix4().set(...rows); }

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

  // Poses of all faces in the first one's frame, at a fraction of their folds.
  function facePoses(piece, fraction) {
    const poses = [];
    piece.faces.forEach((face, i) => {
      poses[i] = face.fold
        ? new THREE.Matrix4().multiplyMatrices(poses[face.fold.parent], across(face.fold, fraction * face.fold.angle))
        : new THREE.Matrix4();
    });
    return poses;
  }

  // One copy of a piece: buffers that are refilled whenever the fraction changes.
  class Film {
    constructor(placed) {
      this.piece = data.pieces[placed.piece];
      this.placed = placed;
      this.group = new THREE.Group();
      this.group.name = this.piece.name;
      const triangles = this.piece.faces.reduce((n, face) => n + face.triangles.length, 0);
      this.surface = new THREE.BufferGeometry();
      this.surface.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * triangles), 3));
      this.surface.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(3 * triangles), 3));
      for (const paint of painted[this.piece.material]) {
        const mesh = new THREE.Mesh(this.surface, paint);
        mesh.castShadow = true;
        mesh.frustumCulled = false;
        this.group.add(mesh);
      }
      this.segments = {cut: [], mountain: [], valley: []};
      this.piece.faces.forEach((face, f) => {
        let start = 0;
        face.rings.forEach((end, ring) => {
          for (let i = start; i < end; i++) {
            const next = i + 1 < end ? i + 1 : start;
            if (ring > 0 || !this.isFolded(f, i)) this.segments.cut.push([f, i, next]);
          }
          start = end;
        });
        if (face.fold && face.fold.drawn) {
          const n = face.rings[0], i = face.fold.edge;
          this.segments[face.fold.angle > 0 ? "valley" : "mountain"].push([f, i, (i + 1) % n]);
        }
      });
      this.lines = {};
      for (const kind of Object.keys(this.segments)) {
        const geometry = new THREE.BufferGeometry();
        const room = new Float32Array(6 * this.segments[kind].length);
        geometry.setAttribute("position", new THREE.BufferAttribute(room, 3));
        this.lines[kind] = new THREE.LineSegments(geometry, inked[kind]);
        this.lines[kind].frustumCulled = false;
        this.group.add(this.lines[kind]);
      }
      scene.add(this.group);
    }

    // Whether edge i of a face is one that it shares over a fold.
    isFolded(f, i) {
      const own = this.piece.faces[f].fold;
      if (own && own.edge === i) return true;
      const p = this.piece.faces[f].points, n = this.piece.faces[f].rings[0], j = (i + 1) % n;
      return this.piece.faces.some(other => other.fold && other.fold.parent === f &&
        Math.abs(other.fold.on[0] - p[2 * i]) < 1e-3 && Math.abs(other.fold.on[1] - p[2 * i + 1]) < 1e-3 &&
        Math.abs(other.fold.on[2] - p[2 * j]) < 1e-3 && Math.abs(other.fold.on[3] - p[2 * j + 1]) < 1e-3);
    }

    // Fills the buffers in the first face's frame; returns the middle of the piece over that frame's plane and its least height.
    fold(fraction) {
      const poses = facePoses(this.piece, fraction);
      const corners = this.piece.faces.map((face, f) => {
        const points = [];
        for (let i = 0; i < face.points.length; i += 2) {
          const lift = fraction * APART_MM * Math.sign(face.offset);
          points.push(new THREE.Vector3(face.points[i], face.points[i + 1], lift).applyMatrix4(poses[f]));
        }
        return points;
      });
      const position = this.surface.attributes.position, normal = this.surface.attributes.normal;
      let at = 0;
      this.piece.faces.forEach((face, f) => {
        const e = poses[f].elements;
        for (const i of face.triangles) {
          position.setXYZ(at, corners[f][i].x, corners[f][i].y, corners[f][i].z);
          normal.setXYZ(at, e[8], e[9], e[10]);
          at++;
        }
      });
      position.needsUpdate = normal.needsUpdate = true;
      for (const [kind, segments] of Object.entries(this.segments)) {
        const line = this.lines[kind].geometry.attributes.position;
        segments.forEach(([f, i, j], n) => {
          line.setXYZ(2 * n, corners[f][i].x, corners[f][i].y, corners[f][i].z);
          line.setXYZ(2 * n + 1, corners[f][j].x, corners[f][j].y, corners[f][j].z);
        });
        line.needsUpdate = true;
      }
      this.corners = corners;
      const box = new THREE.Box3().setFromPoints(corners.flat());
      return new THREE.Vector3((box.min.x + box.max.x) / 2, (box.min.y + box.max.y) / 2, Math.min(0, box.min.z));
    }
  }

  class Bought {
    constructor(mount) {
      this.placed = mount;
      this.group = new THREE.Group();
      this.group.name = `${mount.name} (${mount.part})`;
      const box = new THREE.BoxGeometry(...mount.size.map(size => Math.max(0.5, size - APART_MM)));
      const mesh = new THREE.Mesh(box, painted[mount.material][0]);
      mesh.castShadow = true;
      this.group.add(mesh, new THREE.LineSegments(new THREE.EdgesGeometry(box), inked.cut));
      scene.add(this.group);
    }

    fold() { return new THREE.Vector3(0, 0, -this.placed.size[2] / 2); }
  }

  const films = data.placed.map(placed => new Film(placed));
  const bought = data.mounts.map(mount => new Bought(mount));
  for (const part of [...films, ...bought]) part.middle = part.fold(0);
  const smooth = t => t * t * (3 - 2 * t);

  // The body's film first, then what is in it, then the wheels.
  function wave(part) {
    if (/^wheel/.test(part.placed.body)) return 2;
    return part instanceof Film ? 0 : 1;
  }

  // From lying on the floor to its place, by a share from 0 to 1.
  function place(part, middle, share) {
    const [x, y, turn] = part.placed.flat;
    const flat = new THREE.Matrix4().makeRotationZ(turn).setPosition(x, y, data.ground - middle.z);
    // What folds stays where it lay.
    flat.multiply(new THREE.Matrix4().makeTranslation(part.middle.x - middle.x, part.middle.y - middle.y, 0));
    const ends = [flat, matrix(part.placed.pose)].map(m => {
      const end = {p: new THREE.Vector3(), q: new THREE.Quaternion(), s: new THREE.Vector3()};
      m.decompose(end.p, end.q, end.s);
      return end;
    });
    part.group.position.lerpVectors(ends[0].p, ends[1].p, share);
    part.group.position.z += 60 * Math.sin(Math.PI * share);
    part.group.quaternion.copy(ends[0].q).slerp(ends[1].q, share);
    if (part.placed.layer) part.group.translateZ(share * APART_MM);
    part.group.updateMatrixWorld(true);
  }

  function filmBox() {
    const box = new THREE.Box3(), point = new THREE.Vector3();
    for (const film of films) for (const face of film.corners) for (const corner of face) {
      box.expandByPoint(point.copy(corner).applyMatrix4(film.group.matrixWorld));
    }
    return box;
  }

  let shown = -1;
  function show(t) {
    const fraction = Math.min(1, t / FOLDED_AT), done = Math.max(0, (t - FOLDED_AT) / (1 - FOLDED_AT));
    for (const part of [...films, ...bought]) {
      const share = Math.min(1, Math.max(0, 2 * done - 0.5 * wave(part)));
      place(part, part.fold(fraction), smooth(share));
    }
    shown = t;
    const box = filmBox();
    document.body.dataset.fold = t.toFixed(3);
    document.body.dataset.box = [...box.min.toArray(), ...box.max.toArray()].map(v => v.toFixed(3)).join(" ");
    for (const part of bought) box.expandByPoint(part.group.position);
    return box;
  }

  // The camera looks at the flat pieces as a whole, then at the car.
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.enableDamping = false;
  let held = false;
  controls.addEventListener("start", () => { held = true; });
  controls.addEventListener("change", draw);
  const views = [0, 1].map(t => show(t)).map(box => ({
    target: box.getCenter(new THREE.Vector3()), size: box.getSize(new THREE.Vector3()),
  }));
  const direction = new THREE.Vector3(1.0, 0.85, 0.95).normalize();
  function look(t) {
    const share = smooth(Math.max(0, (t - FOLDED_AT) / (1 - FOLDED_AT)));
    const target = views[0].target.clone().lerp(views[1].target, share);
    const size = views[0].size.clone().lerp(views[1].size, share);
    // Just far enough for every corner of the box.
    const right = new THREE.Vector3(0, 0, 1).cross(direction).normalize(), up = direction.clone().cross(right);
    const high = Math.tan(camera.fov * Math.PI / 360) * 0.94, wide = high * camera.aspect;
    let away = 0;
    for (const x of [-0.5, 0.5]) for (const y of [-0.5, 0.5]) for (const z of [-0.5, 0.5]) {
      const corner = new THREE.Vector3(x * size.x, y * size.y, z * size.z);
      const aside = Math.max(Math.abs(corner.dot(right)) / wide, Math.abs(corner.dot(up)) / high);
      away = Math.max(away, corner.dot(direction) + aside);
    }
    camera.position.copy(target).addScaledVector(direction, away);
    controls.target.copy(target);
    controls.update();
  }
  const reach = Math.max(views[0].size.x, views[0].size.y);
  sun.position.set(0.25 * reach, 0.45 * reach, reach);
  Object.assign(sun.shadow.camera, {left: -reach, right: reach, top: reach, bottom: -reach, near: 1, far: 3 * reach});

  function draw() {
    const width = canvas.clientWidth, height = canvas.clientHeight, size = renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) {
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
    }
    renderer.render(scene, camera);
  }

  const slider = document.getElementById("fold"), percent = document.getElementById("percent");
  function set(t) {
    slider.value = t;
    percent.textContent = t < FOLDED_AT ? `folded ${Math.round(100 * t / FOLDED_AT)} %` :
      `assembled ${Math.round(100 * (t - FOLDED_AT) / (1 - FOLDED_AT))} %`;
    show(t);
    if (!held) look(t);
    draw();
  }
  slider.addEventListener("input", () => set(Number(slider.value)));
  document.getElementById("parts").addEventListener("change", event => {
    for (const part of bought) part.group.visible = event.target.checked;
    draw();
  });
  document.getElementById("through").addEventListener("change", event => {
    for (const name of ["film", "tyre"]) for (const paint of painted[name]) {
      paint.transparent = event.target.checked;
      paint.opacity = event.target.checked ? 0.35 : 1;
      paint.depthWrite = !event.target.checked;
      paint.needsUpdate = true;
    }
    draw();
  });
  document.getElementById("reset").addEventListener("click", () => { held = false; set(Number(slider.value)); });
  document.getElementById("play").addEventListener("click", () => {
    const from = Number(slider.value), to = from < 0.5 ? 1 : 0, began = performance.now();
    (function step(now) {
      const share = Math.min(1, Math.max(0, (now - began) / 5000));
      set(from + (to - from) * share);
      if (share < 1) requestAnimationFrame(step);
    })(began);
  });

  const pointer = new THREE.Raycaster(), named = document.getElementById("named");
  canvas.addEventListener("pointermove", event => {
    if (event.buttons) return;
    const box = canvas.getBoundingClientRect();
    const at = new THREE.Vector2(2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height);
    pointer.setFromCamera(at, camera);
    for (const film of films) { film.surface.boundingSphere = null; }
    const groups = [...films, ...bought].map(part => part.group).filter(group => group.visible);
    const hit = pointer.intersectObjects(groups, true).find(found => found.object.isMesh);
    named.textContent = hit ? hit.object.parent.name : "";
  });

  function start() {
    const wanted = /fold=([0-9.]+)/.exec(window.location.hash);
    draw();
    set(wanted ? Math.min(1, Number(wanted[1])) : 1);
    document.body.dataset.state = "ready";
  }
  window.addEventListener("resize", () => set(shown));
  window.addEventListener("hashchange", start);
  start();
})();
