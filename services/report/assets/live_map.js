// The map: relief, contours, candidates, and the chosen plan coloured by speed.

const canvas = element("canvas");
const frame = element("map");
const view = { x: 0, y: 0, scale: 1, follow: true };
let ground = null;
let picture = null;
let contours = [];
let surfaces = [];
let shownPlan = null;
let topSpeed = 1;

const toX = (x) => (x - view.x) * view.scale;
const toY = (y) => (view.y - y) * view.scale;

async function takeGround() {
  const response = await fetch("/map", { cache: "no-store" });
  const table = response.ok ? await response.json() : null;
  if (!table) return;
  const image = new Image();
  image.src = table.picture;
  await image.decode();
  ground = table;
  contours = table.contours.map((line) => ({ strong: line.strong, path: new Path2D(line.path) }));
  surfaces = table.surfaces.map((surface) => ({ name: surface.name, path: new Path2D(surface.path) }));
  picture = tintedRelief(image);
  paint();
}

function takePlan(plan) {
  shownPlan = plan;
  const top = Math.max(roundedTop(plan?.chosen?.speed ?? []), topSpeed);
  topSpeed = top;
  paint();
}

function boundsOfGround() {
  if (!ground) return [0, 1, 0, 1];
  const [left, right, bottom, top] = ground.bounds;
  const [x, y] = ground.origin;
  return [left + x, right + x, bottom + y, top + y];
}

function boundsOfPlan() {
  const lines = shownPlan?.chosen ? [shownPlan.chosen, ...shownPlan.others] : shownPlan?.others ?? [];
  if (!lines.length) return boundsOfGround();
  const [left, right] = span(lines.flatMap((line) => line.x));
  const [bottom, top] = span(lines.flatMap((line) => line.y));
  const margin = 0.1 * Math.max(right - left, top - bottom) + 1;
  return [left - margin, right + margin, bottom - margin, top + margin];
}

function fit([left, right, bottom, top]) {
  const { clientWidth: width, clientHeight: height } = frame;
  view.scale = Math.min(width / (right - left), height / (top - bottom));
  view.x = (left + right) / 2 - width / 2 / view.scale;
  view.y = (bottom + top) / 2 + height / 2 / view.scale;
}

function paint() {
  const sharp = Math.max(window.devicePixelRatio || 1, 1);
  const { clientWidth: width, clientHeight: height } = frame;
  if (!width || !height) return;
  canvas.width = Math.round(width * sharp);
  canvas.height = Math.round(height * sharp);
  fit(view.follow ? boundsOfPlan() : boundsOfGround());
  const pen = canvas.getContext("2d");
  pen.setTransform(sharp, 0, 0, sharp, 0, 0);
  pen.lineJoin = pen.lineCap = "round";
  paintGround(pen, width, height, sharp);
  if (shownPlan) paintAnswer(pen, shownPlan);
  paintScale(pen, height);
}

function paintGround(pen, width, height, sharp) {
  hatchUnknown(pen, width, height);
  if (!ground) return;
  const [left, right, bottom, top] = boundsOfGround();
  pen.imageSmoothingQuality = "high";
  pen.drawImage(picture, toX(left), toY(top), (right - left) * view.scale, (top - bottom) * view.scale);
  // Lines count in tenths of a cell from the centre of the first one, northwards.
  const unit = (view.scale * ground.cell) / 10;
  const [x, y] = [ground.origin[0] + ground.first, ground.origin[1] + ground.first];
  pen.save();
  pen.setTransform(sharp * unit, 0, 0, -sharp * unit, sharp * toX(x), sharp * toY(y));
  pen.strokeStyle = styleOf("--contour");
  for (const line of contours) {
    pen.lineWidth = (line.strong ? 1.5 : 0.8) / unit;
    pen.stroke(line.path);
  }
  pen.strokeStyle = pen.fillStyle = styleOf("--surface");
  for (const surface of surfaces) {
    pen.globalAlpha = 0.16;
    pen.fill(surface.path, "evenodd");
    pen.globalAlpha = 1;
    pen.lineWidth = 1.3 / unit;
    pen.stroke(surface.path);
  }
  pen.restore();
}

function follow(pen, line, from, to) {
  pen.beginPath();
  pen.moveTo(toX(line.x[from]), toY(line.y[from]));
  for (let k = from + 1; k <= to; k += 1) pen.lineTo(toX(line.x[k]), toY(line.y[k]));
}

