// The workspace: forbidden regions, obstacles, the path, and the arm on it. In centimetres, y upwards.

/** Joint positions of a planar arm, base first; angles in degrees, each from the link before. */
function forward(arm, angles) {
  let [x, y] = arm.base_cm;
  let heading = 0;
  const points = [[x, y]];
  arm.link_lengths_cm.forEach((length, i) => {
    heading += (angles[i] * Math.PI) / 180;
    x += length * Math.cos(heading);
    y += length * Math.sin(heading);
    points.push([x, y]);
  });
  return points;
}

const placed = (points) => points.map(([x, y]) => `${x.toFixed(3)},${(-y).toFixed(3)}`).join(" ");
const paired = ([xs, ys]) => xs.map((x, i) => [x, ys[i]]);
const GHOSTS = 8;
const APART_CM = 0.15; // from here on planned and real arm are told apart by eye

class Workspace {
  constructor(record) {
    this.record = record;
    const { planned, real, arm } = record;
    this.tip = paired(planned.tip_cm);
    this.realTip = real ? paired(real.tip_cm) : [];
    this.strays = real !== null && Math.max(...real.tip_error_mm) > 10 * APART_CM;
    this.movers = []; // obstacles that move, with where they are when
    const box = this.box();
    this.svg = s("svg", { class: "map", viewBox: `${box.x} ${-box.y - box.h} ${box.w} ${box.h}`, role: "img", "aria-label": this.words() });
    this.wide = box.w;
    const thick = Math.max(arm.link_width_cm, box.w * 0.0055);
    this.done = s("polyline", { class: "way done c1" });
    this.realWay = s("polyline", { class: "way real off", points: this.strays ? placed(this.realTip) : "" });
    this.casing = s("polyline", { class: "casing", "stroke-width": thick + box.w * 0.004 });
    this.links = s("polyline", { class: "links", "stroke-width": thick });
    this.realLinks = s("polyline", { class: "links real", "stroke-width": thick * 0.55 });
    this.hinges = s("g", {});
    this.realHinges = s("g", {});
    this.svg.append(
      patterns(), s("g", {}, ...this.regions()), s("g", {}, ...this.mesh(box)), s("g", {}, ...this.obstacles()),
      s("g", {}, ...this.ghosts(thick)), ...this.routes(), this.realWay, this.done, this.casing, this.links, this.hinges,
      this.realLinks, this.realHinges, ...this.ends());
  }

  words() {
    const { map, obstacles, start_cm: from, goal_cm: to } = this.record;
    return `Workspace ${num(map.columns * map.cell_cm, 0)} by ${num(map.rows * map.cell_cm, 0)} centimetres with `
      + `${obstacles.length} obstacles; the end effector goes from (${from.map(short).join(", ")}) to (${to.map(short).join(", ")})`;
  }

  /** The map and every pose, with some air. */
  box() {
    const { map, planned, real, arm } = this.record;
    const half = map.cell_cm / 2;
    const xs = [map.x0_cm - half, map.x0_cm + map.columns * map.cell_cm - half, arm.base_cm[0]];
    const ys = [map.y0_cm - half, map.y0_cm + map.rows * map.cell_cm - half, arm.base_cm[1]];
    for (const curves of [planned, real]) {
      if (!curves) continue;
      for (let i = 0; i < curves.t_s.length; i += 9) {
        for (const [x, y] of forward(arm, curves.q_deg.map((q) => q[i]))) {
          xs.push(x);
          ys.push(y);
        }
      }
    }
    const air = (Math.max(...xs) - Math.min(...xs)) * 0.025;
    const [x, y] = [Math.min(...xs) - air, Math.min(...ys) - air * 1.9];
    return { x, y, w: Math.max(...xs) + air - x, h: Math.max(...ys) + air - y };
  }

  regions() {
    const { map } = this.record;
    const half = map.cell_cm / 2;
    return map.runs.flatMap((runs, code) => {
      if (code === 0 || !runs.length) return [];
      let path = "";
      for (let i = 0; i < runs.length; i += 3) {
        const x = map.x0_cm + runs[i + 1] * map.cell_cm - half;
        const y = -(map.y0_cm + runs[i] * map.cell_cm + half);
        path += `M${x.toFixed(3)} ${y.toFixed(3)}h${(runs[i + 2] * map.cell_cm).toFixed(3)}v${map.cell_cm}H${x.toFixed(3)}z`;
      }
      const marks = code === 3 ? "url(#hatch)" : code === 4 ? "url(#dots)" : null;
      return [s("path", { class: `region r${code}`, d: path }), marks ? s("path", { d: path, fill: marks }) : null];
    }).filter(Boolean);
  }

  mesh(box) {
    const { found } = marks(box.x, box.x + box.w, 10);
    const pace = found[1] - found[0];
    const parts = [];
    for (const x of found) {
      parts.push(s("line", { class: "mesh", x1: x, x2: x, y1: -box.y, y2: -box.y - box.h }));
      parts.push(s("text", { x, y: -box.y - box.w * 0.006, "text-anchor": "middle" }, num(x)));
    }
    for (let y = Math.ceil(box.y / pace) * pace; y < box.y + box.h; y += pace) {
      parts.push(s("line", { class: "mesh", x1: box.x, x2: box.x + box.w, y1: -y, y2: -y }));
      if (y > box.y + pace * 0.4) parts.push(s("text", { x: box.x + box.w * 0.005, y: -y - box.w * 0.004 }, num(y)));
    }
    return parts;
  }

