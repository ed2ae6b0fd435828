// Many clips side by side, kept in step by their matches; one renderer draws those in sight.

const HOLD_S = 0.4;
const GALLERY_KEYS = [["space", "play or pause"], ["← →", "one frame"], ["l", "loop on or off"], [", .", "slower, faster"]];

// A clip among others: its own seconds at a phase, and its own camera, turned like all.
class Cell {
  constructor(gallery, content, index) {
    this.content = content;
    this.clip = new Clip(content.clip);
    this.phases = content.warp.map(([phase]) => phase);
    this.view = h("div", { class: "cell-view", role: "img", "aria-label": `${content.title}; drag to turn all bodies` });
    this.readout = h("span", { class: "soft cell-time" });
    this.element = h("li", { class: content.query ? "cell query" : "cell" },
      h("h3", { title: shown(content.title) }, content.title),
      h("p", { class: "soft" }, content.detail),
      this.view,
      h("p", { class: "cell-line" }, this.readout, gallery.judge(content, index)),
      content.notes.length ? h("ul", { class: "soft notes" }, content.notes.map((text) => h("li", {}, text))) : null);
    this.target = new THREE.Vector3();
  }

  build() {
    this.scene = makeScene();
    this.ground = new Ground(this.scene, 10);
    this.body = new Body(this.scene, this.content.clip);
  }

  // Whether the pose of a phase is ready to be drawn.
  show(phase, onready) {
    const seconds = between(this.content.warp, this.phases, phase), pose = this.clip.at(seconds, onready);
    if (!pose) return false;
    if (!this.body) this.build();
    this.body.face(pose);
    this.body.show(pose);
    this.body.centre(pose, this.target);
    this.ground.place(this.target.x, this.target.z, 0);
    this.readout.textContent = `${formatTime(seconds + this.content.start_s)} s · frame ${frameAt(this.content.clip, seconds)}`;
    return true;
  }
}

class Gallery extends Clock {
  constructor(host) {
    super();
    this.turn = 0.6;
    this.tilt = 0.22;
    this.grid = h("ol", { class: "grid" });
    this.above = h("section", { class: "above" });
    this.canvas = h("canvas", { class: "grid-canvas", "aria-hidden": "true" });
    this.scroller = h("main", { class: "scroller" }, this.canvas, this.above, this.grid);
    const names = content.galleries.map((one) => one.name);
    host.append(this.header("Class", names, GALLERY_KEYS, "Drag a body to turn all of them."), this.transport(), this.scroller);
    this.bar = h("footer", { class: "judging", hidden: true });
    host.append(this.bar);
    this.scroller.addEventListener("scroll", () => (this.dirty = true));
    new ResizeObserver(() => (this.dirty = true)).observe(this.scroller);
    this.grid.addEventListener("pointerdown", (event) => this.grab(event));
    this.open(0);
    this.setLoops(true);
    this.start();
    this.toggle();
    onceSeen(this.scroller, () => this.begin());
  }

  begin() {
    this.drawing = Drawing.on(this.canvas);
    if (!this.drawing) this.scroller.prepend(h("p", { class: "above", role: "alert" }, "This browser draws no three dimensions (WebGL is off)."));
    else this.camera = new THREE.PerspectiveCamera(34, 1, 0.05, 100);
    this.dirty = true;
  }

  get length() {
    return this.gallery.duration_s;
  }

  get hz() {
    return 30;
  }

  // At the end all stand still for a moment, to be compared.
  get span() {
    return [0, this.length + HOLD_S * this.speed];
  }

  transport() {
    this.slider = h("input", { type: "range", min: 0, max: 1000, value: 0, "aria-label": "Moment", oninput: () => {
      if (this.playing) this.toggle();
      this.seek((this.slider.value / 1000) * this.length);
    } });
    return h("div", { class: "transport", role: "toolbar", "aria-label": "Playing" },
      button("◁", "One frame back", () => this.step(-1)),
      this.playButton,
      button("▷", "One frame on", () => this.step(1)),
      this.loopButton, this.speedChoice, this.slider);
  }

