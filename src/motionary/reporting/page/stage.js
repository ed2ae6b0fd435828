// Bodies in three dimensions: bones in the colours of their sides, and what was not seen.

const UP = new THREE.Vector3(0, 1, 0);
const DASHES = 4;
const REST_MS = 500;

function sideColours() {
  return { l: cssColour("--left"), r: cssColour("--right"), "": cssColour("--trunk") };
}

function instanced(geometry, material, count) {
  const mesh = new THREE.InstancedMesh(geometry, material, Math.max(count, 1));
  mesh.instanceMatrix.setUsage(THREE.DynamicDrawUsage);
  mesh.frustumCulled = false;
  mesh.count = 0;
  return mesh;
}

// A scene with light; what is drawn in it is added by others.
function makeScene() {
  const scene = new THREE.Scene();
  const sun = new THREE.DirectionalLight(0xffffff, 1.7);
  sun.position.set(1.5, 4, 2.5);
  scene.add(new THREE.AmbientLight(0xffffff, 2.3), sun);
  return scene;
}

// The ground: a line each metre, a stronger one each five.
class Ground {
  constructor(scene, size = 30) {
    this.size = size;
    this.scene = scene;
    this.grids = [];
    this.height = 0;
    this.recolour();
  }

  recolour() {
    for (const grid of this.grids) {
      this.scene.remove(grid);
      grid.geometry.dispose();
      grid.material.dispose();
    }
    const make = (step, colour) => {
      const grid = new THREE.GridHelper(this.size, this.size / step, colour, colour);
      grid.step = step;
      this.scene.add(grid);
      return grid;
    };
    this.grids = [make(1, cssColour("--grid")), make(5, cssColour("--grid-strong"))];
    this.place(0, 0, this.height);
  }

  // Below a point, in steps of its lines: the ground does not move with who walks on it.
  place(x, z, height) {
    this.height = height;
    for (const grid of this.grids) {
      const lift = grid.step > 1 ? 0.001 : 0;
      grid.position.set(Math.round(x / grid.step) * grid.step, height + lift, Math.round(z / grid.step) * grid.step);
    }
  }
}

class Body {
  constructor(scene, recording) {
    this.recording = recording;
    this.n = recording.joints.length;
    const bones = recording.bones, never = new Set(recording.missing);
    this.never = recording.joints.map((name) => never.has(name));
    this.scale = recording.height / 1.7;
    const bone = new THREE.CylinderGeometry(1, 1, 1, 10), ball = new THREE.SphereGeometry(1, 14, 10);
    this.solid = new THREE.MeshLambertMaterial();
    this.pale = new THREE.MeshBasicMaterial({ color: cssColour("--unknown") });
    this.wire = new THREE.MeshBasicMaterial({ color: cssColour("--unknown"), wireframe: true });
    this.heldMaterial = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.55, depthWrite: false });
    this.failedMaterial = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.75, depthWrite: false });
    this.meshes = {
      bones: instanced(bone, this.solid, bones.length),
      joints: instanced(ball, this.solid, this.n + 1),
      dashes: instanced(bone, this.pale, bones.length * DASHES),
      hollow: instanced(new THREE.SphereGeometry(1, 8, 6), this.wire, this.n),
      held: instanced(ball, this.heldMaterial, this.n),
      failed: instanced(new THREE.OctahedronGeometry(1, 0), this.failedMaterial, this.n),
    };
    this.held = new Set();
    this.failed = new Set();
    this.group = Object.values(this.meshes);
    scene.add(...this.group);
    this.place = { turn: 0, x: 0, y: 0, z: 0, aside: 0 };
    this.recolour();
  }

  recolour() {
    const colours = sideColours();
    this.colours = Object.fromEntries(Object.entries(colours).map(([side, c]) => [side, new THREE.Color(c)]));
    this.pale.color.set(cssColour("--unknown"));
    this.wire.color.set(cssColour("--unknown"));
    this.heldMaterial.color.set(cssColour("--held"));
    this.failedMaterial.color.set(cssColour("--failed"));
  }

  mark(held, failed) {
    this.held = held;
    this.failed = failed;
  }

  // From now on in place: its first pose faces us, on the ground, so far to the right.
  face(pose, aside = 0) {
    if (this.faced) return;
    const middle = this.centre(pose, new THREE.Vector3());
    this.place = { turn: -facingOf(this, pose), x: middle.x, y: this.recording.floor, z: middle.z, aside };
    this.faced = true;
  }

  point(pose, joint, out) {
    const x = pose.positions[joint * 3] - this.place.x;
    const z = pose.positions[joint * 3 + 2] - this.place.z;
    const cos = Math.cos(this.place.turn), sin = Math.sin(this.place.turn);
    return out.set(cos * x + sin * z + this.place.aside, pose.positions[joint * 3 + 1] - this.place.y, cos * z - sin * x);
  }

  show(pose) {
    const matrix = new THREE.Matrix4(), turn = new THREE.Quaternion();
    const a = new THREE.Vector3(), b = new THREE.Vector3(), middle = new THREE.Vector3(), size = new THREE.Vector3();
    const sides = this.recording.sides, s = this.scale;
    for (const mesh of this.group) mesh.count = 0;
    const put = (mesh, place, rotation, scale, colour) => {
      matrix.compose(place, rotation, scale);
      if (colour) mesh.setColorAt(mesh.count, colour);
      mesh.setMatrixAt(mesh.count++, matrix);
    };
    const rod = (mesh, from, to, width, colour) => {
      middle.addVectors(from, to).multiplyScalar(0.5);
      size.subVectors(to, from);
      const length = size.length();
      if (length < 1e-5) return;
      turn.setFromUnitVectors(UP, size.divideScalar(length));
      put(mesh, middle, turn, size.set(width, length, width), colour);
    };
    const from = new THREE.Vector3(), to = new THREE.Vector3();
    for (const [joint, parent] of this.recording.bones) {
      this.point(pose, parent, a);
      this.point(pose, joint, b);
      if (pose.known[joint] && pose.known[parent]) {
        rod(this.meshes.bones, a, b, 0.022 * s, this.colours[sides[joint]]);
        continue;
      }
      for (let i = 0; i < DASHES; i++) {
        from.lerpVectors(a, b, (i + 0.2) / DASHES);
        to.lerpVectors(a, b, (i + 0.8) / DASHES);
        rod(this.meshes.dashes, from, to, 0.011 * s, null);
      }
    }
    turn.identity();
    const alone = this.recording.bones.length === 0;
    for (let joint = 0; joint < this.n; joint++) {
      if (this.never[joint]) continue;
      this.point(pose, joint, a);
      const width = (alone ? 0.02 : 0.03) * s;
      if (pose.known[joint]) put(this.meshes.joints, a, turn, size.setScalar(width), this.colours[sides[joint]]);
      else put(this.meshes.hollow, a, turn, size.setScalar(1.5 * width), null);
      if (this.failed.has(joint)) put(this.meshes.failed, a, turn, size.setScalar(0.1 * s), null);
      else if (this.held.has(joint)) put(this.meshes.held, a, turn, size.setScalar(0.05 * s), null);
    }
    this.showHead(pose, put, a, b, turn, size);
    for (const mesh of this.group) {
      mesh.instanceMatrix.needsUpdate = true;
      if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
    }
  }

  showHead(pose, put, a, b, turn, size) {
    const head = this.recording.joints.indexOf("head"), top = this.recording.joints.indexOf("headtop");
    if (head < 0 || this.never[head] || !pose.known[head]) return;
    this.point(pose, head, a);
    if (top >= 0 && !this.never[top] && pose.known[top]) a.lerp(this.point(pose, top, b), 0.5);
    put(this.meshes.joints, a, turn, size.setScalar(0.095 * this.scale), this.colours[""]);
  }

  // The middle of the body on the ground plan, and its height.
  centre(pose, out) {
    const root = this.recording.joints.indexOf("root");
    if (root >= 0 && !this.never[root]) return this.point(pose, root, out);
    const sum = new THREE.Vector3();
    let n = 0;
    for (let joint = 0; joint < this.n; joint++) {
      if (this.never[joint]) continue;
      sum.add(this.point(pose, joint, out));
      n++;
    }
    return out.copy(sum.divideScalar(Math.max(n, 1)));
  }
}

