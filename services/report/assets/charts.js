// Charts of the selected candidate over its stations, with one crosshair through all of them.

const LEFT = 46;
const RIGHT = 10;
const TOP = 8;
const AXIS = 19;
const RIBBON = 24;

const series = (plan, name) => plan.columns[name];

const CHARTS = [
  {
    name: "Speed", unit: "m/s", height: 214, ribbon: true,
    range: (plan) => [0, Math.max(span(series(plan, "speed"))[1], Math.min(span(series(plan, "speed_bound"))[1], 1.15 * (data.limits.speed ?? 1e9))) * 1.06],
    keys: [
      { word: "speed", look: "line ink", value: (plan, k) => number(plan.columns.speed[k], 2, "m/s") },
      { word: "bound", look: "bound", value: (plan, k) => number(plan.columns.speed_bound[k], 2, "m/s") },
    ],
    draw: drawSpeed,
    dots: [["speed", "ink"]],
  },
  {
    name: "Emergency stop", unit: "m ahead", height: 118,
    range: (plan) => {
      const longest = Math.max(span(series(plan, "stop_distance"))[1], 0.5);
      return [0, Math.min(2.4 * longest, Math.max(1.08 * longest, 1.02 * (plan.clear ?? Infinity)))];
    },
    keys: [
      { word: "stop", look: "line stop", value: (plan, k) => number(plan.columns.stop_distance[k], 2, "m") },
      { word: "clear way", look: "line clear", value: (plan, k) => (clearAhead(plan, k) < 0 ? "–" : number(clearAhead(plan, k), 2, "m")) },
      { word: "margin", look: "", value: (plan, k) => (plan.columns.speed[k] > 0 ? number(marginAt(plan, k), 2, "m") : "–") },
    ],
    draw: drawStop,
    dots: [["stop_distance", "stop"]],
  },
  {
    name: "Load in that stop", unit: "% of level static", height: 112,
    range: (plan) => {
      const [low, high] = span([...series(plan, "rear_load"), ...series(plan, "side_load")]);
      return [Math.min(0, 100 * low), Math.max(100 * high, 60) * 1.04];
    },
    keys: [
      { word: "rear axle", look: "line first", value: (plan, k) => number(percent(plan.columns.rear_load[k]), 0, "%") },
      { word: "lighter side", look: "line second dashed", value: (plan, k) => number(percent(plan.columns.side_load[k]), 0, "%") },
      { word: "least allowed", look: "limit", value: () => number(percent(data.limits.min_load), 0, "%") },
    ],
    draw: drawLoads,
    dots: [["rear_load", "first", percent], ["side_load", "second", percent]],
  },
  {
    name: "Acceleration", unit: "m/s²", height: 104,
    range: (plan) => {
      const [low, high] = span(series(plan, "accel"));
      const { accel, decel } = data.limits;
      return [Math.min(low, -(decel ?? 0)) * 1.12, Math.max(high, accel ?? 0) * 1.18];
    },
    keys: [
      { word: "acceleration", look: "line ink", value: (plan, k) => number(plan.columns.accel[k], 2, "m/s²") },
      { word: "limits of the plan", look: "limit", value: () => "" },
    ],
    draw: drawAccel,
    dots: [["accel", "ink"]],
  },
  {
    name: "Grade and roll", unit: "°", height: 112,
    range: (plan) => {
      const [low, high] = span([...series(plan, "grade"), ...series(plan, "roll")].map(degrees));
      const pad = Math.max(0.08 * (high - low), 0.8);
      return [Math.min(low, -1) - pad, Math.max(high, 1) + pad];
    },
    keys: [
      { word: "grade, uphill +", look: "line first", value: (plan, k) => number(degrees(plan.columns.grade[k]), 1, "°") },
      { word: "roll, left up +", look: "line second dashed", value: (plan, k) => number(degrees(plan.columns.roll[k]), 1, "°") },
      { word: "trained", look: "limit", value: () => "" },
    ],
    draw: drawSlope,
    dots: [["grade", "first", degrees], ["roll", "second", degrees]],
  },
  {
    name: "Height of the ground", unit: "m", height: 92, last: true,
    range: (plan) => {
      const [low, high] = span(series(plan, "z"));
      const pad = Math.max(0.1 * (high - low), 0.1);
      return [low - pad, high + pad];
    },
    keys: [{ word: "height", look: "line ink", value: (plan, k) => number(plan.columns.z[k], 2, "m") }],
    draw: drawHeight,
    dots: [["z", "ink"]],
  },
];

