// The map of a plan page: all candidates, the emergency stop ahead of the cursor, and its controls.

const canvas = element("canvas");
const frame = element("map");
const ground = data.map;
const painter = new MapPainter(canvas, frame);
const restStations = plans.map(restOf);
let isWaiting = false;

function repaint() {
  if (isWaiting) return;
  isWaiting = true;
  requestAnimationFrame(() => { isWaiting = false; paintMap(); });
}

function show(bounds, margin) {
  painter.fit(bounds, margin);
  repaint();
}

function showPlans() {
  const [left, right] = span(plans.flatMap((plan) => plan.columns.x));
  const [bottom, top] = span(plans.flatMap((plan) => plan.columns.y));
  show([left, right, bottom, top], 0.06 * Math.max(right - left, top - bottom) + 1);
}

function zoom(factor, x = frame.clientWidth / 2, y = frame.clientHeight / 2) {
  const size = Math.max(ground.bounds[1] - ground.bounds[0], ground.bounds[3] - ground.bounds[2]);
  const smallest = (0.4 * Math.min(frame.clientWidth, frame.clientHeight)) / size;
  const scale = Math.min(Math.max(painter.scale * factor, smallest), 400);
  painter.x += x / painter.scale - x / scale;
  painter.y -= y / painter.scale - y / scale;
  painter.scale = scale;
  repaint();
}

function paintMap() {
  const pen = painter.begin();
  if (!pen) return;
  const behind = plans.map((_, i) => i).filter((i) => i !== state.selected).reverse();
  behind.forEach((i) => painter.paintPlan(pen, plans[i].columns, restStations[i], 2.4, 0.9));
  behind.forEach((i) => paintRest(pen, i, 3.6));
  behind.forEach((i) => paintObstacle(pen, plans[i], 5));
  const selected = plans[state.selected];
  paintStop(pen, selected);
  painter.paintPlan(pen, selected.columns, restStations[state.selected], 5);
  if (clearEndsBefore(selected)) paintCrossBar(pen, along(selected, selected.clear), 12, styleOf("--clear"));
  paintObstacle(pen, selected, 9);
  paintRest(pen, state.selected, 6);
  paintCursor(pen, selected, state.cursor, 6.5);
  const hovered = state.hovered;
  if (hovered && hovered.plan !== state.selected) {
    painter.paintPlan(pen, plans[hovered.plan].columns, restStations[hovered.plan], 4);
    paintCursor(pen, plans[hovered.plan], hovered.station, 5);
  }
  painter.paintScaleBar(pen);
  painter.paintNorth(pen);
}

const paintObstacle = (pen, plan, size) => painter.paintObstacle(pen, plan.obstacle, size, data.limiting[plan.obstacle?.code]?.key);

function paintRest(pen, index, size) {
  const { x, y } = plans[index].columns;
  const rest = restStations[index];
  markRest(pen, painter.toX(x[rest]), painter.toY(y[rest]), size, endOf(plans[index]));
}

// A ring at the end of the path, an octagon before it, a cross where the vehicle cannot stop.
function markRest(pen, x, y, size, kind) {
  pen.beginPath();
  if (kind === "cross") {
    pen.moveTo(x - size, y - size);
    pen.lineTo(x + size, y + size);
    pen.moveTo(x + size, y - size);
    pen.lineTo(x - size, y + size);
    strokeMark(pen);
    return;
  }
  const corners = kind === "end" ? 0 : 8;
  if (corners === 0) pen.arc(x, y, size, 0, 2 * Math.PI);
  for (let i = 0; i < corners; i += 1) {
    const angle = ((i + 0.5) * Math.PI) / 4;
    pen.lineTo(x + 1.25 * size * Math.cos(angle), y + 1.25 * size * Math.sin(angle));
  }
  pen.closePath();
  pen.fillStyle = kind === "end" ? "#ffffff" : "#d55e00";
  pen.fill();
  pen.lineWidth = Math.max(1.5, 0.34 * size);
  pen.strokeStyle = kind === "end" ? "#16181a" : "#ffffff";
  pen.stroke();
}

// The place on a plan at a station, with its heading.
function along(plan, station) {
  const stations = plan.columns.station;
  let index = nearestStation(plan, station);
  if (stations[index] > station && index > 0) index -= 1;
  const next = Math.min(index + 1, stations.length - 1);
  const length = stations[next] - stations[index];
  const share = length > 0 ? Math.min(Math.max((station - stations[index]) / length, 0), 1) : 0;
  const { x, y } = plan.columns;
  const before = Math.max(next - 1, 0);
  return {
    index,
    x: x[index] + share * (x[next] - x[index]),
    y: y[index] + share * (y[next] - y[index]),
    heading: Math.atan2(y[next] - y[before], x[next] - x[before]),
  };
}

