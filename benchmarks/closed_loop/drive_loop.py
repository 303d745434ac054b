"""One drive: course, world, sensors, tracking and a policy, and what came of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.quantity import GRAVITY

from .course import Course
from .policies import CYCLE, Policy, View
from .quad import OVERHANG, QUAD
from .records import DrivenScene, ForcedStop, StopTrace
from .route import Route
from .sensors import Sensors
from .terrain import SURFACES, PhysicsGround
from .tracking import DriveCommand, Tracker
from .world import TICK, DrivenWorld

ROLLING = 0.5
"""A stop from below this speed is none [m/s]."""

FINISH = 6.0
"""A drive ends this far before its route, where no plan slows down for the end yet [m]."""

_STANDING = 0.03  # [m/s]
_PAUSE = 0.5  # [s] at rest until what bars the way is gone
_NEAR = 4.0  # [m] from which the robot is taken to stand before it
_STUCK = 5.0  # [s] at rest before nothing
_LONGEST = 180.0  # [s]
_LOAD_FILTER = 0.15  # [s] rocking that is faster tips nothing over
_BITES = 0.12  # [s] after a stop command the drive lets go: the brake line reports pressure


class _Loop:
    """The state of one drive."""

    def __init__(
        self, terrain: PhysicsGround, route: Route, course: Course, policy: Policy, seed: int
    ) -> None:
        rng = np.random.default_rng(seed)
        self.terrain, self.route, self.course, self.policy = terrain, route, course, policy
        self.world = DrivenWorld(terrain, np.random.default_rng(seed + 1))
        self.world.reset(float(route.x[0]), float(route.y[0]), float(route.heading[0]))
        self.sensors = Sensors(self.world, None if policy.exact else rng)
        self.tracker = Tracker(route, QUAD)
        self.drive = DrivenScene(policy.name, terrain.source)
        self.told_heights = terrain.told(None if policy.exact else rng)
        self.map = self._map()
        self.state = self.sensors.read()
        self.index = self.believed = 0
        self.station = self.seen_station = 0.0
        self.command = DriveCommand()
        self.commanded_at = -np.inf
        self.stop_started: tuple[float, float, float, float, float, str, bool] | None = None
        self.rows: list[tuple[float, float, float, float]] = []
        self.rest = 0.0
        self.shares = np.ones(4)
        self.wheels = np.ones(4)
        self.beyond = False
        self.history: list[tuple[float, ...]] = []
        weight = QUAD.mass * GRAVITY
        front = QUAD.cg_x / QUAD.wheelbase
        self.level = weight * np.array([front, 1.0 - front, 0.5, 0.5])

    def _map(self) -> ElevationMap:
        heights = self.told_heights
        unknown = self.course.unknown_cells(self.terrain)
        if unknown is not None:
            heights = np.where(unknown, np.nan, heights)
        return self.terrain.elevation_map(heights)

    def view(self) -> View:
        """As the policy sees it; sight depends on where the vehicle really is."""
        told = self.course.told(self.station, self.policy.exact)
        return View(
            self.state,
            self.seen_station,
            self.route,
            self.map,
            told - self.seen_station,
            self.course.known - self.seen_station,
        )

    def stop_now(self, *, forced: bool, reason: str) -> None:
        """Slam the brakes on and remember from where."""
        predicted = self.policy.stopping_distance(self.view())
        self.command = DriveCommand(
            speed=max(self.state.speed, 0.0), accel=0.0, stop=True, reason=reason
        )
        self.commanded_at = self.world.time
        surface = SURFACES[self.world.surface]
        held = self.state.speed
        self.stop_started = (
            self.station,
            self.world.speed,
            predicted,
            held,
            self.seen_station,
            surface,
            forced,
        )
        self.rows = []

    def trigger(self) -> None:
        """Let appear what is due."""
        for h in self.course.happenings:
            if h.kind == "forced" and not h.over and not h.active and self.station >= h.trigger:
                if self.world.speed < ROLLING or self.command.stop:
                    h.over = True
                    continue
                h.active = True
                self.stop_now(forced=True, reason="a wall at the end of the clear distance")
        self.put_wall()

    def put_wall(self) -> None:
        """The nearest wall stands in the world, its face where the front would touch it."""
        walls = [
            h.barrier
            for h in self.course.happenings
            if not h.over and (h.active or h.kind == "obstacle")
        ]
        if not walls:
            self.world.wall(None)
            return
        i = int(np.searchsorted(self.route.station, min(walls)))
        i = min(i, len(self.route.station) - 1)
        reach = OVERHANG * np.cos(self.route.grade[i]) + 0.03
        heading = float(self.route.heading[i])
        x = float(self.route.x[i] + reach * np.cos(heading))
        y = float(self.route.y[i] + reach * np.sin(heading))
        self.world.wall((x, y, heading))

    def settle(self) -> None:
        """At rest: close the record of a stop, and clear the way after a pause."""
        if self.world.speed > _STANDING:
            self.rest = 0.0
            return
        self.rest += TICK
        if self.stop_started is not None:
            self.finish_stop()
        if self.rest < _PAUSE:
            return
        if self.command.stop:
            self.command = DriveCommand()
        gone = False
        for h in self.course.happenings:
            near = h.barrier - self.station < _NEAR
            if not h.over and (h.active or (h.kind != "forced" and near)):
                h.over = gone = True
        if gone or self.world.collided:
            self.world.collided = False
            self.put_wall()
            self.map = self._map()
            self.rest = 0.0

    def finish_stop(self) -> None:
        """The vehicle stands: judge the stop."""
        assert self.stop_started is not None
        station, speed, predicted, held, seen, surface, forced = self.stop_started
        self.stop_started = None
        if speed < ROLLING:
            return
        rows = np.array(self.rows)
        trace = StopTrace(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], held, seen)
        self.drive.stops.append(
            ForcedStop(
                speed,
                self.route.at(station, self.route.grade),
                surface,
                self.station - station,
                predicted,
                self.course.limit - self.station,
                forced,
                trace,
            )
        )

    def judge(self) -> None:
        """Loads, collisions, barriers: by the truth, every tick."""
        drive, loads = self.drive, self.world.loads
        axles = np.array(
            [loads[0] + loads[1], loads[2] + loads[3], loads[0] + loads[2], loads[1] + loads[3]]
        )
        keep = np.exp(-TICK / _LOAD_FILTER)
        self.shares += (axles / self.level - self.shares) * (1.0 - keep)
        self.wheels += (4.0 * loads / (QUAD.mass * GRAVITY) - self.wheels) * (1.0 - keep)
        drive.least_share = np.minimum(drive.least_share, self.shares)
        drive.least_wheel = min(drive.least_wheel, float(self.wheels.min()))
        over = self.station - self.course.limit
        drive.farthest = max(drive.farthest, over)
        if over > 0.0 and not self.beyond:
            drive.past_clear += 1
        self.beyond = over > 0.0
        x, y, _ = self.world.pose
        away = np.hypot(self.route.x[self.index] - x, self.route.y[self.index] - y)
        drive.track_error = max(drive.track_error, float(away))

    def tick(self) -> None:
        """One tick of world, sensors and controller."""
        since = self.world.time - self.commanded_at
        holding = self.command.stop and since < _BITES
        control = self.tracker.actuate(self.state, self.seen_station, self.command, since, holding)
        touched = self.world.collided
        self.world.tick(*control)
        if self.world.collided and not touched:
            self.drive.collisions += 1
        self.state = self.sensors.read()
        x, y, _ = self.world.pose
        self.index, self.station = self.route.locate(x, y, self.index)
        self.believed, self.seen_station = self.route.locate(
            self.state.x, self.state.y, self.believed
        )
        if self.stop_started is not None:
            since = self.world.time - self.commanded_at
            self.rows.append((since, self.state.speed, self.state.pitch, self.seen_station))

    def remember(self) -> None:
        """Keep a row of this cycle."""
        route, station = self.route, self.station
        row = (
            self.world.time,
            station,
            self.world.speed,
            self.course.told(station, self.policy.exact),
            self.course.limit,
            route.at(station, route.grade),
            route.at(station, route.roll),
            float(self.world.surface),
        )
        self.history.append(row)

    def cycle(self) -> None:
        """Ask the policy."""
        if self.command.stop:
            return
        command = self.policy.command(self.view())
        if command.stop and self.world.speed > 0.05:
            self.drive.reasons.append(command.reason)
            self.stop_now(forced=False, reason=command.reason)
            return
        self.command = command
        self.commanded_at = self.world.time


def run_drive(
    terrain: PhysicsGround,
    route: Route,
    course: Course,
    policy: Policy,
    seed: int,
    watch: Callable[[DrivenWorld], None] | None = None,
) -> DrivenScene:
    """Drive a route once.

    Args:
        terrain, route, course: where and what; the course is used up.
        policy: who decides.
        seed: of noise and scatter.
        watch: called every cycle.
    """
    loop = _Loop(terrain, route, course, policy, seed)
    drive, cycle = loop.drive, round(CYCLE / TICK)
    ticks = 0
    while loop.world.time < _LONGEST:
        if ticks % cycle == 0:
            loop.cycle()
            loop.remember()
            if watch is not None:
                watch(loop.world)
        loop.trigger()
        loop.tick()
        loop.settle()
        loop.judge()
        ticks += 1
        if loop.world.speed > 0.05 or loop.rest == 0.0:
            drive.moving_time += TICK
        if loop.station > route.length - FINISH and loop.stop_started is None:
            drive.finished = True
            break
        if loop.rest > _STUCK:
            break
    drive.distance = loop.station
    drive.history = np.array(loop.history)
    return drive
