// The page of recordings: one time, and everything that shows it.

const KEYS = [
  ["space", "play or pause"], ["← →", "one frame"], ["shift ← →", "one second"],
  ["home end", "start, end"], ["n p", "next, previous label"], ["l", "loop on or off"],
  ["i o", "loop starts, ends here"], ["+ − 0", "zoom in, out, whole"], [", .", "slower, faster"],
  ["f", "follow the body"], ["delete", "delete the chosen label, while correcting"],
];

class Player extends Clock {
  constructor(host) {
    super();
    this.models = content.recordings.map(makeModel);
    this.build(host);
    addEventListener("beforeunload", (event) => this.unsaved && event.preventDefault());
    this.open(0);
    this.start();
    onceSeen(this.view.host, () => {
      this.view.begin();
      this.seek(this.time);
    });
  }

  get length() {
    return this.model.duration_s;
  }

  get hz() {
    return this.model.page_hz || 30;
  }

  get span() {
    return (this.loops && this.model.loop) || [0, this.length];
  }

  // -- the page ------------------------------------------------------------------------------

  build(host) {
    const view = h("section", { class: "view", "aria-label": "Body" });
    const lines = h("section", { class: "time", "aria-label": "Labels over time" });
    const why = h("div", { class: "why" }), list = h("div", { class: "labels" });
    const names = content.recordings.map((one) => (one.other ? `${one.short} and ${one.other.clip.short}` : one.name || "motion"));
    this.readout = h("div", { class: "readout", "aria-live": "off" });
    this.notice = h("div", { class: "notice soft" });
    this.hover = h("div", { class: "hover soft", role: "status" });
    this.legend = h("ul", { class: "legend", "aria-label": "Colours" });
    view.append(this.readout, this.notice, this.legend);
    host.append(
      this.header("Recording", names, KEYS, "On the time axis: drag to move the playhead, scroll or pinch to zoom, shift and scroll to move along."),
      h("main", { class: "work" },
        view,
        h("aside", { class: "side", "aria-label": "Labels and reasons" },
          h("section", { class: "panel" }, h("h2", {}, "Why"), why),
          h("section", { class: "panel" }, h("h2", {}, "Labels"), list))),
      this.transport(), this.hover, lines,
    );
    this.view = new View(view);
    this.timeline = new Timeline(lines, {
      seek: (s) => this.seek(s),
      select: (lane, label) => this.select(lane, label),
      hover: (text) => (this.hover.textContent = shown(text)),
      edit: (label, end, s) => this.labels.change(label, { [end]: s }),
      edited: () => this.labels.list(),
    });
    this.why = new Why(why, { seek: (s) => this.seek(s) });
    this.labels = new Labels(list, {
      select: (lane, label) => this.select(lane, label),
      changed: (lane, label) => this.changed(lane, label),
      startCorrecting: (lane) => this.startCorrecting(lane),
      save: (lane) => this.save(lane),
      time: () => this.time,
      loop: () => this.model.loop,
    });
  }

  transport() {
    this.loopButton.title = "Loop the chosen part";
    this.loopButton.setAttribute("aria-label", this.loopButton.title);
    this.followButton = button("follow", "Follow the body", () => this.setFollow(!this.view.follow), { "aria-pressed": "true" });
    this.eyeChoice = h("select", { "aria-label": "Seen from", onchange: () => this.setEye(Number(this.eyeChoice.value)) });
    this.range = h("output", { class: "range", "aria-label": "Chosen part" });
    this.copied = h("span", { class: "soft", role: "status" });
    this.curveChoice = h("details", { class: "curves" });
    return h("div", { class: "transport", role: "toolbar", "aria-label": "Playing" },
      button("|◁", "To the start", () => this.seek(0)),
      button("◁", "One frame back", () => this.step(-1)),
      this.playButton,
      button("▷", "One frame on", () => this.step(1)),
      this.loopButton, this.followButton, this.eyeChoice, this.speedChoice,
      button("[", "The chosen part starts here", () => this.markLoop(0)),
      button("]", "The chosen part ends here", () => this.markLoop(1)),
      h("span", { class: "group" }, this.range,
        button("copy s", "Copy the chosen part as seconds: --from --to", () => this.copy(false)),
        button("copy frames", "Copy the chosen part as frames: --from --to", () => this.copy(true)), this.copied),
      h("span", { class: "grow" }),
      this.curveChoice,
      button("−", "Zoom out", () => this.timeline.zoom(1 / 1.6)),
      button("+", "Zoom in", () => this.timeline.zoom(1.6)),
      button("↔", "The whole recording", () => this.timeline.setRange(0, this.model.duration_s)));
  }

