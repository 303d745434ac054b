// The map: relief, contours, candidates coloured by speed, and the stop ahead of the cursor.

const canvas = element("canvas");
const relief = element("relief");
const frame = element("map");
const ground = data.map;
const topSpeed = roundedTop(plans.flatMap((plan) => plan.columns.speed));
const view = { x: 0, y: 0, scale: 1, whole: 1 };
const contourPaths = ground.contours.map((line) => ({ strong: line.strong, path: new Path2D(line.path) }));
const surfacePaths = ground.surfaces.map((surface) => new Path2D(surface.path));
const rests = plans.map(restOf);
let tinted = null;
let colours = {};
let waiting = false;

function readColours() {
  const names = ["contour", "casing", "not-driven", "map-ink", "map-halo", "surface", "stop", "clear", "panel"];
  colours = Object.fromEntries(names.map((name) => [name, styleOf(`--${name}`)]));
  tinted = null;
}

const toX = (x) => (x - view.x) * view.scale;
const toY = (y) => (view.y - y) * view.scale;

function show(bounds, margin) {
  const { clientWidth: width, clientHeight: height } = frame;
  const [left, right, bottom, top] = bounds;
  const wide = Math.max(right - left, 2 * ground.cell) + 2 * margin;
  const high = Math.max(top - bottom, 2 * ground.cell) + 2 * margin;
  view.scale = Math.min(width / wide, height / high);
  view.x = (left + right) / 2 - width / 2 / view.scale;
  view.y = (bottom + top) / 2 + height / 2 / view.scale;
  repaint();
}

function boundsOfPlans() {
  const [left, right] = span(plans.flatMap((plan) => plan.columns.x));
  const [bottom, top] = span(plans.flatMap((plan) => plan.columns.y));
  return [left, right, bottom, top];
}

function showPlans() {
  const bounds = boundsOfPlans();
  show(bounds, 0.06 * Math.max(bounds[1] - bounds[0], bounds[3] - bounds[2]) + 1);
}

function zoom(factor, x = frame.clientWidth / 2, y = frame.clientHeight / 2) {
  const size = Math.max(ground.bounds[1] - ground.bounds[0], ground.bounds[3] - ground.bounds[2]);
  const least = (0.4 * Math.min(frame.clientWidth, frame.clientHeight)) / size;
  const scale = Math.min(Math.max(view.scale * factor, least), 400);
  view.x += x / view.scale - x / scale;
  view.y -= y / view.scale - y / scale;
  view.scale = scale;
  repaint();
}

function repaint() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; paintMap(); });
}

function paintMap() {
  const sharp = Math.max(window.devicePixelRatio || 1, 1);
  const { clientWidth: width, clientHeight: height } = frame;
  if (!width || !height) return;
  if (canvas.width !== Math.round(width * sharp)) canvas.width = Math.round(width * sharp);
  if (canvas.height !== Math.round(height * sharp)) canvas.height = Math.round(height * sharp);
  const pen = canvas.getContext("2d");
  pen.setTransform(sharp, 0, 0, sharp, 0, 0);
  paintGround(pen, width, height, sharp);
  pen.lineCap = "round";
  pen.lineJoin = "round";
  const order = plans.map((_, i) => i).filter((i) => i !== state.selected).reverse();
  order.forEach((i) => paintPlan(pen, plans[i], rests[i], 2.4, 0.9));
  order.forEach((i) => paintRest(pen, plans[i], rests[i], 3.6));
  const selected = plans[state.selected];
  order.forEach((i) => paintObstacle(pen, plans[i], 5));
  if (selected) {
    paintStop(pen, selected);
    paintPlan(pen, selected, rests[state.selected], 5, 1);
    paintClear(pen, selected);
    paintObstacle(pen, selected, 9);
    paintRest(pen, selected, rests[state.selected], 6);
    paintCursor(pen, selected, state.cursor, 6.5);
  }
  const hovered = state.hovered;
  if (hovered && hovered.plan !== state.selected) {
    paintPlan(pen, plans[hovered.plan], rests[hovered.plan], 4, 1);
    paintCursor(pen, plans[hovered.plan], hovered.station, 5);
  }
  paintScaleBar(pen, width, height);
  paintNorth(pen, width);
}

