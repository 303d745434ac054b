"""Comparison of two models by simulated stops on a grid of everything that they depend on.

Speeds and grades of the trained rectangle, every surface that either names, and for effects that
depend on them roll, heading, turns, places, heat and time of the session.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.effects.registry import LAWS
from slopewise.models.errors import InputError
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_distance import StopDistance
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from slopewise.planner.ground.uncertainty import QUANTILE
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.wire.model_proposal import StopDistanceChange

_MAX_DISTANCE = 1000.0  # distance of a stop that never ends [m]
_ROLLS = (-0.15, 0.0, 0.15)  # Level, and the roll of rough ground to both sides [rad]

_YAWS = tuple(np.linspace(-np.pi, np.pi, 8, endpoint=False).tolist())
_CURVATURE = 0.3
"""Curvature of a tight turn [1/m]."""

_HOT = 2000.0  # heat of brakes after a long descent [J/kg]
_LATER = 3600.0  # time in the session by which a drift has developed [s]
_FAR_AWAY = 1e7  # coordinate without any surface patch [m]

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Case:
    surface: str
    speed: float
    grade: float
    roll: float
    yaw: float
    curvature: float
    place: tuple[float, float]
    time: float
    heat: float

    def __str__(self) -> str:
        on = f" on {self.surface}" if self.surface else ""
        return f"{self.speed:.1f} m/s, grade {math.degrees(self.grade):+.1f}°{on}"


def compare_stops(after: Model, before: Model) -> StopDistanceChange:
    """Stops of ``after`` less those of ``before``, in the ranges of both, without margins."""
    smallest, largest, where = math.inf, -math.inf, ""
    for case in _cases(after, before):
        change = _distance(after, case) - _distance(before, case)
        largest = max(largest, change)
        if change < smallest:
            smallest, where = change, str(case)
    return StopDistanceChange(least=smallest, most=largest, where=where)


def cautious(finding: Model, file: Model) -> Model:
    """A finding that no operator confirmed: as uncertain as it and the model file together.

    Margins grow with uncertainty: with the finding's small covariance alone, stops a little weaker
    could make plans faster.
    """
    f, o = finding.braking, file.braking
    braking = dataclasses.replace(
        f,
        covariance=_sum(f, o),
        distance=_wider(f.distance, o.distance),
        dead_time=max(f.dead_time, o.dead_time),
        distance_offset=max(f.distance_offset, o.distance_offset),
        time_offset=max(f.time_offset, o.time_offset),
        speed_error=max(f.speed_error, o.speed_error),
        force_std=max(f.force_std, o.force_std),
        force_scatter=max(f.force_scatter, o.force_scatter),
        dead_time_std=max(f.dead_time_std, o.dead_time_std),
    )
    return dataclasses.replace(finding, braking=braking)


def _wider(a: StopDistance | None, b: StopDistance | None) -> StopDistance | None:
    """The table that allows more; a finding without one keeps that of the file."""
    if a is None or b is None:
        return a or b
    return max(a, b, key=lambda table: table.worst(QUANTILE))


def model_of(tables: dict[str, Any], file: Model) -> Model:
    """Model of a proposal; vehicle, terrain and limits are those of the model file."""
    try:
        finding = model_from_dict(tables, "offer")
    except InputError as error:
        raise ValueError(str(error)) from None
    return dataclasses.replace(file, braking=finding.braking, effect=finding.effect)


def _sum(a: Braking, b: Braking) -> tuple[tuple[float, ...], ...] | None:
    if a.covariance is None or b.covariance is None:
        return a.covariance or b.covariance
    total = np.array(a.covariance) + np.array(b.covariance)
    return tuple(tuple(row) for row in total.tolist())


def _distance(model: Model, case: _Case) -> float:
    values = (0.0, case.grade, case.roll, case.yaw, case.curvature, *case.place)
    track = GroundTrack(*(np.array([value]) for value in values))
    stop = simulate_stop(
        model, track, case.speed, surface=case.surface, session_time=case.time, heat=case.heat
    )
    offset = model.braking.on(case.surface).distance_offset
    return min(stop.distance + offset, _MAX_DISTANCE)


def _cases(after: Model, before: Model) -> Iterator[_Case]:
    effects = (*after.effect, *before.effect)
    arguments = {name for e in effects for name in LAWS[e.name].depends_on}
    placed = [e.parameters for e in effects if "place" in LAWS[e.name].depends_on]
    surfaces = dict.fromkeys(("", *before.braking.terrain, *after.braking.terrain))
    a, b = after.braking, before.braking
    return itertools.starmap(
        _Case,
        itertools.product(
            surfaces,
            _speeds(a.speed_range, b.speed_range),
            _grades(a.grade_range, b.grade_range),
            _ROLLS if "roll" in arguments else (0.0,),
            _YAWS if "yaw" in arguments else (0.0,),
            (0.0, _CURVATURE) if "turning" in arguments else (0.0,),
            ((_FAR_AWAY, _FAR_AWAY), *((p["x"], p["y"]) for p in placed)),
            (0.0, _LATER) if "session_time" in arguments else (0.0,),
            (0.0, _HOT) if "heat" in arguments else (0.0,),
        ),
    )


def _speeds(a: Range, b: Range) -> list[float]:
    """Speeds of both models, and below: there the coefficients of the lowest one hold [m/s]."""
    low, high = 0.5 * min(a[0], b[0]), min(a[1], b[1])
    return [float(value) for value in np.linspace(low, high, 4)]


def _grades(a: Range, b: Range) -> list[float]:
    """Grades of both models, of the first where they have none in common [rad]."""
    low, high = max(a[0], b[0]), min(a[1], b[1])
    if not low < high:
        low, high = a
    return [float(value) for value in np.linspace(low, high, 5)]
