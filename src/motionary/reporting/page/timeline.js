// The time axis: lanes of labels, curves, features and gaps over one range of time.

const LANE_ROW = 18;
const CURVE_ROW = 38;
const FEATURE_ROW = 3;
const AXIS_ROW = 24;
const GROUP_GAP = 4;
const MOST_ROWS_OF_LANE = 3;
const STEPS_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600];

class Timeline {
  // `actions`: seek(s), select(lane, label), edit(label, which end, s), hover(text)
  constructor(host, actions) {
    this.host = host;
    this.actions = actions;
    this.canvas = h("canvas", {
      class: "time-canvas", tabindex: "0", role: "slider", "aria-label": "Time",
      "aria-valuemin": "0",
    });
    this.playhead = h("div", { class: "playhead", "aria-hidden": "true" });
    this.area = h("div", { class: "time-area" }, this.canvas, this.playhead);
    host.append(this.area);
    this.start = 0;
    this.stop = 1;
    this.rows = [];
    this.pointers = new Map();
    this.dirty = true;
    new ResizeObserver(() => this.resize()).observe(host);
    this.listen();
  }

  setRecording(model) {
    this.model = model;
    this.length = Math.max(model.duration_s, 0.001);
    this.canvas.setAttribute("aria-valuemax", this.length.toFixed(2));
    this.setRange(0, this.length);
    this.arrange();
  }

  setRange(start, stop) {
    const least = Math.min(this.length, 0.2);
    const span = clamp(stop - start, least, this.length);
    this.start = clamp(start, 0, this.length - span);
    this.stop = this.start + span;
    this.dirty = true;
  }

  zoom(factor, around) {
    const at = around === undefined ? this.time : around;
    const middle = clamp(at, this.start, this.stop);
    this.setRange(middle - (middle - this.start) / factor, middle + (this.stop - middle) / factor);
  }

  arrange() {
    const model = this.model, rows = [];
    let y = AXIS_ROW;
    const add = (row) => {
      rows.push({ ...row, y });
      y += row.height;
    };
    for (const lane of model.lanes) {
      const levels = layLabels(lane.labels);
      const height = Math.max(levels, 1) * LANE_ROW + 6;
      add({ kind: "lane", lane, height, name: lane.name });
    }
    for (const index of model.chosenCurves) add({ kind: "curve", index, height: CURVE_ROW, name: model.curves.classes[index].name });
    if (model.features && model.showsFeatures) {
      for (const group of model.groups) {
        y += GROUP_GAP;
        add({ kind: "features", group, height: Math.max(group.features.length * FEATURE_ROW, 14), name: group.name });
      }
    }
    if (model.gaps.length) add({ kind: "gaps", height: 14, name: "not seen" });
    this.rows = rows;
    this.height = y + 6;
    this.resize();
  }

  resize() {
    const width = this.host.clientWidth;
    if (!width || !this.height) return;
    this.gutter = width < 600 ? 86 : 118;
    this.width = width;
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.canvas.style.width = `${width}px`;
    this.canvas.style.height = `${this.height}px`;
    this.area.style.height = `${this.height}px`;
    this.ratio = ratio;
    this.dirty = true;
  }

  x(seconds) {
    return this.gutter + ((seconds - this.start) / (this.stop - this.start)) * (this.width - this.gutter - 8);
  }

  seconds(x) {
    return this.start + ((x - this.gutter) / (this.width - this.gutter - 8)) * (this.stop - this.start);
  }

  setTime(seconds, isPlaying) {
    this.time = seconds;
    if (isPlaying && (seconds < this.start || seconds > this.stop)) {
      const span = this.stop - this.start;
      this.setRange(seconds - 0.05 * span, seconds + 0.95 * span);
    }
    this.canvas.setAttribute("aria-valuenow", seconds.toFixed(2));
    this.movePlayhead();
  }

  movePlayhead() {
    const inside = this.time >= this.start - 1e-6 && this.time <= this.stop + 1e-6;
    this.playhead.hidden = !inside;
    this.playhead.style.transform = `translateX(${this.x(this.time).toFixed(1)}px)`;
  }

