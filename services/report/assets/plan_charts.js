// Charts of the selected candidate over its stations, with one cursor through all of them.

const LIMIT = { colour: "soft", width: 1.3, dash: [5, 4] };
const constant = (plan, value) => plan.columns.station.map(() => value);
const upToRest = (plan, values) => values.slice(0, restOf(plan) + 1).concat(values.slice(restOf(plan) + 1).fill(null));
const whileMoving = (plan, values) => values.map((value, k) => (plan.columns.speed[k] > 0 ? value : null));

// Each: name, unit, height of the plot, range of y, curves, and keys without a curve.
const CHARTS = [
  {
    name: "Speed", unit: "m/s", height: 240, hasRibbon: true, isFine: true,
    range: ({ columns }) => [0, Math.max(span(columns.speed)[1], Math.min(span(columns.speed_bound)[1], 1.15 * (data.limits.speed ?? 1e9))) * 1.06],
    curves: (plan) => [
      { label: "speed", colour: "ink", width: 1.7, hasCursor: true, values: upToRest(plan, plan.columns.speed), text: (k) => number(plan.columns.speed[k], 2, "m/s") },
      { label: "bound", colour: "faint", width: 1.6, dash: [2, 3], values: plan.columns.speed_bound, text: (k) => number(plan.columns.speed_bound[k], 2, "m/s") },
      ...plan.bounds.map((bound) => ({ colour: data.limiting[bound.code].key, width: 1.3, dash: [7, 2, 1.5, 2], values: bound.speed })),
    ],
    under: (plot, plan) => paintLimits(plot, plan),
    over: (plot, plan) => { paintClearMark(plot, plan); paintRibbon(plot, limitRuns(plan)); },
  },
  {
    name: "Emergency stop", unit: "m ahead", height: 144,
    range: (plan) => {
      const longest = Math.max(span(plan.columns.stop_distance)[1], 0.5);
      return [0, Math.min(2.4 * longest, Math.max(1.08 * longest, 1.02 * (plan.clear ?? Infinity)))];
    },
    curves: (plan) => {
      const stop = upToRest(plan, plan.columns.stop_distance);
      const ahead = plan.columns.station.map((_, k) => clearAhead(plan, k));
      const isOver = (k) => plan.status === "infeasible" && stop[k] !== null && ahead[k] !== null && stop[k] > ahead[k];
      return [
        { label: "stop", colour: "stop", fill: 0.2, hasCursor: true, values: stop, text: (k) => number(plan.columns.stop_distance[k], 2, "m") },
        { label: "clear way", colour: "clear", values: ahead.map((value) => (value < 0 ? null : value)), text: (k) => (ahead[k] < 0 ? "–" : number(ahead[k], 2, "m")) },
        { label: "margin", values: constant(plan, null), text: (k) => (plan.columns.speed[k] > 0 ? number(marginAt(plan, k), 2, "m") : "–") },
        { values: stop.map((value, k) => (isOver(k) ? value : null)) },
        { values: ahead.map((value, k) => (isOver(k) ? Math.max(value, 0) : null)) },
      ];
    },
    bands: () => [{ series: [4, 5], fill: `color-mix(in srgb, ${styleOf("--infeasible")} 45%, transparent)` }],
  },
  {
    name: "Load in that stop", unit: "% of level static", height: 138,
    range: ({ columns }) => {
      const [low, high] = span([...columns.rear_load, ...columns.side_load]);
      return [Math.min(0, 100 * low), Math.max(100 * high, 60) * 1.04];
    },
    curves: (plan) => [
      { label: "rear axle", colour: "first", hasCursor: true, unit: "%", digits: 0, values: whileMoving(plan, plan.columns.rear_load).map(percent) },
      { label: "lighter side", colour: "second", dash: [7, 4], hasCursor: true, unit: "%", digits: 0, values: whileMoving(plan, plan.columns.side_load).map(percent) },
      { ...LIMIT, label: "smallest allowed", fill: 0.13, fillColour: "infeasible", unit: "%", digits: 0, values: constant(plan, percent(data.limits.min_load)) },
    ],
  },
  {
    name: "Acceleration", unit: "m/s²", height: 130,
    range: ({ columns }) => {
      const [low, high] = span(columns.accel);
      const { accel, decel } = data.limits;
      return [Math.min(low, -(decel ?? 0)) * 1.12, Math.max(high, accel ?? 0) * 1.18];
    },
    curves: (plan) => [
      { label: "acceleration", colour: "ink", isStepped: true, hasCursor: true, unit: "m/s²", values: upToRest(plan, plan.columns.accel.with(restOf(plan), plan.columns.accel[Math.max(restOf(plan) - 1, 0)])), text: (k) => number(plan.columns.accel[k], 2, "m/s²") },
      { ...LIMIT, label: "limits of the plan", values: constant(plan, data.limits.accel), text: () => "" },
      { ...LIMIT, values: constant(plan, data.limits.decel === null ? null : -data.limits.decel) },
    ],
  },
  {
    name: "Grade and roll", unit: "°", height: 138,
    range: ({ columns }) => {
      const [low, high] = span([...columns.grade, ...columns.roll].map(degrees));
      const pad = Math.max(0.08 * (high - low), 0.8);
      return [Math.min(low, -1) - pad, Math.max(high, 1) + pad];
    },
    curves: (plan) => [
      { label: "grade, uphill +", colour: "first", hasCursor: true, unit: "°", digits: 1, values: plan.columns.grade.map(degrees) },
      { label: "roll, left up +", colour: "second", dash: [7, 4], hasCursor: true, unit: "°", digits: 1, values: plan.columns.roll.map(degrees) },
      { ...LIMIT, label: "trained", values: constant(plan, degrees(data.limits.grade_range[0])), text: () => "" },
      { ...LIMIT, values: constant(plan, degrees(data.limits.grade_range[1])) },
    ],
  },
  {
    name: "Height of the ground", unit: "m", height: 118,
    range: ({ columns }) => {
      const [low, high] = span(columns.z);
      const pad = Math.max(0.1 * (high - low), 0.1);
      return [low - pad, high + pad];
    },
    curves: (plan) => [{ label: "height", colour: "ink", fill: 0.28, fillColour: "faint", hasCursor: true, unit: "m", values: plan.columns.z }],
  },
];

