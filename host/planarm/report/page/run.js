// The page of a run.

const TONES = ["c1", "c2", "c3", "c4"];
const joined = (list, decimals = 0) => list.map((one) => num(one, decimals)).join(" + ");

function heading(record) {
  const { verdict } = record;
  return h("header", { class: "top" },
    h("div", { class: "name" }, h("h1", {}, record.title), h("p", {}, `${record.planner}; ${record.held_back}.`)),
    h("div", { class: `verdict ${verdict.state}`, role: "status" }, glyph(verdict.state), h("div", {}, h("b", {}, verdict.word), h("span", {}, verdict.why))),
    themeButton());
}

function readouts(record) {
  const { summary, planned } = record;
  const known = (value, decimals, unit) => (value === null || value === undefined ? "–" : [num(value, decimals), h("span", { class: "unit" }, ` ${unit}`)]);
  const bound = summary.path_bound_cm ? `none shorter than ${num(summary.path_bound_cm, 3)} cm` : "";
  const entries = [
    ["Path of the tip", known(summary.path_length_cm, 3, "cm"), bound],
    ["Motion", known(summary.motion_s, 3, "s"), summary.motion_full_acceleration_s === undefined ? "" : `${num(summary.motion_full_acceleration_s, 3)} s with all acceleration`],
    ["Steps at the pins", summary.steps_at_pins ? joined(summary.steps_at_pins) : "–", `planned ${joined(summary.steps_planned)}`],
    ["Worst step", known(summary.max_step_timing_error_ticks, 0, "ticks"), summary.max_step_timing_error_ticks === null ? "other steps than planned" : "of 62.5 ns off its schedule"],
    ["Tip at the goal", known(summary.tip_error_mm, 3, "mm"), summary.tip_bound_mm === undefined ? "" : `by the steps; half a step allows ${num(summary.tip_bound_mm, 3)} mm`],
    ["Arm off the plan", known(summary.arm_max_tip_error_mm, 3, "mm"), summary.arm_max_tip_error_at_s === undefined ? "no arm was seen" : `largest, at ${num(summary.arm_max_tip_error_at_s, 3)} s`],
    ["Work of the joints", known(planned.work_mj.at(-1), 1, "mJ"), `motors heat with ${num(planned.copper_w, 1)} W`],
    ["On the line", known(summary.bytes_sent, 0, "bytes"), summary.retransmissions === undefined ? "" : `${num(summary.retransmissions)} sent again`],
  ];
  return h("dl", { class: "readouts" }, ...entries.map(([name, value, note]) =>
    h("div", {}, h("dt", {}, name), h("dd", {}, value, h("small", {}, note)))));
}

function timeAxis(record) {
  const { planned, real, pins, stream, events } = record;
  const ends = [planned.t_s.at(-1)];
  if (real) ends.push(real.t_s.at(-1));
  if (pins) ends.push(pins.t_s.at(-1));
  if (stream) ends.push(stream.t_s.at(-1));
  const early = events.filter((event) => event.severity !== "info").map((event) => event.t_s);
  return new TimeAxis(Math.max(-1, Math.min(0, ...early)), Math.max(...ends));
}

/** A series for each joint from rows of values. */
const perJoint = (t, rows, name, more = {}) => rows.map((y, j) => ({ name: name(j), tone: TONES[j % 4], t, y, ...more }));

function stripsOf(record, axis, seek) {
  const { planned, real, pins, limits, stream } = record;
  const t = planned.t_s;
  const both = (values) => values.flatMap((one) => [{ at: one }, { at: -one }]);
  const angles = perJoint(t, planned.q_deg, (j) => `θ${j + 1}`);
  if (real) angles.push(...perJoint(real.t_s, real.q_deg, (j) => `θ${j + 1} as it was`, { thin: true, keyless: true }));
  const share = limits.acceleration_share;
  const rates = pins ? perJoint(pins.t_s, pins.step_rate_hz, (j) => `${j + 1} at the pins`, { fill: true })
    : perJoint(t, planned.step_rate_hz, (j) => `${j + 1} planned`);
  const options = [
    { title: "Joint angle", unit: real ? "°, dotted: as it was" : "°", decimals: 2, series: angles, height: 92 },
    { title: "Joint speed", unit: "°/s", decimals: 1, series: perJoint(t, planned.speed_deg_s, (j) => `${j + 1}`), limits: both(limits.speed_deg_s) },
    { title: "Joint acceleration", unit: "°/s²", decimals: 0, series: perJoint(t, planned.acceleration_deg_s2, (j) => `${j + 1}`),
      limits: both(limits.acceleration_deg_s2.map((one) => share * one)).map((one) => ({ ...one, soft: true })) },
    { title: "Torque, share of the pull-out torque", unit: "%", decimals: 1, series: perJoint(t, planned.torque_percent, (j) => `${j + 1}`, { fill: true }),
      limits: [{ at: limits.torque_percent, soft: true }, { at: 100 }], least: [0, 10] },
    { title: "Step rate", unit: "steps/s", decimals: 0, series: rates },
    { title: "Energy", unit: "mJ", decimals: 1, series: [
      { name: "work of the joints", tone: "ink", t, y: planned.work_mj }, { name: "in motion", tone: "c3", t, y: planned.kinetic_mj, fill: true }], height: 62 },
  ];
  if (real) {
    options.splice(5, 0, { title: "Tip error, real against planned", unit: "mm", decimals: 3, height: 62,
      series: [{ name: "apart", tone: "real", t: real.t_s, y: real.tip_error_mm, fill: true }] });
  }
  if (stream) {
    options.push({ title: "Motion in the device's queue", unit: "ms", decimals: 0, height: 54,
      series: [{ name: "buffered", tone: "plain", t: stream.t_s, y: stream.buffered_ms, stepped: true, fill: true }] });
  }
  return options.map((one) => new Strip(one, axis, seek));
}

