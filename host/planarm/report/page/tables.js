// The certificate and the figures as tables.

/** How much of its limit a check uses, 0 to 1; null where value and limit must be the same. */
function used(check) {
  const { value, limit, verdict } = check;
  if (value === limit) return null;
  const isMost = verdict === "red" ? value > limit : value <= limit; // a red one is beyond its limit, others within
  const [part, whole] = isMost ? [Math.abs(value), Math.abs(limit)] : [Math.abs(limit), Math.abs(value)];
  return whole > 0 ? Math.min(1, part / whole) : 1;
}

function certificateRow(check) {
  const share = used(check);
  const unit = check.unit ? ` ${check.unit}` : "";
  const bar = share === null ? h("span", { class: "quiet" }, "equal")
    : h("span", { class: `use ${check.verdict}`, role: "img", "aria-label": `${num(100 * share)} % of the limit` },
      h("i", { style: `width:${Math.max(2, 100 * share).toFixed(1)}%` }));
  const advice = check.verdict === "green" ? "" : check.setting;
  return h("tr", { class: check.verdict },
    h("td", { class: `mark ${check.verdict}` }, glyph(check.verdict), h("b", {}, ` ${WORDS[check.verdict]}`)),
    h("td", {}, check.name, h("span", { class: "code" }, check.code), h("span", { class: "sub" }, [`limit ${short(check.limit)}${unit}`, check.where, advice && `change ${advice}`].filter(Boolean).join("; "))),
    h("td", { class: "n" }, short(check.value), h("span", { class: "unit" }, unit)),
    h("td", { class: "n wide" }, short(check.limit)),
    h("td", { class: "wide" }, bar),
    h("td", { class: "wide quiet" }, check.where),
    h("td", { class: "wide" }, advice ? h("code", {}, advice) : ""));
}

function certificateTable(checks) {
  const order = { red: 0, amber: 1, green: 2 };
  const sorted = [...checks].sort((a, b) => order[a.verdict] - order[b.verdict] || (used(b) ?? -1) - (used(a) ?? -1));
  const counts = ["green", "amber", "red"].map((state) => {
    const count = checks.filter((check) => check.verdict === state).length;
    const words = { green: "hold", amber: "to look at", red: "fail" }[state];
    return h("span", { class: `mark ${state}` }, glyph(state), ` ${count} ${words}`);
  });
  return h("section", { class: "panel certificate", "aria-label": "certificate" },
    h("h2", {}, "Certificate", h("small", {}, `${checks.length} checks of the expanded segments, nearest to its limit first`), h("span", { class: "counts" }, ...counts)),
    h("div", { class: "scroll" }, h("table", {},
      h("thead", {}, h("tr", {},
        ...[["verdict", ""], ["check", ""], ["value", "n"], ["limit", "n wide"], ["of the limit", "wide"], ["where", "wide"], ["change", "wide"]]
          .map(([name, look]) => h("th", { scope: "col", class: look }, name)))),
      h("tbody", {}, ...sorted.map(certificateRow)))));
}

const UNITS = { cm: "cm", mm: "mm", s: "s", ms: "ms", us: "µs", hz: "Hz", ticks: "ticks", usteps: "micro-steps", bytes: "bytes", percent: "%" };

function figureText(value, unit) {
  if (value === null || value === undefined) return "not measured";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (Array.isArray(value) && !value.length) return "none";
  if (Array.isArray(value)) return value.map((one) => (typeof one === "object" ? Object.values(one).map(short).join(" ") : short(one))).join(" / ") + unit;
  return short(value) + unit;
}

function figuresTable(summary) {
  const skipped = new Set(["scene", "binding_limits", "error"]);
  const rows = Object.entries(summary).filter(([key]) => !skipped.has(key)).map(([key, value]) => {
    const words = key.split("_");
    const unit = words.length > 1 && UNITS[words.at(-1)];
    return h("tr", {}, h("th", { scope: "row" }, (unit ? words.slice(0, -1) : words).join(" ")), h("td", {}, figureText(value, unit ? ` ${unit}` : "")));
  });
  return h("section", { class: "panel figures", "aria-label": "figures" },
    h("h2", {}, "All figures", h("small", {}, "as in summary.json")), h("table", {}, h("tbody", {}, ...rows)));
}
