// The model change proposed from stored stops: adopted and reverted on a command line, never here.

const BADGES = { adopted: "ok", nothing: "ok", refused: "infeasible", offered: "offered" };
let shownFinding = "";

function showFinding(finding) {
  const text = JSON.stringify(finding);
  // A command that is marked for copying stays marked as long as nothing changes.
  if (text === shownFinding) return;
  shownFinding = text;
  element("finding").replaceChildren(...(finding ? findingOf(finding) : [note("Nothing has been found on stored stops.")]));
}

function findingOf(finding) {
  const state = finding.state === "nothing" ? [finding.words] : [finding.state, finding.words];
  const date = new Date(1000 * finding.at).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  const facts = [["found", date], ["on", `${finding.stops} stops`], ["who asked", finding.cause], ["offer", finding.id]];
  const effects = finding.effects.flatMap((effect) => Object.entries(effect.parameters).map(([name, value]) =>
    [`${spaced(effect.name)}, ${spaced(name)}`, formatUncertain(value)]));
  return [
    make("p", { class: "state" }, badge(BADGES[finding.state], state[0]), ...state.slice(1)),
    make("p", { class: "summary" }, make("b", {}, spaced(finding.verdict)), ` – ${finding.summary}`),
    make("dl", { class: "values" }, ...definitions(effects)),
    gapOf(finding),
    ...(finding.notes.length ? [make("ul", { class: "warnings", "aria-label": "Warnings" }, ...finding.notes.map((note) => make("li", {}, note)))] : []),
    make("dl", { class: "facts" }, ...definitions(facts)),
    ...(finding.command ? [make("p", { class: "typed" }, `To ${finding.purpose}, an operator types `, commandLine(finding.command))] : []),
  ];
}

// Lines break between words only, never within an option.
function commandLine(command) {
  const parts = command.split(" ").flatMap((word) => [make("span", {}, word), " "]);
  return make("code", {}, ...parts.slice(0, -1));
}

// Rounded to two digits of the standard deviation.
function formatUncertain({ value, std, unit }) {
  const digits = std > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(std)), 0), 9) : 4;
  return `${number(value, digits)} ± ${number(std, digits)}${unit === "1" ? "" : `\u202f${unit}`}`;
}

function gapOf(finding) {
  const rows = [["before", "as configured", finding.before], ["after", "with it", finding.after], ["floor", "floor", finding.floor]];
  const known = rows.filter(([, , value]) => value !== null);
  const [, largest] = span(known.map(([, , value]) => value));
  const rowsOfGap = known.map(([key, name, value]) => make("div", { class: key }, make("dt", {}, name),
    make("dd", {}, make("span", { class: "bar", style: `width: ${((100 * value) / (largest || 1)).toFixed(1)}%` }), make("b", {}, number(value, 3, "m")))));
  const [smallest, greatest] = finding.longer.map((by) => (by > 0 ? "+" : "") + number(by, 2));
  return make("figure", {}, make("dl", { class: "gap" }, ...rowsOfGap), make("figcaption", {},
    `${known.length ? "stopping distance error on held-out stops, rms; " : ""}adopted, stops change by ${smallest} … ${greatest}\u202fm compared with the model file`));
}
