// Start, and follow what the reader's screen does.

if (plans.length) {
  readColours();
  startMap();
  startCharts();
  startDetails();
  startTable();
  const wanted = /^#candidate-(\d+)$/.exec(window.location.hash);
  const asked = wanted ? plans.findIndex((plan) => plan.rank === Number(wanted[1])) : -1;
  select(asked >= 0 ? asked : state.selected);
  const recolour = () => { readColours(); repaint(); };
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  window.addEventListener("beforeprint", () => { readColours(); drawCharts(); paintMap(); });
  window.addEventListener("afterprint", () => { recolour(); drawCharts(); });
}
