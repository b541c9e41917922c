// The run's events: lanes on the time axis that the strips share, and a list to read and to jump by.

const LANES = [["injected", "Injected"], ["line", "Link"], ["device", "Device"], ["arm", "Arm"]];
const STATES = { info: "info", warn: "amber", bad: "red" };
const LANE_HEIGHT = 17;
const STAYS = new Set(["ready", "idle"]);

/** Events of the device doing nothing are no news. */
const newsworthy = (event) => !(event.lane === "device" && STAYS.has(event.text));

class Lanes {
  constructor(events, axis, seek, lanes = LANES, title = "Events") {
    this.axis = axis;
    this.events = events;
    this.shown = lanes.filter(([lane]) => events.some((event) => event.lane === lane));
    const bad = events.filter((event) => event.severity !== "info").length;
    this.svg = s("svg", { class: "lanes", role: "img", "aria-label": `${title} over time: ${events.length}, of which ${bad} are out of the ordinary; the list below has them` });
    this.element = h("figure", { class: "strip" },
      h("figcaption", {}, h("b", {}, title), h("span", { class: "quiet" }, bad ? `${num(bad)} out of the ordinary` : "none out of the ordinary")), this.svg);
    scrubbing(this.svg, axis, seek);
  }

  draw() {
    const width = this.svg.clientWidth || this.svg.parentElement.clientWidth;
    if (!width) return;
    const height = Math.max(1, this.shown.length) * LANE_HEIGHT + 3;
    const parts = this.axis.marks(width).found.map((t) =>
      s("line", { class: "gridline", x1: this.axis.x(t, width), x2: this.axis.x(t, width), y1: 0, y2: height }));
    this.shown.forEach(([lane, name], row) => {
      const y = row * LANE_HEIGHT;
      parts.push(s("text", { class: "name", x: 0, y: y + 12 }, name));
      parts.push(s("line", { class: "gridline", x1: EDGE.left, x2: width - EDGE.right, y1: y + LANE_HEIGHT + 0.5, y2: y + LANE_HEIGHT + 0.5 }));
      for (const event of this.events.filter((one) => one.lane === lane)) parts.push(...this.mark(event, y, width));
    });
    this.cursor = s("line", { class: "cursor", y1: 0, y2: height });
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.style.height = `${height}px`;
    this.svg.replaceChildren(...parts, this.cursor);
    this.width = width;
  }

  mark(event, y, width) {
    const inside = (t) => Math.min(Math.max(this.axis.x(t, width), EDGE.left), width - EDGE.right);
    const x = inside(event.t_s);
    const tip = s("title", {}, `${num(event.t_s, 4)} s: ${event.text}`);
    if (event.until_s === undefined) {
      const half = event.severity === "info" ? 2.5 : 4;
      const shape = event.severity === "bad" ? `M${x} ${y + 8 - half}l${half} ${half}l${-half} ${half}l${-half} ${-half}z`
        : `M${x} ${y + 8 - half}l${half} ${2 * half}h${-2 * half}z`;
      return [s("path", { class: `tick ${event.severity}`, d: shape }, tip)];
    }
    const wide = Math.max(1.5, inside(event.until_s) - x);
    const bar = s("rect", { class: `span ${event.severity}`, x, y: y + 3, width: wide, height: LANE_HEIGHT - 6, rx: 2 }, tip);
    const words = wide > event.text.length * 6 + 8 && newsworthy(event) && event.severity === "info"
      ? s("text", { class: "lane", x: x + 5, y: y + 12 }, event.text) : null;
    return words ? [bar, words] : [bar];
  }

  at(t) {
    if (!this.cursor) return;
    const x = Math.round(this.axis.x(t, this.width)) + 0.5;
    this.cursor.setAttribute("x1", x);
    this.cursor.setAttribute("x2", x);
  }
}

/** Every event as a button that jumps to its moment. */
function eventList(events, seek) {
  const items = events.filter(newsworthy).map((event) => h("li", { class: event.severity },
    h("button", { type: "button", onclick: () => seek(event.t_s) },
      h("span", { class: "n" }, `${num(event.t_s, 3)} s`), h("span", {}, glyph(STATES[event.severity])), h("span", {}, event.text))));
  const bad = events.some((event) => event.severity !== "info");
  return h("section", { class: "panel", "aria-label": "events" },
    h("h2", {}, "Events", h("small", {}, bad ? "choose one to go to its moment" : "everything went as planned")),
    h("ol", { class: "events", tabindex: 0, "aria-label": "events in order of time" }, ...items));
}