let shownCharts = [];

function drawCharts() {
  const host = element("charts");
  const style = getComputedStyle(host);
  const width = Math.max(host.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight), 200);
  shownCharts.forEach(({ plot }) => plot.destroy());
  host.replaceChildren();
  shownCharts = CHARTS.map((chart) => drawChart(host, chart, plans[state.selected], width));
  showKeys();
}

function drawChart(host, chart, plan, width) {
  const curves = chart.curves(plan);
  const keys = curves.filter((curve) => curve.label).map((curve) => {
    const value = make("b");
    const text = curve.text ?? ((k) => number(curve.values[k], curve.digits ?? 2, curve.unit));
    const node = make("span", { class: "key" }, ...(curve.colour ? [keyLine(curve)] : []), curve.label, value);
    return { node, show: (k) => { value.textContent = text(k); } };
  });
  const figure = make("figure", { class: "chart" }, make("figcaption", {},
    make("span", { class: "name" }, chart.name, " ", make("small", {}, `[${chart.unit}]`)),
    make("span", { class: "keys" }, ...keys.map(({ node }) => node))));
  host.append(figure);
  const { station } = plan.columns;
  const x = chart.isFine ? refined(station) : station;
  const plot = lineChart(figure, {
    ...chart, width, x, unit: "m",
    curves: curves.map((curve, i) => (chart.isFine ? { ...curve, values: (i ? refined : refinedSpeed)(curve.values) } : curve)),
    range: chart.range(plan),
    bands: chart.bands?.(),
    under: (u) => chart.under?.(u, plan),
    over: (u) => { paintIdle(u, plan, chart.hasRibbon); chart.over?.(u, plan); },
    onReady: (u) => { followPointer(u, plan); moveCross(u, plan); },
  });
  if (chart.hasRibbon) figure.append(limitKeys(plan));
  return { plot, plan, keys };
}

function keyLine({ colour, width = 2, dash = [] }) {
  const style = `stroke:var(--${colour});stroke-width:${width};stroke-dasharray:${dash.join(" ") || "none"}`;
  return draw("svg", { width: 22, height: 8, "aria-hidden": "true" }, draw("path", { d: "M1 4H21", style }));
}

// Between two stations v² is linear: three values more, so that the curve is the plan's.
const PIECES = 4;
const between = (values, mix) => values.flatMap((a, k) => {
  const b = values[k + 1];
  if (b === undefined) return [a];
  return Array.from({ length: PIECES }, (_, i) => (i === 0 ? a : a === null || b === null ? null : mix(a, b, i / PIECES)));
});
const refined = (values) => between(values, (a, b, share) => a + share * (b - a));
const refinedSpeed = (values) => between(values, (a, b, share) => Math.sqrt(a * a + share * (b * b - a * a)));

// Stretches with one limit, from station to station; a new one where the plan comes to rest.
function limitRuns(plan) {
  const { station, limiting } = plan.columns;
  const rest = restOf(plan);
  const runs = [];
  for (let k = 0; k + 1 < station.length; k += 1) {
    const last = runs.at(-1);
    if (last && last.code === limiting[k] && k !== rest) Object.assign(last, { end: k + 1, to: station[k + 1] });
    else runs.push({ ...data.limiting[limiting[k]], code: limiting[k], begin: k, end: k + 1, from: station[k], to: station[k + 1], isBehind: k >= rest });
  }
  return runs;
}

