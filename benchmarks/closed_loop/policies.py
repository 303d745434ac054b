"""Policies that decide on the speed ten times a second: the planner, and rules without one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings

from .course import Route
from .quad import QUAD
from .tracking import DriveCommand, EstimatedState

CYCLE = 0.1  # Time between two decisions [s]
HORIZON = 15.0  # Planned length of the path [m]
RESERVE = 0.15  # Part of the clear distance reserved for errors of localisation and tracking [m]
_LEAD = (0.1, 0.3)  # [s] ahead of now, in which the acceleration is commanded
_SPEED_TOLERANCE = 0.1  # [m/s] by which planned and measured speed may differ
_RESPONSE = 3.0 * CYCLE  # [s] in which a baseline approaches its speed
_FULL_STOP_SPEED = 0.3  # [m/s] above which a baseline brakes in full
_STRIDE = 2  # points of the route from one station of the horizon to the next
_BEHIND = 20  # points of the route behind the vehicle
_MIN_CLEAR = 0.3  # [m] below which a baseline stays at rest


@dataclass(frozen=True, slots=True)
class View:
    """The robot's knowledge in one cycle."""

    state: EstimatedState  # estimate of its motion
    station: float  # along the route [m]
    route: Route  # route to follow
    elevation_map: ElevationMap  # ground as known
    # along the route, for the middle of the wheelbase, until the front of the vehicle is at the
    # nearest obstacle or the end of sight [m]
    clear: float
    known: float  # along the route to unknown ground [m]


def with_lead(plan: SpeedPlan, time: float) -> tuple[float, float]:
    """Speed of a plan at a time, and its acceleration a little later: brakes need time to act."""
    now, first, last = np.interp(time + np.array((0.0, *_LEAD)), plan.time, plan.speed)
    return float(now), float((last - first) / (_LEAD[1] - _LEAD[0]))


def clear_of_front(clear: float) -> float:
    """Clear distance of the front of the vehicle, from that of the middle of the wheelbase [m]."""
    return max(clear, 0.0) + QUAD.shape.front


class Policy(Protocol):
    """Decides on the speed."""

    name: str  # shown in tables
    exact: bool  # whether it has exact sensors, an exact map and foresight of all obstacles

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
            return DriveCommand(stop=True)
        now, accel = with_lead(plan, 0.0)
        self._target = max(now + accel * CYCLE, 0.0)
        return DriveCommand(speed=now, accel=accel)

    def stopping_distance(self, view: View) -> float:
        """Stopping distance of the model, its safety offset included [m]."""
        self._target = 0.0
        return float(self._plan(view, max(view.state.speed, 0.0), math.inf).stop_distance[0])

    def _plan(self, view: View, speed: float, clear: float) -> SpeedPlan:
        path = CandidatePath("route", view.route.points(view.station, HORIZON))
        clear = clear_of_front(clear)
        return self._planner.plan(view.elevation_map, [path], start_speed=speed, clear=clear)[0]


class LevelBrakes:
    """A speed approached at the service accelerations: a fixed one, or that of a level stop.

    Without a speed it is as fast as a stop on level ground, v²/2a, fits into the clear distance.
    """

    exact = False

    def __init__(self, model: Model, speed: float | None = None) -> None:
        self.name = "level v²/2a" if speed is None else f"fixed {speed:g} m/s"
        self._limits, self._speed = model.limits, speed
        # Learned on level ground: one deceleration, that of the middle surface at 2.5 m/s.
        level = sorted(model.braking.on(s).level_force(2.5) for s in ("", *model.braking.terrain))
        self._deceleration = GRAVITY * level[len(level) // 2]

    def command(self, view: View) -> DriveCommand:
        """Approach the target speed; brake in full if the known route ends within v²/2a."""
        speed = max(view.state.speed, 0.0)
        clear = min(view.clear, view.known)
        if speed > _FULL_STOP_SPEED and clear < speed**2 / (2.0 * self._deceleration):
            return DriveCommand(stop=True)
        target = self._speed or math.sqrt(2.0 * self._deceleration * max(clear, 0.0))
        target = 0.0 if clear < _MIN_CLEAR else min(target, self._limits.speed)
        accel = np.clip((target - speed) / _RESPONSE, -self._limits.decel, self._limits.accel)
        return DriveCommand(speed=speed, accel=float(accel))

    def stopping_distance(self, view: View) -> float:
        """Stopping distance v²/2a of level ground [m]."""
        return float(view.state.speed**2 / (2.0 * self._deceleration))


class MovingHorizon:
    """The planner of a robot.

    The learned offset and force hold the scatter of stops already, so it plans at the median.
    """

    name, exact = "slopewise", False

    def __init__(self, model: Model, budget: float = 0.05) -> None:
        """Plan with a budget for each cycle [s]; other processes share the machine."""
        self._stops = Planned(model)
        settings = HorizonSettings(period=CYCLE, budget=budget)
        self._horizon = Horizon(model, settings, uncertainty=Uncertainty(quantile=0.5))

    def command(self, view: View) -> DriveCommand:
        """Run one cycle of the horizon."""
        seen = view.state
        state = PlanarState(x=seen.x, y=seen.y, heading=seen.yaw, speed=max(seen.speed, 0.0))
        paths, first_station = _route_around(view)
        clear = clear_of_front(view.station + view.clear - RESERVE - first_station)
        answer = self._horizon.step(state, paths, view.elevation_map, clear=clear)
        command = answer.command
        if command.stop:
            self._horizon.forget()
            return DriveCommand(stop=True)
        if answer.chosen is None:
            return DriveCommand()
        speed, accel = with_lead(answer.chosen, answer.chosen.travel_time - command.valid_for)
        return DriveCommand(speed=speed, accel=accel)

    def stopping_distance(self, view: View) -> float:
        """Stopping distance of the model; the current plan ends with the stop [m]."""
        self._horizon.forget()
        return self._stops.stopping_distance(view)


def _route_around(view: View) -> tuple[PathBatch, float]:
    """The route around the vehicle, always on the same stations, and its first station [m]."""
    route = view.route
    here = int(np.searchsorted(route.station, view.station))
    first = max(here - _BEHIND, 0) // _STRIDE * _STRIDE
    last = int(np.searchsorted(route.station, view.station + HORIZON))
    x, y = (np.ascontiguousarray(c[first:last:_STRIDE, None]) for c in (route.x, route.y))
    paths = PathBatch.of_stations(("route",), x, y, np.array([len(x)]))
    return paths, float(route.station[first])
