"""Who decides on the speed: the planner, and what people use without one.

A policy sees a :class:`View` ten times a second and answers with a command. To put another planner
into the loop, write one more class of this shape.
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
"""Between two decisions [s]."""

HORIZON = 15.0
"""Of a path that is planned [m]."""

_LEAD = (0.1, 0.3)  # [s] ahead of now


@dataclass(frozen=True, slots=True)
class View:
    """What the robot knows in one cycle.

    Attributes:
        state: estimate of its motion. station: along the route [m].
        route: to be followed.
        elevation_map: ground as known.
        clear: along the route, for the middle of the wheelbase, until the front of the vehicle is
            at the nearest obstacle or the end of sight [m].
        known: along the route to ground that is unknown [m].
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


def free_for_the_front(clear: float) -> float:
    """What a planner is told: how far the way is free for the front of the vehicle [m].

    Args:
        clear: of the middle of the wheelbase, as in a :class:`View` [m].
    """
    return max(clear, 0.0) + QUAD.shape.front


class Policy(Protocol):
    """Decides on speed.

    Attributes:
        name: in tables.
        exact: it is given exact sensors, an exact map and all obstacles to come.
    """

    name: str
    exact: bool

    def command(self, view: View) -> DriveCommand:
        """The answer of one cycle."""

    def stopping_distance(self, view: View) -> float:
        """Predicted for full brakes now [m]; NaN if the policy knows of no such thing."""


class Planned:
    """The bare planner: in every cycle the fastest plan from here, not smoothed."""

    def __init__(
        self,
        model: Model,
        *,
        name: str = "without memory",
        exact: bool = False,
        reserve: float = 0.15,
    ) -> None:
        """Plan with a model.

        Args:
            model: learned.
            name: in tables. exact: see :class:`Policy`.
            reserve: kept of the clear distance for errors of localisation and tracking [m].
        """
        self.name, self.exact = name, exact
        self._reserve = reserve
        self._planner = CandidatePlanner(model, PlannerSettings(smooth=False))
        self._wanted = 0.0
        self.plan: SpeedPlan | None = None

    def command(self, view: View) -> DriveCommand:
        """Plan from the speed that was to be reached by now, or near the measured one."""
        speed = float(np.clip(self._wanted, view.state.speed - 0.1, view.state.speed + 0.1))
        plan = self.plan = self._plan(view, max(speed, 0.0), view.clear - self._reserve)
        if plan.status is Status.INFEASIBLE:
            self._wanted = 0.0
            return DriveCommand(stop=True, reason=plan.reason)
        speed, accel = with_lead(plan, 0.0)
        self._wanted = max(speed + accel * CYCLE, 0.0)
        return DriveCommand(speed=speed, accel=accel, reason=plan.reason)

    def stopping_distance(self, view: View) -> float:
        """What the model says of full brakes from here, its safety offset included."""
        speed = max(view.state.speed, 0.0)
        self._wanted = 0.0
        return float(self._plan(view, speed, math.inf).stop_distance[0])

    def _plan(self, view: View, speed: float, clear: float) -> SpeedPlan:
        points = view.route.points(view.station, HORIZON)
        path = CandidatePath("route", points)
        (plan,) = self._planner.plan(
            view.elevation_map, [path], start_speed=speed, clear=free_for_the_front(clear)
        )
        return plan


class _Plain:
    """What baselines share: a wanted speed, reached at the service accelerations."""

    exact = False

    def __init__(self, model: Model, name: str) -> None:
        self.name = name
        self._limits = model.limits
        # What one learns on level ground: a single deceleration, that of the middle surface.
        level = sorted(model.braking.on(s).level_force(2.5) for s in ("", *model.braking.terrain))
        self._deceleration = GRAVITY * level[len(level) // 2]

    def command(self, view: View) -> DriveCommand:
        """Towards the wanted speed; full brakes if what is known ends within v²/2a."""
        speed = max(view.state.speed, 0.0)
        free = min(view.clear, view.known)
        if speed > 0.3 and free < speed**2 / (2.0 * self._deceleration):
            return DriveCommand(stop=True, reason="the known way ends")
        wanted = min(self._wanted(view, free), self._limits.speed)
        if free < 0.3:
            wanted = 0.0
        accel = np.clip((wanted - speed) / (3.0 * CYCLE), -self._limits.decel, self._limits.accel)
        return DriveCommand(speed=speed, accel=float(accel))

    def stopping_distance(self, view: View) -> float:
        """v²/2a of level ground."""
        return float(view.state.speed**2 / (2.0 * self._deceleration))

    def _wanted(self, view: View, free: float) -> float:
        raise NotImplementedError


class FixedSpeed(_Plain):
    """One speed for everything."""

    def __init__(self, model: Model, speed: float) -> None:
        super().__init__(model, f"fixed {speed:g} m/s")
        self._speed = speed

    def _wanted(self, view: View, free: float) -> float:
        return self._speed


class LevelStop(_Plain):
    """As fast as a stop on level ground, v²/2a, fits into the clear distance."""

    def __init__(self, model: Model) -> None:
        super().__init__(model, "level v²/2a")

    def _wanted(self, view: View, free: float) -> float:
        return math.sqrt(2.0 * self._deceleration * max(free, 0.0))


class CurvatureOnly(_Plain):
    """Slower in bends, as regulated pure pursuit is, and nothing else."""

    def __init__(self, model: Model) -> None:
        super().__init__(model, "curvature only")

    def _wanted(self, view: View, free: float) -> float:
        points = view.route.points(view.station, 4.0)
        steps = np.diff(points, axis=0)
        turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
        sharpest = float(np.max(np.abs(turns) / np.hypot(*steps[1:].T)))
        return math.sqrt(self._limits.lateral_accel / max(sharpest, 1e-3))


class Blind:
    """Holds one speed after another whatever comes: for learning stops, on ground that is free."""

    name, exact = "blind", False

    def __init__(self, rng: np.random.Generator, accel: float, fastest: float) -> None:
        self._rng, self._accel, self._fastest = rng, accel, fastest
        self._target = rng.uniform(0.6, fastest)
        self._stood = False

    def command(self, view: View) -> DriveCommand:
        """Towards a speed that is drawn anew after every standstill."""
        speed = max(view.state.speed, 0.0)
        if speed < 0.05 and not self._stood:
            self._target = self._rng.uniform(0.6, self._fastest)
        self._stood = speed < 0.05
        if view.route.length - view.station < 6.0:
            return DriveCommand(stop=True, reason="the route ends")
        accel = np.clip((self._target - speed) / (3.0 * CYCLE), -self._accel, self._accel)
        return DriveCommand(speed=speed, accel=float(accel))

    def stopping_distance(self, view: View) -> float:
        """It knows of none."""
        return math.nan


def foresighted(model: Model) -> Planned:
    """The upper bound: exact model, exact sensors, all obstacles known from the start."""
    return Planned(replace(model, name="perfect"), name="perfect knowledge", exact=True)
