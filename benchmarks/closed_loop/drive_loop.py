"""One drive: scene, world, sensors, tracking and a policy, and the record of its outcome."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.quantity import GRAVITY

from .course import Course, Route, draw_route
from .loop_terrain import SURFACES, PhysicsGround, crop, hills
from .policies import CYCLE, Policy, View
from .quad import OVERHANG, QUAD
from .tracking import DriveCommand, Sensors, Tracker
from .world import TICK, DrivenWorld

TESTED = (0.4, 1.0)  # rows of each elevation model, as shares; models were learned on the others

_SERIES = 5  # of seeds
_ATTEMPTS = 200  # grounds that are tried for a route


def dem_folder() -> Path | None:
    """Folder of public elevation models, None without any."""
    default = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    folder = Path(os.environ.get("SLOPEWISE_DATA", default)) / "dem"
    return folder if any(folder.glob("*.tif")) else None


def scene(number: int, dem: Path | None) -> tuple[PhysicsGround, Route, Course]:
    """Ground, route and course of a drive; elevation models are the ground of two of three."""
    rng = np.random.default_rng((_SERIES, number))
    for _ in range(_ATTEMPTS):
        terrain = hills(rng) if dem is None or number % 3 == 0 else crop(dem, rng, TESTED)
        route = draw_route(terrain, rng)
        if route is not None:
            return terrain, route, Course(route, rng)
    raise RuntimeError(f"no route for drive {number} on {_ATTEMPTS} grounds")


ROLLING = 0.5  # Speed from which a stop is recorded [m/s]
FINISH = 6.0  # A drive ends this far before its route, where no plan slows down for the end yet [m]
_STANDSTILL_SPEED = 0.03  # [m/s]
_MOVING_SPEED = 0.05  # [m/s] above which time counts as driven
_PAUSE = 0.5  # [s] at rest until a blocked station is cleared
_NEAR = 4.0  # [m] within which the robot is taken to wait at an obstacle
_STUCK = 5.0  # [s] at rest without an obstacle, after which the drive ends
_MAX_TIME = 180.0  # [s] of a drive
_LOAD_FILTER = 0.15  # [s]; faster oscillation of the loads cannot tip the vehicle
BRAKE_BUILD_UP = 0.12  # [s] after a stop command the drive releases: the brake line has pressure


@dataclass(slots=True)
class ForcedStop:
    """One emergency stop, by the truth."""

    speed: float  # true speed at the command [m/s]
    grade: float  # grade of the ground there [rad]
    surface: str  # name of the surface there
    predicted: float  # distance predicted by the policy, offset included [m]
    forced: bool  # whether a wall forced it, not the policy
    actual: float = np.nan  # distance from command to rest [m]
    left: float = np.nan  # clear distance left at rest, below 0 if exceeded [m]


@dataclass(slots=True)
class DrivenScene:
    """Outcome of one drive."""

    finished: bool = False  # whether the end was reached
    distance: float = 0.0  # driven distance [m]
    moving_time: float = 0.0  # time without waiting at blocked stations [s]
    stops: list[ForcedStop] = field(default_factory=list)  # emergency stops from above walking pace
    collisions: int = 0  # walls touched
    past_clear: int = 0  # times that the vehicle passed a barrier
    farthest: float = -np.inf  # largest distance beyond one [m]
    # minimum filtered load of front, rear, left, right over level, shape (4,) [1]
    min_load_shares: Floats = field(default_factory=lambda: np.ones(4))
    track_error: float = 0.0  # largest distance from the route [m]

    @property
    def mean_speed(self) -> float:
        """Mean speed while moving [m/s]."""
        return self.distance / self.moving_time if self.moving_time > 0.0 else 0.0


class _Loop:
    def __init__(
        self, terrain: PhysicsGround, route: Route, course: Course, policy: Policy, seed: int
    ) -> None:
        rng = np.random.default_rng(seed)
        self.terrain, self.route, self.course, self.policy = terrain, route, course, policy
        self.world = DrivenWorld(terrain, np.random.default_rng(seed + 1))
        self.world.reset(float(route.x[0]), float(route.y[0]), float(route.heading[0]))
        self.sensors = Sensors(self.world, None if policy.exact else rng)
        self.tracker = Tracker(route)
        self.drive = DrivenScene()
        self.mapped_heights = terrain.mapped_heights(None if policy.exact else rng)
        self.map = self._map()
        self.state = self.sensors.read()
        self.index, self.seen_index, self.station, self.seen_station = 0, 0, 0.0, 0.0
        self.command, self.commanded_at = DriveCommand(), -np.inf
        self.stop: ForcedStop | None = None  # until rest
        self.stop_from = 0.0
        self.rest, self.beyond, self.shares = 0.0, False, np.ones(4)
        front = QUAD.cg_x / QUAD.wheelbase
        self.level = QUAD.mass * GRAVITY * np.array([front, 1.0 - front, 0.5, 0.5])

    def _map(self) -> ElevationMap:
        unknown = self.course.unknown_cells(self.terrain)
        return self.terrain.elevation_map(np.where(unknown, np.nan, self.mapped_heights))

    def view(self) -> View:
        """The policy's view; sight depends on the true place of the vehicle."""
        seen = self.seen_station
        clear = self.course.reported_clear(self.station, self.policy.exact) - seen
        return View(self.state, seen, self.route, self.map, clear, self.course.known - seen)

    def stop_now(self, *, forced: bool) -> None:
        """Command full braking and remember its start."""
        self.stop_from, speed = self.station, self.world.speed
        predicted = self.policy.stopping_distance(self.view())
        grade, surface = self.route.at(self.station, self.route.grade), self.world.surface
        self.stop = ForcedStop(speed, grade, SURFACES[surface], predicted, forced)
        self.command = DriveCommand(max(self.state.speed, 0.0), 0.0, stop=True)
        self.commanded_at = self.world.time

    def trigger(self) -> None:
        """Start the events that are due."""
        for e in self.course.events:
            due = e.kind == "forced" and not e.over and not e.active
            if due and self.station >= e.trigger:
                e.over = self.world.speed < ROLLING or self.command.stop
                e.active = not e.over
                if e.active:
                    self.stop_now(forced=True)
        self.put_wall()

    def put_wall(self) -> None:
        """Place the nearest wall, its face where the front would touch it."""
        walls = [e.barrier for e in self.course.events if e.blocks and e.kind != "unknown"]
        if not walls:
            self.world.wall(None)
            return
        route = self.route
        i = min(int(np.searchsorted(route.station, min(walls))), len(route.station) - 1)
        ahead, heading = OVERHANG * np.cos(route.grade[i]) + 0.03, float(route.heading[i])
        x, y = route.x[i] + ahead * np.cos(heading), route.y[i] + ahead * np.sin(heading)
        self.world.wall((float(x), float(y), heading))

    def settle(self) -> None:
        """Finish a stop at rest, and clear the route after a pause."""
        if self.world.speed > _STANDSTILL_SPEED:
            self.rest = 0.0
            return
        self.rest += TICK
        if self.stop is not None:
            if self.stop.speed >= ROLLING:
                self.stop.actual = self.station - self.stop_from
                self.stop.left = self.course.limit - self.station
                self.drive.stops.append(self.stop)
            self.stop = None
        if self.rest < _PAUSE:
            return
        if self.command.stop:
            self.command = DriveCommand()
        cleared = False
        for e in self.course.events:
            near = e.kind != "forced" and e.barrier - self.station < _NEAR
            if not e.over and (e.active or near):
                e.over = cleared = True
        if cleared or self.world.collided:
            self.world.collided = False
            self.put_wall()
            self.map = self._map()
            self.rest = 0.0

    def record_limits(self) -> None:
        """Record loads and passed barriers, by the truth."""
        drive, (a, b, c, d) = self.drive, self.world.loads
        axles = np.array([a + b, c + d, a + c, b + d])
        keep = np.exp(-TICK / _LOAD_FILTER)
        self.shares += (axles / self.level - self.shares) * (1.0 - keep)
        drive.min_load_shares = np.minimum(drive.min_load_shares, self.shares)
        over = self.station - self.course.limit
        drive.farthest = max(drive.farthest, over)
        if over > 0.0 and not self.beyond:
            drive.past_clear += 1
        self.beyond = over > 0.0
        x, y, _ = self.world.pose
        away = np.hypot(self.route.x[self.index] - x, self.route.y[self.index] - y)
        drive.track_error = max(drive.track_error, float(away))

    def tick(self) -> None:
        """Advance world, sensors and controller by one tick."""
        since = self.world.time - self.commanded_at
        holding = self.command.stop and since < BRAKE_BUILD_UP
        control = self.tracker.actuate(self.state, self.seen_station, self.command, since, holding)
        touched = self.world.collided
        self.world.tick(*control)
        if self.world.collided and not touched:
            self.drive.collisions += 1
        self.state = self.sensors.read()
        x, y, _ = self.world.pose
        self.index, self.station = self.route.locate(x, y, self.index)
        seen = (self.state.x, self.state.y, self.seen_index)
        self.seen_index, self.seen_station = self.route.locate(*seen)

    def cycle(self) -> None:
        """Ask the policy for a command."""
        if self.command.stop:
            return
        command = self.policy.command(self.view())
        if command.stop and self.world.speed > _MOVING_SPEED:
            self.stop_now(forced=False)
        else:
            self.command, self.commanded_at = command, self.world.time


def run_drive(
    terrain: PhysicsGround, route: Route, course: Course, policy: Policy, seed: int
) -> DrivenScene:
    """Drive a route once; the course is used up, the seed is that of noise and scatter."""
    loop = _Loop(terrain, route, course, policy, seed)
    drive, cycle = loop.drive, round(CYCLE / TICK)
    ticks = 0
    while loop.world.time < _MAX_TIME:
        if ticks % cycle == 0:
            loop.cycle()
        loop.trigger()
        loop.tick()
        loop.settle()
        loop.record_limits()
        ticks += 1
        if loop.world.speed > _MOVING_SPEED or loop.rest == 0.0:
            drive.moving_time += TICK
        if loop.station > route.length - FINISH and loop.stop is None:
            drive.finished = True
            break
        if loop.rest > _STUCK:
            break
    drive.distance = loop.station
    return drive
