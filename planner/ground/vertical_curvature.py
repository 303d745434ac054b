"""How the grade changes along a path: crests fall away under the vehicle, dips press it down."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.rows import copy_row
from slopewise.planner.kernels.workspace import empty


def vertical_curvature(station: Floats, grade: Floats, known: Bools) -> Floats:
    """κ_v = dθ/ds of the sharper crest of the segments around each station, (N, M) [1/m].

    The grade is linear between stations, so that κ_v is that of segments; where neither of them
    falls away, it is the sharper dip. Ground that is unknown on either end bends nowhere.

    Args:
        station, grade, known: (N, M) of the terrain profile [m], [rad].
    """
    out = empty(*grade.shape)
    _bends(station, grade, known, out)
    return out


@kernel
def _bends(station: Floats, grade: Floats, known: Bools, out: Floats) -> None:
    last = station.shape[0] - 1
    bend, before = np.zeros(station.shape[1]), np.zeros(station.shape[1])
    for k in range(last + 1):
        after = min(k + 1, last)
        _bend(
            (station[k], station[after]), (grade[k], grade[after]), (known[k], known[after]), bend
        )
        _sharper(before, bend, out[k])
        copy_row(bend, before)


@row_pass
def _bend(
    stations: tuple[Floats, Floats],
    grades: tuple[Floats, Floats],
    seen: tuple[Bools, Bools],
    bend: Floats,
) -> None:
    station, ahead = stations[0], stations[1]
    grade, grade_ahead = grades[0], grades[1]
    known, known_ahead = seen[0], seen[1]
    for j in range(bend.shape[0]):
        length = ahead[j] - station[j]
        there = known[j] & known_ahead[j] & (length > 1e-9)
        bend[j] = (grade_ahead[j] - grade[j]) / length if there else 0.0


@row_pass
def _sharper(before: Floats, after: Floats, out: Floats) -> None:
    for j in range(out.shape[0]):
        crest = min(before[j], after[j])
        out[j] = crest if crest < 0.0 else max(before[j], after[j])