  draw() {
    if (!this.dirty || !this.width || !this.model) return;
    this.dirty = false;
    this.movePlayhead();
    const c = this.canvas.getContext("2d");
    this.colours = {};
    for (const name of ["text", "soft", "line", "panel", "label", "label-text", "truth", "truth-text", "accent", "curve", "below", "feature", "unknown", "unknown-line"]) {
      this.colours[name] = cssColour(`--${name}`);
    }
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    c.clearRect(0, 0, this.width, this.height);
    c.font = "12px system-ui, sans-serif";
    c.textBaseline = "middle";
    this.drawAxis(c);
    for (const row of this.rows) {
      this.drawName(c, row);
      c.save();
      c.beginPath();
      c.rect(this.gutter, row.y, this.width - this.gutter, row.height);
      c.clip();
      if (row.kind === "lane") this.drawLane(c, row);
      else if (row.kind === "curve") this.drawCurve(c, row);
      else if (row.kind === "features") this.drawFeatures(c, row);
      else this.hatch(c, this.model.gaps, row.y + 2, row.height - 4);
      c.restore();
    }
    const loop = this.model.loop;
    if (loop) this.drawLoop(c, loop);
  }

  drawAxis(c) {
    const span = this.stop - this.start;
    const most = (this.width - this.gutter) / 70;
    const step = STEPS_S.find((s) => span / s <= most) || 3600;
    const digits = step < 1 ? 1 : 0;
    c.strokeStyle = this.colours.line;
    c.fillStyle = this.colours.soft;
    c.lineWidth = 1;
    c.textAlign = "left";
    for (let k = Math.ceil(this.start / step - 1e-9); k * step <= this.stop + 1e-9; k++) {
      const x = Math.round(this.x(k * step)) + 0.5;
      c.beginPath();
      c.moveTo(x, AXIS_ROW - 6);
      c.lineTo(x, this.height);
      c.globalAlpha = 0.5;
      c.stroke();
      c.globalAlpha = 1;
      if (x < this.width - 30) c.fillText(formatTime(k * step, digits), x + 3, AXIS_ROW - 13);
    }
    c.textAlign = "right";
    c.fillText(this.length >= 60 ? "min:s" : "s", this.gutter - 8, AXIS_ROW - 13);
  }

  drawName(c, row) {
    c.textAlign = "right";
    c.fillStyle = this.colours.soft;
    const middle = row.y + (row.kind === "lane" ? 3 + LANE_ROW / 2 : row.height / 2);
    c.fillText(fitText(c, shown(row.name), this.gutter - 14), this.gutter - 8, middle);
    c.strokeStyle = this.colours.line;
    c.globalAlpha = 0.6;
    c.beginPath();
    c.moveTo(0, row.y - 0.5);
    c.lineTo(this.width, row.y - 0.5);
    c.stroke();
    c.globalAlpha = 1;
  }

  drawLane(c, row) {
    const { lane } = row;
    this.hatch(c, lane.unassessed, row.y + 2, row.height - 4);
    const fill = this.colours[lane.truth ? "truth" : "label"];
    const text = this.colours[lane.truth ? "truth-text" : "label-text"];
    c.textAlign = "left";
    const ends = new Float64Array(MOST_ROWS_OF_LANE).fill(-1);
    for (const label of lane.labels) {
      if (label.end < this.start || label.start > this.stop) continue;
      const left = this.x(label.start), right = Math.max(this.x(label.end), left + 1.5);
      // Of thousands of labels in one pixel one is drawn.
      if (right < ends[label.level] + 0.5 && label !== this.model.selected) continue;
      ends[label.level] = right;
      const y = row.y + 3 + label.level * LANE_ROW;
      c.fillStyle = fill;
      c.globalAlpha = lane.isFaint ? 0.6 : 1;
      c.fillRect(left, y, Math.max(right - left - 0.7, 1), LANE_ROW - 3);
      c.globalAlpha = 1;
      if (label === this.model.selected) {
        c.strokeStyle = this.colours.text;
        c.lineWidth = 2;
        c.strokeRect(left, y, Math.max(right - left - 0.7, 1), LANE_ROW - 3);
      }
      const from = Math.max(left, this.gutter);
      if (right - from > 24) {
        c.fillStyle = text;
        c.fillText(fitText(c, shown(label.name), right - from - 8), from + 4, y + LANE_ROW / 2 - 1);
      }
    }
  }

