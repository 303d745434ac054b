// Paints a map on a canvas: relief, contours, candidates coloured by speed, and marks.

class MapPainter {
  constructor(canvas, frame) {
    Object.assign(this, { canvas, frame, x: 0, y: 0, scale: 1, ground: null, image: null, tinted: null, topSpeed: 1 });
  }

  // offset: where the centre of cell [0, 0] lies in the coordinates of the paths.
  setGround(ground, image, offset = [0, 0]) {
    Object.assign(this, { ground, image, offset, tinted: null });
    this.contours = ground.contours.map((line) => ({ strong: line.strong, path: new Path2D(line.path) }));
    this.surfaces = ground.surfaces.map((surface) => new Path2D(surface.path));
  }

  toX(x) { return (x - this.x) * this.scale; }

  toY(y) { return (this.y - y) * this.scale; }

  bounds() {
    const [left, right, bottom, top] = this.ground?.bounds ?? [0, 1, 0, 1];
    const [x, y] = this.offset ?? [0, 0];
    return [left + x, right + x, bottom + y, top + y];
  }

  fit([left, right, bottom, top], margin = 0) {
    const { clientWidth: width, clientHeight: height } = this.frame;
    const smallest = 2 * (this.ground?.cell ?? 0.5);
    const [wide, high] = [right - left, top - bottom].map((side) => Math.max(side, smallest) + 2 * margin);
    this.scale = Math.min(width / wide, height / high);
    this.x = (left + right) / 2 - width / 2 / this.scale;
    this.y = (bottom + top) / 2 + height / 2 / this.scale;
  }

  // Relief and contours; returns the pen for what is on top, null while the map has no size.
  begin() {
    const sharp = Math.max(window.devicePixelRatio || 1, 1);
    const { clientWidth: width, clientHeight: height } = this.frame;
    if (!width || !height) return null;
    Object.assign(this.canvas, { width: Math.round(width * sharp), height: Math.round(height * sharp) });
    const pen = this.canvas.getContext("2d");
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.lineCap = pen.lineJoin = "round";
    hatchUnknown(pen, width, height);
    if (this.ground) this.paintGround(pen, sharp);
    return pen;
  }

  paintGround(pen, sharp) {
    const [left, right, bottom, top] = this.bounds();
    if (!this.tinted && this.image?.naturalWidth) this.tinted = tintedRelief(this.image);
    pen.imageSmoothingQuality = "high";
    if (this.tinted) pen.drawImage(this.tinted, this.toX(left), this.toY(top), (right - left) * this.scale, (top - bottom) * this.scale);
    // Coordinates of lines are tenths of a cell from the centre of the first one, northwards.
    const unit = (this.scale * this.ground.cell) / 10;
    const [x, y] = this.offset.map((at) => at + this.ground.first);
    pen.save();
    pen.setTransform(sharp * unit, 0, 0, -sharp * unit, sharp * this.toX(x), sharp * this.toY(y));
    pen.strokeStyle = styleOf("--contour");
    for (const line of this.contours) {
      pen.lineWidth = (line.strong ? 1.5 : 0.8) / unit;
      pen.stroke(line.path);
    }
    pen.strokeStyle = pen.fillStyle = styleOf("--surface");
    pen.lineWidth = 1.3 / unit;
    pen.setLineDash([5 / unit, 4 / unit]);
    for (const path of this.surfaces) {
      pen.globalAlpha = 0.16;
      pen.fill(path, "evenodd");
      pen.globalAlpha = 1;
      pen.stroke(path);
    }
    pen.restore();
  }

  trace(pen, { x, y }, from = 0, to = x.length - 1) {
    pen.beginPath();
    pen.moveTo(this.toX(x[from]), this.toY(y[from]));
    for (let k = from + 1; k <= to; k += 1) pen.lineTo(this.toX(x[k]), this.toY(y[k]));
  }

  // line: columns x, y, speed. rest: index of the station from which it is not driven.
  paintPlan(pen, line, rest, width, alpha = 1) {
    const { speed } = line;
    const last = line.x.length - 1;
    pen.globalAlpha = alpha;
    if (rest < last) {
      pen.setLineDash([1, width + 2.5]);
      pen.strokeStyle = styleOf("--not-driven");
      pen.lineWidth = Math.max(1.6, 0.45 * width);
      this.trace(pen, line, rest, last);
      pen.stroke();
      pen.setLineDash([]);
    }
    if (rest > 0) {
      pen.strokeStyle = styleOf("--casing");
      pen.lineWidth = width + (width > 3 ? 2.6 : 1.4);
      this.trace(pen, line, 0, rest);
      pen.stroke();
    }
    // One stroke per colour: neighbours of about the same speed together.
    pen.lineWidth = width;
    const shade = (k) => Math.round((24 * ((speed[k] ?? 0) + (speed[k + 1] ?? 0))) / this.topSpeed);
    let from = 0;
    for (let k = 0; k < rest; k += 1) {
      if (k + 1 < rest && shade(k + 1) === shade(from)) continue;
      pen.strokeStyle = speedColour(shade(from) / 48);
      this.trace(pen, line, from, k + 1);
      pen.stroke();
      from = k + 1;
    }
    pen.globalAlpha = 1;
  }

