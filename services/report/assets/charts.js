// Line charts by uPlot in the colours of the page, and the ribbon of limits below them.

const FAMILY = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';
const RIBBON = 20;
const NO_MOUSE = Object.fromEntries(["mousedown", "mouseup", "click", "dblclick", "mousemove", "mouseleave", "mouseenter"].map((name) => [name, () => null]));

// curve: label, values, colour (a variable); optional width, dash, fill (opacity), isStepped, hasDots (no line), hasCursor.
function seriesOf(curve) {
  const colour = curve.colour && styleOf(`--${curve.colour}`);
  return {
    label: curve.label,
    stroke: colour,
    width: colour ? curve.width ?? 2 : 0,
    dash: curve.dash,
    fill: curve.fill && `color-mix(in srgb, ${styleOf(`--${curve.fillColour ?? curve.colour}`)} ${100 * curve.fill}%, transparent)`,
    fillTo: (plot) => plot.scales.y.min,
    paths: curve.hasDots ? () => null : curve.isStepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
    points: curve.hasDots ? { show: true, size: 9, width: 1, fill: colour, stroke: styleOf(`--${curve.edge ?? "panel"}`) } : { show: false },
  };
}

// chart: x (increasing), curves, range of y, height, width; optional end of x, unit of x, hasRibbon, bands, under, over, onReady.
function lineChart(host, chart) {
  const texts = (unit) => (plot, splits, axis, space, step) => splits.map((value) => (value === 0 && unit ? `0 ${unit}` : tickText(value, step)));
  const axis = { stroke: styleOf("--soft"), font: `11.5px ${FAMILY}`, grid: { stroke: styleOf("--grid"), width: 1 }, ticks: { show: false } };
  const ribbon = chart.hasRibbon ? RIBBON : 0;
  const plot = new uPlot({
    width: chart.width,
    height: chart.height + ribbon,
    padding: [8, 10, 0, 0],
    legend: { show: false },
    scales: { x: { time: false, range: [0, chart.end ?? Math.max(chart.x.at(-1), 1e-3)] }, y: { range: () => chart.range } },
    axes: [
      { ...axis, size: 20 + ribbon, gap: 4 + ribbon, space: 70, values: texts(chart.unit) },
      { ...axis, size: 46, gap: 6, space: 30, values: texts() },
    ],
    cursor: { y: false, drag: { x: false, y: false }, bind: NO_MOUSE, points: { size: 8, show: (u, i) => chart.curves[i - 1].hasCursor && cursorDot(chart.curves[i - 1]) } },
    series: [{}, ...chart.curves.map(seriesOf)],
    bands: chart.bands,
    hooks: { drawAxes: [(u) => chart.under?.(u)], draw: [(u) => chart.over?.(u)], ready: [(u) => chart.onReady?.(u)] },
  }, [chart.x, ...chart.curves.map((curve) => curve.values)], host);
  plot.root.setAttribute("aria-hidden", "true");
  return plot;
}

function cursorDot(curve) {
  const dot = make("div", { class: "dot" });
  dot.style.background = `var(--${curve.colour})`;
  return dot;
}

const canvasX = (plot, value) => plot.valToPos(value, "x", true);

// runs: from, to (stations), key of the bound, word, dark text, isBehind where it is not driven.
function paintRibbon(plot, runs) {
  const { ctx: pen, bbox } = plot;
  const px = uPlot.pxRatio;
  const top = bbox.top + bbox.height + 3 * px;
  pen.save();
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  for (const run of runs) {
    const [left, right] = [canvasX(plot, run.from), canvasX(plot, run.to)];
    pen.globalAlpha = run.isBehind ? 0.35 : 1;
    pen.fillStyle = styleOf(`--${run.key}`);
    pen.beginPath();
    pen.roundRect(left, top, Math.max(right - left - px, 0.8 * px), (RIBBON - 2) * px, 2 * px);
    pen.fill();
    pen.globalAlpha = 1;
    pen.font = `${run.isBehind ? 400 : 600} ${11.5 * px}px ${FAMILY}`;
    if (right - left < pen.measureText(run.word).width + 8 * px) continue;
    pen.fillStyle = run.isBehind ? styleOf("--ink") : run.dark ? "#14171a" : "#fff";
    pen.fillText(run.word, (left + right) / 2, top + (RIBBON / 2 - 0.5) * px);
  }
  pen.restore();
}

// A text on the plot, readable on any curve.
function paintText(plot, text, x, y, { colour = "soft", align = "left", font = "" } = {}) {
  const { ctx: pen } = plot;
  pen.save();
  pen.font = `${font} ${11.5 * uPlot.pxRatio}px ${FAMILY}`;
  pen.textAlign = align;
  pen.lineWidth = 4 * uPlot.pxRatio;
  pen.strokeStyle = styleOf("--panel");
  pen.strokeText(text, x, y);
  pen.fillStyle = styleOf(`--${colour}`);
  pen.fillText(text, x, y);
  pen.restore();
}