  obstacles() {
    return this.record.obstacles.flatMap((one, i) => {
      const points = one.vertices_cm;
      const center = points ? [0, 1].map((k) => points.reduce((sum, p) => sum + p[k], 0) / points.length) : one.center_cm;
      const shape = points ? s("polygon", { class: "obstacle", points: placed(points) })
        : s("circle", { class: "obstacle", cx: center[0], cy: -center[1], r: one.radius_cm });
      const group = s("g", {}, shape, s("text", { class: "on", x: center[0], y: -center[1] }, i + 1));
      if (one.motion) this.movers.push([group, one.motion]);
      return group;
    });
  }

  ghosts(thick) {
    const { planned, arm } = this.record;
    const last = planned.t_s.length - 1;
    return Array.from({ length: GHOSTS + 1 }, (_, k) => {
      const i = Math.round((k * last) / GHOSTS);
      return s("polyline", { class: "ghost", "stroke-width": thick, points: placed(forward(arm, planned.q_deg.map((q) => q[i]))) });
    });
  }

  routes() {
    const corners = paired(this.record.path_cm);
    const dots = corners.length > 60 ? [] : corners.slice(1, -1).map(([x, y]) =>
      s("circle", { class: "point", cx: x, cy: -y, r: this.wide * 0.0033 }));
    return [s("polyline", { class: "way c1", points: placed(this.tip) }), ...dots];
  }

  ends() {
    const size = this.wide * 0.0085;
    const [[x, y], [gx, gy]] = [this.record.start_cm, this.record.goal_cm];
    return [
      s("circle", { class: "end", cx: x, cy: -y, r: size }),
      s("path", { class: "end goal", d: `M${gx} ${-gy - size * 1.3}l${size * 1.3} ${size * 1.3}l${-size * 1.3} ${size * 1.3}l${-size * 1.3} ${-size * 1.3}z` }),
    ];
  }

  /** What is in the picture, as a list. */
  legend() {
    const { map, real } = this.record;
    const swatch = (...shapes) => s("svg", { viewBox: "0 0 20 12", "aria-hidden": "true" }, ...shapes);
    const area = (code) => swatch(s("rect", { class: `region r${code}`, width: 20, height: 12, rx: 2, stroke: "var(--line)" }),
      code === 3 ? s("path", { d: "M2 12L12 0M9 12L19 0", style: "stroke:var(--blocked-mark);stroke-width:1.6" }) : null);
    const line = (name) => swatch(s("path", { class: name, d: "M1 6H19", style: "stroke-width:3" }));
    const when = this.movers.length ? " at time 0" : "";
    const items = map.names.flatMap((name, code) => (code && map.runs[code].length ? [[area(code), code === 3 ? name + when : name]] : []));
    items.unshift([line("links"), "arm as planned"], [line("way c1"), "path of the tip"]);
    if (real) items.splice(1, 0, [line("links real"), "arm as it was"]);
    items.push([swatch(s("circle", { class: "end", cx: 10, cy: 6, r: 4.2 })), "start"]);
    items.push([swatch(s("path", { class: "end goal", d: "M10 .6l5.4 5.4-5.4 5.4L4.6 6z" })), "goal"]);
    return h("ul", { class: "legend" }, ...items.map(([sign, name]) => h("li", {}, sign, name)));
  }

  draw() {
    this.svg.style.setProperty("--u", this.wide / (this.svg.clientWidth || this.wide));
  }

  at(t) {
    const { planned, real, arm } = this.record;
    const now = (curves) => curves.q_deg.map((q) => valueAt(curves.t_s, q, Math.min(Math.max(t, curves.t_s[0]), curves.t_s.at(-1))));
    for (const [group, { t_s: times, offset_cm: [dx, dy] }] of this.movers) {
      const at = Math.min(Math.max(t, times[0]), times.at(-1));
      group.setAttribute("transform", `translate(${valueAt(times, dx, at)} ${-valueAt(times, dy, at)})`);
    }
    const points = forward(arm, now(planned));
    this.show(points, this.links, this.hinges, "hinge");
    this.casing.setAttribute("points", placed(points));
    this.done.setAttribute("points", placed([...this.tip.slice(0, indexAt(planned.t_s, t) + 1), points.at(-1)]));
    if (real) this.show(forward(arm, now(real)), this.realLinks, this.realHinges, "hinge real");
    return { points, real: real ? forward(arm, now(real)) : null };
  }

  show(points, links, hinges, look) {
    links.setAttribute("points", placed(points));
    const r = this.wide * (look === "hinge" ? 0.0062 : 0.0042);
    const [bx, by] = points[0];
    hinges.replaceChildren(
      look === "hinge" ? s("rect", { class: "base", x: bx - r * 2, y: -by - r * 2, width: r * 4, height: r * 4, rx: r * 0.6 }) : "",
      ...points.slice(1).map(([x, y]) => s("circle", { class: look, cx: x, cy: -y, r })));
  }
}

function patterns() {
  return s("defs", {},
    s("pattern", { id: "hatch", width: 1.3, height: 1.3, patternUnits: "userSpaceOnUse", patternTransform: "rotate(40)" },
      s("line", { class: "hatch", x1: 0, x2: 0, y1: 0, y2: 1.3 })),
    s("pattern", { id: "dots", width: 1.4, height: 1.4, patternUnits: "userSpaceOnUse" },
      s("circle", { class: "dots", cx: 0.7, cy: 0.7, r: 0.14 })));
}