const drawn = [];

function drawCharts() {
  const host = element("charts");
  const plan = plans[state.selected];
  const style = getComputedStyle(host);
  const width = Math.max(host.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight), 200);
  drawn.length = 0;
  host.replaceChildren(...CHARTS.map((chart) => drawChart(chart, plan, width)));
  moveCross();
}

function drawChart(chart, plan, width) {
  const ribbon = chart.ribbon ? RIBBON : 0;
  const height = chart.height + ribbon + TOP + AXIS;
  const stations = plan.columns.station;
  const [low, high] = chart.range(plan);
  const end = Math.max(stations.at(-1), 1e-3);
  const plot = {
    plan, end, low, high, ribbon,
    right: width - RIGHT,
    floor: TOP + chart.height,
    x: (station) => LEFT + (station / end) * (width - LEFT - RIGHT),
    y: (value) => TOP + (1 - (value - low) / (high - low)) * chart.height,
  };
  const svg = draw("svg", { class: "plot", viewBox: `0 0 ${width} ${height}`, height, "aria-hidden": "true" });
  plot.svg = svg;
  drawAxes(plot, chart, width);
  const clip = `clip-${CHARTS.indexOf(chart)}`;
  svg.append(draw("clipPath", { id: clip }, draw("rect", { x: LEFT - 2, y: TOP - 2, width: width - LEFT - RIGHT + 4, height: chart.height + 4 })));
  plot.inside = draw("g", { "clip-path": `url(#${clip})` });
  svg.append(plot.inside);
  chart.draw(plot);
  drawIdle(plot, chart.ribbon);
  const cross = draw("line", { class: "cross", y1: TOP, y2: plot.floor + ribbon });
  const dots = chart.dots.map(([, colour]) => draw("circle", { class: `dot ${colour}`, r: 4 }));
  svg.append(cross, ...dots);
  const keys = chart.keys.map((key) => {
    const value = make("b");
    const node = make("span", { class: "key" }, ...(key.look ? [keyLine(key.look)] : []), key.word, value);
    return { key, value, node };
  });
  const caption = make("figcaption", {},
    make("span", { class: "name" }, chart.name, " ", make("small", {}, `[${chart.unit}]`)),
    make("span", { class: "keys" }, ...keys.map(({ node }) => node)));
  const figure = make("figure", { class: "chart" }, caption, svg);
  if (chart.ribbon) figure.append(ribbonKeys(plan));
  follow(svg, plot, width);
  drawn.push({ chart, plot, cross, dots, keys });
  return figure;
}

function keyLine(look) {
  const dashed = look.includes("dashed") ? { "stroke-dasharray": "6 3" } : {};
  return draw("svg", { width: 18, height: 8, "aria-hidden": "true" }, draw("path", { d: "M1 4H17", class: look, ...dashed }));
}

function drawAxes(plot, chart, width) {
  const { svg, low, high, floor, ribbon, end } = plot;
  const rows = ticks(low, high, Math.max(Math.round(chart.height / 32), 2));
  const step = rows.length > 1 ? rows[1] - rows[0] : 1;
  for (const value of rows) {
    const y = plot.y(value);
    svg.append(draw("line", { class: Math.abs(value) < 1e-9 ? "zero" : "grid", x1: LEFT, x2: plot.right, y1: y, y2: y }));
    svg.append(draw("text", { x: LEFT - 7, y: y + 4, "text-anchor": "end" }, tickText(value, step)));
  }
  const columns = ticks(0, end, Math.max(Math.round(width / 80), 3));
  const pace = columns.length > 1 ? columns[1] - columns[0] : 1;
  for (const value of columns) {
    const x = plot.x(value);
    svg.append(draw("line", { class: "grid", x1: x, x2: x, y1: TOP, y2: floor }));
    const anchor = x > plot.right - 22 ? "end" : "middle";
    svg.append(draw("text", { x: anchor === "end" ? plot.right : x, y: floor + ribbon + 14, "text-anchor": anchor }, value === 0 ? "0 m" : tickText(value, pace)));
  }
}

