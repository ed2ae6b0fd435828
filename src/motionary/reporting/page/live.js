// A page that grows while a motion goes on: poses and events come by websocket.

const KEPT_FRAMES = 18000;
const KEPT_LABELS = 5000;
const MOST_MODELS = 64;
const WINDOW_S = 30;
const AGAIN_MS = 2000;
const WAITING = { live: true, name: "waiting for poses", rate_hz: 30, n_frames: 1, first_frame: 0, duration_s: 0, lanes: [], joints: [], sides: [], bones: [], missing: [] };

// The last minutes of one recording, a pose after the other.
class LiveClip {
  constructor(recording) {
    this.recording = recording;
    this.nJoints = recording.joints.length;
    this.times = [];
    this.poses = [];
  }

  // Rows of [x, y, z] in the page's unit, or null where a joint is not seen.
  add(seconds, rows) {
    const before = this.poses.at(-1);
    const positions = new Float32Array(this.nJoints * 3), known = new Uint8Array(this.nJoints);
    rows.forEach((row, joint) => {
      known[joint] = row ? 1 : 0;
      for (let axis = 0; axis < 3; axis++) {
        const at = joint * 3 + axis;
        positions[at] = row ? row[axis] * content.unit_m : before ? before.positions[at] : 0;
      }
    });
    this.times.push(seconds);
    this.poses.push({ positions, known });
    // Now and then many at once: an array is not moved for each.
    if (this.poses.length > 1.2 * KEPT_FRAMES) {
      this.times = this.times.slice(-KEPT_FRAMES);
      this.poses = this.poses.slice(-KEPT_FRAMES);
    }
  }

  at(seconds) {
    return this.poses[Math.max(lastUpTo(this.times, seconds + 1e-6), 0)] || null;
  }
}

class LivePlayer extends Player {
  constructor(host) {
    content.recordings = [WAITING];
    super(host);
    this.isLive = true;
    this.connect();
  }

  build(host) {
    super.build(host);
    this.choice = h("select", { "aria-label": "Recording", onchange: () => this.open(Number(this.choice.value)) });
    host.querySelector("h1").replaceChildren(this.choice);
    this.liveButton = button("live", "Show what happens now", () => this.goLive(), { class: "live", "aria-pressed": "true" });
    host.querySelector(".transport").prepend(this.liveButton);
    this.state = h("span", { class: "soft", role: "status" }, "connecting");
    this.facts.after(this.state);
    this.listModels();
  }

  // -- the connection ------------------------------------------------------------------------

  connect() {
    const socket = new WebSocket(content.live);
    socket.onopen = () => (this.state.textContent = "connected");
    socket.onmessage = (message) => this.take(JSON.parse(message.data));
    socket.onclose = () => {
      this.state.textContent = "not connected: is motionary live still running?";
      setTimeout(() => this.connect(), AGAIN_MS);
    };
  }

  take(message) {
    if (Array.isArray(message)) message.forEach((one) => this.take(one));
    else if (message.live !== undefined) this.begin(message.live);
    else if (message.recording) this.meet(message.recording);
    else if (message.pose) this.move(...message.pose);
    else if (message.event) this.tell(message.event);
  }

  // Another run of the program has other recordings of the same numbers.
  begin(run) {
    if (this.run !== undefined && this.run !== run) {
      this.models = [makeModel(WAITING)];
      this.listModels();
      this.open(0);
    }
    this.run = run;
  }

  find(number) {
    return this.models.find((model) => model.number === number);
  }

  meet(recording) {
    const known = this.find(recording.number);
    if (known) {
      // More of the body is seen than before.
      Object.assign(known, recording);
      Object.assign(known.clips[0].recording, recording);
      if (known === this.model) this.view.setBodies([known.clips[0].recording]);
      return;
    }
    const lane = (name, isFaint) => ({ name, isFaint, truth: false, labels: [], unassessed: [], nearest: "" });
    const model = makeModel({ ...WAITING, ...recording, lanes: [lane("final", false), lane("foreseen", true)] });
    for (const own of model.lanes) own.whys = [];
    this.models = this.models.filter((one) => one.number !== undefined).slice(1 - MOST_MODELS);
    const isNext = !this.models.includes(this.model) || (this.isLive && this.model.name === model.name);
    this.models.push(model);
    this.listModels();
    this.open(isNext ? this.models.length - 1 : this.models.indexOf(this.model));
  }

