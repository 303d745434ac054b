"""A mock navigation stack: requests plans of a running service in every cycle, and drives them.

In one terminal ``slopewise serve --config configs/service.toml`` (with ``[page] enabled = true``
there is something to see), in another ``python examples/mock_navigation.py --seconds 60``.

The robot is a point that follows its plan perfectly, round and round a loop over generated hills.
It sees only the ground around it, and sends what it sees as patches of the map. Of slopewise it
uses nothing but the client and its messages, like a stack that copied those files.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass, field

import numpy as np
import zenoh

from slopewise import PlanClient
from slopewise.services.client import ClientAnswer
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire.plan_messages import MapUpdate, Path

CELL, ROWS, COLUMNS = 0.25, 192, 256
MIDDLE, RADII = (32.0, 24.0), (22.0, 14.0)  # [m] of the loop, an ellipse
SIGHT = 16.0  # [m] how far the robot sees
LENGTH, FAN = 20.0, 11  # [m] of candidates, and how many
SIDEWAYS = 2.0  # [m] between the outermost candidates and the loop
OWN_BRAKES = 1.5  # [m/s²] that the stack's own stop counts on


def hills() -> np.ndarray:
    """Heights of the is_complete ground (rows, columns) [m]; the robot does not know them."""
    x, y = np.meshgrid(CELL * np.arange(COLUMNS), CELL * np.arange(ROWS))
    return 1.2 * np.sin(x / 9.0) + 0.9 * np.cos(y / 8.0) + 0.4 * np.sin((x + y) / 5.0)


@dataclass(frozen=True)
class Loop:
    """A closed line, anticlockwise: points every 0.1 m, unit normals to the left, its length."""

    points: np.ndarray
    left: np.ndarray
    length: float

    @classmethod
    def ellipse(cls) -> Loop:
        """The one that the robot drives."""
        turn = np.linspace(0.0, 2.0 * np.pi, 20_001)
        line = np.array(MIDDLE) + np.array(RADII) * np.stack((np.cos(turn), np.sin(turn)), axis=1)
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
        even = np.arange(0.0, along[-1], 0.1)
        points = np.stack([np.interp(even, along, column) for column in line.T], axis=1)
        ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
        ahead /= np.hypot(*ahead.T)[:, None]
        return cls(points, np.stack((-ahead[:, 1], ahead[:, 0]), axis=1), float(along[-1]))

    def nearest(self, x: float, y: float) -> tuple[int, float]:
        """Index of the nearest point, and how far to the left of it a place is [m]."""
        offset = np.array((x, y)) - self.points
        index = int(np.argmin(np.hypot(*offset.T)))
        return index, float(offset[index] @ self.left[index])


@dataclass
class Robot:
    """Pose [m, m, rad], speed [m/s] and what was seen."""

    ground: np.ndarray
    loop: Loop
    x: float = MIDDLE[0] + RADII[0]
    y: float = MIDDLE[1]
    heading: float = 0.5 * np.pi
    speed: float = 0.0
    driven: float = 0.0
    sequence: int = 0
    source: str = field(default_factory=lambda: f"mock-{os.getpid()}-{time.time_ns()}")

    def __post_init__(self) -> None:
        self.known = np.full(self.ground.shape, np.nan)

    def sees(self) -> MapUpdate:
        """First the complete map, unknown except what is in sight; then a patch around it."""
        rows, columns = np.indices(self.ground.shape)
        away = np.hypot(CELL * columns - self.x, CELL * rows - self.y)
        cells = np.nonzero(away <= SIGHT)
        is_complete = self.sequence == 0
        cut = (
            np.s_[:, :]
            if is_complete
            else np.s_[cells[0].min() : cells[0].max() + 1, cells[1].min() : cells[1].max() + 1]
        )
        first = (0, 0) if is_complete else (int(cells[1].min()), int(cells[0].min()))
        self.known[cells] = self.ground[cells]
        self.sequence += 1
        return MapUpdate(
            source=self.source,
            sequence=self.sequence,
            elevation=self.known[cut],
            resolution=CELL,
            origin=(CELL * first[0], CELL * first[1]),
            patch=not is_complete,
        )

    def candidates(self) -> list[Path]:
        """Stretches of the loop from here on, each moving gently to its own side of it."""
        here, side = self.loop.nearest(self.x, self.y)
        along = np.linspace(0.0, LENGTH, 80)
        at = (here + np.round(10.0 * along).astype(int)) % len(self.loop.points)
        share = np.clip(along / 12.0, 0.0, 1.0)
        blend = share**2 * (3.0 - 2.0 * share)
        return [
            Path(
                name=f"{offset:+.1f} m",
                points=self.loop.points[at]
                + (side + (offset - side) * blend)[:, None] * self.loop.left[at],
            )
            for offset in np.linspace(-SIDEWAYS, SIDEWAYS, FAN)
        ]

    def drive(self, outcome: ClientAnswer, period: float) -> None:
        """Drive a period of the reply; brake without one."""
        reply = outcome.reply
        command = None if reply is None else reply.command
        if reply is None or command is None or command.stop:
            after = max(self.speed - OWN_BRAKES * period, 0.0)
        else:
            after = command.speed
        step = 0.5 * (self.speed + after) * period
        self.speed = after
        self.driven += step
        plan = (
            next((p for p in reply.plans if p.candidate == reply.chosen), None) if reply else None
        )
        if plan is None:
            self.x += step * np.cos(self.heading)
            self.y += step * np.sin(self.heading)
            return
        station, x, y = (plan.column(name) for name in ("station", "x", "y"))
        fine = np.arange(station[0], station[-1], 0.01)
        away = np.hypot(np.interp(fine, station, x) - self.x, np.interp(fine, station, y) - self.y)
        ahead = fine[np.argmin(away)] + step
        here = np.array([np.interp(ahead, station, x), np.interp(ahead, station, y)])
        there = [np.interp(ahead + 0.5, station, x), np.interp(ahead + 0.5, station, y)]
        (self.x, self.y), turn = here, np.array(there) - here
        if np.hypot(*turn) > 1e-3:
            self.heading = float(np.arctan2(turn[1], turn[0]))


@dataclass
class Drive:
    """Result of a drive: seconds of each reply, own stops, late cycles, and the states."""

    took: list[float] = field(default_factory=list)
    stops: int = 0
    late: int = 0
    track: list[tuple[float, float, float]] = field(default_factory=list)


def drive_around(
    robot: Robot, client: PlanClient, period: float, cycles: int, *, paced: bool = True
) -> Drive:
    """Request and drive a number of cycles of a period [s]; unpaced, as fast as replies come."""
    done = Drive()
    begun = time.monotonic()
    for cycle in range(cycles):
        if cycle % 5 == 0:
            client.put_map(robot.sees())
        pose = (float(robot.x), float(robot.y), robot.heading)
        outcome = client.plan(robot.speed, robot.candidates(), pose=pose, clear=SIGHT)
        done.took.append(outcome.seconds)
        done.stops += outcome.stop is not None
        robot.drive(outcome, period)
        done.track.append((float(robot.x), float(robot.y), robot.speed))
        if paced:
            wait = begun + (cycle + 1) * period - time.monotonic()
            done.late += wait < 0.0
            time.sleep(max(wait, 0.0))
    return done


def main() -> None:
    """Drive, then say how it went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447")
    parser.add_argument("--namespace", default="slopewise/robot")
    parser.add_argument("--rate", type=float, default=10.0, help="requests per second")
    parser.add_argument("--seconds", type=float, default=30.0)
    given = parser.parse_args()
    settings = ZenohSettings(mode="client", connect=(given.connect,))
    robot, period = Robot(hills(), Loop.ellipse()), 1.0 / given.rate
    with (
        zenoh.open(zenoh_config(settings)) as session,
        PlanClient(
            session,
            namespace=given.namespace,
            name="mock_navigation",
            timeout=0.9 * period,
            deceleration=OWN_BRAKES,
        ) as client,
    ):
        done = drive_around(robot, client, period, max(round(given.seconds * given.rate), 1))
    ms = 1e3 * np.percentile(done.took, [50, 99])
    laps, top = robot.driven / robot.loop.length, max(speed for *_, speed in done.track)
    print(
        f"{len(done.took)} requests, {done.stops} own stops, {done.late} cycles late; answers in "
        f"{ms[0]:.1f} ms (99 %: {ms[1]:.1f} ms); {robot.driven:.1f} m driven, "
        f"{laps:.1f} laps, at most {top:.2f} m/s"
    )


if __name__ == "__main__":
    main()