  paintObstacle(pen, obstacle, size, limiting) {
    if (obstacle) warn(pen, this.toX(obstacle.x), this.toY(obstacle.y), size, styleOf(`--${limiting}`));
  }

  paintScaleBar(pen) {
    const { clientWidth: width, clientHeight: height } = this.frame;
    const rough = Math.min(110, 0.2 * width) / this.scale;
    const step = niceStep(rough, 1);
    const length = step > rough * 1.5 ? step / 2 : step;
    const [x, y, end] = [14, height - 14, 14 + length * this.scale];
    pen.lineCap = "butt";
    strokeHaloed(pen, 2, 3, styleOf("--map-ink"), [[x, y - 6], [x, y], [end, y], [end, y - 6]]);
    pen.textAlign = "left";
    writeHaloed(pen, `${Number(length.toPrecision(3))} m`, end + 7, y);
  }

  paintNorth(pen) {
    const [x, y] = [this.frame.clientWidth - 22, 14];
    pen.beginPath();
    [[x, y], [x + 6, y + 19], [x, y + 15], [x - 6, y + 19]].forEach(([a, b]) => pen.lineTo(a, b));
    pen.closePath();
    pen.lineWidth = 3.5;
    pen.strokeStyle = styleOf("--map-halo");
    pen.stroke();
    pen.fillStyle = styleOf("--map-ink");
    pen.fill();
    pen.textAlign = "center";
    writeHaloed(pen, "N", x, y + 33);
  }
}

function strokeHaloed(pen, width, halo, colour, points) {
  for (const [thick, ink] of [[width + halo, styleOf("--map-halo")], [width, colour]]) {
    pen.beginPath();
    points.forEach(([x, y]) => pen.lineTo(x, y));
    pen.lineWidth = thick;
    pen.strokeStyle = ink;
    pen.stroke();
  }
}

function writeHaloed(pen, text, x, y) {
  pen.font = `600 12px ${getComputedStyle(document.body).fontFamily}`;
  pen.lineWidth = 4;
  pen.strokeStyle = styleOf("--map-halo");
  pen.strokeText(text, x, y);
  pen.fillStyle = styleOf("--map-ink");
  pen.fillText(text, x, y);
}

// Strokes the current path in white with a dark edge: visible on any ground.
function strokeMark(pen) {
  for (const [width, colour] of [[4.5, "#16181a"], [2, "#ffffff"]]) {
    pen.lineWidth = width;
    pen.strokeStyle = colour;
    pen.stroke();
  }
}

// The grey relief on coloured paper, transparent where the ground is unknown.
function tintedRelief(image) {
  const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0);
  pen.globalCompositeOperation = "multiply";
  pen.fillStyle = styleOf("--paper");
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.globalCompositeOperation = "destination-in";
  pen.drawImage(image, 0, 0);
  return canvas;
}

// Background behind the relief: visible where the ground is unknown.
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

// An obstacle: a triangle in the colour of its bound.
function warn(pen, x, y, size, colour) {
  pen.beginPath();
  [[0, -1.15], [1.1, 0.8], [-1.1, 0.8]].forEach(([a, b]) => pen.lineTo(x + a * size, y + b * size));
  pen.closePath();
  strokeMark(pen);
  pen.fillStyle = colour;
  pen.fill();
  pen.fillStyle = "#ffffff";
  const wide = 0.24 * size;
  pen.fillRect(x - wide / 2, y - 0.42 * size, wide, 0.6 * size);
  pen.fillRect(x - wide / 2, y + 0.38 * size, wide, wide);
}

// A sign for a legend, 16 by 16.
function signed(paint) {
  const canvas = make("canvas", { width: 32, height: 32, "aria-hidden": "true" });
  canvas.style.cssText = "width:16px;height:16px";
  const pen = canvas.getContext("2d");
  pen.scale(2, 2);
  pen.lineCap = pen.lineJoin = "round";
  paint(pen);
  return canvas;
}

const legendItem = (sign, text) => make("span", { class: "item" }, sign, text);
