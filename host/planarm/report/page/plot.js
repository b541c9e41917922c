// Curves over one shared time axis, and bars. Everything is drawn in pixels of its own width, and again when that changes.

const EDGE = { left: 48, right: 10 };

/** Even, round marks that cover a range with about `count` steps. */
function marks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((one) => one >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k += 1) found.push(k * step);
  return { found, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (step / power === 2.5 ? 1 : 0)) };
}

/** The time axis that all strips share. */
class TimeAxis {
  constructor(from, to) {
    this.from = from;
    this.to = to;
  }

  x(t, width) {
    return EDGE.left + ((t - this.from) / (this.to - this.from)) * (width - EDGE.left - EDGE.right);
  }

  t(x, width) {
    const share = (x - EDGE.left) / (width - EDGE.left - EDGE.right);
    return this.from + Math.min(1, Math.max(0, share)) * (this.to - this.from);
  }

  marks(width) {
    return marks(this.from, this.to, width < 420 ? 4 : 8);
  }
}

function linePath(t, y, px, py, stepped) {
  let path = "";
  for (let i = 0; i < t.length; i += 1) {
    const x = px(t[i]).toFixed(1);
    const at = py(y[i]).toFixed(1);
    if (i === 0) path = `M${x} ${at}`;
    else path += stepped ? `H${x}V${at}` : `L${x} ${at}`;
  }
  return path;
}

/** One panel of curves with live values in its caption. */
class Strip {
  /**
   * options: title, unit, decimals, height, series [{name, tone, t, y, stepped, fill, thin}], limits [{at, soft}],
   * least [low, high]: what the range covers at least; whole: whether limits widen the range.
   */
  constructor(options, axis, seek) {
    this.options = { height: 80, decimals: 1, limits: [], least: [0, 0], ...options };
    this.axis = axis;
    this.outputs = this.options.series.map(() => h("output", {}, "–"));
    const keys = this.options.series.map((one, i) => one.keyless ? null : h("span", { class: `key ${one.tone} ${one.thin ? "thin" : ""}` }, one.name, " ", this.outputs[i]));
    this.svg = s("svg", { role: "img", "aria-label": this.words() });
    this.element = h("figure", { class: "strip" },
      h("figcaption", {}, h("b", {}, this.options.title, h("span", { class: "unit" }, `  ${this.options.unit}`)), ...keys),
      this.svg);
    scrubbing(this.svg, axis, seek);
  }

  words() {
    const told = this.options.series.filter((one) => one.y.length).map((one) => {
      const low = num(Math.min(...one.y), this.options.decimals);
      const high = num(Math.max(...one.y), this.options.decimals);
      return `${one.name} from ${low} to ${high}`;
    });
    return `${this.options.title} in ${this.options.unit} over time: ${told.join("; ") || "nothing"}`;
  }

  range() {
    const { series, limits, least } = this.options;
    const every = series.flatMap((one) => [Math.min(...one.y, Infinity), Math.max(...one.y, -Infinity)]);
    let [low, high] = [Math.min(least[0], ...every), Math.max(least[1], ...every)];
    const reach = (high - low) * 1.35 || 1;
    for (const { at } of limits) {
      if (at > high && at - low < reach) high = at;
      if (at < low && high - at < reach) low = at;
    }
    const air = (high - low || 1) * 0.06;
    return [low < 0 || least[0] !== low ? low - air : low, high + air];
  }

  draw() {
    const width = this.svg.clientWidth || this.svg.parentElement.clientWidth;
    if (!width) return;
    const { height, series, limits } = this.options;
    const [low, high] = this.range();
    const px = (t) => this.axis.x(t, width);
    const py = (y) => height - ((y - low) / (high - low)) * height;
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.style.height = `${height}px`;
    const parts = [];
    for (const t of this.axis.marks(width).found) {
      parts.push(s("line", { class: "gridline", x1: px(t), x2: px(t), y1: 0, y2: height }));
    }
    const { found, decimals } = marks(low, high, height / 26);
    for (const y of found) {
      const at = py(y);
      if (at < 5 || at > height - 3) continue;
      parts.push(s("line", { class: y === 0 ? "zero" : "gridline", x1: EDGE.left, x2: width - EDGE.right, y1: at, y2: at }));
      parts.push(s("text", { x: EDGE.left - 6, y: at + 4, "text-anchor": "end" }, num(y, decimals)));
    }
    for (const { at, soft } of limits) {
      if (at >= low && at <= high) {
        const place = { x1: EDGE.left, x2: width - EDGE.right, y1: py(at), y2: py(at) };
        parts.push(s("line", { class: soft ? "limit soft" : "limit", ...place }));
      }
    }
    for (const one of series) {
      if (!one.t.length) continue;
      const path = linePath(one.t, one.y, px, py, one.stepped);
      if (one.fill) {
        const floor = py(Math.max(low, Math.min(high, 0)));
        const close = `L${px(one.t[one.t.length - 1]).toFixed(1)} ${floor}L${px(one.t[0]).toFixed(1)} ${floor}Z`;
        parts.push(s("path", { class: `area ${one.tone}`, d: path + close }));
      }
      parts.push(s("path", { class: `curve ${one.tone} ${one.thin ? "thin" : ""}`, d: path }));
    }
    this.cursor = s("line", { class: "cursor", y1: 0, y2: height });
    this.svg.replaceChildren(...parts, this.cursor);
    this.width = width;
  }