// A path through (station, value); gaps where there is no value.
function pathOf(plot, stations, values) {
  let text = "";
  let on = false;
  stations.forEach((station, k) => {
    const value = values[k];
    if (value === null || value === undefined || !Number.isFinite(value)) { on = false; return; }
    text += `${on ? "L" : "M"}${plot.x(station).toFixed(1)} ${plot.y(value).toFixed(1)}`;
    on = true;
  });
  return text;
}

const addPath = (plot, d, look, extra = {}) => plot.inside.append(draw("path", { d, class: look, ...extra }));

// v² is linear between stations: points in between, so that the curve is the plan's.
function fine(stations, values) {
  const pieces = stations.length > 800 ? 1 : 4;
  const at = [];
  const speed = [];
  for (let k = 0; k + 1 < stations.length; k += 1) {
    const [a, b] = [values[k], values[k + 1]];
    for (let i = 0; i < pieces; i += 1) {
      const share = i / pieces;
      at.push(stations[k] + share * (stations[k + 1] - stations[k]));
      speed.push(a === null || b === null ? (i ? null : a) : Math.sqrt(a * a + share * (b * b - a * a)));
    }
  }
  at.push(stations.at(-1));
  speed.push(values.at(-1));
  return { at, speed, pieces };
}

// Stretches with one limit: {from, to, code}, from station to station; a new one where it rests.
function runs(plan) {
  const { station, limiting } = plan.columns;
  const rest = restOf(plan);
  const found = [];
  for (let k = 0; k + 1 < station.length; k += 1) {
    const before = found.at(-1);
    if (before && before.code === limiting[k] && k !== rest) before.to = k + 1;
    else found.push({ from: k, to: k + 1, code: limiting[k] });
  }
  return found;
}

function drawSpeed(plot) {
  const { plan } = plot;
  const { station, speed, speed_bound: bound } = plan.columns;
  const { at, speed: v, pieces } = fine(station, speed);
  const limits = runs(plan);
  for (const run of limits) {
    const [a, b] = [run.from * pieces, run.to * pieces + 1];
    const line = pathOf(plot, at.slice(a, b), v.slice(a, b));
    if (!line) continue;
    const colour = `var(--${data.limiting[run.code].key})`;
    const area = `${line}L${plot.x(station[run.to]).toFixed(1)} ${plot.floor}L${plot.x(station[run.from]).toFixed(1)} ${plot.floor}Z`;
    addPath(plot, area, "area", { style: `fill:${colour};opacity:.17` });
    if (run.from < restOf(plan)) addPath(plot, line, "line", { style: `stroke:${colour};stroke-width:6.5;stroke-linecap:butt` });
  }
  for (const one of plan.bounds) {
    const key = data.limiting[one.code];
    const line = draw("path", { d: pathOf(plot, station, one.speed), class: "each", style: `stroke:var(--${key.key})` });
    line.append(draw("title", {}, `${key.word} by itself: ${key.meaning}`));
    plot.inside.append(line);
  }
  addPath(plot, pathOf(plot, station, bound), "bound");
  const driven = restOf(plan) * pieces + 1;
  addPath(plot, pathOf(plot, at.slice(0, driven), v.slice(0, driven)), "line ink", { style: "stroke-width:1.7" });
  drawClearMark(plot);
  drawRibbon(plot, limits);
}

function drawClearMark(plot) {
  const { plan } = plot;
  if (!clearEndsBefore(plan)) return;
  const x = plot.x(plan.clear);
  plot.svg.append(draw("line", { class: "clear-mark", x1: x, x2: x, y1: TOP, y2: plot.floor }));
  const left = x > plot.right - 150; // beyond it nothing is driven: room for words
  plot.svg.append(draw("text", { class: "clear-text", x: x + (left ? -6 : 6), y: left ? plot.floor - 10 : TOP + 12, "text-anchor": left ? "end" : "start" }, `clear distance ${number(plan.clear, 2, "m")}`));
}

