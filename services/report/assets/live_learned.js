// What was learned: parameters with their history, class of the ground, predicted and driven stops.

const when = (seconds) => new Date(1000 * seconds).toLocaleTimeString();

function showLearned(learned) {
  // A finding that is only offered is no parameter yet.
  const groups = learned.groups.filter((group) => group.names.length || group.valid).map(groupOf);
  element("groups").replaceChildren(...(groups.length ? groups : [make("p", { class: "none" }, "Nothing has been learned yet.")]));
  const ground = learned.ground;
  element("ground").replaceChildren(...(ground ? ["Ground: ", make("b", {}, ground.name || "none that is known"), ` ${number(percent(ground.probability), 0, "%")}, since ${when(ground.at)}`] : []));
  showStops(learned.stops);
  showFinding(learned.finding);
}

function groupOf(group) {
  const told = group.at.length < 2 && group.version < 2 ? ["", "as in the model file"] : group.valid ? ["", "valid"] : ["invalid", "not valid yet: planned with cautiously"];
  const title = make("h3", {}, words(group.group), make("span", { class: told[0] }, told[1]),
    make("small", {}, `version ${group.version}, ${group.cause}, ${when(group.at.at(-1))}`));
  const values = group.names.map((name, i) => {
    const history = group.value.map((row) => row[i]);
    const spread = group.std.map((row) => row[i] ?? null);
    const [value, std] = [history.at(-1), spread.at(-1)];
    const text = std === null ? number(value, 4) : `${number(value, 4)} ± ${number(std, 4)}`;
    return make("div", {}, make("dt", {}, name.length > 3 ? words(name) : name), make("dd", {}, text, ...(history.length > 1 ? [spark(group.at, history, spread)] : [])));
  });
  return make("section", { class: "group" }, title, make("dl", { class: "values" }, ...values));
}

function spark(at, values, spread) {
  const [width, height] = [170, 40];
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: "none", "aria-hidden": "true" });
  const low = values.map((v, i) => (v === null ? null : v - 2 * (spread[i] ?? 0)));
  const high = values.map((v, i) => (v === null ? null : v + 2 * (spread[i] ?? 0)));
  let [least, most] = span([...low, ...high]);
  if (most - least < 1e-9) [least, most] = [least - 0.5, most + 0.5];
  const long = Math.max(at.at(-1) - at[0], 1e-3);
  // Steps: a value holds until the next one.
  const x = (k) => (k >= at.length ? width : (at.length === 1 ? 0 : ((at[k] - at[0]) / long) * (width - 8)));
  const y = (v) => height - 3 - ((v - least) / (most - least)) * (height - 6);
  const steps = (row) => row.flatMap((v, k) => (v === null ? [] : [[x(k), y(v)], [x(k + 1), y(v)]]));
  const text = (points) => points.map(([a, b]) => `${a.toFixed(1)} ${b.toFixed(1)}`).join("L");
  const band = [...steps(high), ...steps(low).reverse()];
  if (band.length) svg.append(draw("path", { class: "band", d: `M${text(band)}Z` }));
  const line = steps(values);
  if (line.length) svg.append(draw("path", { class: "line", d: `M${text(line)}`, "vector-effect": "non-scaling-stroke" }));
  return svg;
}

const longer = (stop) => stop.actual !== null && stop.predicted !== null && stop.actual > stop.predicted;

function showStops(stops) {
  element("stops-chart").replaceChildren(...(stops.length ? [stopsChart(stops), make("figcaption", {}, "driven over predicted distance, m; above the line it took longer than predicted")] : [make("p", { class: "none" }, "No stop has been driven yet.")]));
  if (!stops.length) return element("stops").replaceChildren();
  const head = make("thead", {}, make("tr", {}, ...["time", "from, m/s", "grade", "predicted, m", "driven, m", "became"].map((name) => make("th", { scope: "col" }, name))));
  const rows = stops.slice(-40).reverse().map((stop) => make("tr", {},
    make("td", {}, when(stop.at)), make("td", {}, number(stop.speed)), make("td", {}, number(degrees(stop.grade), 1, "°")),
    make("td", {}, number(stop.predicted)), make("td", longer(stop) ? { class: "over" } : {}, number(stop.actual)),
    make("td", {}, [stop.outcome, stop.surface].filter(Boolean).join(", "))));
  return element("stops").replaceChildren(make("table", {}, head, make("tbody", {}, ...rows)));
}

function stopsChart(stops) {
  const [width, height, left, top] = [Math.max(element("stops-chart").clientWidth, 240), 200, 36, 8];
  const [, most] = span(stops.flatMap((stop) => [stop.predicted, stop.actual]));
  const end = roundedTop([1.05 * most]);
  const floor = height - 22;
  const x = (value) => left + (value / end) * (width - left - 8);
  const y = (value) => floor - (value / end) * (floor - top);
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": "Driven over predicted stopping distance" });
  const marks = ticks(0, end, 4);
  for (const value of marks) {
    svg.append(draw("line", { class: "grid", x1: left, x2: width - 8, y1: y(value), y2: y(value) }));
    svg.append(draw("text", { x: left - 6, y: y(value) + 4, "text-anchor": "end" }, tickText(value, marks[1])));
    svg.append(draw("text", { x: x(value), y: floor + 15, "text-anchor": "middle" }, tickText(value, marks[1])));
  }
  svg.append(draw("path", { class: "even", d: `M${x(0)} ${y(0)}L${x(end)} ${y(end)}` }));
  stops.forEach((stop, i) => {
    if (stop.predicted === null || stop.actual === null) return;
    const look = `stop${longer(stop) ? " over" : ""}${i === stops.length - 1 ? " last" : ""}`;
    svg.append(draw("circle", { class: look, cx: x(stop.predicted), cy: y(stop.actual), r: 4.5 }));
  });
  return svg;
}