  at(t) {
    if (!this.cursor) return;
    const x = Math.round(this.axis.x(t, this.width)) + 0.5;
    this.cursor.setAttribute("x1", x);
    this.cursor.setAttribute("x2", x);
    this.options.series.forEach((one, i) => {
      this.outputs[i].textContent = num(valueAt(one.t, one.y, t, one.stepped), this.options.decimals);
    });
  }
}

/** The marks and numbers of the time axis. */
class TimeScale {
  constructor(axis, title) {
    this.axis = axis;
    this.svg = s("svg", { "aria-hidden": "true" });
    this.element = this.svg;
    this.title = title;
  }

  draw() {
    const width = this.svg.clientWidth || this.svg.parentElement.clientWidth;
    if (!width) return;
    const { found, decimals } = this.axis.marks(width);
    this.svg.setAttribute("viewBox", `0 0 ${width} 18`);
    this.svg.style.height = "18px";
    this.svg.replaceChildren(
      s("text", { x: 0, y: 13 }, this.title),
      ...found.map((t) => s("text", { x: this.axis.x(t, width), y: 13, "text-anchor": "middle" }, num(t, decimals))));
  }

  at() {}
}

/** Let a pointer on an element with the time axis move the moment that is shown. */
function scrubbing(svg, axis, seek) {
  const go = (event) => {
    const box = svg.getBoundingClientRect();
    seek(axis.t(event.clientX - box.left, box.width));
  };
  svg.addEventListener("pointerdown", (event) => {
    svg.setPointerCapture(event.pointerId);
    go(event);
  });
  svg.addEventListener("pointermove", (event) => {
    if (svg.hasPointerCapture(event.pointerId)) go(event);
  });
}

/** Bars side by side for each joint. options: title, note, words, labels [[position, text]], counts [[...]], unit. */
class Bars {
  constructor(options) {
    this.options = options;
    this.svg = s("svg", { role: "img", "aria-label": `${options.title}. ${options.words}` });
    const keys = options.counts.length > 1
      ? options.counts.map((_, j) => h("span", { class: `key c${(j % 4) + 1}` }, `joint ${j + 1} `)) : [];
    this.element = h("figure", {},
      h("figcaption", {}, h("b", {}, options.title), h("span", {}, options.note), " ", ...keys), this.svg);
  }

  draw() {
    const width = this.svg.clientWidth || this.svg.parentElement.clientWidth;
    if (!width) return;
    const height = 104;
    const foot = 18;
    const { counts, labels } = this.options;
    const bars = counts[0].length;
    const pace = (width - 4) / bars;
    const most = Math.max(1, ...counts.flat());
    const wide = Math.max(1, (pace * 0.86) / counts.length);
    const parts = [s("line", { class: "zero", x1: 0, x2: width, y1: height - foot + 0.5, y2: height - foot + 0.5 })];
    counts.forEach((row, j) => row.forEach((count, i) => {
      if (!count) return;
      const tall = Math.max(1.5, (count / most) * (height - foot - 14));
      const x = 2 + i * pace + pace * 0.07 + j * wide;
      parts.push(s("rect", { class: `bar c${(j % 4) + 1}`, x, y: height - foot - tall, width: wide, height: tall }));
    }));
    for (const [position, text] of labels) {
      const x = 2 + position * pace;
      const anchor = x < 18 ? "start" : x > width - 18 ? "end" : "middle";
      parts.push(s("text", { x, y: height - 4, "text-anchor": anchor }, text));
    }
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.style.height = `${height}px`;
    this.svg.replaceChildren(...parts);
  }
}