  open(index) {
    this.gallery = content.galleries[index];
    const { gallery } = this;
    // Ranks that were given before and are out of sight still count.
    const given = (kind) => (gallery.judging ? gallery.judging[kind].map((rank) => [rank, kind]) : []);
    this.judged = new Map([...given("relevant"), ...given("irrelevant")]);
    this.facts.textContent = shown(gallery.facts.join("; "));
    this.cells = gallery.cells.map((cell, i) => new Cell(this, cell, i));
    this.heights = Math.max(...gallery.cells.map((cell) => cell.clip.reach), 0.5);
    this.grid.replaceChildren(...this.cells.map((cell) => cell.element));
    this.above.replaceChildren(...this.describe());
    this.tellJudged();
    this.scroller.scrollTop = 0;
    this.seek(0);
  }

  describe() {
    const { gallery } = this, parts = [];
    for (const [title, lines] of gallery.lists || []) {
      parts.push(h("section", {}, h("h2", {}, title), h("ul", {}, lines.map((line) => h("li", {}, line)))));
    }
    this.template = gallery.template ? new Template(gallery.template, (phase) => this.seek(phase * this.length)) : null;
    if (this.template) {
      parts.push(h("details", { class: "template", open: Boolean(gallery.lists), ontoggle: () => (this.dirty = true) },
        h("summary", {}, "What all have in common"), this.template.element));
    }
    return parts;
  }

  seek(seconds) {
    this.time = clamp(seconds, 0, this.span[1]);
    this.phase = clamp(this.time / Math.max(this.length, 1e-6), 0, 1);
    this.slider.value = Math.round(1000 * this.phase);
    if (this.template) this.template.setPhase(this.phase);
    this.dirty = true;
  }

  recolour() {
    for (const cell of this.cells) {
      if (!cell.body) continue;
      cell.body.recolour();
      cell.ground.recolour();
    }
    this.dirty = true;
  }

  // -- drawing -------------------------------------------------------------------------------

  draw() {
    if (!this.drawing || !this.drawing.isDue(this.dirty)) return;
    this.dirty = false;
    const { scroller } = this, { renderer } = this.drawing, width = scroller.clientWidth, height = scroller.clientHeight;
    if (this.size !== `${width} ${height}`) {
      this.size = `${width} ${height}`;
      renderer.setSize(width, height);
    }
    // The canvas goes along with what is scrolled, so that nothing lags behind.
    this.canvas.style.transform = `translateY(${scroller.scrollTop}px)`;
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    const frame = scroller.getBoundingClientRect();
    let n = 0;
    for (const cell of this.cells) {
      const box = cell.view.getBoundingClientRect();
      if (box.bottom < frame.top || box.top > frame.bottom || !box.width) continue;
      if (!cell.show(this.phase, () => (this.dirty = true))) continue;
      const left = box.left - frame.left, bottom = frame.bottom - box.bottom;
      renderer.setViewport(left, bottom, box.width, box.height);
      renderer.setScissor(left, bottom, box.width, box.height);
      this.look(cell.target, box.width / box.height);
      renderer.render(cell.scene, this.camera);
      n++;
    }
    // Some browsers show a canvas on which nothing was ever drawn in black.
    this.canvas.hidden = !n;
  }

  look(target, aspect) {
    const away = 1.98 * this.heights * Math.max(1, 0.75 / aspect), flat = away * Math.cos(this.tilt);
    const { camera } = this, middle = 0.5 * this.heights;
    camera.aspect = aspect;
    camera.updateProjectionMatrix();
    camera.position.set(target.x + flat * Math.sin(this.turn), middle + away * Math.sin(this.tilt), target.z + flat * Math.cos(this.turn));
    camera.lookAt(target.x, middle, target.z);
  }

