"""The page of `slopewise fleet discrepancy`: who lacks what, how sure, and what it is in metres.

One HTML file that works offline and without a script; it links to the pages of the vehicles.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.effects.registry import LAWS
from slopewise.services.fleet import finding
from slopewise.services.fleet.census import Census, Lacked
from slopewise.services.fleet.finding import Row
from slopewise.services.fleet.picture import picture
from slopewise.services.fleet.words import (
    by_surprise,
    chance_words,
    counted,
    effect_words,
    left_out,
    numbers,
)
from slopewise.services.io.files import write_atomic
from slopewise.services.io.findings_file import PAGE
from slopewise.services.report.discrepancy_page import WORDS
from slopewise.services.report.page import escaped, fact_list, notices, page
from slopewise.services.report.words import plural

_LISTED = 500
_NOTES = 20


def write_report(path: Path, rows: Sequence[Row], census: Census) -> None:
    """Write the page, all or nothing.

    Args:
        path: HTML file beside `vehicles/`. rows: of all vehicles. census: of them.

    Raises:
        InputError: the file cannot be written, or matplotlib is not installed.
    """
    write_atomic(path, render_report(rows, census).encode("utf-8", "replace"))


def render_report(rows: Sequence[Row], census: Census) -> str:
    """The page as text; see :func:`write_report`."""
    done = by_surprise(rows)
    verdicts = {WORDS[Verdict(name)][0]: str(n) for name, n in census.verdicts.items()}
    notes = left_out(census, _NOTES)
    if len(done) > _LISTED:
        notes.append(f"{plural(len(done) - _LISTED, 'more vehicle')} in findings.jsonl")
    fields = {
        "title": f"{plural(census.looked_at, 'vehicle')} against their logs",
        "verdict": escaped(_verdict(census)),
        "facts": fact_list({"vehicles": str(len(rows)), **verdicts}),
        "notes": notices(notes),
        "effects": _effects(census),
        "picture": picture(done, [one.name for one in census.lacked]),
        "rows": "\n".join(map(_vehicle, done[:_LISTED])),
    }
    return page(
        "fleet.html",
        fields,
        title=f"{fields['title']} – slopewise fleet",
        styles=("page.css", "calibration.css", "discrepancy.css", "fleet.css"),
        scripts=(),
        data=None,
    )


def _verdict(census: Census) -> str:
    named = [one for one in census.lacked if one.vehicles]
    told = ", ".join(f"{one.name.replace('_', ' ')} in {len(one.vehicles)}" for one in named)
    return f"{f'Missing: {told}.' if named else 'No effect is named.'} {chance_words(census)}"


def _effects(census: Census) -> str:
    if not census.lacked:
        return ""
    titles = (
        "effect",
        "what is missing",
        "in",
        "how sure",
        "of them right",
        "perhaps in",
        "numbers",
    )
    head = "".join(f'<th scope="col">{title}</th>' for title in titles)
    rows = "".join(_effect(one, census.looked_at) for one in census.lacked)
    return (
        '<section class="panel numbers"><h2>What is missing</h2><div class="scroll" tabindex="0">'
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div><p>"
        "<b>Of them right</b>: how many of the vehicles are to be expected to lack just this, the "
        "sum of their confidences. Numbers: the median, and from the least to the most.</p>"
        "</section>"
    )


def _effect(one: Lacked, looked_at: int) -> str:
    cells = (one.name, LAWS[one.name].missing, *counted(one, looked_at), numbers(one))
    return "<tr>" + "".join(f"<td>{escaped(cell)}</td>" for cell in cells) + "</tr>"


def _vehicle(row: Row) -> str:
    name = row["vehicle"]
    own = "/".join(quote(part) for part in (finding.VEHICLES, name, PAGE))
    cells = (WORDS[Verdict(row["verdict"])][0], effect_words(row).replace("_", " "))
    off = (f"{row[f'stop_distance_{when}']:.2f} m" for when in ("before", "after"))
    return (
        f'<tr><th scope="row"><a href="{escaped(own)}">{escaped(name)}</a></th>'
        + "".join(f"<td>{escaped(cell)}</td>" for cell in cells)
        + "".join(f'<td class="number">{cell}</td>' for cell in (str(row["stops"]), *off))
        + "</tr>"
    )