function paintAnswer(pen, answer) {
  pen.strokeStyle = styleOf("--not-driven");
  pen.globalAlpha = 0.55;
  for (const line of answer.others) {
    pen.setLineDash(line.status === "infeasible" ? [2, 5] : []);
    pen.lineWidth = 1.3;
    follow(pen, line, 0, line.x.length - 1);
    pen.stroke();
  }
  pen.setLineDash([]);
  pen.globalAlpha = 1;
  const plan = answer.chosen;
  answer.others.forEach((line) => paintMet(pen, line.obstacle, 5));
  if (plan) paintChosen(pen, plan);
  if (plan) paintMet(pen, plan.obstacle, 9);
  const [x, y, heading] = answer.pose ?? (plan ? [plan.x[0], plan.y[0], Math.atan2(plan.y[1] - plan.y[0], plan.x[1] - plan.x[0])] : []);
  if (x !== undefined && x !== null) paintVehicle(pen, toX(x), toY(y), heading);
}

function paintMet(pen, met, size) {
  if (met) warn(pen, toX(met.x), toY(met.y), size, styleOf(`--${met.bound}`));
}

function paintChosen(pen, plan) {
  const last = plan.x.length - 1;
  pen.strokeStyle = styleOf("--casing");
  pen.lineWidth = 8;
  follow(pen, plan, 0, last);
  pen.stroke();
  pen.lineWidth = 5;
  for (let k = 0; k < last; k += 1) {
    const mean = ((plan.speed[k] ?? 0) + (plan.speed[k + 1] ?? 0)) / 2;
    pen.strokeStyle = mean > 0 ? speedColour(mean / topSpeed) : styleOf("--not-driven");
    follow(pen, plan, k, k + 1);
    pen.stroke();
  }
}

function paintVehicle(pen, x, y, heading) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(-heading);
  pen.beginPath();
  pen.moveTo(11, 0);
  pen.lineTo(-8, 7);
  pen.lineTo(-4, 0);
  pen.lineTo(-8, -7);
  pen.closePath();
  pen.fillStyle = "#ffffff";
  pen.strokeStyle = "#16181a";
  pen.lineWidth = 2;
  pen.fill();
  pen.stroke();
  pen.restore();
}

function paintScale(pen, height) {
  const wanted = 90 / view.scale;
  const step = niceStep(wanted, 1);
  const long = step * view.scale > 160 ? step / 2 : step;
  pen.strokeStyle = pen.fillStyle = styleOf("--map-ink");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(14, height - 20);
  pen.lineTo(14, height - 14);
  pen.lineTo(14 + long * view.scale, height - 14);
  pen.lineTo(14 + long * view.scale, height - 20);
  pen.stroke();
  pen.font = `600 12px ${getComputedStyle(document.body).fontFamily}`;
  pen.fillText(`${Number(long.toPrecision(3))} m`, 21 + long * view.scale, height - 13);
}

function showMapLegend(version) {
  const marked = ticks(0, topSpeed, 4);
  const marks = marked.map((value) => {
    const mark = make("span", {}, tickText(value, marked[1]));
    mark.style.left = `${(100 * value) / topSpeed}%`;
    return mark;
  });
  const bar = make("span", { class: "bar" });
  const stops = SPEED_COLOURS.map((_, i) => speedColour(i / (SPEED_COLOURS.length - 1)));
  bar.style.background = `linear-gradient(90deg, ${stops.join(", ")})`;
  const scale = make("span", { class: "speed-scale" }, make("span", {}, "speed, m/s"), bar, make("span", { class: "ticks" }, ...marks));
  const named = surfaces.map((surface) => make("span", { class: "item" }, `outlined: ${surface.name || "base"}`));
  const behind = ground && version > ground.version ? [make("span", { class: "item" }, `drawn: version ${ground.version}`)] : [];
  element("map-legend").replaceChildren(scale, make("span", { class: "item" }, "hatched: unknown ground"), make("span", { class: "item" }, "triangle: obstacle"), ...named, ...behind);
}

function look(at) {
  view.follow = at === "plan";
  element("follow").setAttribute("aria-pressed", String(view.follow));
  element("whole").setAttribute("aria-pressed", String(!view.follow));
  paint();
}

element("follow").addEventListener("click", () => look("plan"));
element("whole").addEventListener("click", () => look("map"));
new ResizeObserver(paint).observe(frame);
