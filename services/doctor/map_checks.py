"""Checks of a map for a vehicle: what its cells and its noise do not show."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from slopewise.models.height_noise import EXACT
from slopewise.models.smallest_seen import (
    TOO_HIGH,
    SmallestSeen,
    hides_steps,
    misstated,
    seen_at,
    smallest_seen,
)
from slopewise.models.vehicle import Vehicle
from slopewise.services.doctor.robot_facts import ConfigIssue, RobotFacts, error, warning

_REPORTED_RATIO = 1.2
"""Ratio of the lowest step that is seen to the highest that may be climbed, above which it is
reported [1]."""
_STEEP = 2.0
"""Rise over length that half of a map never exceeds [1], 63°: noise of 0.1 m in cells of 0.1 m has
1."""


def check_cells(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Cells larger than the wheels."""
    if facts.ground is None or facts.model is None:
        return
    cell, radius = facts.ground.resolution, facts.model.vehicle.wheel_radius
    if cell > radius:
        yield warning(
            "map cells",
            f"cells of {cell:g} m show no steps, no twist and no roughness to wheels of radius "
            f"{radius:g} m",
            f"use cells of at most {radius:g} m",
        )


def check_heights(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Heights in another unit than metres: no ground is that steep throughout."""
    if facts.ground is None:
        return
    z, cell = facts.ground.elevation, facts.ground.resolution
    rises = (np.abs(np.diff(z, axis=axis)) / cell for axis in (0, 1))
    known = (rise[np.isfinite(rise)] for rise in rises)
    steepest = max((float(np.median(rise)) for rise in known if len(rise)), default=0.0)
    if steepest > _STEEP:
        yield warning(
            "map heights",
            f"half of all neighbouring cells rise by {steepest:.1f} m a metre or more",
            "write heights in metres, not in centimetres or millimetres",
        )


def check_noise(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Noise that hides steps which the vehicle cannot climb."""
    if facts.ground is None or facts.model is None:
        return
    ground, vehicle = facts.ground, facts.model.vehicle
    seen = smallest_seen(ground, vehicle)
    if seen is None or seen.step <= _REPORTED_RATIO * vehicle.shape.max_step:
        return
    severity = error if hides_steps(ground, vehicle) else warning
    yield severity(
        "map noise",
        f"at a noise of {seen.noise:.3f} m steps below {seen.step:.2f} m, rocks below "
        f"{seen.rock:.2f} m and posts of one cell below {seen.post:.2f} m are not seen; the "
        f"highest step is {vehicle.shape.max_step:.3g} m",
        _what_helps(seen, vehicle, ground.resolution, ground.correlation_length),
    )


def check_stated_error(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """An error that the map states, and that its heights do not have."""
    if facts.ground is None:
        return
    if sentence := misstated(facts.ground):
        yield warning(
            "map error", sentence, "state height_std, and correlation_length, as measured"
        )


def _what_helps(seen: SmallestSeen, vehicle: Vehicle, cell: float, correlation: float) -> str:
    """Smaller cells, or fewer scans' noise, at which the vehicle's limit is nearly seen."""
    enough, ways = _REPORTED_RATIO * vehicle.shape.max_step, []
    for part in (2.0, 4.0):
        if seen_at(vehicle, seen.noise, cell / part, correlation).step <= enough:
            ways.append(f"cells of {cell / part:g} m with the same noise")
            break
    noise = seen.noise
    while noise > EXACT and seen_at(vehicle, noise, cell, correlation).step > enough:
        noise *= 0.9
    scans = math.ceil((seen.noise / noise) ** 2)
    ways.append(f"a noise of {noise:.3f} m, as the mean of {scans} scans has")
    slow = f"plans go slowly beyond {TOO_HIGH:g} times the limit"
    return f"{' or '.join(ways)}; {slow}"
