"""Commands of recent cycles: what a vehicle may still do that its state does not show yet."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState
from slopewise.planner.horizon.path_projection import locate_on
from slopewise.planner.horizon.polyline import Polyline
from slopewise.planner.plan import SpeedPlan

_CYCLES = 100
"""Cycles that are remembered [1]: 2 s of them at 50 Hz, more than any link is late."""

_SHORT = 0.05
"""A vehicle that drives less than that until a command takes effect bends off no line [m]."""


def _nowhere() -> Floats:
    return np.empty((0, 2))


@dataclass(frozen=True, slots=True)
class UnseenMotion:
    """Motion of a vehicle between its measured state and the first effect of a new command.

    Attributes:
        speed: highest one that it may reach by then [m/s].
        places: (k, 2) where it is by then, on each of the lines that it may follow [m].
    """

    speed: float
    places: Floats = field(default_factory=_nowhere)


class RecentCommands:
    """Commands and plans of the last cycles, the newest first."""

    def __init__(self) -> None:
        """Begin without any."""
        self._driven: deque[tuple[float, SpeedPlan | None]] = deque(maxlen=_CYCLES)

    def add(self, answer: CycleAnswer) -> None:
        """Remember the answer of a cycle."""
        self._driven.appendleft((answer.command.speed, answer.chosen))

    def unseen(
        self, state: PlanarState, latency: float, accel: float, period: float
    ) -> UnseenMotion:
        """Possible motion of the vehicle until a command of now takes effect.

        It obeys earlier commands.

        Args:
            state: as measured. latency: of commands, at the quantile of plans [s].
            accel: highest acceleration [m/s²]. period: of cycles [s].
        """
        if state.invalid_field():
            return UnseenMotion(0.0)
        time = state.age + latency
        recent = list(islice(self._driven, 1 + math.ceil(min(time / period, _CYCLES))))
        speed = measured = max(state.speed, 0.0)
        for commanded, _ in reversed(recent):
            # Nothing is certain of how soon it slows down.
            speed = max(speed, min(commanded, speed + accel * period, measured + accel * time))
        distance = speed * time
        if distance < _SHORT:
            return UnseenMotion(speed)
        places = {_place(plan, state, distance) for _, plan in recent if plan is not None}
        return UnseenMotion(speed, np.array(sorted(places)).reshape(-1, 2))


def _place(plan: SpeedPlan, state: PlanarState, distance: float) -> tuple[float, float]:
    """Point of a plan's line at a distance from the vehicle [m], to a centimetre."""
    x, y = plan.x, plan.y
    here = locate_on(x, y, (state.x, state.y), state.heading).along[0]
    along = Polyline(x, y).arc()
    east, north = (round(float(np.interp(here + distance, along, a)), 2) for a in (x, y))
    return east, north
