// Asks the service twice a second; what it draws less often is fetched when it changed.

const PERIOD = 500;
const seen = { changes: -1, map: 0, mapAt: 0 };
const MAP_PERIOD = 3000;

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
  const able = status.map_version > 0;
  element("verdict").textContent = able
    ? plan ? "Answers questions for plans." : "Ready; nobody has asked yet."
    : "No map has come yet: robots are told to brake.";
  element("flags").replaceChildren(...status.flags.map((flag) => make("li", {}, flag)));
  const { counters, seconds, parameters } = status;
  const facts = [
    ["running for", duration(status.uptime)],
    ["parameters", `version ${parameters.version} of ${parameters.name}, ${duration(parameters.age)} old`],
    ["map", able ? `version ${status.map_version}, ${duration(status.map_age)} old` : "none"],
    ["answered", `${counters.answered ?? 0} of ${counters.queries ?? 0}, busy ${counters.busy ?? 0}`],
    ["answers take", `${number(1000 * seconds.median, 1)} ms, 99 % ${number(1000 * seconds.p99, 1)} ms`],
  ];
  element("facts").replaceChildren(...facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
}

async function look_again() {
  try {
    const state = await ask("/state");
    document.body.classList.remove("lost");
    showStatus(state.status, state.plan);
    const version = state.status.map_version;
    if (version > 0 && version !== seen.map && performance.now() - seen.mapAt > MAP_PERIOD) {
      seen.mapAt = performance.now();
      await takeGround();
      seen.map = ground?.version ?? 0;
    }
    showMapLegend(version);
    takePlan(state.plan);
    showPlan(state.plan);
    if (state.changes !== seen.changes) {
      showLearned(await ask("/learned"));
      seen.changes = state.changes;
    }
    document.body.dataset.ready = "true";
  } catch (error) {
    document.body.classList.add("lost");
    element("verdict").textContent = `The service does not answer (${error.message}).`;
  }
  setTimeout(look_again, PERIOD);
}

seen.mapAt = -MAP_PERIOD;
showMapLegend(0);
look_again();