  drawCurve(c, row) {
    const { curves } = this.model;
    const values = curves.values ? curves.values[row.index] : null;
    if (!values) return;
    const isCost = curves.kind === "cost";
    const threshold = curves.classes[row.index].threshold;
    const top = isCost ? Math.max(3 * threshold, 0.2) : Math.max(curves.highest, 1.3 * threshold, 1);
    const low = row.y + row.height - 3, high = row.y + 4;
    const y = (value) => low - clamp(value / top, 0, 1) * (low - high);
    const hz = values.length / this.length;
    c.strokeStyle = this.colours.curve;
    c.lineWidth = 1.2;
    c.beginPath();
    const left = this.gutter, right = Math.ceil(this.x(this.stop));
    const marked = [];
    for (let x = left; x <= right; x++) {
      const first = clamp(Math.floor(this.seconds(x) * hz), 0, values.length - 1);
      const last = clamp(Math.ceil(this.seconds(x + 1) * hz), first + 1, values.length);
      let best = values[first];
      for (let i = first + 1; i < last; i++) if (isCost ? values[i] < best : values[i] > best) best = values[i];
      if (x === left) c.moveTo(x, y(best));
      else c.lineTo(x, y(best));
      if (isCost ? best <= threshold : best >= threshold) marked.push(x);
    }
    c.stroke();
    c.fillStyle = this.colours.below;
    for (const x of marked) c.fillRect(x, low - 1, 1, 3);
    c.strokeStyle = this.colours.label;
    c.setLineDash([4, 3]);
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(left, y(threshold));
    c.lineTo(right, y(threshold));
    c.stroke();
    c.setLineDash([]);
  }

  drawFeatures(c, row) {
    const { strip } = this.model;
    if (!strip.rows) return;
    const left = this.gutter, width = Math.max(1, Math.ceil(this.x(this.stop)) - left);
    const indices = row.group.features;
    const image = new ImageData(width, indices.length * FEATURE_ROW);
    const pixels = new Uint32Array(image.data.buffer);
    const fills = [null, "feature", "unknown-line", "curve", "label"].map((name) => name && toPixel(this.colours[name]));
    const hz = strip.n_frames / this.length;
    indices.forEach((feature, place) => {
      const { starts, states } = strip.rows[feature];
      let run = Math.max(lastUpTo(starts, Math.floor(this.seconds(left) * hz)), 0);
      for (let x = 0; x < width; x++) {
        const last = this.seconds(left + x + 1) * hz;
        let state = states[run];
        while (run + 1 < starts.length && starts[run + 1] < last) {
          run++;
          // A short one between two pixels stays visible.
          if (state === 0 || state === 2) state = states[run];
        }
        if (state === 0) continue;
        for (let k = 0; k < FEATURE_ROW - (state === 2 ? 0 : 1); k++) {
          const y = place * FEATURE_ROW + k;
          if (state === 2 && (x + y) % 4) continue;
          pixels[y * width + x] = fills[state];
        }
      }
    });
    const buffer = document.createElement("canvas");
    buffer.width = width;
    buffer.height = image.height;
    buffer.getContext("2d").putImageData(image, 0, 0);
    c.imageSmoothingEnabled = false;
    c.drawImage(buffer, left, row.y, width, image.height);
  }