function paintGround(pen, width, height, sharp) {
  hatchUnknown(pen, width, height);
  if (!tinted && relief.naturalWidth) tinted = tintedRelief(relief);
  const [left, right, bottom, top] = ground.bounds;
  pen.imageSmoothingEnabled = true;
  pen.imageSmoothingQuality = "high";
  if (tinted) pen.drawImage(tinted, toX(left), toY(top), (right - left) * view.scale, (top - bottom) * view.scale);
  // Lines count in tenths of a cell from the centre of the first one, northwards.
  const unit = (view.scale * ground.cell) / 10;
  pen.save();
  pen.setTransform(sharp * unit, 0, 0, -sharp * unit, sharp * toX(ground.first), sharp * toY(ground.first));
  pen.strokeStyle = colours.contour;
  contourPaths.forEach((line) => {
    pen.lineWidth = (line.strong ? 1.5 : 0.8) / unit;
    pen.stroke(line.path);
  });
  pen.strokeStyle = colours.surface;
  pen.fillStyle = colours.surface;
  surfacePaths.forEach((path) => {
    pen.globalAlpha = 0.16;
    pen.fill(path, "evenodd");
    pen.globalAlpha = 1;
    pen.lineWidth = 1.3 / unit;
    pen.setLineDash([5 / unit, 4 / unit]);
    pen.stroke(path);
  });
  pen.restore();
}

function trace(pen, plan, from, to) {
  const { x, y } = plan.columns;
  pen.beginPath();
  pen.moveTo(toX(x[from]), toY(y[from]));
  for (let k = from + 1; k <= to; k += 1) pen.lineTo(toX(x[k]), toY(y[k]));
}

function paintPlan(pen, plan, rest, width, alpha) {
  const { x, y, speed } = plan.columns;
  const last = x.length - 1;
  pen.globalAlpha = alpha;
  if (rest < last) {
    pen.setLineDash([1, width + 2.5]);
    pen.strokeStyle = colours["not-driven"];
    pen.lineWidth = Math.max(1.6, 0.45 * width);
    trace(pen, plan, rest, last);
    pen.stroke();
    pen.setLineDash([]);
  }
  if (rest > 0) {
    pen.strokeStyle = colours.casing;
    pen.lineWidth = width + (width > 3 ? 2.6 : 1.4);
    trace(pen, plan, 0, rest);
    pen.stroke();
  }
  // One stroke a colour: neighbours of about the same speed go together.
  pen.lineWidth = width;
  const shade = (k) => Math.round((48 * ((speed[k] ?? 0) + (speed[k + 1] ?? 0))) / 2 / topSpeed);
  let from = 0;
  for (let k = 0; k < rest; k += 1) {
    if (k + 1 < rest && shade(k + 1) === shade(from)) continue;
    pen.strokeStyle = speedColour(shade(from) / 48);
    trace(pen, plan, from, k + 1);
    pen.stroke();
    from = k + 1;
  }
  pen.globalAlpha = 1;
}

// How a plan ends: a ring at the end of its path, an octagon before it, a cross if it cannot stop.
function paintRest(pen, plan, rest, size) {
  const x = toX(plan.columns.x[rest]);
  const y = toY(plan.columns.y[rest]);
  markRest(pen, x, y, size, endOf(plan));
}

function markRest(pen, x, y, size, kind) {
  pen.beginPath();
  pen.lineWidth = Math.max(1.5, 0.34 * size);
  if (kind === "end") {
    pen.arc(x, y, size, 0, 2 * Math.PI);
    pen.fillStyle = "#ffffff";
    pen.fill();
    pen.strokeStyle = "#16181a";
    pen.stroke();
  } else if (kind === "stop") {
    for (let i = 0; i < 8; i += 1) {
      const angle = ((i + 0.5) * Math.PI) / 4;
      pen.lineTo(x + 1.25 * size * Math.cos(angle), y + 1.25 * size * Math.sin(angle));
    }
    pen.closePath();
    pen.fillStyle = "#d55e00";
    pen.fill();
    pen.strokeStyle = "#ffffff";
    pen.stroke();
  } else {
    for (const [width, colour] of [[4.5, "#16181a"], [2, "#ffffff"]]) {
      pen.beginPath();
      pen.moveTo(x - size, y - size);
      pen.lineTo(x + size, y + size);
      pen.moveTo(x + size, y - size);
      pen.lineTo(x - size, y + size);
      pen.lineWidth = width;
      pen.strokeStyle = colour;
      pen.stroke();
    }
  }
}

