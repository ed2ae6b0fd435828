// Time that runs: playing, speed and loop, for whatever shows a moment.

const SPEEDS = [0.1, 0.25, 0.5, 1, 1.5, 2, 4, 8];

class Clock {
  constructor() {
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.loops = false;
    this.playButton = button("▶", "Play", () => this.toggle(), { class: "main play" });
    this.loopButton = button("loop", "Loop", () => this.setLoops(!this.loops), { "aria-pressed": "false" });
    this.speedChoice = h("select", { "aria-label": "Speed", onchange: () => (this.speed = Number(this.speedChoice.value)) },
      SPEEDS.map((speed) => h("option", { value: speed, selected: speed === 1 }, `${speed}×`)));
  }

  // The bar at the top: which of several is shown, facts on it, colours and keys.
  header(label, names, keys, text) {
    const choice = h("select", { "aria-label": label, onchange: () => this.open(Number(choice.value)) },
      names.map((name, i) => h("option", { value: i }, name)));
    return h("header", { class: "bar" },
      h("h1", {}, names.length > 1 ? choice : names[0]),
      (this.facts = h("span", { class: "soft facts" })),
      h("span", { class: "grow" }),
      themeButton(() => this.recolour()),
      helpButton(keys, text));
  }

  // What plays: [start, stop]; pages have `open(index)`, `seek(s)`, `draw()`, `recolour()` and `hz`.
  get span() {
    return [0, this.length];
  }

  start() {
    addEventListener("keydown", (event) => this.press(event));
    requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    requestAnimationFrame((next) => this.tick(next));
    if (this.playing) {
      const [start, stop] = this.span;
      let time = this.time + Math.min((now - (this.last || now)) / 1000, 0.25) * this.speed;
      if (time >= stop) {
        if (this.loops) time = start + ((time - start) % Math.max(stop - start, 0.01));
        else {
          time = stop;
          this.toggle();
        }
      }
      this.seek(time);
    }
    this.last = now;
    this.draw();
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing && this.time >= this.length - 1e-3) this.seek(0);
    this.playButton.textContent = this.playing ? "❚❚" : "▶";
    const label = this.playing ? "Pause" : "Play";
    this.playButton.title = label;
    this.playButton.setAttribute("aria-label", label);
  }

  setLoops(on) {
    this.loops = on;
    this.loopButton.setAttribute("aria-pressed", String(on));
  }

  step(by) {
    if (this.playing) this.toggle();
    this.seek((Math.round(this.time * this.hz) + by) / this.hz);
  }

  changeSpeed(by) {
    this.speed = SPEEDS[clamp(SPEEDS.indexOf(this.speed) + by, 0, SPEEDS.length - 1)];
    this.speedChoice.value = String(this.speed);
  }

  keys(event) {
    return {
      ArrowLeft: () => (event.shiftKey ? this.seek(this.time - 1) : this.step(-1)),
      ArrowRight: () => (event.shiftKey ? this.seek(this.time + 1) : this.step(1)),
      Home: () => this.seek(0),
      End: () => this.seek(this.length),
      l: () => this.setLoops(!this.loops),
      ",": () => this.changeSpeed(-1),
      ".": () => this.changeSpeed(1),
      " ": () => this.toggle(),
    };
  }

  press(event) {
    const { target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target.closest("dialog, textarea, [type=text], [type=search], [type=number]")) return;
    const onControl = target.closest("button, select, summary, [type=checkbox], [type=range]");
    const action = this.keys(event)[event.key];
    // Space presses a button, arrows choose in a list: there they keep their meaning.
    const isTheirs = onControl && (event.key === " " || (onControl.matches("select, [type=range]") && event.key.length > 1));
    if (!action || isTheirs) return;
    event.preventDefault();
    action();
  }
}
