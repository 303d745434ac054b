// Selection and cursor of a plan page, and the listeners of their changes.

const plans = data.plans;
// Columns come as whole numbers of their last decimal.
const scaled = (values, name) => values.map((value) => (value === null ? null : value / 10 ** data.decimals[name]));
for (const plan of plans) {
  for (const name of Object.keys(data.decimals)) plan.columns[name] = scaled(plan.columns[name], name);
  for (const bound of plan.bounds) bound.speed = scaled(bound.speed, "speed_bound");
}

const state = { selected: data.selected, cursor: 0, hovered: null };
const listeners = { select: [], cursor: [], hover: [] };
const when = (change, listener) => listeners[change].push(listener);
const notify = (change) => listeners[change].forEach((listener) => listener());

function select(index) {
  if (index < 0 || index >= plans.length) return;
  state.selected = index;
  state.cursor = fastest(plans[index]);
  notify("select");
  notify("cursor");
}

function moveCursor(index) {
  const last = plans[state.selected].columns.station.length - 1;
  state.cursor = Math.min(Math.max(index, 0), last);
  notify("cursor");
}

function hover(place) {
  const before = state.hovered;
  if (before?.plan === place?.plan && before?.station === place?.station) return;
  state.hovered = place;
  notify("hover");
}

// Where the cursor begins: in the middle of the stations with the highest speed.
function fastest(plan) {
  const speed = plan.columns.speed;
  const top = speed.reduce((max, v) => Math.max(max, v ?? 0), 0);
  const there = speed.map((_, k) => k).filter((k) => (speed[k] ?? 0) >= top - 1e-3);
  return there[there.length >> 1];
}

// How a plan ends: at the end of its path (less a safety offset), before it, or too late.
function endOf(plan) {
  if (plan.status === "infeasible") return "cross";
  return plan.status === "blocked" || plan.length - plan.progress > 1 ? "stop" : "end";
}

// Index of the station at which the plan comes to rest, the last one at the latest.
function restOf(plan) {
  const speed = plan.columns.speed;
  let k = speed.length - 1;
  while (k > 0 && !(speed[k - 1] > 0)) k -= 1;
  return speed[k] > 0 ? speed.length - 1 : k;
}

function nearestStation(plan, station) {
  const stations = plan.columns.station;
  const beyond = stations.findIndex((at) => at > station);
  if (beyond < 1) return beyond < 0 ? stations.length - 1 : 0;
  return station - stations[beyond - 1] < stations[beyond] - station ? beyond - 1 : beyond;
}

const clearAhead = (plan, k) => (plan.clear === null ? null : plan.clear - plan.columns.station[k]);

const clearEndsBefore = (plan) => plan.clear !== null && plan.clear < plan.length - 1e-2;

function marginAt(plan, k) {
  const stop = plan.columns.stop_distance[k];
  return plan.clear === null || stop === null ? null : clearAhead(plan, k) - stop;
}
