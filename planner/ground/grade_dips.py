"""Weak brakes where the grade dips between stations.

Stops take the grade to be linear between stations. Where an axle crosses an edge of the map it
kinks, and may be steeper downhill in between. Where brakes and slope nearly balance, that decides
how long a stop is: there the force is lowered by what the dip may add on average.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.planner.ground.forces import Forces
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.kernels.workspace import empty

_DIP = 1.0 / 8.0
"""Mean depth of a dip over the second difference of the grades around it [1]: of a kink in the
middle of a segment that neither end shows."""

_SMALL = 0.01
"""Share of what slows the vehicle that a dip may take without a word [1]: of a stop, 1 % of its
length."""


def lower_force_over_dips(forces: Forces, profile: TerrainProfile) -> Forces:
    """The lower bound of the force, less what dips between stations take of it, (N, M)."""
    lower = empty(*profile.grade.shape)
    _lower(profile.grade, profile.sin_grade, profile.known, forces, lower)
    return forces._replace(lower_intercept=lower)


class _Row(NamedTuple):
    """One row of M candidates."""

    sin_grade: Floats
    slope: Floats
    intercept: Floats
    slowest: Floats
    fastest: Floats


@kernel
def _lower(grade: Floats, sin_grade: Floats, known: Bools, forces: Forces, lower: Floats) -> None:
    stations, candidates = grade.shape
    dips = np.zeros((stations + 2, candidates))
    for k in range(1, stations - 1):
        _dip(grade[k - 1], grade[k], grade[k + 1], known[k - 1], known[k + 1], dips[k + 1])
    for k in range(stations):
        row = _Row(
            sin_grade[k],
            forces.lower_slope[k],
            forces.lower_intercept[k],
            forces.slowest[k],
            forces.fastest[k],
        )
        _give_up(row, dips[k], dips[k + 1], dips[k + 2], lower[k])


@row_pass
def _dip(
    before: Floats, here: Floats, ahead: Floats, from_known: Bools, to_known: Bools, dip: Floats
) -> None:
    """Second difference where the grade dips, 0 where it does not, or is unknown."""
    for j in range(here.shape[0]):
        second = before[j] - 2.0 * here[j] + ahead[j]
        dip[j] = max(second, 0.0) if from_known[j] & to_known[j] else 0.0


@row_pass
def _give_up(row: _Row, before: Floats, here: Floats, ahead: Floats, lower: Floats) -> None:
    for j in range(lower.shape[0]):
        slope, intercept = row.slope[j], row.intercept[j]
        force = intercept + min(row.slowest[j] * slope, row.fastest[j] * slope)
        dip = _DIP * max(before[j], max(here[j], ahead[j]))
        lower[j] = intercept - max(dip - _SMALL * max(force + row.sin_grade[j], 0.0), 0.0)
