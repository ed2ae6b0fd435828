// The list of labels, and correcting them: ends, names, new ones, deleted ones, the table.

const LABELS_A_PAGE = 100;

class Labels {
  // `actions`: select(lane, label), changed(lane), time(), loop(), startCorrecting(lane)
  constructor(host, actions) {
    this.actions = actions;
    this.from = 0;
    this.filter = "";
    this.laneChoice = h("select", { "aria-label": "Lane", onchange: () => this.choose() });
    this.search = h("input", { type: "search", placeholder: "name", "aria-label": "Show labels of this name only", oninput: () => {
      this.filter = this.search.value.toLowerCase();
      this.from = 0;
      this.list();
    } });
    this.rows = h("ol", { class: "label-list" });
    this.count = h("span", { class: "soft", role: "status" });
    this.correct = button("", "", () => this.actions.startCorrecting(this.lane));
    this.editor = h("div", { class: "editor", hidden: true });
    this.names = h("datalist", { id: "known-names" });
    host.append(
      h("div", { class: "tools" }, this.laneChoice, this.search, this.correct),
      this.editor,
      h("div", { class: "tools" },
        button("‹", "Earlier labels of the list", () => this.turn(-1)), this.count,
        button("›", "Later labels of the list", () => this.turn(1))),
      this.rows, this.names,
    );
    this.buildEditor();
  }

  buildEditor() {
    const changed = () => this.apply();
    this.name = h("input", { type: "text", list: "known-names", "aria-label": "Name of the label", onchange: changed, maxlength: 500 });
    this.start = h("input", { type: "number", step: "any", min: 0, "aria-label": "Start, seconds", onchange: changed });
    this.stop = h("input", { type: "number", step: "any", min: 0, "aria-label": "End, seconds", onchange: changed });
    this.problem = h("p", { class: "problem", role: "alert" });
    this.fields = h("div", { class: "fields" },
      h("label", {}, "name ", this.name),
      h("label", {}, "from ", this.start, button("⇤ here", "Start the label at the playhead", () => this.put("start"))),
      h("label", {}, "to ", this.stop, button("here ⇥", "End the label at the playhead", () => this.put("end"))),
      button("Delete", "Delete the chosen label", () => this.remove(), { class: "plain" }),
    );
    this.editor.append(
      this.fields, this.problem,
      h("div", { class: "tools" },
        button("Add", "Add a label at the loop, or at the playhead", () => this.add()),
        button("Save table", "Download the labels of this lane, of all recordings, as a table", () => this.actions.save(this.lane), { class: "main" })),
    );
  }

  setRecording(model) {
    this.model = model;
    this.lane = model.lanes.find((lane) => lane.labels.length) || model.lanes[0];
    this.from = 0;
    this.refreshLanes();
  }

  refreshLanes() {
    const { lanes } = this.model;
    this.laneChoice.replaceChildren(...lanes.map((lane, i) => h("option", { value: i, selected: lane === this.lane }, lane.name)));
    const names = new Set();
    for (const lane of lanes) for (const label of lane.labels) if (names.size < 500) names.add(label.name);
    for (const one of this.model.curves ? this.model.curves.classes : []) names.add(one.name);
    this.names.replaceChildren(...[...names].sort().map((name) => h("option", { value: name })));
    this.list();
  }

  choose() {
    this.lane = this.model.lanes[Number(this.laneChoice.value)];
    this.from = 0;
    this.list();
  }

  turn(by) {
    const n = this.visible().length;
    this.from = clamp(this.from + by * LABELS_A_PAGE, 0, Math.max(Math.floor((n - 1) / LABELS_A_PAGE), 0) * LABELS_A_PAGE);
    this.list();
  }

  visible() {
    if (!this.lane) return [];
    return this.filter ? this.lane.labels.filter((label) => label.name.toLowerCase().includes(this.filter)) : this.lane.labels;
  }

