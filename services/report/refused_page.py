"""The page of a calibration that was refused: what was found in the log, and why it is not enough.

One HTML file that works offline and without a script.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from slopewise.models.stop_logs.drive_quality import Suspect
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.services.io.files import write_atomic
from slopewise.services.report.calibration_page import stops_found, suspect_rows
from slopewise.services.report.page import escaped, fact_list, number_row, page

_LISTED = 500


class RefusedLog(NamedTuple):
    """What a log had.

    Attributes:
        reason: why it was refused. windows: stops that were found. places: run and time of each.
        suspects: stretches that nothing is learned from. clock: time at which each begins [s].
    """

    reason: str
    windows: Sequence[StopWindow]
    places: Sequence[str]
    suspects: Sequence[Suspect]
    clock: Mapping[int, float]


def write_refused(
    path: Path, refused: RefusedLog, *, title: str, provenance: Mapping[str, str]
) -> None:
    """Write the page, all or nothing.

    Raises:
        InputError: the file cannot be written.
    """
    kinds = Counter(w.verdict.value for w in refused.windows)
    listed = list(zip(refused.windows, refused.places, strict=True))[:_LISTED]
    fields = {
        "title": escaped(title),
        "verdict": escaped(f"Refused: {refused.reason}"),
        "facts": fact_list(provenance),
        "found": stops_found(dict(kinds.most_common())),
        "each": "\n".join(
            number_row(place, [f"{w.held_speed:.2f}", w.reason or w.verdict.value])
            for w, place in listed
        ),
        "suspects": suspect_rows(refused.suspects, refused.clock),
    }
    text = page(
        "refused.html",
        fields,
        title=f"{title} – slopewise calibrate",
        styles=("page.css", "calibration.css"),
        scripts=(),
        data=None,
    )
    write_atomic(path, text.encode("utf-8", "replace"))
