// The selected candidate in numbers, the values under the cursor, the table of candidates; starts the page.

function showDetails() {
  const plan = plans[state.selected];
  element("select").value = String(state.selected);
  element("previous").disabled = state.selected === 0;
  element("next").disabled = state.selected === plans.length - 1;
  const count = plan.columns.station.length;
  const thinned = count < plan.stations ? ` Drawn from ${count} of its ${plan.stations} stations.` : "";
  const reason = plan.reason || "reaches the end of its path";
  element("state").replaceChildren(badge(plan.status), ` ${reason}.${thinned}`.replace("..", "."));
  const tiles = [
    ["travel time", number(plan.travel_time, 1), "s"],
    ["stops at", number(plan.progress, 1), plan.progress < plan.length - 0.05 ? `m of ${number(plan.length, 1)}` : "m"],
    ["mean speed", number(plan.mean_speed, 2), "m/s"],
    ["top speed", number(plan.max_speed, 2), "m/s"],
    ["stop margin", number(plan.margin, 2), "m"],
    ["rear load", number(percent(plan.rear_load), 0), "%"],
    ["side load", number(percent(plan.side_load), 0), "%"],
    ["off the given path", number(plan.path_deviation, 2), "m"],
    ["limited most by", data.limiting[plan.limits]?.word ?? "–", ""],
  ];
  element("tiles").replaceChildren(...definitions(tiles.map(([name, value, unit]) => [name, value, " ", make("small", {}, unit)])));
}

function showCursor() {
  const plan = plans[state.selected];
  const k = state.cursor;
  const at = (name) => plan.columns[name][k];
  const limit = data.limiting[at("limiting")];
  const curvature = at("curvature");
  const turn = Math.abs(curvature ?? 0) < 1e-3 ? "straight" : `${number(1 / Math.abs(curvature), 1, "m")} ${curvature > 0 ? "left" : "right"}`;
  const [x0, y0] = ground.origin;
  element("cursor").replaceChildren(...definitions([
    ["station", number(at("station"), 2, "m")],
    ["time", number(at("time"), 2, "s")],
    ["speed", number(at("speed"), 2, "m/s")],
    ["speed bound", number(at("speed_bound"), 2, "m/s")],
    ["limited by", make("span", { title: limit.meaning }, swatch(limit), limit.word)],
    ["acceleration", number(at("accel"), 2, "m/s²")],
    ["emergency stop", number(at("stop_distance"), 2, "m")],
    ["margin", at("speed") > 0 ? number(marginAt(plan, k), 2, "m") : "–"],
    ["rear load", number(percent(at("rear_load")), 0, "%")],
    ["side load", number(percent(at("side_load")), 0, "%")],
    ["grade", number(degrees(at("grade")), 1, "°")],
    ["roll", number(degrees(at("roll")), 1, "°")],
    ["turn radius", turn],
    ["height", number(at("z"), 2, "m")],
    ["x", number(at("x") === null ? null : x0 + at("x"), 2, "m")],
    ["y", number(at("y") === null ? null : y0 + at("y"), 2, "m")],
  ]));
  const slider = element("charts");
  slider.setAttribute("aria-valuemax", String(plan.columns.station.at(-1)));
  slider.setAttribute("aria-valuenow", String(at("station")));
  slider.setAttribute("aria-valuetext", `${number(at("station"), 1, "m")}: ${number(at("speed"), 2, "m/s")}, limited by ${limit.word}`);
}

function startDetails() {
  when("select", showDetails);
  when("cursor", showCursor);
  element("select").addEventListener("change", (event) => select(Number(event.target.value)));
  element("previous").addEventListener("click", () => select(state.selected - 1));
  element("next").addEventListener("click", () => select(state.selected + 1));
}

const body = element("table").tBodies[0];

// The speed of a plan in small.
function spark(plan) {
  const { station, speed } = plan.columns;
  const end = Math.max(station.at(-1), 1e-3);
  const rest = restOf(plan);
  const x = (k) => (1 + (114 * station[k]) / end).toFixed(1);
  const every = Math.max(1, Math.floor(station.length / 116));
  const points = station.map((_, k) => k).filter((k) => k <= rest && (k % every === 0 || k === rest));
  const line = points.map((k) => `${x(k)} ${(22 - (20 * (speed[k] ?? 0)) / painter.topSpeed).toFixed(1)}`).join("L");
  return draw("svg", { viewBox: "0 0 116 24", "aria-hidden": "true" },
    draw("path", { d: `M${x(0)} 22L${line}L${x(rest)} 22Z`, style: "fill:var(--accent);opacity:.2" }),
    draw("path", { d: `M${line}`, style: "fill:none;stroke:var(--accent);stroke-width:1.5;stroke-linejoin:round" }),
    draw("path", { d: `M${x(rest)} 22.5H115`, style: "fill:none;stroke:var(--faint);stroke-width:1.4;stroke-dasharray:2 3" }));
}

function markRow() {
  for (const row of body.rows) {
    const isSelected = Number(row.dataset.plan) === state.selected;
    row.classList.toggle("selected", isSelected);
    row.querySelector(".pick").setAttribute("aria-pressed", String(isSelected));
  }
}

function sortBy(column, heading) {
  const isNumeric = heading.classList.contains("number") || column === 2;
  const isUp = heading.getAttribute("aria-sort") !== "ascending";
  for (const cell of heading.parentNode.cells) cell.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", isUp ? "ascending" : "descending");
  const valueOf = (row) => row.cells[column].dataset.value ?? "";
  body.append(...[...body.rows].sort((a, b) => {
    const [left, right] = [valueOf(a), valueOf(b)];
    if ((left === "") !== (right === "")) return left === "" ? 1 : -1; // missing values last
    const order = isNumeric ? Number(left) - Number(right) : left.localeCompare(right, undefined, { numeric: true });
    return (isUp ? order : -order) || Number(a.dataset.plan) - Number(b.dataset.plan);
  }));
}

function startTable() {
  for (const row of body.rows) row.querySelector(".spark").append(spark(plans[Number(row.dataset.plan)]));
  [...element("table").tHead.rows[0].cells].forEach((heading, column) => {
    heading.querySelector("button")?.addEventListener("click", () => sortBy(column, heading));
  });
  body.addEventListener("click", (event) => {
    const row = event.target.closest("tr");
    if (row && !String(window.getSelection())) select(Number(row.dataset.plan));
  });
  body.addEventListener("keydown", (event) => {
    const step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    const row = step && event.target.closest("tr")?.[step];
    if (!row) return;
    event.preventDefault();
    row.querySelector(".pick").focus();
    select(Number(row.dataset.plan));
  });
  body.addEventListener("pointerover", (event) => {
    const row = event.target.closest("tr");
    const plan = row && Number(row.dataset.plan);
    if (row && plan !== state.selected) hover({ plan, station: fastest(plans[plan]) });
  });
  body.addEventListener("pointerleave", () => hover(null));
  when("select", markRow);
}

if (plans.length) {
  startMap();
  startCharts();
  startDetails();
  startTable();
  const rank = Number(/^#candidate-(\d+)$/.exec(window.location.hash)?.[1]);
  const linked = plans.findIndex((plan) => plan.rank === rank);
  select(linked >= 0 ? linked : state.selected);
  const redraw = () => { painter.tinted = null; drawCharts(); paintMap(); };
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  window.addEventListener("beforeprint", redraw);
  window.addEventListener("afterprint", redraw);
}
