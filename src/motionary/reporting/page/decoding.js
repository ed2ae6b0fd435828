// Blocks of numbers: base64 of deflated variable-length integers; see html.py.

const content = JSON.parse(document.getElementById("content").textContent);

const allRead = new Promise((resolve) => {
  if (document.readyState !== "loading") resolve();
  else document.addEventListener("DOMContentLoaded", resolve, { once: true });
});

async function unpackBlock(name) {
  let element = document.getElementById(name);
  // While the browser still reads the file, its last element may be half there.
  if (!element || (!element.nextElementSibling && document.readyState === "loading")) {
    await allRead;
    element = document.getElementById(name);
  }
  if (!element) throw new Error(`the page has no block ${name}`);
  const letters = atob(element.textContent);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function unpackJson(name) {
  return JSON.parse(new TextDecoder().decode(await unpackBlock(name)));
}

class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  next() {
    let value = 0, scale = 1, byte;
    do {
      byte = this.bytes[this.at++];
      value += (byte & 127) * scale;
      scale *= 128;
    } while (byte & 128);
    return value;
  }

  nextSigned() {
    const value = this.next();
    return value % 2 ? -(value + 1) / 2 : value / 2;
  }
}

// Positions [frame][joint][axis] in metres, and which joints were seen [frame][joint].
function decodePositions(bytes, nFrames, nJoints, unit) {
  const reader = new Reader(bytes);
  const values = new Float32Array(nFrames * nJoints * 3);
  for (let row = 0; row < nJoints * 3; row++) {
    let value = 0;
    for (let frame = 0; frame < nFrames; frame++) {
      value += reader.nextSigned();
      values[frame * nJoints * 3 + row] = value * unit;
    }
  }
  const known = new Uint8Array(nFrames * nJoints);
  for (let joint = 0; joint < nJoints; joint++) {
    for (let frame = 0, seen = 1; frame < nFrames; seen = 1 - seen) {
      const stop = frame + reader.next();
      for (; frame < stop; frame++) known[frame * nJoints + joint] = seen;
    }
  }
  return { values, known };
}

function decodeSeries(bytes, nRows, nFrames, unit) {
  const reader = new Reader(bytes);
  return Array.from({ length: nRows }, () => {
    const row = new Float32Array(nFrames);
    let value = 0;
    for (let frame = 0; frame < nFrames; frame++) row[frame] = (value += reader.nextSigned()) * unit;
    return row;
  });
}

// Per row the first frames of its runs, and their states: 0 no, 1 yes, 2 unknown; of two
// recordings 1 in both, 3 in the first only, 4 in the second only.
function decodeStates(bytes, nRows) {
  const reader = new Reader(bytes);
  return Array.from({ length: nRows }, () => {
    const n = reader.next();
    const starts = new Uint32Array(n), states = new Uint8Array(n);
    for (let i = 0, at = 0; i < n; i++) {
      const run = reader.next();
      starts[i] = at;
      states[i] = run % 8;
      at += Math.floor(run / 8);
    }
    return { starts, states };
  });
}

// Value at a place between points [place, value], by places.
function between(points, places, at) {
  const i = clamp(lastUpTo(places, at), 0, Math.max(points.length - 2, 0));
  const [p, s] = points[i], [q, t] = points[Math.min(i + 1, points.length - 1)];
  return q > p ? s + clamp((at - p) / (q - p), 0, 1) * (t - s) : s;
}

// Index of the last of sorted values that is at most `value`; -1 without one.
function lastUpTo(values, value) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// Poses of a recording; pieces are unpacked when they are asked for, the last few are kept.
class Clip {
  constructor(recording) {
    this.recording = recording;
    this.nJoints = recording.joints ? recording.joints.length : 0;
    this.pieces = new Map();
    this.waiting = new Map();
    this.pose = {
      positions: new Float32Array(this.nJoints * 3),
      known: new Uint8Array(this.nJoints),
    };
  }

  async load(index) {
    const recording = this.recording;
    if (this.pieces.has(index)) return;
    if (!this.waiting.has(index)) {
      const nFrames = Math.min(recording.piece, recording.page_frames - index * recording.piece);
      const ready = unpackBlock(recording.positions[index]).then((bytes) => {
        this.pieces.set(index, decodePositions(bytes, nFrames, this.nJoints, content.unit_m));
        this.waiting.delete(index);
        if (this.pieces.size > 12) this.pieces.delete(this.pieces.keys().next().value);
      });
      this.waiting.set(index, ready);
    }
    await this.waiting.get(index);
  }

  // The pose at a time, between frames in a straight line; null while its piece is unpacked.
  at(seconds, onready) {
    const recording = this.recording;
    const at = clamp(seconds * recording.page_hz, 0, recording.page_frames - 1);
    const frame = Math.floor(at + 1e-6);
    const index = Math.floor(frame / recording.piece);
    const piece = this.pieces.get(index);
    const next = index + 1;
    if (next < recording.positions.length && frame % recording.piece > recording.piece - 90) this.load(next);
    if (!piece) {
      this.load(index).then(onready);
      return null;
    }
    const local = frame - index * recording.piece, n = this.nJoints, size = n * 3;
    const after = (local + 1) * size < piece.values.length ? local + 1 : local;
    const part = clamp(at - frame, 0, 1);
    for (let i = 0; i < size; i++) {
      const here = piece.values[local * size + i];
      this.pose.positions[i] = here + part * (piece.values[after * size + i] - here);
    }
    this.pose.known.set(piece.known.subarray(local * n, (local + 1) * n));
    return this.pose;
  }
}