function drawRibbon(plot, limits) {
  const { plan, floor } = plot;
  const { station } = plan.columns;
  const rest = restOf(plan);
  const group = draw("g", { class: "ribbon" });
  for (const run of limits) {
    const what = data.limiting[run.code];
    const [a, b] = [plot.x(station[run.from]), plot.x(station[run.to])];
    const box = draw("rect", { x: a, y: floor + 4, width: Math.max(b - a, 0.8), height: RIBBON - 6, rx: 2, style: `fill:var(--${what.key})`, class: run.from >= rest ? "behind" : "" });
    box.append(draw("title", {}, `${what.word}: ${what.meaning}`));
    group.append(box);
    if (b - a > 7.2 * what.word.length + 8) {
      group.append(draw("text", { x: (a + b) / 2, y: floor + RIBBON - 7, "text-anchor": "middle", class: run.from >= rest ? "behind" : what.dark ? "dark" : "" }, what.word));
    }
  }
  plot.svg.append(group);
}

// What limits on which share of the driven way, most first.
function shares(plan) {
  const rest = restOf(plan);
  const { station, limiting } = plan.columns;
  const lengths = new Map();
  for (let k = 0; k < rest; k += 1) lengths.set(limiting[k], (lengths.get(limiting[k]) ?? 0) + station[k + 1] - station[k]);
  return [...lengths].sort((a, b) => b[1] - a[1]).map(([code, length]) => ({ code, share: length / station[rest] }));
}

function ribbonKeys(plan) {
  const keys = shares(plan).map(({ code, share }) => {
    const what = data.limiting[code];
    return make("span", { class: "item", title: what.meaning }, swatch(what), `${what.word} ${number(100 * share, 0, "%")}`);
  });
  const top = CHARTS[0].range(plan)[1];
  const shown = plan.bounds.filter(({ speed }) => speed.some((value) => value !== null && value < top));
  const curves = shown.map(({ code }) => make("span", { class: "item", title: data.limiting[code].meaning }, dash(data.limiting[code]), data.limiting[code].word));
  const limited = make("div", { class: "legend ribbon-keys" }, "limited by", ...keys);
  return make("div", {}, limited, make("div", { class: "legend ribbon-keys" }, "each bound by itself", ...curves));
}

function dash(what) {
  const box = draw("svg", { class: "dash", width: 22, height: 8, "aria-hidden": "true" });
  box.append(draw("line", { x1: 0, x2: 22, y1: 4, y2: 4, class: "each", style: `stroke:var(--${what.key})` }));
  return box;
}

// What lies beyond the stop is not driven.
function drawIdle(plot, named) {
  const { plan } = plot;
  const from = plan.columns.station[restOf(plan)];
  if (from >= plot.end - 1e-3) return;
  const x = plot.x(from);
  plot.svg.append(draw("rect", { x, y: TOP, width: plot.right - x, height: plot.floor - TOP, fill: "url(#not-driven)" }));
  if (named && plot.right - x > 76) plot.svg.append(draw("text", { class: "idle", x: (x + plot.right) / 2, y: (TOP + plot.floor) / 2, "text-anchor": "middle" }, "not driven"));
}

const upTo = (plan, values) => values.slice(0, restOf(plan) + 1);
const whileMoving = (plan, values) => values.map((value, k) => (plan.columns.speed[k] > 0 ? value : null));

function drawStop(plot) {
  const { plan } = plot;
  const station = upTo(plan, plan.columns.station);
  const stop = upTo(plan, plan.columns.stop_distance);
  const line = pathOf(plot, station, stop);
  if (line) addPath(plot, `${line}L${plot.x(station.at(-1)).toFixed(1)} ${plot.floor}L${plot.x(0)} ${plot.floor}Z`, "area stop");
  if (plan.clear !== null) {
    const ahead = station.map((s) => plan.clear - s);
    const over = station.map((_, k) => (stop[k] > ahead[k] ? k : -1)).filter((k) => k >= 0);
    if (plan.status === "infeasible" && over.length > 1) {
      const upper = pathOf(plot, over.map((k) => station[k]), over.map((k) => stop[k]));
      const lower = pathOf(plot, over.map((k) => station[k]).reverse(), over.map((k) => Math.max(ahead[k], 0)).reverse());
      addPath(plot, `${upper}${lower.replace("M", "L")}Z`, "area over");
    }
    addPath(plot, pathOf(plot, [0, plan.clear], [plan.clear, 0]), "line clear");
  }
  addPath(plot, line, "line stop");
}