// Whether pictures are drawn without a graphics card; null where they are not drawn at all.
function drawsWithoutCard() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return null;
  let name = gl.getParameter(gl.RENDERER);
  const told = /webkit/i.test(name) && gl.getExtension("WEBGL_debug_renderer_info");
  if (told) name = gl.getParameter(told.UNMASKED_RENDERER_WEBGL);
  // Browsers keep a few contexts only, and a notebook may have many pages.
  const release = gl.getExtension("WEBGL_lose_context");
  if (release) release.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

// Draws when something changed. Without a graphics card smooth edges take most of a frame's
// time: there they come once all is still.
class Drawing {
  static on(canvas) {
    const withoutCard = drawsWithoutCard();
    if (withoutCard === null) return null;
    try {
      return new Drawing(canvas, withoutCard);
    } catch {
      return null;
    }
  }

  constructor(canvas, withoutCard) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !withoutCard, alpha: true });
    this.withoutCard = withoutCard;
    this.refine(!withoutCard);
    canvas.addEventListener("webglcontextrestored", () => (this.isBack = true));
    // Browsers keep some 16 contexts: of a notebook with more pages those in sight have one.
    if (self !== top) new IntersectionObserver((entries) => this.hold(entries.at(-1).isIntersecting)).observe(canvas);
  }

  hold(isSeen) {
    const isLost = this.renderer.getContext().isContextLost();
    if (isSeen && isLost) this.renderer.forceContextRestore();
    else if (!isSeen && !isLost) this.renderer.forceContextLoss();
  }

  refine(isFine) {
    if (this.isFine === isFine) return;
    this.isFine = isFine;
    this.renderer.setPixelRatio(this.withoutCard ? (isFine ? 2 : 1) : Math.min(devicePixelRatio, 2));
  }

  // Whether to draw now, after a change or because nothing changed for a while.
  isDue(moved) {
    const now = performance.now(), changed = moved || this.isBack;
    this.isBack = false;
    if (changed) this.changed = now;
    else if (this.isFine || now - this.changed < REST_MS) return false;
    this.refine(!changed || !this.withoutCard);
    return true;
  }
}
