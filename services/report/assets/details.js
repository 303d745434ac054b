// The selected candidate in words and numbers, and the values under the cursor.

function showDetails() {
  const plan = plans[state.selected];
  element("select").value = String(state.selected);
  element("previous").disabled = state.selected === 0;
  element("next").disabled = state.selected === plans.length - 1;
  const kept = plan.columns.station.length;
  const thin = kept < plan.stations ? ` Drawn from ${kept} of its ${plan.stations} stations.` : "";
  const said = plan.reason || "reaches the end of its path";
  element("state").replaceChildren(badge(plan.status), ` ${said}.${thin}`.replace("..", "."));
  const tile = (name, value, unit, behind = "") => make("div", {}, make("dt", {}, name), make("dd", {}, value, " ", make("small", {}, unit + behind)));
  element("tiles").replaceChildren(
    tile("travel time", number(plan.time, 1), "s"),
    tile("stops at", number(plan.progress, 1), "m", plan.progress < plan.length - 0.05 ? ` of ${number(plan.length, 1)}` : ""),
    tile("mean speed", number(plan.mean, 2), "m/s"),
    tile("top speed", number(plan.max, 2), "m/s"),
    tile("least margin", number(plan.margin, 2), "m"),
    tile("least rear load", number(percent(plan.rear), 0), "%"),
    tile("least side load", number(percent(plan.side), 0), "%"),
    tile("off the given path", number(plan.beside, 2), "m"),
    tile("limited most by", data.limiting[plan.limits]?.word ?? "–", ""),
  );
}

function showCursor() {
  const plan = plans[state.selected];
  const k = state.cursor;
  const at = (name) => plan.columns[name][k];
  const what = data.limiting[at("limiting")];
  const bend = at("curvature");
  const turn = Math.abs(bend ?? 0) < 1e-3 ? "straight" : `${number(1 / Math.abs(bend), 1, "m")} ${bend > 0 ? "left" : "right"}`;
  const [x0, y0] = ground.origin;
  const moving = at("speed") > 0;
  const rows = [
    ["station", number(at("station"), 2, "m")],
    ["time", number(at("time"), 2, "s")],
    ["speed", number(at("speed"), 2, "m/s")],
    ["speed bound", number(at("speed_bound"), 2, "m/s")],
    ["limited by", make("span", { title: what.meaning }, swatch(what), what.word)],
    ["acceleration", number(at("accel"), 2, "m/s²")],
    ["emergency stop", number(at("stop_distance"), 2, "m")],
    ["margin", moving ? number(marginAt(plan, k), 2, "m") : "–"],
    ["rear load", number(percent(at("rear_load")), 0, "%")],
    ["side load", number(percent(at("side_load")), 0, "%")],
    ["grade", number(degrees(at("grade")), 1, "°")],
    ["roll", number(degrees(at("roll")), 1, "°")],
    ["turn radius", turn],
    ["height", number(at("z"), 2, "m")],
    ["x", number(at("x") === null ? null : x0 + at("x"), 2, "m")],
    ["y", number(at("y") === null ? null : y0 + at("y"), 2, "m")],
  ];
  element("cursor").replaceChildren(...rows.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
  const slider = element("charts");
  slider.setAttribute("aria-valuemax", String(plan.columns.station.at(-1)));
  slider.setAttribute("aria-valuenow", String(at("station")));
  slider.setAttribute("aria-valuetext", `${number(at("station"), 1, "m")}: ${number(at("speed"), 2, "m/s")}, limited by ${what.word}`);
}

function startDetails() {
  when("select", showDetails);
  when("cursor", showCursor);
  element("select").addEventListener("change", (event) => select(Number(event.target.value)));
  element("previous").addEventListener("click", () => select(state.selected - 1));
  element("next").addEventListener("click", () => select(state.selected + 1));
}
