"""How steep it may be between stations: where a wheel crosses an edge of the map, grade kinks.

Heights between cells are ruled surfaces, so that the grade under the wheels is close to linear but
for a kink wherever an axle crosses a line of cell centres. With one kink between two stations the
grade there is that at which the straight lines from both sides meet.
"""

from __future__ import annotations

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.workspace import empty


def grade_between(grade: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest grade from the station before to the one after, (N, M) each [rad].

    Args:
        grade: (N, M) at stations that are about evenly spaced [rad].
    """
    lowest, highest = empty(2, *grade.shape)
    _extremes(grade, lowest, highest)
    return lowest, highest


@kernel
def _extremes(grade: Floats, lowest: Floats, highest: Floats) -> None:
    last = grade.shape[0] - 1
    for k in range(last + 1):
        ahead = min(k + 1, last)
        _widen(
            grade[max(k - 1, 0)],
            grade[k],
            grade[ahead],
            grade[min(k + 2, last)],
            lowest[k],
            highest[k],
        )
    for k in range(last, 0, -1):
        _join(lowest[k - 1], highest[k - 1], lowest[k], highest[k])


@row_pass
def _widen(
    before: Floats, here: Floats, ahead: Floats, beyond: Floats, lowest: Floats, highest: Floats
) -> None:
    """Extremes from here to the station ahead."""
    for j in range(here.shape[0]):
        rises, falls = here[j] - before[j], ahead[j] - beyond[j]
        change = ahead[j] - here[j]
        bend = rises + falls
        share = (falls + change) / (bend if bend != 0.0 else 1.0)
        inside = (share > 0.0) & (share < 1.0)
        kink = here[j] + rises * share if inside else here[j]
        lowest[j] = min(kink, min(here[j], ahead[j]))
        highest[j] = max(kink, max(here[j], ahead[j]))


@row_pass
def _join(low: Floats, high: Floats, lowest: Floats, highest: Floats) -> None:
    """Take in those from the station before to here."""
    for j in range(low.shape[0]):
        lowest[j] = min(lowest[j], low[j])
        highest[j] = max(highest[j], high[j])
