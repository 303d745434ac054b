"""A navigation stack that is none: asks a running service all the time, and drives what it says.

In one terminal ``slopewise serve --config configs/service.toml`` (with ``[page] enabled = true``
there is something to look at), in another ``python examples/mock_navigation.py --seconds 60``.

The robot is a point that follows its plan perfectly over generated hills. It sees the ground around
it only, and sends what it sees as patches of the map. Of slopewise it knows the client and its
messages alone, like a stack that copied those files.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass, field

import numpy as np
import zenoh

from services.client import ClientAnswer
from services.settings.service import ZenohSettings
from services.settings.session import zenoh_config
from services.wire.messages import MapUpdate, Path
from slopewise import PlanClient

CELL, ROWS, COLUMNS = 0.25, 240, 480
SIGHT = 18.0  # [m] how far the robot sees
LENGTH, FAN = 25.0, 11  # [m] of candidates, and how many
SIDEWAYS = 2.5  # [m] between the outermost candidates and the middle one
OWN_BRAKES = 1.5  # [m/s²] that the stack's own stop counts on


def hills() -> np.ndarray:
    """Heights of the whole ground (rows, columns) [m]; the robot does not know them."""
    x, y = np.meshgrid(CELL * np.arange(COLUMNS), CELL * np.arange(ROWS))
    return 1.2 * np.sin(x / 9.0) + 0.9 * np.cos(y / 8.0) + 0.4 * np.sin((x + y) / 5.0)


@dataclass
class Robot:
    """Pose [m, m, rad], speed [m/s] and what was seen."""

    ground: np.ndarray
    x: float = 12.0
    y: float = 30.0
    heading: float = 0.0
    speed: float = 0.0
    way: float = 0.0
    sequence: int = 0
    source: str = field(default_factory=lambda: f"mock-{os.getpid()}-{time.time_ns()}")

    def __post_init__(self) -> None:
        self.known = np.full(self.ground.shape, np.nan)

    def sees(self) -> MapUpdate:
        """The first time the whole map, unknown but for what is in sight; then a patch around."""
        rows, columns = np.indices(self.ground.shape)
        away = np.hypot(CELL * columns - self.x, CELL * rows - self.y)
        cells = np.nonzero(away <= SIGHT)
        whole = self.sequence == 0
        cut = np.s_[:, :] if whole else np.s_[
            cells[0].min() : cells[0].max() + 1, cells[1].min() : cells[1].max() + 1
        ]  # fmt: skip
        first = (0, 0) if whole else (int(cells[1].min()), int(cells[0].min()))
        self.known[cells] = self.ground[cells]
        self.sequence += 1
        return MapUpdate(
            source=self.source, sequence=self.sequence, elevation=self.known[cut], resolution=CELL,
            origin=(CELL * first[0], CELL * first[1]), patch=not whole,
        )  # fmt: skip

    def candidates(self) -> list[Path]:
        """Ways ahead that leave the robot's heading gently to either side."""
        along = np.linspace(0.0, LENGTH, 80)
        blend = np.clip(along / 12.0, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(along / 12.0, 0.0, 1.0))
        turn = np.array([np.cos(self.heading), np.sin(self.heading)])
        left = np.array([-turn[1], turn[0]])
        here = np.array([self.x, self.y])
        return [
            Path(
                name=f"{side:+.1f} m",
                points=here + np.outer(along, turn) + np.outer(side * blend, left),
            )
            for side in np.linspace(-SIDEWAYS, SIDEWAYS, FAN)
        ]

    def drive(self, outcome: ClientAnswer, period: float) -> None:
        """A period of what was said; brakes by itself where nothing was."""
        reply = outcome.reply
        command = None if reply is None else reply.command
        if reply is None or command is None or command.stop:
            after = max(self.speed - OWN_BRAKES * period, 0.0)
        else:
            after = command.speed
        step = 0.5 * (self.speed + after) * period
        self.speed = after
        self.way += step
        plan = (
            next((p for p in reply.plans if p.candidate == reply.chosen), None) if reply else None
        )
        if plan is None:
            self.x += step * np.cos(self.heading)
            self.y += step * np.sin(self.heading)
            return
        station, x, y = (plan.column(name) for name in ("station", "x", "y"))
        near = station[np.argmin(np.hypot(x - self.x, y - self.y))]
        ahead = near + step
        here = np.array([np.interp(ahead, station, x), np.interp(ahead, station, y)])
        there = [np.interp(ahead + 0.5, station, x), np.interp(ahead + 0.5, station, y)]
        (self.x, self.y), turn = here, np.array(there) - here
        if np.hypot(*turn) > 1e-3:
            self.heading = float(np.arctan2(turn[1], turn[0]))


def main() -> None:
    """Drive, then say how it went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447")
    parser.add_argument("--namespace", default="slopewise/robot")
    parser.add_argument("--rate", type=float, default=10.0, help="questions a second")
    parser.add_argument("--seconds", type=float, default=30.0)
    given = parser.parse_args()
    settings = ZenohSettings(mode="client", connect=(given.connect,))
    robot, period = Robot(hills()), 1.0 / given.rate
    took: list[float] = []
    stops = late = 0
    top = 0.0
    with (
        zenoh.open(zenoh_config(settings)) as session,
        PlanClient(
            session, namespace=given.namespace, name="mock_navigation", timeout=0.9 * period,
            deceleration=OWN_BRAKES,
        ) as client,
    ):  # fmt: skip
        begun = time.monotonic()
        cycle = 0
        while time.monotonic() - begun < given.seconds:
            if cycle % 5 == 0:
                client.put_map(robot.sees())
            pose = (float(robot.x), float(robot.y), robot.heading)
            outcome = client.plan(robot.speed, robot.candidates(), pose=pose, clear=SIGHT)
            took.append(outcome.seconds)
            stops += outcome.stop is not None
            robot.drive(outcome, period)
            top = max(top, robot.speed)
            cycle += 1
            wait = begun + cycle * period - time.monotonic()
            late += wait < 0.0
            time.sleep(max(wait, 0.0))
    ms = 1e3 * np.percentile(took, [50, 99])
    print(
        f"{len(took)} questions, {stops} own stops, {late} cycles late; answers in {ms[0]:.1f} ms "
        f"(99 %: {ms[1]:.1f} ms); {robot.way:.1f} m driven, at most {top:.2f} m/s"
    )


if __name__ == "__main__":
    main()
