// Round numbers for axes, and the colours of speed.

function niceStep(span, wanted) {
  const rough = Math.max(span, 1e-9) / wanted;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * 0.999);
}

function ticks(low, high, wanted) {
  const step = niceStep(high - low, wanted);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-6); i * step <= high + 1e-6 * step; i += 1) found.push(i * step);
  return found;
}

function tickText(value, step) {
  const digits = Math.min(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), 6);
  return number(value, digits);
}

function span(values) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value === null || !Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : [0, 1];
}

// "Plasma" without its ends: perceptually uniform, and told apart by the colour-blind.
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

// The end of the colour scale for plans that reach some speed.
function roundedTop(speeds) {
  const [, top] = span(speeds);
  const high = Math.max(top, 0.1);
  const step = niceStep(high, 8);
  return step * Math.ceil(high / step - 1e-6);
}
