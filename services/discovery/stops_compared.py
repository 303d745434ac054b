"""Whether one model ever stops shorter than another: simulated stops on a grid of all that matters.

Speeds and grades of the trained rectangle, every surface that either names, and for effects that
depend on them roll, heading, turns, places, heat and time of the session.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Braking, Model
from slopewise.models.stops.simulation import GroundTrack, simulate_stop

_FARTHEST = 1000.0  # [m] a stop that never ends counts as that
_ROLLS = (-0.15, 0.0, 0.15)  # [rad]
_YAWS = tuple(np.linspace(-np.pi, np.pi, 8, endpoint=False).tolist())
_TURN = 0.3  # [1/m]
_HOT = 2000.0  # [J/kg]
_LATER = 3600.0  # [s]
_FAR_AWAY = 1e7  # [m] where no patch is

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Longer:
    """By how much stops are longer with one model than with another, dead time and offset too.

    Attributes:
        least, most: over the grid [m]; below 0 it stops shorter somewhere. where: the least, in
            words.
    """

    least: float
    most: float
    where: str


@dataclass(frozen=True, slots=True)
class _Case:
    surface: str
    speed: float
    grade: float
    roll: float
    yaw: float
    curvature: float
    place: Place
    time: float
    heat: float

    def __str__(self) -> str:
        on = f" on {self.surface}" if self.surface else ""
        return f"{self.speed:.1f} m/s, grade {math.degrees(self.grade):+.1f}°{on}"


def compared(after: Model, before: Model) -> Longer:
    """``after`` beside ``before``, where both vouch; beyond that plans are cautious anyhow.

    Margins for what a model leaves open are not in it.
    """
    least, most, where = math.inf, -math.inf, ""
    for case in _cases(after, before):
        longer = _distance(after, case) - _distance(before, case)
        most = max(most, longer)
        if longer < least:
            least, where = longer, str(case)
    return Longer(least, most, where)


def cautious(found: Model, file: Model) -> Model:
    """A finding that nobody has vouched for: as unsure as it and the model file together.

    A plan's margin grows with what is not known. Were a small covariance alone to count, stops a
    little weaker could make plans faster.
    """
    f, o = found.braking, file.braking
    braking = dataclasses.replace(
        f,
        covariance=_sum(f, o),
        dead_time=max(f.dead_time, o.dead_time),
        distance_offset=max(f.distance_offset, o.distance_offset),
        time_offset=max(f.time_offset, o.time_offset),
        speed_error=max(f.speed_error, o.speed_error),
        force_std=max(f.force_std, o.force_std),
        force_scatter=max(f.force_scatter, o.force_scatter),
        dead_time_std=max(f.dead_time_std, o.dead_time_std),
    )
    return dataclasses.replace(found, braking=braking)


def _sum(one: Braking, other: Braking) -> tuple[tuple[float, ...], ...] | None:
    if one.covariance is None or other.covariance is None:
        return one.covariance or other.covariance
    total = np.array(one.covariance) + np.array(other.covariance)
    return tuple(tuple(row) for row in total.tolist())


def _distance(model: Model, case: _Case) -> float:
    one = np.zeros(1)
    track = GroundTrack(
        one,
        one + case.grade,
        one + case.roll,
        one + case.yaw,
        one + case.curvature,
        one + case.place[0],
        one + case.place[1],
    )
    stop = simulate_stop(
        model, track, case.speed, surface=case.surface, session_time=case.time, heat=case.heat
    )
    on = model.braking.on(case.surface) if case.surface else model.braking
    return min(stop.distance + on.distance_offset, _FARTHEST)


def _cases(after: Model, before: Model) -> Iterator[_Case]:
    effects = (*after.effect, *before.effect)
    matters = {what for e in effects for what in LAWS[e.name].depends_on}
    placed = [e.parameters for e in effects if "place" in LAWS[e.name].depends_on]
    surfaces = dict.fromkeys(("", *before.braking.terrain, *after.braking.terrain))
    a, b = after.braking, before.braking
    return itertools.starmap(
        _Case,
        itertools.product(
            surfaces,
            _speeds(a.speed_range, b.speed_range),
            _between(a.grade_range, b.grade_range, 5),
            _ROLLS if "roll" in matters else (0.0,),
            _YAWS if "yaw" in matters else (0.0,),
            (0.0, _TURN) if "turning" in matters else (0.0,),
            ((_FAR_AWAY, _FAR_AWAY), *((p["x"], p["y"]) for p in placed)),
            (0.0, _LATER) if "session_time" in matters else (0.0,),
            (0.0, _HOT) if "heat" in matters else (0.0,),
        ),
    )


def _speeds(one: Place, other: Place) -> list[float]:
    """Below the trained speeds, too: there the coefficients of the lowest one hold."""
    low, high = 0.5 * min(one[0], other[0]), min(one[1], other[1])
    return [float(value) for value in np.linspace(low, high, 4)]


def _between(one: Place, other: Place, count: int) -> list[float]:
    low, high = max(one[0], other[0]), min(one[1], other[1])
    if not low < high:
        low, high = one
    return [float(value) for value in np.linspace(low, high, count)]
