"""The page of `slopewise terrain`: one run in detail, all stretches by feature, all runs.

One HTML file that works offline and without a script.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.trace import TerrainTrace
from slopewise.services.io.files import write_atomic
from slopewise.services.report.page import escaped, fact_list, notices, page
from slopewise.services.report.terrain_pictures import Point, pictures

_LISTED = 50


@dataclass(frozen=True, slots=True)
class TerrainPage:
    """What the page shows.

    Attributes:
        title: what was driven. verdict: a sentence.
        run: name of the run in detail. trace: of it. changes: of it [s].
        points: class and features of all stretches. classes: that are known.
        rows: cells of the table of runs.
        reliability: (said, right, stretches) by tenths of probability, where the log is labelled.
        excluded: (run, from when, why) of what was left out.
        notes: what a reader has to know. facts: name -> value.
    """

    title: str
    verdict: str
    run: str
    trace: TerrainTrace
    changes: Sequence[float]
    points: Sequence[Point]
    classes: TerrainClasses
    rows: Sequence[Sequence[str]]
    excluded: Sequence[Sequence[str]] = ()
    reliability: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()
    facts: Mapping[str, str] = field(default_factory=dict)


def write_report(path: Path, content: TerrainPage) -> None:
    """Write the page, all or nothing.

    Raises:
        InputError: the file cannot be written, or matplotlib is not installed.
    """
    write_atomic(path, render_report(content).encode("utf-8", "replace"))


def render_report(content: TerrainPage) -> str:
    """The page as text; see :func:`write_report`."""
    fields = {
        "title": escaped(content.title),
        "verdict": escaped(content.verdict),
        "facts": fact_list(content.facts),
        "run_name": escaped(content.run),
        "notes": notices(content.notes),
        "rows": "\n".join(_row(cells, numbers=(1, 2, 3, 5, 6, 7, 8)) for cells in content.rows),
        "suspects": _reliability(content.reliability) + _excluded(content.excluded),
        **pictures(content.trace, content.points, content.classes, content.changes),
    }
    return page(
        "terrain.html",
        fields,
        title=f"{content.title} – slopewise terrain",
        styles=("page.css", "calibration.css"),
        scripts=(),
        data=None,
    )


def _row(cells: Sequence[str], numbers: Sequence[int] = ()) -> str:
    kinds = [' class="number"' if i in numbers else "" for i in range(len(cells))]
    return (
        "<tr>"
        + "".join(
            f"<td{kind}>{escaped(cell)}</td>" for kind, cell in zip(kinds, cells, strict=True)
        )
        + "</tr>"
    )


def _reliability(rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    listed = "\n".join(_row(cells, numbers=(0, 1, 2)) for cells in rows)
    heads = "".join(
        f'<th class="number">{name}</th>' for name in ("probability said", "right", "stretches")
    )
    return (
        '<section class="panel numbers"><h2>Do probabilities mean what they say</h2>'
        f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{listed}</tbody>'
        "</table></div><p>By the names of the log. Of a log that the classes were learned from "
        "this is better than of another.</p></section>"
    )


def _excluded(rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    listed = "\n".join(_row(cells) for cells in rows[:_LISTED])
    more = len(rows) - _LISTED
    further = f"<p>… and {more} more.</p>" if more > 0 else ""
    return (
        '<section class="panel numbers"><h2>Left out</h2><div class="scroll"><table><thead><tr>'
        f"<th>run</th><th>from</th><th>why</th></tr></thead><tbody>{listed}</tbody></table></div>"
        f"{further}</section>"
    )
