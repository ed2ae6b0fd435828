// Why a label stands where it does: what its class asks for, and what held and failed.

const MOST_LINES = 14;

class Why {
  constructor(host, actions) {
    this.host = host;
    this.actions = actions;
    this.why = null;
    this.clear("Choose a label on the time axis or in the list.");
  }

  clear(text) {
    this.why = null;
    this.lines = [];
    this.host.replaceChildren(h("p", { class: "soft" }, text));
  }

  list(title, lines) {
    this.clear("");
    this.host.replaceChildren(h("h4", {}, title), h("ul", { class: "lines" }, lines.map((line) => h("li", {}, line))));
  }

  show(label, recording, why) {
    this.why = why;
    this.lines = [];
    const parts = [
      h("h3", {}, label.name),
      h("p", { class: "soft" }, `${formatTime(label.start)}–${formatTime(label.end)} s, frames ${frameAt(recording, label.start)}–${lastFrameBefore(recording, label.end)}`),
    ];
    const numbers = [];
    if (label.score !== null) numbers.push(`score ${label.score.toFixed(1)}`);
    if (label.cost !== null) numbers.push(`cost ${label.cost.toFixed(3)}`);
    if (label.known !== null && label.known < 1) numbers.push(`${Math.floor(100 * label.known)} % of it seen`);
    if (why && !why.lines) numbers.push(`${Math.round(100 * why.fraction)} % of what the class asks for held`);
    if (numbers.length) parts.push(h("p", {}, numbers.join(", ")));
    if (why && why.lines) parts.push(...why.lines.map((line) => h("p", {}, line)));
    else if (why) {
      parts.push(...this.findings("Failed", "failed", "◆", why.failed), ...this.findings("Held", "held", "●", why.held));
      if (why.unknown.length) {
        parts.push(h("h4", {}, "Not seen"), h("p", { class: "soft" }, why.unknown.map((i) => content.features[i].yes).join(", ")));
      }
      if (why.gains.length) parts.push(...this.gains(why.gains));
    } else parts.push(h("p", { class: "soft" }, "This label was read from a table: there is no match behind it to explain."));
    this.host.replaceChildren(...parts);
  }

  findings(title, kind, mark, findings) {
    if (!findings.length) return [];
    const list = h("ul", { class: "findings" });
    for (const [feature, holds, start, end] of findings.slice(0, MOST_LINES)) {
      const phrase = content.features[feature][holds ? "yes" : "no"];
      const line = h("button", { type: "button", onclick: () => this.actions.seek(start) },
        h("span", { class: `mark ${kind}`, "aria-hidden": "true" }, mark),
        h("span", {}, phrase), h("span", { class: "soft" }, ` ${start.toFixed(1)}–${end.toFixed(1)} s`));
      this.lines.push({ line, start, end });
      list.append(h("li", {}, line));
    }
    const more = findings.length - MOST_LINES;
    return [h("h4", {}, title), list, more > 0 ? h("p", { class: "soft" }, `and ${more} of less weight`) : null].filter(Boolean);
  }

  gains(gains) {
    const list = h("ul", { class: "gains" });
    for (const [feature, part] of gains.slice(0, 6)) {
      list.append(h("li", {}, `${part > 0 ? "+" : "−"}${Math.abs(part).toFixed(1)} `, content.features[feature].yes));
    }
    return [h("h4", {}, "What the score is made of"), list];
  }

  // Joints of the features that hold and fail now; lines of now are set off.
  at(seconds) {
    const held = new Set(), failed = new Set();
    if (!this.why) return { held, failed };
    for (const [findings, joints] of [[this.why.held, held], [this.why.failed, failed]]) {
      for (const [feature, , start, end] of findings) {
        if (seconds < start || seconds >= end) continue;
        for (const joint of tellingJoints(content.features[feature].joints)) joints.add(joint);
      }
    }
    for (const { line, start, end } of this.lines) line.classList.toggle("now", seconds >= start && seconds < end);
    return { held, failed };
  }
}

// Of the joints that a feature is measured by, those that it is about: the corner of an angle,
// both of a pair, or the last one, which is seen against the others.
function tellingJoints(joints) {
  const [first, second, third, fourth] = joints;
  if (joints.length === 4 && first === third && second !== fourth) return [first];
  const pair = joints.slice(-2), names = pair.map((joint) => content.joints[joint]);
  const isPair = pair.length === 2 && names[0] !== names[1] && names[0].slice(1) === names[1].slice(1);
  return isPair ? pair : joints.slice(-1);
}
