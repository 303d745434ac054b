"""Is what was learned physically possible? Numbers that no brakes have are a log misread."""

from __future__ import annotations

import numpy as np

from slopewise.models.calibration.surface_fit import SurfaceFit
from slopewise.models.stop_logs.dead_time import DeadTime

_MOST_FORCE = 1.2  # [1] of the weight; tyres on dry tarmac reach one
_LATEST = 1.5  # [s] no brakes of vehicles that plan take longer
_TOO_LONG = 3.0
"""Median factor of allowed over actual distance from which a promise is of little use [1]."""


def objections(surfaces: tuple[SurfaceFit, ...], dead_time: DeadTime) -> tuple[str, ...]:
    """What is wrong with a calibration, in sentences; none where nothing is.

    Args:
        surfaces: as learned, with what plans allow for each stop. dead_time: of the brakes.
    """
    said = []
    if dead_time.value > _LATEST:
        said.append(
            f"a dead time of {dead_time.value:.2f} s, where {_LATEST:g} s is the longest that "
            "brakes have: is v_cmd the command that the vehicle followed?"
        )
    for surface in surfaces:
        on = f" on {surface.name}" if surface.name else ""
        force = float(np.median([r.force_ratio for r in surface.records]))
        if force > _MOST_FORCE:
            said.append(
                f"braking forces of {force:.2f} of the weight{on}, where {_MOST_FORCE:g} is a lot"
            )
        actual = np.array([r.samples.distance for r in surface.records])
        bound = np.array([r.bound_distance for r in surface.records])
        longer = float(np.median(bound / np.maximum(actual, 1e-6)))
        if longer > _TOO_LONG:
            said.append(f"plans allow {longer:.1f} times the length of the stops{on}")
    return tuple(said)