  hatch(c, segments, y, height) {
    c.strokeStyle = this.colours["unknown-line"];
    for (const [start, stop] of segments) {
      if (stop < this.start || start > this.stop) continue;
      const left = Math.max(this.x(start), this.gutter), right = Math.max(Math.min(this.x(stop), this.width), left + 1);
      c.save();
      c.fillStyle = this.colours.unknown;
      c.fillRect(left, y, right - left, height);
      c.beginPath();
      c.rect(left, y, right - left, height);
      c.clip();
      c.beginPath();
      c.lineWidth = 1;
      for (let x = left - height - ((left - height) % 5); x < right; x += 5) {
        c.moveTo(x, y + height);
        c.lineTo(x + height, y);
      }
      c.stroke();
      c.restore();
    }
  }

  drawLoop(c, [start, stop]) {
    const left = this.x(start), right = this.x(stop);
    c.fillStyle = this.colours.accent;
    c.globalAlpha = 0.12;
    c.fillRect(Math.max(left, this.gutter), 0, Math.max(right - Math.max(left, this.gutter), 0), this.height);
    c.globalAlpha = 1;
    for (const x of [left, right]) if (x >= this.gutter) c.fillRect(x - 1, 0, 2, AXIS_ROW - 4);
  }

  // -- what a person does ------------------------------------------------------------------

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("wheel", (event) => {
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        const by = ((event.deltaX || event.deltaY) / this.width) * (this.stop - this.start);
        this.setRange(this.start + by, this.stop + by);
      } else if (event.ctrlKey || event.offsetX > this.gutter) {
        this.zoom(Math.exp(-event.deltaY * 0.0022), this.seconds(event.offsetX));
      } else return;
      event.preventDefault();
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.release(event));
    canvas.addEventListener("pointerleave", () => this.actions.hover(""));
  }

  hit(event) {
    const row = this.rows.find((one) => event.offsetY >= one.y && event.offsetY < one.y + one.height);
    if (!row || event.offsetX < this.gutter) return { row };
    if (row.kind !== "lane") return { row };
    const level = Math.floor((event.offsetY - row.y - 3) / LANE_ROW);
    let best = null, nearest = 7;
    for (const label of row.lane.labels) {
      if (label.level !== level) continue;
      const left = this.x(label.start), right = this.x(label.end);
      const off = event.offsetX < left ? left - event.offsetX : Math.max(event.offsetX - right, 0);
      if (off < nearest) [best, nearest] = [label, off];
    }
    if (!best) return { row };
    const toStart = Math.abs(event.offsetX - this.x(best.start)), toEnd = Math.abs(event.offsetX - this.x(best.end));
    const reach = Math.min(8, Math.max((this.x(best.end) - this.x(best.start)) / 3, 3));
    const end = Math.min(toStart, toEnd) <= reach ? (toStart < toEnd ? "start" : "end") : null;
    return { row, label: best, end };
  }

  press(event) {
    if (event.button > 1) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event.offsetX);
    if (this.pointers.size === 2) {
      this.drag = { kind: "pinch", range: [this.start, this.stop], x: [...this.pointers.values()] };
      return;
    }
    const { row, label, end } = this.hit(event);
    const editable = row && row.kind === "lane" && row.lane.editable;
    if (label && editable && end) this.drag = { kind: "end", label, end };
    else if (event.button === 1) this.drag = { kind: "pan", x: event.offsetX, range: [this.start, this.stop] };
    else {
      this.drag = { kind: "seek", x: event.offsetX, label, row };
      if (!label) this.actions.seek(this.snap(event.offsetX));
    }
  }

  snap(x) {
    return clamp(this.seconds(x), 0, this.length);
  }

  move(event) {
    if (!this.model) return;
    if (this.pointers.has(event.pointerId)) this.pointers.set(event.pointerId, event.offsetX);
    const drag = this.drag;
    if (!drag) return this.describe(event);
    if (drag.kind === "pinch" && this.pointers.size === 2) {
      const [a, b] = [...this.pointers.values()], [c, d] = drag.x;
      const [start, stop] = drag.range, width = this.width - this.gutter - 8;
      const scale = Math.max(Math.abs(d - c), 20) / Math.max(Math.abs(b - a), 20);
      const at = start + (((c + d) / 2 - this.gutter) / width) * (stop - start);
      const part = ((a + b) / 2 - this.gutter) / width, span = (stop - start) * scale;
      this.setRange(at - part * span, at + (1 - part) * span);
    } else if (drag.kind === "end") {
      this.actions.edit(drag.label, drag.end, this.snap(event.offsetX));
    } else if (drag.kind === "pan") {
      const by = ((drag.x - event.offsetX) / (this.width - this.gutter - 8)) * (drag.range[1] - drag.range[0]);
      this.setRange(drag.range[0] + by, drag.range[1] + by);
    } else if (drag.kind === "seek" && (Math.abs(event.offsetX - drag.x) > 4 || !drag.label)) {
      drag.label = null;
      this.actions.seek(this.snap(event.offsetX));
    }
  }

  release(event) {
    const drag = this.drag;
    this.pointers.delete(event.pointerId);
    if (this.pointers.size) return;
    this.drag = null;
    if (drag && drag.kind === "seek" && drag.label) this.actions.select(drag.row.lane, drag.label);
    if (drag && drag.kind === "end") this.actions.edited(drag.label);
  }

  describe(event) {
    const { row, label, end } = this.hit(event);
    const editable = row && row.kind === "lane" && row.lane.editable;
    this.canvas.style.cursor = label ? (editable && end ? "ew-resize" : "pointer") : "default";
    const at = formatTime(this.snap(event.offsetX));
    if (label) this.actions.hover(`${label.name}, ${formatTime(label.start)}–${formatTime(label.end)} s`);
    else if (row && row.kind === "features") {
      const place = clamp(Math.floor((event.offsetY - row.y) / FEATURE_ROW), 0, row.group.features.length - 1);
      const feature = row.group.features[place], strip = this.model.strip;
      const frame = Math.floor((this.snap(event.offsetX) * strip.n_frames) / this.length);
      const runs = strip.rows && strip.rows[feature];
      const state = runs ? runs.states[Math.max(lastUpTo(runs.starts, frame), 0)] : 2;
      const { yes, no, id } = content.features[feature];
      const { short, other } = this.model;
      const said = [no, yes, `unknown: ${yes}`, `${yes} in ${short} only`, other && `${yes} in ${other.clip.short} only`][state];
      this.actions.hover(`${at} s: ${said} (${id})`);
    } else if (row && row.kind === "curve" && this.model.curves.values) {
      const values = this.model.curves.values[row.index];
      const value = values[clamp(Math.floor((this.snap(event.offsetX) * values.length) / this.length), 0, values.length - 1)];
      this.actions.hover(`${at} s: ${this.model.curves.kind} of ${row.name} ${value.toFixed(3)}`);
    } else this.actions.hover(row && row.kind === "gaps" ? `${at} s: hatched where joints were not seen` : "");
  }
}