  // -- recordings ----------------------------------------------------------------------------

  open(index) {
    this.model = this.models[index];
    const { model } = this;
    this.clips = model.clips;
    const rate = model.rate_hz ? `${Number(model.rate_hz.toFixed(2))} Hz, frames ${model.first_frame}–${model.first_frame + model.n_frames - 1}` : "";
    this.facts.textContent = `${formatTime(model.duration_s)} ${model.duration_s >= 60 ? "min" : "s"}, ${rate}`;
    this.view.setBodies(model.clips.filter((clip) => clip.nJoints).map((clip) => clip.recording));
    const views = model.views || [];
    this.eyeChoice.hidden = !views.length;
    this.eyeChoice.replaceChildren(...["any side", ...views.map((view) => view.name)].map((name, i) => h("option", { value: String(i - 1) }, name)));
    this.setEye(-1);
    this.setLoops(false);
    this.labels.setRecording(model);
    if (model.other) this.why.list("What differs most", model.other.summary);
    else this.why.clear(model.lanes.some((lane) => lane.labels.length) ? "Choose a label on the time axis or in the list." : nothingSays(model));
    this.legend.replaceChildren(...legend(model));
    this.timeline.time = 0;
    this.timeline.setRecording(model);
    this.listCurves();
    this.seek(0);
    loadRest(model).then(() => {
      if (model === this.model) this.timeline.arrange();
    });
  }

  listCurves() {
    const { model } = this;
    this.curveChoice.hidden = !model.curves && !model.strip;
    const box = (text, checked, onchange) =>
      h("label", {}, h("input", { type: "checkbox", checked, onchange: (event) => {
        onchange(event.target.checked);
        this.timeline.arrange();
      } }), " ", text);
    const classes = model.curves ? model.curves.classes : [];
    this.curveChoice.replaceChildren(
      h("summary", {}, "Show"),
      h("div", { class: "menu" },
        model.strip ? box("features", model.showsFeatures, (on) => (model.showsFeatures = on)) : null,
        classes.length ? h("p", { class: "soft" }, model.curves.kind === "score" ? "score of" : "cost of") : null,
        classes.map((one, i) => box(one.name, model.chosenCurves.includes(i), (on) => {
          model.chosenCurves = classes.map((_, k) => k).filter((k) => (k === i ? on : model.chosenCurves.includes(k)));
        }))));
  }

  recolour() {
    this.view.recolour();
    this.timeline.dirty = true;
    this.seek(this.time);
  }

  // -- time ----------------------------------------------------------------------------------

  draw() {
    if (this.moved) this.show();
    this.timeline.draw();
    this.view.draw();
  }

  // Several in one frame are shown once.
  seek(seconds) {
    this.time = clamp(seconds, 0, this.length);
    this.moved = true;
  }

  show() {
    const { model } = this;
    this.moved = false;
    const times = [this.time, model.other ? between(model.other.warp, model.warpPlaces, this.time) : 0];
    const poses = this.clips.map((clip, i) => clip.nJoints ? clip.at(times[i], () => this.seek(this.time)) : null);
    const { held, failed } = this.why.at(this.time);
    this.view.bodies.forEach((body) => body.mark(held, failed));
    this.view.show(poses);
    this.view.showImage(this.time);
    this.timeline.setTime(this.time, this.playing);
    const readouts = this.clips.map((clip, i) => `${formatTime(times[i])} s  ·  frame ${frameAt(clip.recording, times[i])}`);
    this.readout.textContent = readouts[0];
    this.view.tell(readouts);
    this.timeline.canvas.setAttribute("aria-valuetext", this.readout.textContent);
    this.tellUnseen(poses[0]);
  }