  // Turns the list to the page with a label.
  reveal(lane, label) {
    if (lane !== this.lane) {
      this.lane = lane;
      this.laneChoice.value = String(this.model.lanes.indexOf(lane));
    }
    const place = this.visible().indexOf(label);
    if (place >= 0) this.from = Math.floor(place / LABELS_A_PAGE) * LABELS_A_PAGE;
    this.list();
    const row = this.rows.querySelector("[aria-current]");
    if (!row) return;
    // The list alone scrolls, not the page around it.
    const top = row.offsetTop, list = this.rows;
    if (top < list.scrollTop || top + row.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = top - list.clientHeight / 2;
  }

  list() {
    const labels = this.visible(), lane = this.lane;
    const part = labels.slice(this.from, this.from + LABELS_A_PAGE);
    this.count.textContent = labels.length ? `${this.from + 1}–${this.from + part.length} of ${labels.length}` : "no labels";
    this.rows.replaceChildren(...part.map((label) =>
      h("li", {}, h("button", {
        type: "button", "aria-current": label === this.model.selected ? "true" : null,
        onclick: () => this.actions.select(lane, label),
      }, h("span", { class: "label-name" }, label.name), h("span", { class: "soft" }, `${formatTime(label.start)}–${formatTime(label.end)}`)))));
    if (lane && !labels.length && lane.nearest) this.rows.append(h("li", { class: "soft" }, lane.nearest));
    this.correct.hidden = Boolean(this.model.other || (lane && lane.editable));
    const what = lane ? ["Correct", "Make the labels of this lane editable"] : ["Label", "Begin a lane of labels"];
    this.correct.textContent = what[0];
    this.correct.title = what[1];
    this.correct.setAttribute("aria-label", what[1]);
    for (const one of [this.laneChoice, this.search, this.count.parentElement]) one.hidden = !lane;
    this.editor.hidden = !lane || !lane.editable;
    this.fill();
  }

  // -- correcting ----------------------------------------------------------------------------

  get chosen() {
    const { selected } = this.model;
    return this.lane && this.lane.editable && this.lane.labels.includes(selected) ? selected : null;
  }

  fill() {
    const label = this.chosen;
    for (const field of this.fields.querySelectorAll("input, button")) field.disabled = !label;
    this.problem.textContent = "";
    this.name.value = label ? label.name : "";
    this.start.value = label ? label.start.toFixed(3) : "";
    this.stop.value = label ? label.end.toFixed(3) : "";
  }

  put(end) {
    const label = this.chosen;
    if (label) this.change(label, { [end]: this.actions.time() });
  }

  apply() {
    const label = this.chosen;
    if (!label) return;
    const near = (field, value) => (Math.abs(Number(field.value) - value) < 0.0006 ? value : Number(field.value));
    this.change(label, { name: this.name.value, start: near(this.start, label.start), end: near(this.stop, label.end) });
  }

  // A label as it should be; says what is wrong instead where it cannot be.
  change(label, values) {
    const next = { name: label.name, start: label.start, end: label.end, ...values };
    const length = this.model.duration_s;
    this.problem.textContent = "";
    if (!next.name.trim()) return this.refuse("A label needs a name.");
    if (!(next.start >= 0 && next.end <= length + 1e-6 && next.start < next.end)) {
      return this.refuse(`A label needs a start before its end, both within 0–${length.toFixed(2)} s.`);
    }
    if (next.name === label.name && next.start === label.start && next.end === label.end) return undefined;
    Object.assign(label, next, { why: null, score: null, cost: null, known: null });
    this.actions.changed(this.lane, label);
    return undefined;
  }

  refuse(text) {
    this.fill();
    this.problem.textContent = text;
  }

  add() {
    if (!this.lane.editable) return;
    const length = this.model.duration_s, loop = this.actions.loop();
    const here = this.actions.time();
    let [start, end] = loop || [here, Math.min(here + 1, length)];
    if (end - start < 1e-3) start = Math.max(end - 1, 0);
    const name = this.chosen ? this.chosen.name : this.filter || "new";
    const label = { name, start, end, cost: null, score: null, known: null, why: null, level: 0 };
    this.lane.labels.push(label);
    this.actions.changed(this.lane, label);
    this.actions.select(this.lane, label);
    this.name.focus();
    this.name.select();
  }

  remove() {
    const label = this.chosen;
    if (!label) return;
    this.lane.labels.splice(this.lane.labels.indexOf(label), 1);
    this.actions.changed(this.lane, null);
  }
}
