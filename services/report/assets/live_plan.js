// The plan in use: how fast, what limits it where, and how much the tightest stop leaves.

const words = (name) => name.replaceAll("_", " ");

function showPlan(plan) {
  const chosen = plan?.chosen ?? null;
  element("plan-age").textContent = plan ? `${number(plan.age, 1)} s ago${plan.client ? `, asked by ${plan.client}` : ""}` : "";
  const state = element("plan-state");
  if (!plan) {
    state.replaceChildren("No question has come yet.");
  } else {
    const reason = plan.reason || (chosen ? "reaches the end of its path" : "");
    state.replaceChildren(badge(plan.status), `${chosen ? `${chosen.name}: ` : ""}${reason}`);
  }
  element("tiles").replaceChildren(...tiles(plan, chosen).flatMap(([name, value, small]) => {
    return make("div", {}, make("dt", {}, name), make("dd", small ? { class: "small" } : {}, value));
  }));
  element("speed-chart").replaceChildren(...(chosen ? [speedChart(chosen), make("figcaption", {}, "speed, m/s, and the least bound on it (dotted) over station, m")] : []));
  element("limit-legend").replaceChildren(...(chosen ? limits(chosen) : []));
}

function tiles(plan, chosen) {
  if (!plan) return [];
  const command = plan.command;
  const ordered = command?.stop ? "full braking" : number(command?.speed, 2, "m/s");
  const shown = [
    ["speed now", number(plan.speed, 2, "m/s")],
    ["command", command ? ordered : "none"],
    ["candidates", `${plan.candidates - plan.refused} of ${plan.candidates}`],
    ["planned in", number(plan.planner === null ? null : 1000 * plan.planner, 1, "ms")],
  ];
  if (!chosen) return shown;
  return [
    ...shown,
    ["limited now by", words(chosen.limiting[0]), true],
    ["comes to rest at", `${number(chosen.progress, 1)} of ${number(chosen.length, 1, "m")}`, true],
    ["least margin", number(chosen.least_margin, 2, "m")],
    ["least rear load", number(percent(chosen.least_rear_load), 0, "%")],
  ];
}

function limits(chosen) {
  const share = new Map();
  chosen.limiting.forEach((name) => share.set(name, (share.get(name) ?? 0) + 1));
  const sorted = [...share].sort((a, b) => b[1] - a[1]);
  return sorted.map(([name, count]) => make("span", { class: "item" },
    swatch({ key: name }), `${words(name)} ${Math.round((100 * count) / chosen.limiting.length)} %`));
}

function speedChart(plan) {
  const [width, height, left, right, top, ribbon] = [Math.max(element("speed-chart").clientWidth, 260), 190, 34, 8, 8, 12];
  const floor = height - 34;
  const end = Math.max(plan.station.at(-1), 1e-3);
  const most = roundedTop([...plan.speed, ...plan.speed_bound.filter((v) => v !== null && v < 3 * topSpeed)]);
  const x = (station) => left + (station / end) * (width - left - right);
  const y = (speed) => floor - (speed / most) * (floor - top);
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": "Speed along the path" });
  const rows = ticks(0, most, 4);
  for (const value of rows) {
    svg.append(draw("line", { class: "grid", x1: left, x2: width - right, y1: y(value), y2: y(value) }));
    svg.append(draw("text", { x: left - 6, y: y(value) + 4, "text-anchor": "end" }, tickText(value, rows[1] ?? 1)));
  }
  const columns = ticks(0, end, Math.max(Math.round(width / 90), 3));
  for (const value of columns) {
    svg.append(draw("text", { x: x(value), y: height - 4, "text-anchor": "middle" }, tickText(value, columns[1] ?? 1)));
  }
  const line = (values) => values.map((v, k) => (v === null ? "" : `${k && values[k - 1] !== null ? "L" : "M"}${x(plan.station[k]).toFixed(1)} ${y(Math.min(v, most)).toFixed(1)}`)).join("");
  svg.append(draw("path", { class: "bound", d: line(plan.speed_bound) }), draw("path", { class: "line", d: line(plan.speed) }));
  plan.limiting.slice(0, -1).forEach((name, k) => {
    const from = x(plan.station[k]);
    svg.append(draw("rect", { "data-limiting": name, x: from, y: floor + 4, width: Math.max(x(plan.station[k + 1]) - from + 0.4, 0.5), height: ribbon }));
  });
  return svg;
}
