// Basics of every page: elements, formatted numbers, ticks and the colours of speed.

const data = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const styleOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A number as text; a dash where it is missing.
function number(value, digits = 2, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  let text = value.toFixed(digits);
  if (Number(text) === 0) text = (0).toFixed(digits);
  text = text.replace("-", "−");
  return unit === "%" || unit === "°" ? text + unit : unit ? `${text}\u202f${unit}` : text;
}

const degrees = (radians) => (radians === null ? null : (radians * 180) / Math.PI);
const percent = (share) => (share === null ? null : 100 * share);

// HTML without markup in strings: names stay text.
function make(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function draw(tag, attributes = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function badge(status, label = status) {
  const icon = draw("svg", { "aria-hidden": "true" }, draw("use", { href: `#icon-${status}` }));
  return make("span", { class: `badge ${status}` }, icon, label);
}

const swatch = (limiting) => make("span", { class: "swatch", "data-limiting": limiting.key });

// A list of names and values; a value is text or nodes.
const definitions = (rows) => rows.map(([name, ...values]) => make("div", {}, make("dt", {}, name), make("dd", {}, ...values)));

function niceStep(span, count) {
  const rough = Math.max(span, 1e-9) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * 0.999);
}

function tickText(value, step) {
  const digits = Math.min(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), 6);
  return number(value, digits);
}

function span(values) {
  const finite = values.filter((value) => value !== null && Number.isFinite(value));
  return finite.length ? [finite.reduce((a, b) => Math.min(a, b)), finite.reduce((a, b) => Math.max(a, b))] : [0, 1];
}

// The end of the colour scale for plans that reach these speeds.
function roundedTop(speeds) {
  const high = Math.max(span(speeds)[1], 0.1);
  const step = niceStep(high, 8);
  return step * Math.ceil(high / step - 1e-6);
}

// "Plasma" without its ends: perceptually uniform, and distinct to the colour-blind.
const SPEED_COLOURS = [
  [48, 5, 151], [92, 1, 166], [132, 5, 167], [168, 34, 150], [198, 61, 128],
  [221, 94, 102], [240, 127, 79], [251, 165, 55], [252, 206, 37],
];

function speedColour(share) {
  const at = Math.min(Math.max(share, 0), 1) * (SPEED_COLOURS.length - 1);
  const low = Math.min(Math.floor(at), SPEED_COLOURS.length - 2);
  const mixed = SPEED_COLOURS[low].map((value, i) => Math.round(value + (at - low) * (SPEED_COLOURS[low + 1][i] - value)));
  return `rgb(${mixed.join(",")})`;
}

function speedScale(top) {
  const colours = SPEED_COLOURS.map((_, i) => speedColour(i / (SPEED_COLOURS.length - 1)));
  const strip = make("span", { class: "bar" });
  strip.style.background = `linear-gradient(90deg, ${colours.join(", ")})`;
  const step = niceStep(top, 5);
  const marks = Array.from({ length: Math.floor(top / step + 1e-6) + 1 }, (_, i) => {
    const mark = make("span", {}, tickText(i * step, step));
    mark.style.left = `${(100 * i * step) / top}%`;
    return mark;
  });
  return make("div", { class: "speed-scale" }, make("span", {}, "speed [m/s]"), strip, make("span", { class: "ticks" }, ...marks));
}