function along(plan, station) {
  const stations = plan.columns.station;
  let k = nearestStation(plan, station);
  if (stations[k] > station && k > 0) k -= 1;
  const next = Math.min(k + 1, stations.length - 1);
  const length = stations[next] - stations[k];
  const share = length > 0 ? Math.min(Math.max((station - stations[k]) / length, 0), 1) : 0;
  const { x, y } = plan.columns;
  return {
    index: k,
    x: x[k] + share * (x[next] - x[k]),
    y: y[k] + share * (y[next] - y[k]),
    heading: Math.atan2(y[next] - y[Math.max(next - 1, 0)], x[next] - x[Math.max(next - 1, 0)]),
  };
}

// The emergency stop from the cursor, as a wide band along the path.
function paintStop(pen, plan) {
  const stop = plan.columns.stop_distance[state.cursor];
  if (!(stop > 0)) return;
  const end = along(plan, plan.columns.station[state.cursor] + stop);
  trace(pen, plan, state.cursor, end.index);
  pen.lineTo(toX(end.x), toY(end.y));
  pen.lineCap = "butt";
  pen.lineWidth = 17;
  pen.strokeStyle = colours.stop;
  pen.globalAlpha = 0.55;
  pen.stroke();
  pen.globalAlpha = 1;
  pen.lineCap = "round";
  bar(pen, end, 10, colours.stop, 3);
}

function paintClear(pen, plan) {
  if (!clearEndsBefore(plan)) return;
  bar(pen, along(plan, plan.clear), 12, colours.clear, 3);
}

function paintObstacle(pen, plan, size) {
  const met = plan.obstacle;
  if (met) warn(pen, toX(met.x), toY(met.y), size, styleOf(`--${data.limiting[met.code].key}`));
}

function bar(pen, at, half, colour, width) {
  const [dx, dy] = [Math.sin(at.heading) * half, Math.cos(at.heading) * half];
  for (const [thick, ink] of [[width + 2.5, colours["map-halo"]], [width, colour]]) {
    pen.beginPath();
    pen.moveTo(toX(at.x) - dx, toY(at.y) - dy);
    pen.lineTo(toX(at.x) + dx, toY(at.y) + dy);
    pen.lineWidth = thick;
    pen.strokeStyle = ink;
    pen.stroke();
  }
}

function paintCursor(pen, plan, k, size) {
  pen.beginPath();
  pen.arc(toX(plan.columns.x[k]), toY(plan.columns.y[k]), size, 0, 2 * Math.PI);
  pen.fillStyle = speedColour((plan.columns.speed[k] ?? 0) / topSpeed);
  pen.fill();
  pen.lineWidth = 4.5;
  pen.strokeStyle = "#16181a";
  pen.stroke();
  pen.lineWidth = 2;
  pen.strokeStyle = "#ffffff";
  pen.stroke();
}

function haloed(pen, text, x, y) {
  pen.font = `600 12px ${getComputedStyle(document.body).fontFamily}`;
  pen.lineWidth = 4;
  pen.strokeStyle = colours["map-halo"];
  pen.strokeText(text, x, y);
  pen.fillStyle = colours["map-ink"];
  pen.fillText(text, x, y);
}

function paintScaleBar(pen, width, height) {
  const wanted = Math.min(110, 0.2 * width) / view.scale;
  const step = niceStep(wanted, 1);
  const length = step > wanted * 1.5 ? step / 2 : step;
  const [x, y, long] = [14, height - 14, length * view.scale];
  pen.lineCap = "butt";
  for (const [thick, ink] of [[5, colours["map-halo"]], [2, colours["map-ink"]]]) {
    pen.beginPath();
    pen.moveTo(x, y - 6);
    pen.lineTo(x, y);
    pen.lineTo(x + long, y);
    pen.lineTo(x + long, y - 6);
    pen.lineWidth = thick;
    pen.strokeStyle = ink;
    pen.stroke();
  }
  pen.textAlign = "left";
  haloed(pen, `${Number(length.toPrecision(3))} m`, x + long + 7, y);
}