// The emergency stop from the cursor, as a wide band along the path.
function paintStop(pen, plan) {
  const stop = plan.columns.stop_distance[state.cursor];
  if (!(stop > 0)) return;
  const end = along(plan, plan.columns.station[state.cursor] + stop);
  painter.trace(pen, plan.columns, state.cursor, end.index);
  pen.lineTo(painter.toX(end.x), painter.toY(end.y));
  pen.lineCap = "butt";
  pen.lineWidth = 17;
  pen.strokeStyle = styleOf("--stop");
  pen.globalAlpha = 0.55;
  pen.stroke();
  pen.globalAlpha = 1;
  paintCrossBar(pen, end, 10, styleOf("--stop"));
  pen.lineCap = "round";
}

function paintCrossBar(pen, at, half, colour) {
  const [x, y, dx, dy] = [painter.toX(at.x), painter.toY(at.y), Math.sin(at.heading) * half, Math.cos(at.heading) * half];
  strokeHaloed(pen, 3, 2.5, colour, [[x - dx, y - dy], [x + dx, y + dy]]);
}

function paintCursor(pen, plan, k, size) {
  const { x, y, speed } = plan.columns;
  pen.beginPath();
  pen.arc(painter.toX(x[k]), painter.toY(y[k]), size, 0, 2 * Math.PI);
  pen.fillStyle = speedColour((speed[k] ?? 0) / painter.topSpeed);
  pen.fill();
  strokeMark(pen);
}

function nearestOnMap(px, py, reach) {
  let nearest = null;
  let smallest = reach * reach;
  plans.forEach((plan, index) => {
    const { x, y } = plan.columns;
    const weight = index === state.selected ? 0.5 : 1;
    for (let k = 0; k < x.length; k += 1) {
      const distance = ((painter.toX(x[k]) - px) ** 2 + (painter.toY(y[k]) - py) ** 2) * weight;
      if (distance < smallest) {
        smallest = distance;
        nearest = { plan: index, station: k };
      }
    }
  });
  return nearest;
}

function showTip(place, px, py) {
  const tip = element("tip");
  tip.hidden = !place;
  if (!place) return;
  const plan = plans[place.plan];
  const { station, speed, limiting } = plan.columns;
  tip.replaceChildren(
    make("b", {}, `${plan.rank} · ${plan.name}`),
    `${number(speed[place.station], 2, "m/s")} at ${number(station[place.station], 1, "m")}`,
    make("br"),
    make("span", {}, `${plan.status} · ${data.limiting[limiting[place.station]].word}`),
  );
  tip.style.left = `${Math.max(8, Math.min(px + 16, frame.clientWidth - tip.offsetWidth - 8))}px`;
  tip.style.top = `${py + 18 + tip.offsetHeight > frame.clientHeight ? py - tip.offsetHeight - 12 : py + 18}px`;
}

const pointers = new Map();
let draggedBy = 0;

