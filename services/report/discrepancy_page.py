"""The page of `slopewise discrepancy`: what is missing, how sure, what it changes in metres.

One HTML file that works offline and without a script.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import numpy as np

from slopewise.models.discrepancy.findings import Findings, Gap, LocatedAxis, NamedEffect, Verdict
from slopewise.models.discrepancy.report.evidence import Evidence
from slopewise.models.discrepancy.report.words import answers, closed_words, sure_words
from slopewise.models.effects.registry import LAWS
from slopewise.services.io.files import write_atomic
from slopewise.services.report.discrepancy_pictures import pictures
from slopewise.services.report.page import escaped, fact_list, notices, number_row, page
from slopewise.services.report.words import plural

WORDS = {
    Verdict.NONE: ("nothing missing", "fine"),
    Verdict.PARAMETER_DRIFT: ("parameter drift", "fine"),
    Verdict.MISSING_EFFECT: ("missing effect", "found"),
    Verdict.AMBIGUOUS: ("ambiguous", "doubt"),
    Verdict.UNIDENTIFIABLE: ("unidentifiable", "doubt"),
    Verdict.UNKNOWN: ("unknown effect", "doubt"),
    Verdict.TOO_NOISY: ("too noisy", "doubt"),
}
"""What is shown of each verdict, and how."""


def write_report(
    path: Path,
    findings: Findings,
    evidence: Evidence,
    *,
    title: str,
    provenance: Mapping[str, str],
) -> None:
    """Write the page, all or nothing.

    Args:
        path: HTML file to write. findings, evidence: of one log.
        title: what was compared. provenance: logs, model, date: name -> value.

    Raises:
        InputError: the file cannot be written, or matplotlib is not installed.
    """
    text = render_report(findings, evidence, title=title, provenance=provenance)
    write_atomic(path, text.encode("utf-8", "replace"))


def render_report(
    findings: Findings, evidence: Evidence, *, title: str, provenance: Mapping[str, str]
) -> str:
    """The page as text; see :func:`write_report`."""
    drawn = pictures(findings, evidence)
    word, kind = WORDS[findings.verdict]
    facts = {
        "who says so": f"slopewise {metadata.version('slopewise')} from "
        f"{plural(findings.stops, 'stop')}",
        "stopping distance": _metres(findings.stop_distance),
        "safety offset now": f"{findings.model.braking.distance_offset:.2f} m",
        **provenance,
    }
    fields = {
        "title": escaped(title),
        "word": escaped(word),
        "kind": kind,
        "verdict": escaped(findings.summary),
        "answers": fact_list(answers(findings)),
        "facts": fact_list(facts),
        "notes": notices(findings.notes),
        "effects": _effects(findings.effects),
        "closed": escaped(_closed(findings.gap)),
        "located": "\n".join(map(_axis, findings.located)) or _nothing(),
        "map": _map(drawn.pop("map", None)),
        **drawn,
    }
    return page(
        "discrepancy.html",
        fields,
        title=f"{title} – slopewise discrepancy",
        styles=("page.css", "calibration.css", "discrepancy.css"),
        scripts=(),
        data=None,
    )


def _metres(gap: Gap) -> str:
    return f"{gap.before:.2f} m off before, {gap.after:.2f} m after (rms)"


def _closed(gap: Gap) -> str:
    if gap.closed is None or gap.ci95 is None:
        return "The gap is too near its floor for a percentage."
    return f"Of the closable gap {closed_words(gap)}."


def _effects(effects: tuple[NamedEffect, ...]) -> str:
    if not effects:
        return ""
    head = "".join(
        f'<th scope="col">{t}</th>'
        for t in ("effect", "what is missing", "numbers", "how sure", "or it is", "where")
    )
    rows = "".join(map(_effect, effects))
    return (
        '<section class="panel numbers"><h2>What is missing</h2><div class="scroll" tabindex="0">'
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>"
    )


def _effect(effect: NamedEffect) -> str:
    values = "; ".join(
        f"{name} = {p.value:.4g} ± {p.std:.2g} {p.unit if p.unit != '1' else ''}".rstrip()
        for name, p in effect.parameters.items()
    )
    cells = (
        effect.name,
        LAWS[effect.name].missing,
        values,
        sure_words(effect.confidence),
        ", ".join(effect.alternatives) or "–",
        effect.where,
    )
    return "<tr>" + "".join(f"<td>{escaped(c)}</td>" for c in cells) + "</tr>"


def _axis(axis: LocatedAxis) -> str:
    low, high, unit = axis.low, axis.high, axis.unit
    if unit in ("rad", "rad/s"):
        low, high = float(np.rad2deg(low)), float(np.rad2deg(high))
        unit = unit.replace("rad", "°")
    part = f"{low:.3g} … {high:.3g} {'' if unit == '1' else unit}".rstrip()
    chance = "< 0.001" if axis.p_value < 1e-3 else f"{axis.p_value:.3f}"
    return number_row(axis.axis.replace("_", " "), (part, f"{axis.share_of_gap:.0%}", chance))


def _nothing() -> str:
    return '<tr><th scope="row">no axis</th><td></td><td></td><td></td></tr>'


def _map(picture: str | None) -> str:
    if picture is None:
        return ""
    return (
        '<section class="panel wide"><h2>Where the stops were</h2>'
        f'<div class="scroll" tabindex="0"><img src="{picture}" '
        'alt="Missing force of each stop on the map, before and after"></div>'
        "<p>Each dot is a stop: red, the vehicle braked harder than the model says; blue, less."
        "</p></section>"
    )
