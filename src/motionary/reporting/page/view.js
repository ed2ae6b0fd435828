// The view of a player: one or two bodies on the ground, a camera that a person turns.

class View {
  constructor(host) {
    this.host = host;
    this.canvas = h("canvas", { class: "view-canvas", tabindex: "0", role: "img", "aria-label": "The body in three dimensions; drag to turn, scroll to come nearer" });
    this.image = h("img", { class: "view-image", alt: "", hidden: true });
    host.append(this.image, this.canvas);
    this.eye = null;
    this.follow = true;
    this.recordings = [];
    this.bodies = [];
    this.names = [];
    this.dirty = true;
  }

  // What takes longest comes when the rest of the page is there to be seen.
  begin() {
    this.drawing = Drawing.on(this.canvas);
    if (!this.drawing) {
      this.host.append(h("p", { class: "view-problem", role: "alert" }, "This browser draws no three dimensions (WebGL is off); labels, features and reasons work without."));
      return;
    }
    this.scene = makeScene();
    this.ground = new Ground(this.scene);
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.05, 200);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.maxPolarAngle = Math.PI * 0.52;
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.target = new THREE.Vector3();
    new ResizeObserver(() => this.resize()).observe(this.host);
    this.setEye(this.eye);
    this.setBodies(this.recordings);
  }

  resize() {
    const width = this.host.clientWidth, height = this.host.clientHeight;
    if (!width || !height) return;
    this.drawing.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.eye) this.aim(width, height);
    this.dirty = true;
  }

  // Look as a calibrated camera does, its image behind the body; null looks freely again.
  setEye(eye) {
    this.eye = eye;
    this.image.hidden = !eye || !eye.images.length;
    this.image.dataset.name = "";
    if (!this.drawing) return;
    this.controls.enabled = !eye;
    this.ground.grids.forEach((grid) => (grid.visible = this.image.hidden));
    this.eyeCamera = eye ? new THREE.PerspectiveCamera() : null;
    this.resize();
  }

  // The whole image fits into the view; its pixels lie where the camera has them.
  aim(width, height) {
    const { place, axes, focal, centre, size } = this.eye, camera = this.eyeCamera, near = 0.05;
    const scale = Math.min(width / size[0], height / size[1]);
    const x = scale * (centre[0] - size[0] / 2), y = scale * (centre[1] - size[1] / 2);
    const across = near / (scale * focal[0]), up = near / (scale * focal[1]);
    camera.matrixAutoUpdate = false;
    camera.matrix.makeBasis(...axes.map((axis) => new THREE.Vector3(...axis))).setPosition(...place);
    camera.matrixWorldNeedsUpdate = true;
    camera.projectionMatrix.makePerspective(-(width / 2 + x) * across, (width / 2 - x) * across, (height / 2 + y) * up, -(height / 2 - y) * up, near, 200, camera.coordinateSystem);
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  }

  showImage(seconds) {
    if (!this.eye || !this.eye.images.length) return;
    const { images, images_hz } = this.eye;
    const name = images[clamp(Math.floor(seconds * images_hz), 0, images.length - 1)];
    if (this.image.dataset.name === name) return;
    this.image.dataset.name = name;
    this.image.src = `data:image/jpeg;base64,${document.getElementById(name).textContent}`;
  }

  // Other bodies in place of those shown; the camera looks from their front right.
  setBodies(recordings) {
    this.recordings = recordings;
    if (!this.drawing) return;
    for (const body of this.bodies) this.scene.remove(...body.group);
    this.bodies = recordings.map((recording) => new Body(this.scene, recording));
    this.names.forEach((name) => name.remove());
    this.names = recordings.length > 1 ? recordings.map((one) => h("div", { class: "body-name" }, h("b", {}, one.short), h("br"), h("span", {}))) : [];
    this.host.append(...this.names);
    this.framed = false;
  }

  // Two bodies stand side by side and face us; one stays where it is.
  frame(poses) {
    const [body] = this.bodies, [pose] = poses, n = this.bodies.length;
    // Who squats most of the time stands up, too; who climbs is not to become small.
    const height = Math.max(...this.bodies.map(({ recording }) => clamp(recording.reach, recording.height, 1.6 * recording.height)));
    if (n > 1) this.bodies.forEach((one, i) => one.face(poses[i], (i - (n - 1) / 2) * 1.05 * height));
    const floor = body.recording.floor - body.place.y;
    body.centre(pose, this.target);
    if (n > 1) this.target.x = 0;
    // Names stand above two bodies.
    this.target.y = floor + (n > 1 ? 0.57 : 0.5) * height;
    const away = (n > 1 ? 2.3 : 1.85) * height * Math.max(1, (0.8 * n) / Math.min(this.camera.aspect, n));
    const facing = n > 1 ? -0.3 : facingOf(body, pose);
    this.controls.target.copy(this.target);
    this.camera.position.set(
      this.target.x + away * Math.sin(facing + 0.6),
      this.target.y + 0.28 * height,
      this.target.z + away * Math.cos(facing + 0.6),
    );
    this.controls.update();
    this.ground.place(this.target.x, this.target.z, floor);
    this.framed = true;
  }

  show(poses) {
    if (!this.drawing || (!this.framed && !poses.every(Boolean))) return;
    if (!this.framed) this.frame(poses);
    const middle = new THREE.Vector3(), one = new THREE.Vector3();
    let n = 0;
    poses.forEach((pose, i) => {
      const body = this.bodies[i];
      if (!pose || !body) return;
      body.show(pose);
      body.middle = body.centre(pose, one).clone();
      middle.add(body.middle);
      n++;
    });
    if (n && this.follow) {
      middle.divideScalar(n);
      const dx = middle.x - this.controls.target.x, dz = middle.z - this.controls.target.z;
      this.controls.target.x += dx;
      this.controls.target.z += dz;
      this.camera.position.x += dx;
      this.camera.position.z += dz;
      this.controls.update();
      this.ground.place(middle.x, middle.z, this.ground.height);
    }
    this.dirty = true;
  }

  recolour() {
    if (!this.drawing) return;
    this.ground.recolour();
    for (const body of this.bodies) body.recolour();
    this.dirty = true;
  }

  draw() {
    if (!this.drawing || !this.drawing.isDue(this.dirty)) return;
    this.dirty = false;
    this.drawing.renderer.render(this.scene, this.eyeCamera || this.camera);
    this.names.forEach((name, i) => this.nameBody(name, this.bodies[i]));
  }

  // Times and frames of several bodies stand below their names.
  tell(readouts) {
    this.names.forEach((name, i) => (name.lastChild.textContent = readouts[i]));
  }

  // The name stands above its body's place on the screen.
  nameBody(name, body) {
    if (!body.middle) return;
    const at = body.middle.clone();
    at.y = this.ground.height + 1.12 * body.recording.reach;
    at.project(this.camera);
    const x = ((at.x + 1) / 2) * this.host.clientWidth, y = ((1 - at.y) / 2) * this.host.clientHeight;
    name.style.transform = `translate(${x.toFixed(0)}px, ${Math.max(y, 44).toFixed(0)}px) translate(-50%, -100%)`;
  }
}

// Direction that the hips face, about the vertical, radians; 0 is +z.
function facingOf(body, pose) {
  const at = (name) => body.recording.joints.indexOf(name);
  for (const [left, right] of [["lhip", "rhip"], ["lshoulder", "rshoulder"]]) {
    const l = at(left), r = at(right);
    if (l < 0 || r < 0 || body.never[l] || body.never[r]) continue;
    const x = pose.positions[l * 3] - pose.positions[r * 3];
    const z = pose.positions[l * 3 + 2] - pose.positions[r * 3 + 2];
    if (Math.hypot(x, z) > 1e-4) return Math.atan2(-z, x);
  }
  return 0;
}
