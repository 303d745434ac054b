"""Stops of a log as an effect sees them, to say what one unit of it would add there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from slopewise.models.arrays import Floats, Ints

MIN_STOP_COUNT = 3
"""Stops without which nothing is seen: on each side of a change, or in a place."""


@dataclass(frozen=True, slots=True)
class StopsSeen:
    """S stops at M times each; zero where a log lacks the channel.

    Attributes:
        speed: (S, M) measured [m/s].
        grade, roll, yaw: (S, M) [rad]. yaw_rate: (S, M) [rad/s]. x, y: (S, M) [m].
        vertical_curvature: (S, M) change of grade along the ground [1/m].
        clock: (S,) of the stop command since the session began [s]. run: (S,) its number.
        demanded, built, given: (S, M) F_b/W by surface and brakes, after its build-up, and after
            fade and friction.
        passes: (S, M) share of a small change of the built-up force that they let through.
        heat: (S, M) of the brakes for a cooling time constant [J/kg].
    """

    speed: Floats
    grade: Floats
    roll: Floats
    yaw: Floats
    yaw_rate: Floats
    x: Floats
    y: Floats
    vertical_curvature: Floats
    clock: Floats
    run: Ints
    demanded: Floats
    built: Floats
    given: Floats
    passes: Floats
    heat: Callable[[float], Floats]
