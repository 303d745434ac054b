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

// What body or wheels must not come to: a triangle in the colour of its bound.
function warn(pen, x, y, size, colour) {
  pen.save();
  pen.translate(x, y);
  pen.lineJoin = "round";
  pen.beginPath();
  pen.moveTo(0, -1.15 * size);
  pen.lineTo(1.1 * size, 0.8 * size);
  pen.lineTo(-1.1 * size, 0.8 * size);
  pen.closePath();
  pen.lineWidth = 4.5;
  pen.strokeStyle = "#16181a";
  pen.stroke();
  pen.lineWidth = 2;
  pen.strokeStyle = "#ffffff";
  pen.stroke();
  pen.fillStyle = colour;
  pen.fill();
  pen.fillStyle = "#ffffff";
  const [wide, high] = [0.24 * size, 0.85 * size];
  pen.fillRect(-wide / 2, -0.42 * size, wide, 0.7 * high);
  pen.fillRect(-wide / 2, 0.38 * size, wide, wide);
  pen.restore();
}

// A sign for a legend, 16 by 16, that a pen paints.
function signed(paint) {
  const small = make("canvas", { width: 32, height: 32, "aria-hidden": "true" });
  small.style.cssText = "width:16px;height:16px";
  const pen = small.getContext("2d");
  pen.scale(2, 2);
  paint(pen);
  return small;
}
