// Polls the service: its status, the plan in use, learned parameters and stops.

const PERIOD_MS = 500;
const MAP_PERIOD_MS = 3000; // drawing a map takes the processor from planning
const seen = { changes: -1, map: 0, mapAt: -MAP_PERIOD_MS };

const spaced = (name) => name.replaceAll("_", " ");
const clock = (seconds) => new Date(1000 * seconds).toLocaleTimeString();
const note = (text) => make("p", { class: "none" }, text);

async function ask(path) {
  const response = await fetch(path, { cache: "no-store", signal: AbortSignal.timeout(4000) });
  if (!response.ok) throw new Error(`${path}: ${response.status}`);
  return response.json();
}

function duration(seconds) {
  if (seconds === null) return "–";
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${number(seconds / 3600, 1)} h`;
}

function showStatus(status, plan) {
  element("service").textContent = status.service;
  document.title = `${status.service} – slopewise live`;
  const hasMap = status.map_version > 0;
  element("verdict").textContent = !hasMap ? "No map received: robots are commanded to brake."
    : plan ? "Answers plan requests." : "Ready; no plan request received.";
  element("flags").replaceChildren(...status.flags.map((flag) => make("li", {}, flag)));
  const { counters, seconds, parameters } = status;
  element("facts").replaceChildren(...definitions([
    ["running for", duration(status.uptime)],
    ["parameters", `version ${parameters.version} of ${parameters.name}, ${duration(parameters.age)} old`],
    ["map", hasMap ? `version ${status.map_version}, ${duration(status.map_age)} old` : "none"],
    ["answered", `${counters.answered ?? 0} of ${counters.queries ?? 0}, busy ${counters.busy ?? 0}`],
    ["answers take", `${number(1000 * seconds.median, 1)} ms, 99 % ${number(1000 * seconds.p99, 1)} ms`],
  ]));
}

function showPlan(plan) {
  const chosen = plan?.chosen ?? null;
  element("plan-age").textContent = plan ? `${number(plan.age, 1)} s ago${plan.client ? `, asked by ${plan.client}` : ""}` : "";
  const reason = plan && (plan.reason || (chosen ? "reaches the end of its path" : ""));
  element("plan-state").replaceChildren(...(plan ? [badge(plan.status), `${chosen ? `${chosen.name}: ` : ""}${reason}`] : ["No plan request received."]));
  element("tiles").replaceChildren(...(plan ? planTiles(plan, chosen) : []));
  element("speed-chart").replaceChildren();
  element("limit-legend").replaceChildren(...(chosen ? limitShares(chosen) : []));
  if (chosen) showSpeed(chosen);
}

function planTiles(plan, chosen) {
  const { command } = plan;
  return definitions([
    ["speed now", number(plan.speed, 2, "m/s")],
    ["command", command ? (command.stop ? "full braking" : number(command.speed, 2, "m/s")) : "none"],
    ["candidates", `${plan.candidates - plan.refused} of ${plan.candidates}`],
    ["planned in", number(plan.planner === null ? null : 1000 * plan.planner, 1, "ms")],
    ...(chosen ? [
      ["limited now by", make("span", { class: "small" }, spaced(chosen.limiting[0]))],
      ["comes to rest at", make("span", { class: "small" }, `${number(chosen.progress, 1)} of ${number(chosen.length, 1, "m")}`)],
      ["stop margin", number(chosen.least_margin, 2, "m")], // words: ok (key of the message)
      ["rear load", number(percent(chosen.least_rear_load), 0, "%")], // words: ok (key of the message)
    ] : []),
  ]);
}

function limitShares({ limiting }) {
  const count = new Map();
  limiting.forEach((name) => count.set(name, (count.get(name) ?? 0) + 1));
  return [...count].sort((a, b) => b[1] - a[1]).map(([name, stations]) => legendItem(
    swatch({ key: name }), `${spaced(name)} ${Math.round((100 * stations) / limiting.length)} %`));
}

function showSpeed(plan) {
  const host = element("speed-chart");
  const { station, speed, speed_bound: bound } = plan;
  const top = roundedTop([...speed, ...bound.filter((value) => value !== null && value < 3 * painter.topSpeed)]);
  const runs = [];
  plan.limiting.slice(0, -1).forEach((key, k) => {
    if (runs.at(-1)?.key === key) runs.at(-1).to = station[k + 1];
    else runs.push({ key, word: "", from: station[k], to: station[k + 1] });
  });
  lineChart(host, {
    x: station, range: [0, top], width: Math.max(host.clientWidth, 260), height: 180, unit: "m", hasRibbon: true,
    curves: [
      { label: "bound", colour: "faint", width: 1.6, dash: [2, 3], values: bound },
      { label: "speed", colour: "first", values: speed },
    ],
    over: (plot) => paintRibbon(plot, runs),
  });
  host.append(make("figcaption", {}, "speed, m/s, and its tightest bound (dotted) over station, m"));
}

function showLearned(learned) {
  // A proposal that waits for an operator is no parameter yet.
  const groups = learned.groups.filter((group) => group.names.length || group.valid).map(groupSection);
  element("groups").replaceChildren(...(groups.length ? groups : [note("Nothing has been learned yet.")]));
  const { ground } = learned;
  element("ground").replaceChildren(...(ground ? ["Ground: ", make("b", {}, ground.name || "unknown"), `${ground.probability ? ` ${number(percent(ground.probability), 0, "%")}` : ""}, since ${clock(ground.at)}`] : []));
  showStops(learned.stops);
  showFinding(learned.finding);
}

function groupSection(group) {
  const isFile = group.at.length < 2 && group.version < 2;
  const state = isFile ? "as in the model file" : group.valid ? "valid" : "not valid yet: planned with cautiously";
  const title = make("h3", {}, spaced(group.group), make("span", { class: isFile || group.valid ? "" : "invalid" }, state),
    make("small", {}, `version ${group.version}, ${group.cause}, ${clock(group.at.at(-1))}`));
  const values = group.names.map((name, i) => {
    const history = group.value.map((row) => row[i]);
    const stds = group.std.map((row) => row[i] ?? null);
    const [value, std] = [history.at(-1), stds.at(-1)];
    const text = std === null ? number(value, 4) : `${number(value, 4)} ± ${number(std, 4)}`;
    return [name.length > 3 ? spaced(name) : name, text, ...(history.length > 1 ? [historyLine(group.at, history, stds)] : [])];
  });
  return make("section", { class: "group" }, title, make("dl", { class: "values" }, ...definitions(values)));
}

// A value over time with two standard deviations; it holds until the next one.
function historyLine(at, values, stds) {
  const [width, height] = [170, 40];
  const [low, high] = [-2, 2].map((factor) => values.map((value, k) => (value === null ? null : value + factor * (stds[k] ?? 0))));
  const [min, max] = span([...low, ...high]);
  const duration = Math.max(at.at(-1) - at[0], 1e-3);
  const x = (k) => (k >= at.length ? width : ((at[k] - at[0]) / duration) * (width - 8));
  const y = (value) => height - 3 - (max - min < 1e-9 ? 0.5 : (value - min) / (max - min)) * (height - 6);
  const steps = (row) => row.flatMap((value, k) => (value === null ? [] : [[x(k), y(value)], [x(k + 1), y(value)]]));
  const path = (points) => points.map(([a, b]) => `${a.toFixed(1)} ${b.toFixed(1)}`).join("L");
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: "none", "aria-hidden": "true" });
  const line = steps(values);
  if (line.length) {
    svg.append(draw("path", { class: "band", d: `M${path([...steps(high), ...steps(low).reverse()])}Z` }),
      draw("path", { class: "line", d: `M${path(line)}`, "vector-effect": "non-scaling-stroke" }));
  }
  return svg;
}

const isLonger = (stop) => stop.actual !== null && stop.predicted !== null && stop.actual > stop.predicted;

function showStops(stops) {
  const host = element("stops-chart");
  host.replaceChildren();
  if (!stops.length) {
    host.append(note("No stop has been driven yet."));
    return element("stops").replaceChildren();
  }
  const known = stops.filter((stop) => stop.predicted !== null && stop.actual !== null).sort((a, b) => a.predicted - b.predicted);
  const end = roundedTop(known.flatMap((stop) => [1.05 * stop.predicted, 1.05 * stop.actual]));
  const dots = (colour, edge, isShown) => ({ colour, edge, hasDots: true, values: [null, ...known.map((stop) => (isShown(stop) ? stop.actual : null)), null] });
  const plot = lineChart(host, {
    x: [0, ...known.map((stop) => stop.predicted), end], end, range: [0, end], width: Math.max(host.clientWidth, 240), height: 210, unit: "m",
    curves: [
      { label: "equal", colour: "faint", width: 1, dash: [5, 4], values: [0, ...known.map((stop) => stop.predicted), end] },
      dots("first", "panel", (stop) => !isLonger(stop)),
      dots("infeasible", "panel", isLonger),
      dots(known.length && isLonger(stops.at(-1)) ? "infeasible" : "first", "ink", (stop) => stop === stops.at(-1)),
    ],
  });
  plot.root.removeAttribute("aria-hidden");
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute("aria-label", `Driven over predicted stopping distance of ${known.length} stops`);
  host.append(make("figcaption", {}, "driven over predicted distance, m; above the line it took longer than predicted"));
  const head = make("thead", {}, make("tr", {}, ...["time", "from, m/s", "grade", "predicted, m", "driven, m", "outcome"].map((name) => make("th", { scope: "col" }, name))));
  const rows = stops.slice(-40).reverse().map((stop) => make("tr", {},
    make("td", {}, clock(stop.at)), make("td", {}, number(stop.speed)), make("td", {}, number(degrees(stop.grade), 1, "°")),
    make("td", {}, number(stop.predicted)), make("td", isLonger(stop) ? { class: "over" } : {}, number(stop.actual)),
    make("td", {}, [stop.outcome, stop.surface].filter(Boolean).join(", "))));
  return element("stops").replaceChildren(make("table", {}, head, make("tbody", {}, ...rows)));
}

async function poll() {
  try {
    const { status, plan, changes } = await ask("/state");
    document.body.classList.remove("lost");
    showStatus(status, plan);
    const version = status.map_version;
    if (version > 0 && version !== seen.map && performance.now() - seen.mapAt > MAP_PERIOD_MS) {
      seen.mapAt = performance.now();
      await loadGround();
      seen.map = painter.ground?.version ?? 0;
    }
    showOnMap(plan);
    showMapLegend(version);
    showPlan(plan);
    if (changes !== seen.changes) {
      showLearned(await ask("/learned"));
      seen.changes = changes;
    }
    document.body.dataset.ready = "true";
  } catch (error) {
    document.body.classList.add("lost");
    element("verdict").textContent = `The service does not answer (${error.message}).`;
  }
  setTimeout(poll, PERIOD_MS);
}

// Charts have the width of their panels: all are drawn again.
window.addEventListener("resize", () => { seen.changes = -1; });
showMapLegend(0);
poll();
