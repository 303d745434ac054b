// What every page needs: elements, numbers as people read them.

const data = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const styleOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Numbers as people read them; none is a dash.
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
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

function draw(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

function badge(status, label = status) {
  const icon = draw("svg", { "aria-hidden": "true" }, draw("use", { href: `#icon-${status}` }));
  return make("span", { class: `badge ${status}` }, icon, label);
}

function swatch(limiting) {
  return make("span", { class: "swatch", "data-limiting": limiting.key });
}

// The grey relief on coloured paper, clear where the ground is unknown.
function tintedRelief(image) {
  const made = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
  const pen = made.getContext("2d");
  pen.drawImage(image, 0, 0);
  pen.globalCompositeOperation = "multiply";
  pen.fillStyle = styleOf("--paper");
  pen.fillRect(0, 0, made.width, made.height);
  pen.globalCompositeOperation = "destination-in";
  pen.drawImage(image, 0, 0);
  return made;
}

// What lies behind the relief, and shows where the ground is unknown.
function hatchUnknown(pen, width, height) {
  pen.fillStyle = styleOf("--unknown-ground");
  pen.fillRect(0, 0, width, height);
  pen.strokeStyle = styleOf("--unknown-hatch");
  pen.lineWidth = 1;
  pen.beginPath();
  for (let x = -height; x < width; x += 9) {
    pen.moveTo(x, height);
    pen.lineTo(x + height, 0);
  }
  pen.stroke();
}
