// The table of candidates: sorts by its columns, selects by its rows, shows each speed in small.

const body = element("table").tBodies[0];

function spark(plan) {
  const { station, speed } = plan.columns;
  const end = Math.max(station.at(-1), 1e-3);
  const rest = restOf(plan);
  const point = (k) => `${(1 + (114 * station[k]) / end).toFixed(1)} ${(22 - (20 * (speed[k] ?? 0)) / topSpeed).toFixed(1)}`;
  const every = Math.max(1, Math.floor(station.length / 116));
  const kept = station.map((_, k) => k).filter((k) => k <= rest && (k % every === 0 || k === rest));
  const line = kept.map(point).join("L");
  const [from, to] = [point(0), point(rest)].map((text) => text.split(" ")[0]);
  return draw("svg", { viewBox: "0 0 116 24", "aria-hidden": "true" },
    draw("path", { d: `M${from} 22L${line}L${to} 22Z`, style: "fill:var(--accent);opacity:.2" }),
    draw("path", { d: `M${line}`, style: "fill:none;stroke:var(--accent);stroke-width:1.5;stroke-linejoin:round" }),
    draw("path", { d: `M${to} 22.5H115`, style: "fill:none;stroke:var(--faint);stroke-width:1.4;stroke-dasharray:2 3" }));
}

function markRow() {
  for (const row of body.rows) {
    const on = Number(row.dataset.plan) === state.selected;
    row.classList.toggle("selected", on);
    row.querySelector(".pick").setAttribute("aria-pressed", String(on));
  }
}

function sortBy(column, heading) {
  const numeric = heading.classList.contains("number") || column === 2;
  const up = heading.getAttribute("aria-sort") !== "ascending";
  for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", up ? "ascending" : "descending");
  const valueOf = (row) => row.cells[column].dataset.value ?? "";
  const order = [...body.rows].sort((a, b) => {
    const [left, right] = [valueOf(a), valueOf(b)];
    if ((left === "") !== (right === "")) return left === "" ? 1 : -1; // what is missing goes last
    const way = numeric ? Number(left) - Number(right) : left.localeCompare(right, undefined, { numeric: true });
    return (up ? way : -way) || Number(a.dataset.plan) - Number(b.dataset.plan);
  });
  body.append(...order);
}

function startTable() {
  for (const row of body.rows) row.querySelector(".spark").append(spark(plans[Number(row.dataset.plan)]));
  [...element("table").tHead.rows[0].cells].forEach((heading, column) => {
    heading.querySelector("button")?.addEventListener("click", () => sortBy(column, heading));
  });
  body.addEventListener("click", (event) => {
    const row = event.target.closest("tr");
    if (row && !String(window.getSelection())) select(Number(row.dataset.plan));
  });
  body.addEventListener("keydown", (event) => {
    const step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    const row = step && event.target.closest("tr")?.[step];
    if (!row) return;
    event.preventDefault();
    row.querySelector(".pick").focus();
    select(Number(row.dataset.plan));
  });
  body.addEventListener("pointerover", (event) => {
    const row = event.target.closest("tr");
    const plan = row && Number(row.dataset.plan);
    if (row && plan !== state.selected) hover({ plan, station: fastest(plans[plan]) });
  });
  body.addEventListener("pointerleave", () => hover(null));
  when("select", markRow);
}