  grab(event) {
    if (!event.target.closest(".cell-view")) return;
    const { turn, tilt } = this, x = event.clientX, y = event.clientY;
    const move = (now) => {
      this.turn = turn - (now.clientX - x) * 0.01;
      this.tilt = clamp(tilt + (now.clientY - y) * 0.006, -0.1, 1.4);
      this.dirty = true;
    };
    const end = new AbortController();
    addEventListener("pointermove", move, { signal: end.signal });
    for (const name of ["pointerup", "pointercancel"]) addEventListener(name, () => end.abort(), { signal: end.signal });
  }

  // -- relevance feedback --------------------------------------------------------------------

  judge(cell, index) {
    const { judging, cells } = this.gallery;
    if (!judging || cell.query) return null;
    const rank = judging.ranks[index - cells.filter((one, i) => one.query && i < index).length];
    if (!rank) return h("span", { class: "soft", title: "The search without feedback does not have this hit" }, "new");
    const kinds = [["relevant", "yes", `Hit ${rank} is right`], ["irrelevant", "no", `Hit ${rank} is wrong`]];
    const buttons = kinds.map(([kind, text, label]) => button(text, label, () => {
      if (this.judged.get(rank) === kind) this.judged.delete(rank);
      else this.judged.set(rank, kind);
      mark();
      this.tellJudged();
    }, { class: kind }));
    const mark = () => buttons.forEach((one, i) => one.setAttribute("aria-pressed", String(this.judged.get(rank) === kinds[i][0])));
    mark();
    return h("span", { class: "yes-no" }, buttons);
  }

  tellJudged() {
    const { judging } = this.gallery;
    this.bar.hidden = !judging;
    if (!judging) return;
    const parts = [judging.command];
    for (const kind of ["relevant", "irrelevant"]) {
      const ranks = [...this.judged].filter(([, said]) => said === kind).map(([rank]) => rank).sort((a, b) => a - b);
      if (ranks.length) parts.push(`--${kind} ${ranks.join(",")}`);
    }
    const command = parts.join(" "), said = h("span", { class: "soft", role: "status" });
    this.bar.replaceChildren(
      button("Copy command", "Copy the command that searches again with what you said", async () => {
        said.textContent = (await copyText(command)) ? "copied" : "mark the text and copy it";
      }, { class: "main", disabled: parts.length === 1 }),
      h("code", {}, parts.length > 1 ? command : "Say yes or no to hits: the next search learns from it."), said);
  }
}

// What a template asks for, a row each feature: white where it must hold, black where not.
class Template {
  constructor(asked, seek) {
    const features = new Map();
    for (const row of asked) features.set(row[0], [...(features.get(row[0]) || []), row]);
    this.heads = [];
    // What changes comes first.
    const rows = [...features].sort(([, one], [, other]) => (one.length === 1) - (other.length === 1));
    const lines = rows.map(([feature, parts]) => {
      const head = h("span", { class: "template-head" });
      this.heads.push(head);
      const { yes, no } = content.features[feature];
      const bars = parts.map(([, holds, start, stop]) => {
        const bar = h("button", { type: "button", class: holds ? "bar-yes" : "bar-no", title: holds ? yes : no, "aria-label": holds ? yes : no, onclick: () => seek(start) });
        bar.style.left = `${100 * start}%`;
        bar.style.width = `${100 * (stop - start)}%`;
        return bar;
      });
      return h("li", {}, h("span", { class: "template-name", title: yes }, yes), h("span", { class: "template-bars" }, bars, head));
    });
    this.element = h("div", {},
      h("ul", { class: "template-rows" }, lines),
      h("p", { class: "soft" }, h("span", { class: "swatch bar-yes" }), " must hold ", h("span", { class: "swatch bar-no" }), " must not ", h("span", { class: "swatch bar-free" }), " free"));
  }

  setPhase(phase) {
    for (const head of this.heads) head.style.left = `${100 * phase}%`;
  }
}