  move(number, seconds, rows) {
    const model = this.find(number);
    if (!model) return;
    const [clip] = model.clips;
    clip.add(seconds, rows);
    this.lengthen(model, seconds);
    if (model !== this.model) return;
    if (this.isLive) {
      super.seek(seconds);
      this.follow();
    }
  }

  lengthen(model, seconds) {
    model.duration_s = Math.max(model.duration_s, seconds);
    model.n_frames = model.clips[0].recording.n_frames = Math.round(model.duration_s * model.rate_hz) + 1;
    if (model === this.model) this.measure();
  }

  // The axis is as long as the window from the beginning on, so that labels keep their size.
  measure() {
    const { model, timeline } = this;
    timeline.length = Math.max(model.duration_s, WINDOW_S);
    timeline.dirty = true;
    const at = Math.floor(model.duration_s);
    if (this.measured_s === at) return;
    this.measured_s = at;
    timeline.canvas.setAttribute("aria-valuemax", timeline.length.toFixed(2));
    this.facts.textContent = model.number === undefined ? "" : `${formatTime(at, 0)} ${at >= 60 ? "min" : "s"}, ${Number(model.rate_hz.toFixed(2))} Hz`;
  }

  follow() {
    const { timeline } = this, span = timeline.stop - timeline.start;
    if (this.time > timeline.stop || this.time < timeline.start) timeline.setRange(this.time - span, this.time);
  }

  // -- labels --------------------------------------------------------------------------------

  tell(event) {
    const model = this.find(event.recording);
    if (!model) return;
    const [final, foreseen] = model.lanes.filter((lane) => !lane.editable);
    foreseen.labels = foreseen.labels.filter((label) => label.id !== event.id);
    if (event.event === "unassessed") final.unassessed.push([event.start_s, event.end_s]);
    else if (event.event === "final") {
      if (!final.labels.some((label) => label.id === event.id)) this.put(final, event);
    } else if (event.event !== "withdrawn") this.put(foreseen, event);
    this.lengthen(model, event.event === "final" ? event.end_s : 0);
    if (model === this.model) this.relabelled = true;
  }

  put(lane, event) {
    const lines = [event.event === "final" ? "Final." : "Foreseen: it stands if nothing more comes."];
    if (event.probability !== null) lines.push(`Right with a probability of ${event.probability.toFixed(2)}.`);
    if (event.why.length) lines.push(`What tells most: ${event.why.join(", ")}.`);
    const name = event.side ? `${event.label} (${event.side})` : event.label;
    lane.labels.push({ id: event.id, name, start: event.start_s, end: event.end_s, cost: null, score: event.score, known: null, why: event.id, level: 0 });
    lane.labels.sort((a, b) => a.start - b.start || a.end - b.end);
    lane.whys[event.id] = { lines, held: [], failed: [], unknown: [], gains: [] };
    if (lane.labels.length > KEPT_LABELS) delete lane.whys[lane.labels.shift().id];
  }

  // -- what is shown -------------------------------------------------------------------------

  listModels() {
    this.choice.replaceChildren(...this.models.map((model, i) => h("option", { value: i, selected: model === this.model }, model.name)));
  }

  open(index) {
    super.open(index);
    this.why.clear("Choose a label on the time axis or in the list.");
    if (this.choice) this.choice.value = String(index);
    this.measured_s = null;
    this.measure();
    this.timeline.setRange(this.length - WINDOW_S, Math.max(this.length, WINDOW_S));
    this.seek(this.length);
  }

  // At the end one sees what happens now.
  seek(seconds) {
    super.seek(seconds);
    this.isLive = this.time >= this.length - 0.1;
    if (this.liveButton) this.liveButton.setAttribute("aria-pressed", String(this.isLive));
    if (this.isLive) this.follow();
  }

  goLive() {
    if (this.playing) this.toggle();
    this.setLoops(false);
    this.seek(this.length);
  }

  draw() {
    if (this.relabelled) {
      this.relabelled = false;
      this.timeline.arrange();
      this.labels.list();
    }
    super.draw();
  }
}
