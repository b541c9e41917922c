// The page of a timing report: rates over the recording, findings on the same axis, and the joints' figures.

const TONES = ["c1", "c2", "c3", "c4"];

function timingEvents(record) {
  return record.findings.map((one) => ({
    t_s: one.time_s, lane: `joint ${one.joint}`, severity: "bad",
    text: record.words[one.kind] + (one.cause ? ` (${one.cause})` : ""),
  }));
}

function timingHeading(record) {
  const { verdict } = record;
  const clock = record.clock_ppm === null ? "judged by the driver's rules alone"
    : `board clock ${record.clock_ppm < 0 ? "−" : "+"}${num(Math.abs(record.clock_ppm), 1)} ppm, plan starts at ${num(record.start_s, 6)} s`;
  return h("header", { class: "top" },
    h("div", { class: "name" }, h("h1", {}, record.title), h("p", {}, `${clock}; resolution ${short(record.resolution_ns)} ns; off time beyond ${short(record.tolerance_us)} µs`)),
    h("div", { class: `verdict ${verdict.state}`, role: "status" }, glyph(verdict.state), h("div", {}, h("b", {}, verdict.word), h("span", {}, verdict.why))),
    themeButton());
}

function timingReadouts(record) {
  const total = Object.values(record.counts).reduce((sum, one) => sum + one, 0);
  const steps = record.joints.map((one) => num(one.steps)).join(" + ");
  const planned = record.joints.map((one) => (one.steps_planned === null ? null : num(one.steps_planned))).filter(Boolean);
  const least = (key) => Math.min(...record.joints.map((one) => one[key] ?? Infinity));
  const most = (key) => Math.max(...record.joints.map((one) => one[key]?.max_us ?? -Infinity));
  const us = (value) => (Number.isFinite(value) ? [num(value, 3), h("span", { class: "unit" }, " µs")] : "–");
  const entries = [
    ["Findings", num(total), total > record.findings.length ? `${num(record.findings.length)} of them listed` : "all listed"],
    ["Steps", steps, planned.length ? `planned ${planned.join(" + ")}` : "no plan given"],
    ["Recorded motion", [num(record.end_s - record.begin_s, 3), h("span", { class: "unit" }, " s")], `from ${num(record.begin_s, 4)} s`],
    ["Largest time error", us(most("timing_error")), "against the fitted clock"],
    ["Largest interval error", us(most("interval_error")), ""],
    ["Shortest pulse", us(least("high_min_us")), "STEP high"],
    ["Shortest DIR setup", us(least("dir_setup_min_us")), "before STEP"],
    ["Shortest interval", us(least("shortest_interval_us")), "between two steps"],
  ];
  return h("dl", { class: "readouts" }, ...entries.map(([name, value, note]) =>
    h("div", {}, h("dt", {}, name), h("dd", {}, value, h("small", {}, note)))));
}

function findingsTable(record, seek) {
  const us = (value) => (value === null ? "" : num(value, 3));
  const rows = record.findings.map((one) => h("tr", {},
    h("td", { class: "n" }, h("button", { type: "button", class: "jump", onclick: () => seek(one.time_s) }, `${num(one.time_s, 6)} s`)),
    h("td", { class: "n" }, one.joint),
    h("td", {}, record.words[one.kind], one.cause ? h("span", { class: "quiet" }, ` held up by ${one.cause}`) : null),
    h("td", { class: "n" }, us(one.value_us)), h("td", { class: "n" }, us(one.limit_us)),
    h("td", { class: "n" }, one.path_s === null ? "" : num(one.path_s, 6)),
    h("td", { class: "n" }, one.tip_cm ? one.tip_cm.map((x) => num(x, 2)).join(", ") : "")));
  const head = [["time", "n"], ["joint", "n"], ["finding", ""], ["measured µs", "n"], ["limit µs", "n"], ["path s", "n"], ["tip cm", "n"]];
  return h("section", { class: "panel", "aria-label": "findings" },
    h("h2", {}, "Findings", h("small", {}, rows.length ? "choose a time to see it on the curves" : "nothing is wrong")),
    rows.length ? h("div", { class: "scroll tall", tabindex: 0, role: "region", "aria-label": "table of findings" }, h("table", {},
      h("thead", {}, h("tr", {}, ...head.map(([name, look]) => h("th", { scope: "col", class: look }, name)))), h("tbody", {}, ...rows))) : null);
}

function jointsTable(record) {
  return h("section", { class: "panel", "aria-label": "figures of the joints" }, h("h2", {}, "Joints"),
    h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "table of the joints" }, h("table", {},
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "figure"), ...record.joints.map((one) => h("th", { scope: "col", class: "n" }, `joint ${one.joint}`)))),
      h("tbody", {}, ...record.rows.map(([name, cells]) => h("tr", {}, h("th", { scope: "row" }, name), ...cells.map((cell) => h("td", { class: "n" }, cell))))))));
}

function timingPage(record) {
  const axis = new TimeAxis(record.begin_s, Math.max(record.end_s, record.begin_s + 1e-6));
  const parts = [];
  let moment = record.begin_s;
  const seek = (t) => {
    moment = t;
    for (const part of parts) part.at(t);
  };
  const rates = record.joints.map((one, j) => ({ name: "steps/s", tone: TONES[j % 4], t: record.curve_times_s, y: one.rate_hz, fill: true, stepped: true }));
  parts.push(...rates.map((one, j) => new Strip({ title: `Joint ${record.joints[j].joint}, step rate`, unit: "steps/s", decimals: 0, height: 96, series: [one] }, axis, seek)));
  const lanes = record.joints.map((one) => [`joint ${one.joint}`, `Joint ${one.joint}`]);
  parts.push(new Lanes(timingEvents(record), axis, seek, lanes, "Findings"), new TimeScale(axis, "s"));
  document.getElementById("page").append(
    timingHeading(record),
    h("main", {}, timingReadouts(record),
      h("section", { class: "panel strips", "aria-label": "rates over time" }, h("h2", {}, "Recording", h("small", {}, "drag to move the moment")), ...parts.map((part) => part.element)),
      findingsTable(record, seek), jointsTable(record)),
    h("footer", {}, h("span", {}, `planarm ${record.planarm}`), h("span", {}, h("code", {}, record.source)), h("span", {}, "This page is complete in itself: it loads nothing.")));
  const redraw = () => {
    for (const part of parts) part.draw();
    seek(moment);
  };
  new ResizeObserver(redraw).observe(document.getElementById("page"));
  redraw();
}

timingPage(JSON.parse(document.getElementById("record").textContent));
