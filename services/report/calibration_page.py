"""The page of `slopewise calibrate`: what the stops say, how well it predicts, what was left out.

One HTML file that works offline and without a script.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template

import numpy as np

from slopewise.models.calibration.learn import Calibration
from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.stop_logs.find_stops import Usability
from slopewise.services.io.files import write_atomic
from slopewise.services.report.calibration_pictures import pictures
from slopewise.services.report.page import asset, escaped, fact_list, notices, number_row, page
from slopewise.services.report.words import plural

_LISTED = 50

Rows = Mapping[str, Sequence[str]]
"""Label -> one cell a surface, as they are shown."""


def write_report(
    path: Path,
    calibration: Calibration,
    rows: Rows,
    clock: Mapping[int, float],
    *,
    title: str,
    provenance: Mapping[str, str],
) -> None:
    """Write the page of a calibration, all or nothing.

    Args:
        path: HTML file to write. calibration: what was learned.
        rows: table of numbers. clock: time of the samples at which suspect stretches begin [s].
        title: what was calibrated. provenance: logs, model, date: name -> value.

    Raises:
        InputError: the file cannot be written, or matplotlib is not installed.
    """
    text = render_report(calibration, rows, clock, title=title, provenance=provenance)
    write_atomic(path, text.encode("utf-8", "replace"))


def render_report(
    calibration: Calibration,
    rows: Rows,
    clock: Mapping[int, float],
    *,
    title: str,
    provenance: Mapping[str, str],
) -> str:
    """The page as text; see :func:`write_report`."""
    surfaces = [surface.name or "base" for surface in calibration.surfaces]
    fields = {
        "title": escaped(title),
        "verdict": escaped(_verdict(calibration)),
        "facts": fact_list({**_shared(calibration), **provenance}),
        "notes": notices((*calibration.objections, *calibration.warnings)),
        "surfaces": "".join(f'<th class="number" scope="col">{escaped(n)}</th>' for n in surfaces),
        "rows": "\n".join(number_row(label, cells) for label, cells in rows.items()),
        "found": stops_found(
            {Usability[name.upper()].value: n for name, n in calibration.verdicts.items()}
        ),
        "suspects": suspect_rows(calibration.suspects, clock),
        **pictures(calibration),
    }
    return page(
        "calibration.html",
        fields,
        title=f"{title} – slopewise calibrate",
        styles=("page.css", "calibration.css"),
        scripts=(),
        data=None,
    )


def _verdict(calibration: Calibration) -> str:
    base = calibration.surfaces[0]
    excess = np.array([r.bound_distance - r.samples.distance for r in base.records])
    inside, ends = int(np.sum(excess >= 0.0)), excess[np.isfinite(excess)]
    mean = float(np.mean(ends)) if len(ends) else float("inf")
    return (
        f"{inside} of {plural(len(base.records), 'stop')} ended within what a plan allows for, "
        f"by a fit that had not seen them, {mean:.2f} m before its end on average."
    )


def _shared(calibration: Calibration) -> dict[str, str]:
    dead, dive, mount = calibration.dead_time, calibration.dive, calibration.mount
    degrees = np.rad2deg(dive.per_deceleration)
    askew = f"{np.rad2deg(mount.offset):+.2f}° by {mount.source}" if mount.known else "not known"
    driven = calibration.speed_error
    told = "not known" if driven is None else f"to ± {driven.value:.3f} m/s"
    return {
        "speeds driven": told,
        "dead time": f"{dead.value:.3f} ± {dead.std:.3f} s, jitter {dead.between_stops:.3f} s",
        "brake dive": f"{degrees:.2f}° per m/s²",
        "pitch sensor mounted": askew,
    }


def stops_found(counts: Mapping[str, int]) -> str:
    """A section that says how many stops there were of each kind."""
    rows = "\n".join(number_row(kind, [str(count)]) for kind, count in counts.items())
    return Template(asset("stops_found.html")).substitute(found=rows).strip()


def suspect_rows(suspects: Sequence[Suspect], clock: Mapping[int, float]) -> str:
    """A section that names stretches that were left out; nothing if there are none."""
    if not suspects:
        return ""
    listed = "".join(number_row(f"{clock[s.start]:.2f} s", [s.reason]) for s in suspects[:_LISTED])
    more = len(suspects) - _LISTED
    further = f"<p>… and {more} more.</p>" if more > 0 else ""
    return (
        '<section class="panel numbers"><h2>Left out</h2><table><thead><tr><th>from</th>'
        f"<th>why</th></tr></thead><tbody>{listed}</tbody></table>{further}</section>"
    )