function paintNorth(pen, width) {
  const [x, y] = [width - 22, 14];
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x + 6, y + 19);
  pen.lineTo(x, y + 15);
  pen.lineTo(x - 6, y + 19);
  pen.closePath();
  pen.lineWidth = 3.5;
  pen.strokeStyle = colours["map-halo"];
  pen.stroke();
  pen.fillStyle = colours["map-ink"];
  pen.fill();
  pen.textAlign = "center";
  haloed(pen, "N", x, y + 33);
}

function nearestOnMap(px, py, reach) {
  let found = null;
  let least = reach * reach;
  plans.forEach((plan, index) => {
    const { x, y } = plan.columns;
    const bonus = index === state.selected ? 0.5 : 1;
    for (let k = 0; k < x.length; k += 1) {
      const distance = ((toX(x[k]) - px) ** 2 + (toY(y[k]) - py) ** 2) * bonus;
      if (distance < least) {
        least = distance;
        found = { plan: index, station: k };
      }
    }
  });
  return found;
}

function showTip(found, px, py) {
  const tip = element("tip");
  tip.hidden = !found;
  if (!found) return;
  const plan = plans[found.plan];
  const { station, speed, limiting } = plan.columns;
  const what = data.limiting[limiting[found.station]];
  tip.replaceChildren(
    make("b", {}, `${plan.rank} · ${plan.name}`),
    `${number(speed[found.station], 2, "m/s")} at ${number(station[found.station], 1, "m")}`,
    make("br"),
    make("span", {}, `${plan.status} · ${what.word}`),
  );
  const room = frame.clientWidth - tip.offsetWidth - 8;
  tip.style.left = `${Math.max(8, Math.min(px + 16, room))}px`;
  tip.style.top = `${py + 18 + tip.offsetHeight > frame.clientHeight ? py - tip.offsetHeight - 12 : py + 18}px`;
}

function startMap() {
  const pointers = new Map();
  let moved = 0;
  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const point = (event) => {
    const { x, y } = at(event);
    const found = nearestOnMap(x, y, event.pointerType === "touch" ? 34 : 22);
    hover(found);
    showTip(found, x, y);
    if (found && found.plan === state.selected) moveCursor(found.station);
    canvas.style.cursor = found ? "pointer" : "";
  };
  canvas.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, at(event));
    moved = 0;
    if (event.pointerType === "touch") point(event);
    else canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return point(event);
    const now = at(event);
    if (event.pointerType === "touch" && pointers.size === 1) return point(event);
    const [dx, dy] = [now.x - before.x, now.y - before.y];
    moved += Math.hypot(dx, dy);
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      const grown = Math.hypot(now.x - other.x, now.y - other.y) / Math.max(Math.hypot(before.x - other.x, before.y - other.y), 1);
      zoom(grown, (now.x + other.x) / 2, (now.y + other.y) / 2);
    }
    if (moved > 4) {
      frame.classList.add("dragging");
      view.x -= dx / view.scale / pointers.size;
      view.y += dy / view.scale / pointers.size;
      showTip(null);
      repaint();
    }
    pointers.set(event.pointerId, now);
  });
  const release = (event) => {
    const pressed = pointers.delete(event.pointerId);
    frame.classList.remove("dragging");
    if (event.type === "pointerup" && pressed && moved <= 4 && state.hovered) {
      const { plan, station } = state.hovered;
      if (plan !== state.selected) select(plan);
      moveCursor(station);
    }
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("pointerleave", () => { hover(null); showTip(null); });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
    event.preventDefault();
    const { x, y } = at(event);
    zoom(Math.exp(-event.deltaY * 0.01), x, y);
  }, { passive: false });
  canvas.addEventListener("dblclick", (event) => { const { x, y } = at(event); zoom(1.8, x, y); });
  element("zoom-in").addEventListener("click", () => zoom(1.5));
  element("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
  element("fit-paths").addEventListener("click", showPlans);
  element("fit-map").addEventListener("click", () => show(ground.bounds, 0));
  when("select", repaint);
  when("cursor", repaint);
  when("hover", repaint);
  relief.decode().then(() => { tinted = null; repaint(); }, () => {});
  let size = "";
  new ResizeObserver(() => {
    const now = `${frame.clientWidth}x${frame.clientHeight}`;
    if (now === size) return;
    size = now;
    showPlans();
  }).observe(frame);
  mapLegend();
}

