"""Is what was learned of any use, and is it physically possible?

A margin that covers every stop and is as long as the stops themselves is no success, and numbers
that no brakes have are a log that was misread. Both are said; neither is written over.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.stop_logs.dead_time import DeadTime

_MOST_FORCE = 1.2  # [1] of the weight; tyres on dry tarmac reach one
_LATEST = 1.5  # [s] no brakes of vehicles that plan take longer
_SMOTHERS = 2.0  # times its stops that a plan allows for, and
_COSTLY = 0.5  # [m] more than they took
_ENDLESS = 0.2  # share of the stops that a plan would not let happen at all
_CHANCE = 0.01
"""Probability below which the count of stops beyond is not chance [1]."""


def objections(
    surfaces: tuple[SurfaceFit, ...], dead_time: DeadTime, coverage: float
) -> tuple[str, ...]:
    """Why a calibration is of no use, in sentences; none where it is.

    Args:
        surfaces: as learned. dead_time: of the brakes. coverage: quantile that was asked for.
    """
    said = []
    if dead_time.value > _LATEST:
        said.append(
            f"a dead time of {dead_time.value:.2f} s, where {_LATEST:g} s is the longest that "
            "brakes have: is v_cmd the command that the vehicle followed?"
        )
    for surface in surfaces:
        on = f" on {surface.name}" if surface.name else ""
        said += [words + on for words in _of_surface(surface, coverage)]
    return tuple(said)


def _of_surface(surface: SurfaceFit, coverage: float) -> list[str]:
    said = []
    actual = np.array([r.samples.distance for r in surface.records])
    bound = np.array([r.bound_distance for r in surface.records])
    force = float(np.median([r.force_ratio for r in surface.records]))
    if force > _MOST_FORCE:
        said.append(f"braking forces of {force:.2f} of the weight, where {_MOST_FORCE:g} is a lot")
    if surface.distance_offset > float(np.max(actual)):
        said.append(
            f"a distance offset of {surface.distance_offset:.2f} m, longer than the longest stop"
        )
    endless = float(np.mean(~np.isfinite(bound)))
    longer = float(np.median(bound / np.maximum(actual, 1e-6)))
    if endless > _ENDLESS:
        said.append(
            f"so much scatter that plans at {coverage:g} would not allow {endless:.0%} of the "
            "stops of the log at all"
        )
    elif longer > _SMOTHERS and float(np.median(bound - actual)) > _COSTLY:
        said.append(f"plans at {coverage:g} allow for {longer:.1f} times the length of the stops")
    beyond = int(np.sum(actual > bound))
    if float(stats.binom.sf(beyond - 1, len(actual), 1.0 - coverage)) < _CHANCE:
        said.append(f"{beyond} of {len(actual)} stops beyond what plans at {coverage:g} allow for")
    return said