  tellUnseen(pose) {
    const { model } = this;
    if (!pose) return;
    const unseen = model.joints.filter((name, i) => !pose.known[i] && !model.missing.includes(name));
    const parts = [];
    if (unseen.length) parts.push(`not seen now: ${unseen.join(", ")}`);
    if (model.missing.length) parts.push(`never seen: ${model.missing.join(", ")}`);
    const text = parts.join("; ");
    if (this.told !== text) this.notice.textContent = shown((this.told = text));
  }

  setLoops(on) {
    super.setLoops(on);
    this.showRange();
  }

  setFollow(on) {
    this.view.follow = on;
    this.followButton.setAttribute("aria-pressed", String(on));
  }

  setEye(index) {
    this.view.setEye(index < 0 ? null : this.model.views[index]);
    this.seek(this.time);
  }

  markLoop(end) {
    const loop = this.model.loop ? [...this.model.loop] : [0, this.model.duration_s];
    loop[end] = this.time;
    if (loop[0] > loop[1]) loop[1 - end] = this.time;
    this.model.loop = loop;
    this.setLoops(true);
  }

  showRange() {
    const { loop } = this.model;
    this.range.textContent = loop ? `${formatTime(loop[0])}–${formatTime(loop[1])} s` : "";
    this.timeline.dirty = true;
  }

  async copy(asFrames) {
    const { model } = this;
    const [start, stop] = model.loop || [this.time, model.duration_s];
    const text = asFrames
      ? `--from ${frameAt(model, start)}f --to ${lastFrameBefore(model, Math.max(stop, start + 1e-3))}f`
      : `--from ${start.toFixed(3)} --to ${stop.toFixed(3)}`;
    this.copied.textContent = (await copyText(text)) ? `copied: ${text}` : text;
  }

  // -- labels --------------------------------------------------------------------------------

  async select(lane, label) {
    const { model } = this;
    model.selected = label;
    model.loop = [label.start, label.end];
    this.setLoops(true);
    this.labels.reveal(lane, label);
    if (label.start < this.timeline.start || label.end > this.timeline.stop) {
      const span = Math.max(this.timeline.stop - this.timeline.start, 1.6 * (label.end - label.start));
      const middle = (label.start + label.end) / 2;
      this.timeline.setRange(middle - span / 2, middle + span / 2);
    }
    if (label.why !== null && !lane.whys) lane.whys = await unpackJson(lane.why);
    if (model.selected !== label) return;
    this.why.show(label, model, label.why === null ? null : lane.whys[label.why]);
    this.seek(label.start);
    if (!this.playing) this.toggle();
  }

  next(by) {
    const { lane } = this.labels;
    if (!lane || !lane.labels.length) return;
    const at = lane.labels.indexOf(this.model.selected);
    let index = at + by;
    if (at < 0) index = by > 0 ? lane.labels.findIndex((label) => label.start >= this.time) : lastUpTo(lane.labels.map((l) => l.start), this.time - 1e-3);
    const label = lane.labels[clamp(index, 0, lane.labels.length - 1)];
    if (label) this.select(lane, label);
  }

  // A copy of a lane in every recording that has it: what was found stays beside what is made.
  startCorrecting(lane) {
    const name = lane ? `${lane.name}, corrected` : "labels";
    for (const model of this.models) {
      const source = lane ? model.lanes.find((one) => one.name === lane.name) : { labels: [] };
      if (model.lanes.some((one) => one.name === name) || !source) continue;
      const copy = { name, editable: true, truth: false, unassessed: [], nearest: "", why: source.why, whys: source.whys, labels: source.labels.map((label) => ({ ...label })) };
      model.lanes.splice(model.lanes.indexOf(source) + 1, 0, copy);
    }
    this.labels.lane = this.model.lanes.find((one) => one.name === name);
    this.labels.refreshLanes();
    this.timeline.arrange();
  }

