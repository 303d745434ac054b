// What the model leaves out, by stored stops: adopted and taken back on a command line, never here.

const LOOKS = { adopted: "ok", nothing: "ok", refused: "infeasible", offered: "offered", reverted: "reverted" };
let findingShown = "";

function showFinding(finding) {
  const told = JSON.stringify(finding);
  // A command that somebody marks to copy it stays marked as long as nothing changes.
  if (told === findingShown) return;
  findingShown = told;
  element("finding").replaceChildren(...(finding ? findingOf(finding) : [make("p", { class: "none" }, "Nothing has been found on stored stops.")]));
}

function findingOf(finding) {
  const state = finding.state === "nothing" ? [finding.words] : [finding.state, finding.words];
  const found = new Date(1000 * finding.at).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  const facts = [["found", found], ["on", `${finding.stops} stops`], ["who asked", finding.cause], ["offer", finding.id]];
  const effects = finding.effects.flatMap((effect) => Object.entries(effect.parameters).map(([name, told]) =>
    make("div", {}, make("dt", {}, `${words(effect.name)}, ${words(name)}`), make("dd", {}, uncertain(told)))));
  return [
    make("p", { class: "state" }, badge(LOOKS[finding.state], state[0]), ...state.slice(1)),
    make("p", { class: "summary" }, make("b", {}, words(finding.verdict)), ` – ${finding.summary}`),
    make("dl", { class: "values" }, ...effects),
    gapOf(finding),
    ...(finding.notes.length ? [make("ul", { class: "doubts", "aria-label": "Doubts" }, ...finding.notes.map((note) => make("li", {}, note)))] : []),
    make("dl", { class: "facts" }, ...facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value)))),
    ...(finding.command ? [make("p", { class: "typed" }, `To ${finding.purpose}, an operator types `, commandLine(finding.command))] : []),
  ];
}

// Lines break between words only, never within an option.
function commandLine(command) {
  const parts = command.split(" ").flatMap((word) => [make("span", {}, word), " "]);
  return make("code", {}, ...parts.slice(0, -1));
}

// As many digits as the standard deviation leaves: two of its own.
function uncertain({ value, std, unit }) {
  const digits = std > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(std)), 0), 9) : 4;
  return `${number(value, digits)} ± ${number(std, digits)}${unit === "1" ? "" : `\u202f${unit}`}`;
}

function gapOf(finding) {
  const rows = [["before", "as configured", finding.before], ["after", "with it", finding.after], ["floor", "floor", finding.floor]];
  const known = rows.filter(([, , value]) => value !== null);
  const [, most] = span(known.map(([, , value]) => value));
  const bars = known.map(([key, name, value]) => make("div", { class: key }, make("dt", {}, name),
    make("dd", {}, make("span", { class: "bar", style: `width: ${((100 * value) / (most || 1)).toFixed(1)}%` }), make("b", {}, number(value, 3, "m")))));
  const [least, longest] = finding.longer.map((by) => (by > 0 ? "+" : "") + number(by, 2));
  return make("figure", {}, make("dl", { class: "gap" }, ...bars), make("figcaption", {},
    `${known.length ? "stopping distance off on stops held out, rms; " : ""}adopted, stops change by ${least} … ${longest}\u202fm beside the model file`));
}