// The speed in the colours of what limits it, and the area below.
function paintLimits(plot, plan) {
  const { ctx: pen, bbox } = plot;
  const [at, speed] = [refined(plan.columns.station), refinedSpeed(plan.columns.speed)];
  pen.save();
  pen.lineWidth = 6.5 * uPlot.pxRatio;
  for (const run of limitRuns(plan)) {
    pen.beginPath();
    for (let i = run.begin * PIECES; i <= run.end * PIECES; i += 1) pen.lineTo(canvasX(plot, at[i]), plot.valToPos(speed[i] ?? 0, "y", true));
    pen.strokeStyle = pen.fillStyle = styleOf(`--${run.key}`);
    if (!run.isBehind) pen.stroke();
    pen.lineTo(canvasX(plot, run.to), bbox.top + bbox.height);
    pen.lineTo(canvasX(plot, run.from), bbox.top + bbox.height);
    pen.globalAlpha = 0.17;
    pen.fill();
    pen.globalAlpha = 1;
  }
  pen.restore();
}

function paintClearMark(plot, plan) {
  if (!clearEndsBefore(plan)) return;
  const { ctx: pen, bbox } = plot;
  const [x, px] = [canvasX(plot, plan.clear), uPlot.pxRatio];
  pen.save();
  pen.strokeStyle = styleOf("--clear");
  pen.lineWidth = 1.5 * px;
  pen.setLineDash([6 * px, 3 * px]);
  pen.beginPath();
  pen.moveTo(x, bbox.top);
  pen.lineTo(x, bbox.top + bbox.height);
  pen.stroke();
  pen.restore();
  const isLeft = x > bbox.left + bbox.width - 150 * px; // the text is on the side with space for it
  const y = isLeft ? bbox.top + bbox.height - 10 * px : bbox.top + 12 * px;
  paintText(plot, `clear distance ${number(plan.clear, 2, "m")}`, x + (isLeft ? -6 : 6) * px, y, { colour: "clear", align: isLeft ? "right" : "left", font: "600" });
}

// Hatches what lies beyond the stop.
function paintIdle(plot, plan, isNamed) {
  const from = plan.columns.station[restOf(plan)];
  if (from >= plan.columns.station.at(-1) - 1e-3) return;
  const { ctx: pen, bbox } = plot;
  const [x, end, px] = [canvasX(plot, from), bbox.left + bbox.width, uPlot.pxRatio];
  pen.save();
  pen.beginPath();
  pen.rect(x, bbox.top, end - x, bbox.height);
  pen.clip();
  pen.beginPath();
  for (let at = x - bbox.height; at < end; at += 9 * px) {
    pen.moveTo(at, bbox.top + bbox.height);
    pen.lineTo(at + bbox.height, bbox.top);
  }
  pen.strokeStyle = styleOf("--line");
  pen.lineWidth = 2.2 * px;
  pen.setLineDash([]);
  pen.stroke();
  pen.restore();
  if (isNamed && end - x > 76 * px) paintText(plot, "not driven", (x + end) / 2, bbox.top + bbox.height / 2, { align: "center", font: "italic" });
}

// What limits on which share of the driven distance, and the bounds that the chart shows.
function limitKeys(plan) {
  const rest = restOf(plan);
  const { station, limiting } = plan.columns;
  const lengths = new Map();
  for (let k = 0; k < rest; k += 1) lengths.set(limiting[k], (lengths.get(limiting[k]) ?? 0) + station[k + 1] - station[k]);
  const shares = [...lengths].sort((a, b) => b[1] - a[1]).map(([code, length]) => {
    const limit = data.limiting[code];
    return make("span", { class: "item", title: limit.meaning }, swatch(limit), `${limit.word} ${number((100 * length) / station[rest], 0, "%")}`);
  });
  const top = CHARTS[0].range(plan)[1];
  const curves = plan.bounds.filter(({ speed }) => speed.some((value) => value !== null && value < top)).map(({ code }) => {
    const limit = data.limiting[code];
    return make("span", { class: "item", title: limit.meaning }, keyLine({ colour: limit.key, width: 1.3, dash: [7, 2, 1.5, 2] }), limit.word);
  });
  return make("div", {},
    make("div", { class: "legend ribbon-keys" }, "limited by", ...shares),
    make("div", { class: "legend ribbon-keys" }, "each bound alone", ...curves));
}

function followPointer(plot, plan) {
  const point = (event) => moveCursor(nearestStation(plan, plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x")));
  plot.over.addEventListener("pointermove", point);
  plot.over.addEventListener("pointerdown", point);
}

const moveCross = (plot, plan) => plot.setCursor({ left: plot.valToPos(plan.columns.station[state.cursor], "x"), top: 0 }, false);

function showKeys() {
  shownCharts.forEach(({ keys }) => keys.forEach((key) => key.show(state.cursor)));
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
  when("cursor", () => {
    shownCharts.forEach(({ plot, plan }) => moveCross(plot, plan));
    showKeys();
  });
  host.addEventListener("keydown", (event) => {
    const pace = event.shiftKey ? 10 : 1;
    const to = {
      ArrowRight: state.cursor + pace, ArrowUp: state.cursor + pace, ArrowLeft: state.cursor - pace, ArrowDown: state.cursor - pace,
      PageUp: state.cursor + 10, PageDown: state.cursor - 10, Home: 0, End: plans[state.selected].columns.station.length - 1,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    moveCursor(to);
  });
}