// Gives overlapping labels rows of their own; the number of rows comes back.
function layLabels(labels) {
  const ends = [];
  for (const label of labels) {
    let level = ends.findIndex((end) => end <= label.start + 1e-6);
    if (level < 0) level = ends.length < MOST_ROWS_OF_LANE ? ends.length : ends.indexOf(Math.min(...ends));
    label.level = level;
    ends[level] = Math.max(label.end, ends[level] || 0);
  }
  return ends.length;
}

const fittedTexts = new Map();

function fitText(c, text, width) {
  const key = `${Math.round(width)} ${text}`;
  if (fittedTexts.has(key)) return fittedTexts.get(key);
  let kept = text.length > 200 ? text.slice(0, 200) + "…" : text;
  if (c.measureText(kept).width > width) {
    let low = 0, high = kept.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (c.measureText(kept.slice(0, middle) + "…").width <= width) low = middle;
      else high = middle;
    }
    kept = low ? kept.slice(0, low) + "…" : "";
  }
  if (fittedTexts.size > 5000) fittedTexts.clear();
  fittedTexts.set(key, kept);
  return kept;
}

// Four bytes of an image, as one number of this machine.
function toPixel(hex) {
  const value = parseInt(hex.slice(1), 16);
  return new Uint32Array(new Uint8Array([value >> 16, (value >> 8) & 255, value & 255, 255]).buffer)[0];
}
