// The map of the live page: relief, candidates, and the chosen plan coloured by speed.

const painter = new MapPainter(element("canvas"), element("map"));
let shownPlan = null;
let followsPlan = true;

async function loadGround() {
  const response = await fetch("/map", { cache: "no-store" });
  const ground = response.ok ? await response.json() : null;
  if (!ground) return;
  const image = new Image();
  image.src = ground.picture;
  await image.decode();
  painter.setGround(ground, image, ground.origin);
  paintMap();
}

function showOnMap(plan) {
  shownPlan = plan;
  painter.topSpeed = Math.max(roundedTop(plan?.chosen?.speed ?? []), painter.topSpeed);
  paintMap();
}

const shownLines = () => (shownPlan?.chosen ? [shownPlan.chosen, ...shownPlan.others] : shownPlan?.others ?? []);

function fitMap() {
  const lines = shownLines();
  if (!followsPlan || !lines.length) return painter.fit(painter.bounds());
  const [left, right] = span(lines.flatMap((line) => line.x));
  const [bottom, top] = span(lines.flatMap((line) => line.y));
  return painter.fit([left, right, bottom, top], 0.1 * Math.max(right - left, top - bottom) + 1);
}

function paintMap() {
  fitMap();
  const pen = painter.begin();
  if (!pen) return;
  for (const line of shownPlan?.others ?? []) paintOther(pen, line);
  const chosen = shownPlan?.chosen;
  shownPlan?.others.forEach(({ obstacle }) => painter.paintObstacle(pen, obstacle, 5, obstacle?.bound));
  if (chosen) {
    painter.paintPlan(pen, chosen, chosen.speed.findLastIndex((speed) => speed > 0) + 1 || 0, 5);
    painter.paintObstacle(pen, chosen.obstacle, 9, chosen.obstacle?.bound);
  }
  const [x, y, heading] = shownPlan?.pose ?? (chosen ? [chosen.x[0], chosen.y[0], Math.atan2(chosen.y[1] - chosen.y[0], chosen.x[1] - chosen.x[0])] : []);
  if (x !== undefined && x !== null) paintVehicle(pen, painter.toX(x), painter.toY(y), heading);
  painter.paintScaleBar(pen);
}

function paintOther(pen, line) {
  pen.strokeStyle = styleOf("--not-driven");
  pen.globalAlpha = 0.55;
  pen.setLineDash(line.status === "infeasible" ? [2, 5] : []);
  pen.lineWidth = 1.3;
  painter.trace(pen, line);
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

function paintVehicle(pen, x, y, heading) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(-heading);
  pen.beginPath();
  [[11, 0], [-8, 7], [-4, 0], [-8, -7]].forEach(([ahead, right]) => pen.lineTo(ahead, right));
  pen.closePath();
  strokeMark(pen);
  pen.fillStyle = "#ffffff";
  pen.fill();
  pen.restore();
}

function showMapLegend(version) {
  const { ground } = painter;
  const note = (text) => make("span", { class: "item" }, text);
  const outlined = (ground?.surfaces ?? []).map((surface) => note(`outlined: ${surface.name || "base"}`));
  const behind = ground && version > ground.version ? [note(`drawn: version ${ground.version}`)] : [];
  element("map-legend").replaceChildren(speedScale(painter.topSpeed), note("hatched: unknown ground"), note("triangle: obstacle"), ...outlined, ...behind);
}

function chooseView(plan) {
  followsPlan = plan;
  element("follow").setAttribute("aria-pressed", String(plan));
  element("whole").setAttribute("aria-pressed", String(!plan));
  paintMap();
}

element("follow").addEventListener("click", () => chooseView(true));
element("whole").addEventListener("click", () => chooseView(false));
new ResizeObserver(paintMap).observe(element("map"));