function drawLoads(plot) {
  const { plan } = plot;
  const least = percent(data.limits.min_load);
  if (least !== null) {
    const y = plot.y(least);
    plot.inside.append(draw("rect", { class: "area low", x: LEFT, y, width: plot.right - LEFT, height: Math.max(plot.floor - y, 0) }));
    addPath(plot, `M${LEFT} ${y}H${plot.right}`, "limit");
  }
  const { station, side_load: side, rear_load: rear } = plan.columns;
  addPath(plot, pathOf(plot, station, whileMoving(plan, side).map(percent)), "line second", { "stroke-dasharray": "7 4" });
  addPath(plot, pathOf(plot, station, whileMoving(plan, rear).map(percent)), "line first");
}

function drawAccel(plot) {
  const { plan } = plot;
  const { accel, decel } = data.limits;
  for (const value of [accel, decel === null ? null : -decel]) {
    if (value !== null) addPath(plot, `M${LEFT} ${plot.y(value)}H${plot.right}`, "limit");
  }
  // It holds from its station to the next.
  const station = upTo(plan, plan.columns.station);
  const held = plan.columns.accel;
  let line = "";
  for (let k = 0; k + 1 < station.length; k += 1) {
    if (held[k] === null) continue;
    line += `${line ? "L" : "M"}${plot.x(station[k]).toFixed(1)} ${plot.y(held[k]).toFixed(1)}H${plot.x(station[k + 1]).toFixed(1)}`;
  }
  addPath(plot, line, "line ink");
}

function drawSlope(plot) {
  const { plan } = plot;
  for (const value of data.limits.grade_range.map(degrees)) {
    if (value !== null && value > plot.low && value < plot.high) addPath(plot, `M${LEFT} ${plot.y(value)}H${plot.right}`, "limit");
  }
  const { station, roll, grade } = plan.columns;
  addPath(plot, pathOf(plot, station, roll.map(degrees)), "line second", { "stroke-dasharray": "7 4" });
  addPath(plot, pathOf(plot, station, grade.map(degrees)), "line first");
}

function drawHeight(plot) {
  const { station, z } = plot.plan.columns;
  const line = pathOf(plot, station, z);
  if (line) addPath(plot, `${line}L${plot.right} ${plot.floor}L${LEFT} ${plot.floor}Z`, "area earth");
  addPath(plot, line, "line ink");
}

function follow(svg, plot, width) {
  const point = (event) => {
    const box = svg.getBoundingClientRect();
    const x = ((event.clientX - box.left) * width) / box.width;
    moveCursor(nearestStation(plot.plan, ((x - LEFT) / (width - LEFT - RIGHT)) * plot.end));
  };
  svg.addEventListener("pointermove", point);
  svg.addEventListener("pointerdown", point);
}

function moveCross() {
  const k = state.cursor;
  for (const { chart, plot, cross, dots, keys } of drawn) {
    const { plan } = plot;
    const x = plot.x(plan.columns.station[k]);
    cross.setAttribute("x1", x);
    cross.setAttribute("x2", x);
    chart.dots.forEach(([name, , change], i) => {
      const value = plan.columns[name][k];
      const shown = value !== null && (change ? change(value) : value);
      const inside = shown !== false && shown >= plot.low && shown <= plot.high;
      dots[i].style.display = inside ? "" : "none";
      if (inside) {
        dots[i].setAttribute("cx", x);
        dots[i].setAttribute("cy", plot.y(shown));
      }
    });
    keys.forEach(({ key, value }) => { value.textContent = key.value(plan, k); });
  }
}

function startCharts() {
  const host = element("charts");
  let width = 0;
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    drawCharts();
  }).observe(host);
  when("select", drawCharts);
  when("cursor", moveCross);
  host.addEventListener("keydown", (event) => {
    const last = plans[state.selected].columns.station.length - 1;
    const pace = event.shiftKey ? 10 : 1;
    const to = {
      ArrowRight: state.cursor + pace, ArrowUp: state.cursor + pace, ArrowLeft: state.cursor - pace, ArrowDown: state.cursor - pace,
      PageUp: state.cursor + 10, PageDown: state.cursor - 10, Home: 0, End: last,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    moveCursor(to);
  });
}
