// The moment that is shown: play, pause, scrub, speed; everything else follows it.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

class Player {
  /** `show(t)` is told every new moment; the axis gives the ends. */
  constructor(axis, show) {
    this.axis = axis;
    this.show = show;
    this.t = 0;
    this.playing = false;
    this.button = h("button", { type: "button", class: "play", onclick: () => this.toggle() }, "Play");
    this.slider = h("input", { type: "range", min: 0, max: 1000, step: 1, "aria-label": "moment of the motion", oninput: () => {
      this.seek(axis.from + (this.slider.value / 1000) * (axis.to - axis.from));
    } });
    this.clock = h("output", {}, "");
    this.speed = h("select", { "aria-label": "speed of the animation" },
      ...SPEEDS.map((one) => h("option", { value: one, selected: one === 1 }, one < 1 ? `1/${1 / one}` : `${one} ×`)));
    this.element = h("div", { class: "player" }, this.button, this.slider, this.clock, this.speed);
    document.addEventListener("keydown", (event) => this.onKey(event));
  }

  seek(t) {
    this.t = Math.min(this.axis.to, Math.max(this.axis.from, t));
    const words = `${num(this.t, 3)} of ${num(this.axis.to, 3)} s`;
    this.slider.value = Math.round(((this.t - this.axis.from) / (this.axis.to - this.axis.from)) * 1000);
    this.slider.setAttribute("aria-valuetext", words);
    this.clock.textContent = `${num(this.t, 3)} / ${num(this.axis.to, 2)} s`;
    this.show(this.t);
  }

  toggle() {
    this.playing = !this.playing;
    this.button.textContent = this.playing ? "Pause" : "Play";
    if (!this.playing) return;
    if (this.t >= this.axis.to - 1e-6) this.seek(this.axis.from);
    this.before = null;
    requestAnimationFrame((now) => this.step(now));
  }

  step(now) {
    if (!this.playing) return;
    const passed = this.before === null ? 0 : (now - this.before) / 1000;
    this.before = now;
    this.seek(this.t + passed * Number(this.speed.value));
    if (this.t >= this.axis.to) this.toggle();
    else requestAnimationFrame((next) => this.step(next));
  }

  /** Space plays, arrows step, Home and End jump, + and - change the speed; keys that an element needs stay its own. */
  onKey(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    if (event.key === " " && /^(BUTTON|SUMMARY|A)$/.test(event.target.tagName)) return;
    const pace = event.shiftKey ? 0.1 : 0.01;
    const actions = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.seek(this.t - pace),
      ArrowRight: () => this.seek(this.t + pace),
      Home: () => this.seek(this.axis.from),
      End: () => this.seek(this.axis.to),
      "+": () => { this.speed.selectedIndex = Math.min(SPEEDS.length - 1, this.speed.selectedIndex + 1); },
      "-": () => { this.speed.selectedIndex = Math.max(0, this.speed.selectedIndex - 1); },
    };
    if (event.target.closest("[tabindex]") && !["+", "-"].includes(event.key)) return; // a scrolling region keeps its keys
    const action = actions[event.key];
    if (action) {
      event.preventDefault();
      action();
    }
  }
}