function placeOf(event) {
  const box = canvas.getBoundingClientRect();
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

function point(event) {
  const { x, y } = placeOf(event);
  const place = nearestOnMap(x, y, event.pointerType === "touch" ? 34 : 22);
  hover(place);
  showTip(place, x, y);
  if (place && place.plan === state.selected) moveCursor(place.station);
  canvas.style.cursor = place ? "pointer" : "";
}

function press(event) {
  pointers.set(event.pointerId, placeOf(event));
  draggedBy = 0;
  if (event.pointerType === "touch") point(event);
  else canvas.setPointerCapture(event.pointerId);
}

function drag(event) {
  const before = pointers.get(event.pointerId);
  if (!before || (event.pointerType === "touch" && pointers.size === 1)) return point(event);
  const now = placeOf(event);
  const [dx, dy] = [now.x - before.x, now.y - before.y];
  draggedBy += Math.hypot(dx, dy);
  if (pointers.size === 2) {
    const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    const factor = Math.hypot(now.x - other.x, now.y - other.y) / Math.max(Math.hypot(before.x - other.x, before.y - other.y), 1);
    zoom(factor, (now.x + other.x) / 2, (now.y + other.y) / 2);
  }
  if (draggedBy > 4) {
    frame.classList.add("dragging");
    painter.x -= dx / painter.scale / pointers.size;
    painter.y += dy / painter.scale / pointers.size;
    showTip(null);
    repaint();
  }
  return pointers.set(event.pointerId, now);
}

function release(event) {
  const wasPressed = pointers.delete(event.pointerId);
  frame.classList.remove("dragging");
  if (event.type !== "pointerup" || !wasPressed || draggedBy > 4 || !state.hovered) return;
  const { plan, station } = state.hovered;
  if (plan !== state.selected) select(plan);
  moveCursor(station);
}

function startMap() {
  const relief = element("relief");
  painter.topSpeed = roundedTop(plans.flatMap((plan) => plan.columns.speed));
  painter.setGround(ground, relief);
  canvas.addEventListener("pointerdown", press);
  canvas.addEventListener("pointermove", drag);
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("pointerleave", () => { hover(null); showTip(null); });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
    event.preventDefault();
    const { x, y } = placeOf(event);
    zoom(Math.exp(-event.deltaY * 0.01), x, y);
  }, { passive: false });
  canvas.addEventListener("dblclick", (event) => { const { x, y } = placeOf(event); zoom(1.8, x, y); });
  element("zoom-in").addEventListener("click", () => zoom(1.5));
  element("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
  element("fit-paths").addEventListener("click", showPlans);
  element("fit-map").addEventListener("click", () => show(ground.bounds, 0));
  ["select", "cursor", "hover"].forEach((change) => when(change, repaint));
  relief.decode().then(() => { painter.tinted = null; repaint(); }, () => {});
  new ResizeObserver(showPlans).observe(frame);
  showMapLegend();
}

function showMapLegend() {
  const mark = (kind) => signed((pen) => markRest(pen, 8, 8, kind === "stop" ? 5 : 4.6, kind));
  const line = (style) => draw("svg", { width: 22, height: 12, "aria-hidden": "true" }, draw("line", { x1: 2, x2: 20, y1: 6, y2: 6, style }));
  const hatch = draw("svg", { width: 18, height: 12, "aria-hidden": "true" },
    draw("rect", { width: 18, height: 12, rx: 2, style: "fill:var(--unknown-ground);stroke:var(--unknown-hatch)" }),
    draw("path", { d: "M1 11L11 1M8 11L17 2", style: "stroke:var(--unknown-hatch);stroke-width:1.4" }));
  const stop = draw("svg", { width: 22, height: 12, "aria-hidden": "true" },
    draw("path", { d: "M1 6H18", style: "stroke:var(--stop);stroke-width:8;opacity:.55" }),
    draw("path", { d: "M18.5 0V12", style: "stroke:var(--stop);stroke-width:2.6" }));
  const clear = draw("svg", { width: 10, height: 12, "aria-hidden": "true" }, draw("path", { d: "M5 0V12", style: "stroke:var(--clear);stroke-width:2.8" }));
  const kinds = new Set(plans.map(endOf));
  const isShort = kinds.has("stop") || kinds.has("cross");
  const obstacles = [...new Set(plans.filter((plan) => plan.obstacle).map((plan) => plan.obstacle.code))];
  const items = [
    kinds.has("end") && legendItem(mark("end"), "end of the path"),
    kinds.has("stop") && legendItem(mark("stop"), "stops before it"),
    kinds.has("cross") && legendItem(mark("cross"), "cannot stop in time"),
    isShort && legendItem(line("stroke:var(--not-driven);stroke-width:2.4;stroke-dasharray:.1 5;stroke-linecap:round"), "not driven"),
    legendItem(stop, "emergency stop from the cursor"),
    plans.some(clearEndsBefore) && legendItem(clear, "end of the clear distance"),
    ...obstacles.map((code) => legendItem(signed((pen) => warn(pen, 8, 9, 5, styleOf(`--${data.limiting[code].key}`))), `obstacle: ${data.limiting[code].word}`)),
    legendItem(hatch, "unknown ground"),
    ground.contours.length > 0 && legendItem(line("stroke:var(--contour);stroke-width:1.4"), `contours every ${Number(ground.interval.toPrecision(3))} m`),
    ...ground.surfaces.map((surface) => legendItem(line("stroke:var(--surface);stroke-width:1.6;stroke-dasharray:4 3"), surface.name)),
  ];
  element("map-legend").replaceChildren(speedScale(painter.topSpeed), ...items.filter(Boolean));
}
