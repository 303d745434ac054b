"""Policies that decide on the speed: the planner, and the usual ways without one.

A policy receives a :class:`View` ten times a second and returns a command. Another planner joins
the loop as one more class of this shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings

from .quad import QUAD
from .route import Route
from .sensors import EstimatedState
from .tracking import DriveCommand

CYCLE = 0.1
"""Time between two decisions [s]."""

HORIZON = 15.0
"""Planned length of the path [m]."""

RESERVE = 0.15
"""Part of the clear distance reserved for errors of localisation and tracking [m]."""

_LEAD = (0.1, 0.3)  # [s] ahead of now, in which the acceleration is commanded
_SPEED_TOLERANCE = 0.1  # [m/s] by which planned and measured speed may differ
_RESPONSE = 3.0 * CYCLE  # [s] in which a baseline approaches its speed
_FULL_STOP_SPEED = 0.3  # [m/s] above which a baseline brakes in full
_MIN_CLEAR = 0.3  # [m] below which a baseline stays at rest


@dataclass(frozen=True, slots=True)
class View:
    """The robot's knowledge in one cycle.

    Attributes:
        state: estimate of its motion.
        station: along the route [m].
        route: route to follow.
        elevation_map: ground as known.
        clear: along the route, for the middle of the wheelbase, until the front of the vehicle is
            at the nearest obstacle or the end of sight [m].
        known: along the route to unknown ground [m].
    """

    state: EstimatedState
    station: float
    route: Route
    elevation_map: ElevationMap
    clear: float
    known: float


def with_lead(plan: SpeedPlan, time: float) -> tuple[float, float]:
    """Speed of a plan at a time, and its acceleration a little later: brakes need time to act."""
    now, first, last = np.interp(time + np.array((0.0, *_LEAD)), plan.time, plan.speed)
    return float(now), float((last - first) / (_LEAD[1] - _LEAD[0]))


def clear_of_front(clear: float) -> float:
    """Clear distance of the front of the vehicle, from that of the middle of the wheelbase [m]."""
    return max(clear, 0.0) + QUAD.shape.front


class Policy(Protocol):
    """Decides on the speed.

    Attributes:
        name: shown in tables.
        exact: whether it has exact sensors, an exact map and foresight of all obstacles.
    """

    name: str
    exact: bool

    def command(self, view: View) -> DriveCommand:
        """Return the command of one cycle."""

    def stopping_distance(self, view: View) -> float:
        """Predicted distance of full braking now [m]; NaN without a prediction."""


class Planned:
    """The bare planner: in every cycle the fastest plan from here, not smoothed."""

    def __init__(self, model: Model, *, name: str = "without memory", exact: bool = False) -> None:
        self.name, self.exact = name, exact
        self._planner = CandidatePlanner(model, PlannerSettings(smooth=False))
        self._target = 0.0

    def command(self, view: View) -> DriveCommand:
        """Plan from the target speed, or near the measured one."""
        measured = view.state.speed
        speed = np.clip(self._target, measured - _SPEED_TOLERANCE, measured + _SPEED_TOLERANCE)
        plan = self._plan(view, max(float(speed), 0.0), view.clear - RESERVE)
        if plan.status is Status.INFEASIBLE:
            self._target = 0.0
            return DriveCommand(stop=True, reason=plan.reason)
        now, accel = with_lead(plan, 0.0)
        self._target = max(now + accel * CYCLE, 0.0)
        return DriveCommand(speed=now, accel=accel, reason=plan.reason)

    def stopping_distance(self, view: View) -> float:
        """Stopping distance of the model, its safety offset included [m]."""
        self._target = 0.0
        return float(self._plan(view, max(view.state.speed, 0.0), math.inf).stop_distance[0])

    def _plan(self, view: View, speed: float, clear: float) -> SpeedPlan:
        path = CandidatePath("route", view.route.points(view.station, HORIZON))
        (plan,) = self._planner.plan(
            view.elevation_map, [path], start_speed=speed, clear=clear_of_front(clear)
        )
        return plan


class _Baseline:
    """A target speed that is approached at the service accelerations."""

    exact = False

    def __init__(self, model: Model, name: str) -> None:
        self.name = name
        self._limits = model.limits
        # Learned on level ground: one deceleration, that of the middle surface at 2.5 m/s.
        level = sorted(model.braking.on(s).level_force(2.5) for s in ("", *model.braking.terrain))
        self._deceleration = GRAVITY * level[len(level) // 2]

    def command(self, view: View) -> DriveCommand:
        """Approach the target speed; brake in full if the known route ends within v²/2a."""
        speed = max(view.state.speed, 0.0)
        clear = min(view.clear, view.known)
        if speed > _FULL_STOP_SPEED and clear < speed**2 / (2.0 * self._deceleration):
            return DriveCommand(stop=True, reason="the known route ends")
        target = min(self._target_speed(view, clear), self._limits.speed)
        if clear < _MIN_CLEAR:
            target = 0.0
        accel = np.clip((target - speed) / _RESPONSE, -self._limits.decel, self._limits.accel)
        return DriveCommand(speed=speed, accel=float(accel))

    def stopping_distance(self, view: View) -> float:
        """Stopping distance v²/2a of level ground [m]."""
        return float(view.state.speed**2 / (2.0 * self._deceleration))

    def _target_speed(self, view: View, clear: float) -> float:
        raise NotImplementedError


class FixedSpeed(_Baseline):
    """One speed for everything."""

    def __init__(self, model: Model, speed: float) -> None:
        super().__init__(model, f"fixed {speed:g} m/s")
        self._speed = speed

    def _target_speed(self, view: View, clear: float) -> float:
        return self._speed


class LevelStop(_Baseline):
    """As fast as a stop on level ground, v²/2a, fits into the clear distance."""

    def __init__(self, model: Model) -> None:
        super().__init__(model, "level v²/2a")

    def _target_speed(self, view: View, clear: float) -> float:
        return math.sqrt(2.0 * self._deceleration * max(clear, 0.0))


class CurvatureOnly(_Baseline):
    """Slower in curves, as regulated pure pursuit is, and without any other limit."""

    def __init__(self, model: Model) -> None:
        super().__init__(model, "curvature only")

    def _target_speed(self, view: View, clear: float) -> float:
        points = view.route.points(view.station, 4.0)
        steps = np.diff(points, axis=0)
        turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
        curvature = float(np.max(np.abs(turns) / np.hypot(*steps[1:].T)))
        return math.sqrt(self._limits.lateral_accel / max(curvature, 1e-3))


class ScriptedSpeed:
    """Hold one drawn speed after another on free ground, to learn from the stops."""

    name = "scripted"

    def __init__(
        self, rng: np.random.Generator, accel: float, max_speed: float, *, exact: bool
    ) -> None:
        self._rng, self._accel, self._max_speed = rng, accel, max_speed
        self._target = rng.uniform(0.6, max_speed)
        self._stood = False
        self.exact = exact

    def command(self, view: View) -> DriveCommand:
        """Approach a speed that is drawn again after every standstill."""
        speed = max(view.state.speed, 0.0)
        if speed < 0.05 and not self._stood:
            self._target = self._rng.uniform(0.6, self._max_speed)
        self._stood = speed < 0.05
        if view.route.length - view.station < 6.0:
            return DriveCommand(stop=True, reason="the route ends")
        accel = np.clip((self._target - speed) / _RESPONSE, -self._accel, self._accel)
        return DriveCommand(speed=speed, accel=float(accel))

    def stopping_distance(self, view: View) -> float:
        """NaN: no prediction."""
        return math.nan


def oracle_policy(model: Model) -> Planned:
    """The upper bound: exact model, exact sensors, foresight of all obstacles."""
    return Planned(replace(model, name="perfect"), name="perfect knowledge", exact=True)
