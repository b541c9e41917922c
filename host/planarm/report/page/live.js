// A run while it goes on: the arm by the device's ledger, what is queued, what is left, and orders.

const EVERY_MS = 100;
const OFFERED = { hold: ["running"], resume: ["holding", "held"], stop: ["running", "holding", "held", "starved"] };

class LivePage {
  constructor(record) {
    this.record = record;
    this.workspace = new Workspace({ ...record, real: null });
    this.now = h("p", { class: "now", role: "status" }, "waiting for the start");
    this.why = h("p", { class: "quiet" }, "");
    this.share = h("progress", { max: 1, value: 0, "aria-label": "share of the motion that is done" });
    this.cells = ["left", "queued", "segments", "sent again"].map((name) => [name, h("dd", {}, "–")]);
    const axis = new TimeAxis(0, Math.max(record.total_s, 1e-3));
    this.queue = { t: [], y: [] };
    this.strip = new Strip({ title: "Motion in the device's queue", unit: "ms, over path time", decimals: 0, height: 90,
      series: [{ name: "queued", tone: "c1", t: this.queue.t, y: this.queue.y, stepped: true, fill: true }], least: [0, 50] }, axis, () => {});
    this.buttons = Object.fromEntries([["start", "Start"], ["hold", "Hold"], ["resume", "Resume"], ["stop", "Stop"]].map(([word, name]) =>
      [word, h("button", { type: "button", class: word, onclick: () => this.order(word) }, name)]));
    this.percent = h("output", {}, "100 %");
    this.rate = h("input", { type: "range", min: 5, max: 100, step: 5, value: 100, "aria-label": "speed on the path, per cent of the plan",
      oninput: () => { this.percent.textContent = `${this.rate.value} %`; }, onchange: () => this.order("override", Number(this.rate.value)) });
  }

  show() {
    const { record } = this;
    document.getElementById("page").append(
      h("header", { class: "top" }, h("div", { class: "name" }, h("h1", {}, record.title), h("p", {}, record.planner)), themeButton()),
      h("main", {}, h("div", { class: "live" },
        h("section", { class: "panel stage", "aria-label": "workspace" }, h("h2", {}, "Workspace", h("small", {}, "black: the plan at this path time; coloured: the arm by the device's own count")), this.workspace.svg),
        h("div", { class: "side" },
          h("section", { class: "panel", "aria-label": "state" }, this.now, this.why, this.share),
          h("section", { class: "panel orders", "aria-label": "orders" }, ...Object.values(this.buttons), h("label", {}, "Speed", this.rate, this.percent)),
          h("dl", { class: "readouts" }, ...this.cells.map(([name, cell]) => h("div", {}, h("dt", {}, name), cell))),
          h("section", { class: "panel", "aria-label": "queue" }, this.strip.element)))),
      h("footer", {}, h("span", {}, "On this computer alone. A real emergency stop cuts the motors' supply.")));
    const redraw = () => { this.workspace.draw(); this.strip.draw(); };
    new ResizeObserver(redraw).observe(document.getElementById("page"));
    redraw();
    this.follow();
  }

  async order(word, percent = 100) {
    await fetch("order", { method: "POST", body: JSON.stringify({ order: word, percent }) });
  }

  async follow() {
    const answer = await fetch("state").catch(() => null);
    if (answer === null) {
      this.now.textContent = this.over ? this.now.textContent : "planarm has gone";
      return;
    }
    const state = await answer.json();
    this.take(state);
    this.over = state.over;
    if (!state.over) setTimeout(() => this.follow(), EVERY_MS);
  }

  take(state) {
    if (this.now.textContent !== state.state) this.now.textContent = state.state; // else a reader would hear it again
    this.now.className = `now ${state.over && state.state !== "done" ? "failed" : state.state}`;
    this.why.textContent = state.why ?? "";
    this.share.value = state.total_s ? state.path_s / state.total_s : 0;
    const values = [[state.remaining_s, 2, "s"], [state.buffered_ms, 0, "ms"], [state.executed_segments, 0, `of ${num(state.total_segments)}`], [state.retransmissions, 0, "frames"]];
    this.cells.forEach(([, cell], i) => {
      const [value, decimals, unit] = values[i];
      cell.replaceChildren(num(value, decimals), h("span", { class: "unit" }, value === undefined ? "" : ` ${unit}`));
    });
    const waiting = state.state === "waiting for the start";
    for (const [word, button] of Object.entries(this.buttons)) {
      button.disabled = state.over || (word === "start" ? !waiting : !OFFERED[word].includes(state.state));
    }
    this.rate.disabled = state.over || waiting;
    this.workspace.at(state.path_s ?? 0);
    this.workspace.show(forward(this.record.arm, state.q_deg), this.workspace.realLinks, this.workspace.realHinges, "hinge real");
    if (state.buffered_ms !== undefined && this.queue.t.at(-1) !== state.path_s) {
      this.queue.t.push(state.path_s);
      this.queue.y.push(state.buffered_ms);
      this.strip.draw();
      this.strip.at(state.path_s);
    }
  }
}

new LivePage(JSON.parse(document.getElementById("record").textContent)).show();
