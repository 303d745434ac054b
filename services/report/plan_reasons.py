"""The part of a plan page that says why the best candidate is not faster."""

from __future__ import annotations

from slopewise.planner.explain.explain import Explanation
from slopewise.services.report.page import escaped
from slopewise.services.report.words import LIMITING_MEANING, word


def reasons(found: Explanation | None) -> str:
    """A panel of two tables, empty if nothing is explained."""
    if found is None:
        return ""
    spent = {cost.limiting: 0.0 for cost in found.costs}
    for stretch in found.stretches:
        spent[stretch.limiting] += stretch.seconds
    bounds = "".join(
        f'<tr><th scope="row"><span class="swatch" data-limiting="{cost.limiting.label}"></span>'
        f'<span title="{escaped(LIMITING_MEANING.get(cost.limiting, ""))}">'
        f"{escaped(word(cost.limiting))}</span></th>"
        f"{_cell(spent[cost.limiting], '.2f')}{_cell(cost.seconds, '.2f')}"
        f"{_cell(cost.reach, '.1f')}</tr>"
        for cost in found.costs
        if cost.seconds > 0.0 or spent[cost.limiting] > 0.0
    )
    measurements = "".join(
        f"<li>{escaped(measurement.sentence)}</li>"
        for measurement in found.measurements
        if measurement.seconds > 0.0
    )
    return (
        '<section class="panel reasons" aria-labelledby="reasons-title">'
        f'<h2 id="reasons-title">Why {escaped(found.plan.candidate)} is not faster '
        '<span class="hint">planned again without each bound; a metre not reached is charged as in '
        "the ranking</span></h2>"
        '<div class="scroll"><table><thead><tr><th scope="col">bound</th>'
        f"{_head('limits for', 's')}{_head('gained without it', 's')}{_head('farther', 'm')}"
        f"</tr></thead><tbody>{bounds}</tbody></table></div>"
        f"<h2>What to measure next</h2>"
        + (f"<ol>{measurements}</ol>" if measurements else "<p>No measurement helps here.</p>")
        + "</section>"
    )


def _head(name: str, unit: str) -> str:
    return f'<th scope="col" class="number">{name}<small> {unit}</small></th>'


def _cell(value: float, form: str) -> str:
    return f'<td class="number">{f"{value:{form}}" if value > 0.0 else "–"}</td>'