  changed(lane, label) {
    lane.labels.sort((a, b) => a.start - b.start || a.end - b.end);
    this.unsaved = true;
    this.model.selected = label;
    this.model.loop = label ? [label.start, label.end] : null;
    if (label && label.why === null) this.why.show(label, this.model, null);
    this.showRange();
    this.timeline.arrange();
    this.labels.refreshLanes();
  }

  save(lane) {
    const lanes = this.models.map((model) => [model.name, model.lanes.find((one) => one.name === lane.name)]).filter(([, own]) => own);
    // A recording of which no label is left says so, by a segment without length.
    const emptied = lanes.some(([, own]) => own.editable && !own.labels.length) ? ["unassessed"] : [];
    const rows = [["recording", "label", "start_s", "end_s", ...emptied]];
    for (const [name, own] of lanes) {
      for (const label of own.labels) rows.push([name, label.name, Number(label.start.toFixed(4)), Number(label.end.toFixed(4)), ...emptied.map(() => "")]);
      if (emptied.length && !own.labels.length) rows.push([name, "", 0, 0, 1]);
    }
    download("labels.csv", toCsv(rows));
    this.unsaved = false;
  }

  // -- keys ----------------------------------------------------------------------------------

  keys(event) {
    return {
      ...super.keys(event),
      n: () => this.next(1),
      p: () => this.next(-1),
      i: () => this.markLoop(0),
      o: () => this.markLoop(1),
      "+": () => this.timeline.zoom(1.6),
      "=": () => this.timeline.zoom(1.6),
      "-": () => this.timeline.zoom(1 / 1.6),
      0: () => this.timeline.setRange(0, this.length),
      f: () => this.setFollow(!this.view.follow),
      Delete: () => this.labels.remove(),
    };
  }
}

// A recording with what a person changes of it.
function makeModel(recording) {
  const lanes = recording.lanes.map((lane) => ({
    ...lane,
    labels: lane.labels.map(([name, start, end, cost, score, known, why]) => ({ name, start, end, cost, score, known, why, level: 0 })),
  }));
  const groups = [];
  content.features.forEach((feature, i) => {
    let group = groups.find((one) => one.id === feature.group);
    if (!group) groups.push((group = { id: feature.group, name: { upper: "upper body", lower: "lower body", mix: "whole body" }[feature.group] || feature.group, features: [] }));
    group.features.push(i);
  });
  const named = new Set(lanes.flatMap((lane) => lane.labels.map((label) => label.name)));
  const classes = recording.curves ? recording.curves.classes : [];
  const labelled = classes.map((_, i) => i).filter((i) => named.has(classes[i].name)).slice(0, 3);
  return {
    ...recording, lanes, groups,
    gaps: recording.gaps || [],
    clips: [recording.live ? new LiveClip(recording) : new Clip(recording), ...(recording.other ? [new Clip(recording.other.clip)] : [])],
    warpPlaces: recording.other ? recording.other.warp.map(([place]) => place) : [],
    chosenCurves: labelled.length ? labelled : classes.length ? [0] : [],
    showsFeatures: true, features: null, loop: null, selected: null,
  };
}

async function loadRest(model) {
  if (model.strip && !model.features) {
    model.strip.rows = decodeStates(await unpackBlock(model.strip.block), content.features.length);
    model.features = model.strip;
  }
  if (model.curves && !model.curves.values) {
    const { curves } = model;
    curves.values = decodeSeries(await unpackBlock(curves.block), curves.classes.length, curves.n_frames, curves.unit);
    curves.highest = 0;
    for (const row of curves.values) for (const value of row) if (value > curves.highest) curves.highest = value;
  }
}

function nothingSays(model) {
  const lane = model.lanes.find((one) => one.nearest);
  return lane ? lane.nearest : "This recording has no labels.";
}

function legend(model) {
  const items = [["left", "left side"], ["right", "right side"], ["unseen", "not seen"]];
  if (model.other) items.push(["failed", "◆ differs"], ["first", `in ${model.short} only`], ["second", `in ${model.other.clip.short} only`]);
  else if (model.lanes.some((lane) => lane.why)) items.push(["held", "● held"], ["failed", "◆ failed"]);
  return items.map(([kind, text]) => h("li", { class: `key-${kind}` }, text));
}