function mapLegend() {
  const stops = Array.from({ length: 17 }, (_, i) => `${speedColour(i / 16)} ${(100 * i) / 16}%`);
  const bar = make("div", { class: "bar" });
  bar.style.background = `linear-gradient(90deg, ${stops.join(",")})`;
  const step = niceStep(topSpeed, 5);
  const marks = ticks(0, topSpeed, 5).map((value) => {
    const mark = make("span", {}, tickText(value, step));
    mark.style.left = `${(100 * value) / topSpeed}%`;
    return mark;
  });
  const scale = make("div", { class: "speed-scale" }, make("span", {}, "speed [m/s]"), bar, make("div", { class: "ticks" }, ...marks));
  const mark = (kind) => signed((pen) => {
    pen.lineCap = "round";
    markRest(pen, 8, 8, kind === "stop" ? 5 : 4.6, kind);
  });
  const warning = (colour) => signed((pen) => warn(pen, 8, 9, 5, colour));
  const line = (style) => draw("svg", { width: 22, height: 12, "aria-hidden": "true" }, draw("line", { x1: 2, x2: 20, y1: 6, y2: 6, style }));
  const item = (sign, text) => make("span", { class: "item" }, sign, text);
  const hatch = draw("svg", { width: 18, height: 12, "aria-hidden": "true" },
    draw("rect", { width: 18, height: 12, rx: 2, style: "fill:var(--unknown-ground);stroke:var(--unknown-hatch)" }),
    draw("path", { d: "M1 11L11 1M8 11L17 2", style: "stroke:var(--unknown-hatch);stroke-width:1.4" }));
  const kinds = new Set(plans.map(endOf));
  const items = [];
  if (kinds.has("end")) items.push(item(mark("end"), "end of the path"));
  if (kinds.has("stop")) items.push(item(mark("stop"), "stops before it"));
  if (kinds.has("cross")) items.push(item(mark("cross"), "cannot stop in time"));
  if (kinds.has("stop") || kinds.has("cross")) items.push(item(line("stroke:var(--not-driven);stroke-width:2.4;stroke-dasharray:.1 5;stroke-linecap:round"), "not driven"));
  items.push(item(draw("svg", { width: 22, height: 12, "aria-hidden": "true" }, draw("path", { d: "M1 6H18", style: "stroke:var(--stop);stroke-width:8;opacity:.55" }), draw("path", { d: "M18.5 0V12", style: "stroke:var(--stop);stroke-width:2.6" })), "emergency stop from the cursor"));
  if (plans.some(clearEndsBefore)) items.push(item(draw("svg", { width: 10, height: 12, "aria-hidden": "true" }, draw("path", { d: "M5 0V12", style: "stroke:var(--clear);stroke-width:2.8" })), "end of the clear distance"));
  const met = [...new Set(plans.filter((plan) => plan.obstacle).map((plan) => plan.obstacle.code))];
  met.forEach((code) => items.push(item(warning(styleOf(`--${data.limiting[code].key}`)), `obstacle: ${data.limiting[code].word}`)));
  items.push(item(hatch, "unknown ground"));
  if (contourPaths.length) items.push(item(line("stroke:var(--contour);stroke-width:1.4"), `contours every ${Number(ground.interval.toPrecision(3))} m`));
  ground.surfaces.forEach((surface) => items.push(item(line("stroke:var(--surface);stroke-width:1.6;stroke-dasharray:4 3"), surface.name)));
  element("map-legend").replaceChildren(scale, ...items);
}