/** The poses at the moment that is shown: planned, real, and how far apart. */
class Pose {
  constructor(record) {
    this.record = record;
    const names = [...record.arm.link_lengths_cm.map((_, j) => [`θ${j + 1}`, "°"]), ["tip x", "cm"], ["tip y", "cm"]];
    const row = (name) => ({ name, cells: names.map(() => h("td", { class: "n" }, "–")) });
    this.rows = [row("planned"), ...(record.real ? [row("as it was"), row("apart")] : [])];
    this.element = h("div", { class: "pose" }, h("table", {},
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "at this moment"), ...names.map(([name, unit]) => h("th", { scope: "col", class: "n" }, `${name}, ${unit}`)))),
      h("tbody", {}, ...this.rows.map(({ name, cells }) => h("tr", {}, h("th", { scope: "row" }, name), ...cells)))));
  }

  at(t, { points, real }) {
    const { planned, real: curves } = this.record;
    const angles = (of) => of.q_deg.map((q) => valueAt(of.t_s, q, Math.min(Math.max(t, of.t_s[0]), of.t_s.at(-1))));
    const told = [[...angles(planned), ...points.at(-1)]];
    if (real) {
      told.push([...angles(curves), ...real.at(-1)]);
      told.push(told[1].map((one, i) => one - told[0][i]));
    }
    told.forEach((values, r) => values.forEach((value, c) => {
      this.rows[r].cells[c].textContent = num(value, r === 2 ? 3 : 2);
    }));
  }
}

function histograms(record) {
  const { errors, intervals, widths } = record.timing;
  const total = (counts) => counts.flat().reduce((sum, one) => sum + one, 0);
  const found = [];
  if (errors) {
    const n = errors.ticks.length;
    const off = total(errors.counts) - total(errors.counts.map((row) => row[(n - 1) / 2]));
    const note = off ? `${num(off)} of ${num(total(errors.counts))} steps off their tick` : `all ${num(total(errors.counts))} steps on their very tick`;
    found.push(new Bars({ title: "Steps off schedule, ticks", note, words: note, counts: errors.counts,
      labels: errors.ticks.map((tick, i) => [i + 0.5, num(tick)]).filter((_, i) => n < 9 || (i - (n - 1) / 2) % 4 === 0) }));
  }
  const edged = (title, of, word) => {
    const edges = of.edges_us;
    const note = `${num(total(of.counts))} ${word}, ${short(edges[0])} to ${short(edges.at(-1))} µs${of.log ? ", log scale" : ""}`;
    const labels = [0, 0.5, 1].map((share) => Math.round(share * (edges.length - 1))).map((i) => [i, short(Number(edges[i].toPrecision(3)))]);
    return new Bars({ title, note, words: note, counts: of.counts, labels });
  };
  if (intervals) found.push(edged("Intervals between steps, µs", intervals, "intervals"));
  if (widths) found.push(edged("STEP pulses high, µs", widths, "pulses"));
  return found;
}

function runPage(record) {
  const axis = timeAxis(record);
  const workspace = new Workspace(record);
  const pose = new Pose(record);
  const parts = [];
  const player = new Player(axis, (t) => {
    pose.at(t, workspace.at(t));
    for (const part of parts) part.at(t);
  });
  const seek = (t) => player.seek(t);
  parts.push(...stripsOf(record, axis, seek), new Lanes(record.events, axis, seek), new TimeScale(axis, "s"));
  const bars = histograms(record);
  document.getElementById("page").append(
    h("a", { class: "skip", href: "#bench" }, "to the motion"),
    heading(record),
    h("main", {}, readouts(record), h("div", { id: "bench", class: "bench" },
      h("div", { class: "left" },
        h("section", { class: "panel stage", "aria-label": "workspace" },
          h("h2", {}, "Workspace", h("small", {}, "cm; space plays, arrows step 10 ms, shift 100 ms, + and − change the speed")),
          workspace.svg, player.element, pose.element, workspace.legend()),
        h("section", { class: "panel", "aria-label": "step timing" }, h("h2", {}, "Step timing", h("small", {}, record.pins ? "from the edges at the pins" : "as planned; the pins were not seen")),
          h("div", { class: "histograms" }, ...bars.map((one) => one.element))),
        eventList(record.events, seek)),
      h("section", { class: "panel strips", "aria-label": "curves over time" },
        h("h2", {}, "Motion", h("small", {}, "drag anywhere to move the moment; dashed: limits")), ...parts.map((part) => part.element))),
    h("div", { class: "bottom" }, certificateTable(record.certificate), figuresTable(record.summary))),
    h("footer", {}, h("span", {}, `planarm ${record.planarm}, wire ${record.wire}`), h("span", {}, h("code", {}, `planarm run ${record.source}`)),
      h("span", {}, "This page is complete in itself: it loads nothing.")));
  const drawn = [workspace, ...parts, ...bars];
  const redraw = () => {
    for (const one of drawn) one.draw();
    player.seek(player.t);
  };
  const asked = new URLSearchParams(location.hash.slice(1)).get("t");
  player.t = asked === null ? Math.max(axis.from, 0) : Number(asked);
  new ResizeObserver(redraw).observe(document.getElementById("page"));
  redraw();
}

runPage(JSON.parse(document.getElementById("record").textContent));
