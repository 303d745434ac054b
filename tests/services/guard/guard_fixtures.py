"""Model, maps and messages that tests of the guard share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand, VehicleMotion
from slopewise.services.guard.guard_model import read_guard_model
from slopewise.services.guard.settings import GuardJudgement, GuardSettings, GuardTiming
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.io.model_file import find_model
from slopewise.services.wire.lateness import WallClock
from slopewise.services.wire.parameter_messages import ParameterGroup
from slopewise.services.wire.plan_messages import MapUpdate

ATV = find_model("atv")
MODEL = read_guard_model(ATV)
CELL = 0.25
WALL_TIME = 1.7e9


def map_of(heights: np.ndarray, x: float = -20.0, y: float = -25.0) -> ElevationMap:
    """Ground whose first cell is at x, y [m]."""
    return ElevationMap(elevation=heights, resolution=CELL, origin=(x, y))


FLAT = map_of(np.zeros((200, 400)))


def ground_with(height: float, first: int | None = None, last: int | None = None) -> ElevationMap:
    """Level ground with another height in some columns; column 80 is at x = 0."""
    heights = np.zeros((200, 400))
    heights[:, first:last] = height
    return map_of(heights)


def slope(grade: float) -> ElevationMap:
    """Ground that rises along x."""
    x = CELL * np.mgrid[0:200, 0:200][1]
    return map_of(np.tan(grade) * x, -10.0)


def hills(seed: int) -> ElevationMap:
    rng = np.random.default_rng(seed)
    y, x = CELL * np.mgrid[0:240, 0:240]
    z = np.zeros_like(x)
    for _ in range(6):
        kx, ky, phase = rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25), rng.uniform(0, 7)
        z += rng.uniform(0.1, 0.6) * np.sin(kx * x + ky * y + phase)
    return map_of(z, 0.0, 0.0)


def motion(speed: float, x: float = 0.0) -> VehicleMotion:
    return VehicleMotion(Pose2d(x, 0.0, 0.0), speed)


def guard(
    now: list[float] | None = None,
    known: ElevationMap | None = FLAT,
    wall_time: Callable[[float], float] = lambda now: WALL_TIME + now,
    **changes: Any,
) -> Guard:
    """A guard; keys of its timing and judgement by name, ``now`` a clock to set."""
    strictness = {k: changes.pop(k) for k in list(changes) if k in GuardJudgement.__slots__}
    settings = GuardSettings(
        model="atv", timing=GuardTiming(**changes), judgement=GuardJudgement(**strictness)
    )
    clock = None if now is None else WallClock(lambda: wall_time(now[0]), lambda: now[0])
    return Guard(settings, MODEL, known, clock)


def feed(
    it: Guard,
    now: float,
    speed: float = 1.0,
    requested: float = 1.0,
    number: int = 0,
    stamp: float | None = None,
) -> None:
    """Odometry and a command, both new."""
    sequence = number or round(1000 * now)
    # A pose that does not change in any digit is that of a localisation that fails.
    it.move(motion(speed, 1e-6 * sequence), now, "r", sequence, stamp)
    it.commands.take((BaseCommand(requested, 0.0), sequence), now, "p", sequence, stamp)


def parameter_group(name: str, **values: float) -> ParameterGroup:
    return ParameterGroup(
        group=name,
        version=2,
        valid=True,
        age=0.0,
        fingerprint="f",
        cause="c",
        who="w",
        values=values,
    )


def braking_group(**values: float) -> ParameterGroup:
    braking = {"m_m": -0.03, "b_m": -0.35, "m_b": 0.015, "b_b": 0.40}
    return parameter_group("braking", **braking | values)


def map_update(sequence: int = 1, **changes: Any) -> MapUpdate:
    """A whole map of 40 x 40 cells, or a patch of 2 x 2, at one height."""
    shape = (2, 2) if changes.get("patch") else (40, 40)
    fields: dict[str, Any] = {
        "source": "mapper",
        "sequence": sequence,
        "elevation": np.full(shape, changes.pop("height", 0.0)),
        "resolution": CELL,
        "origin": (0.0, 0.0),
    }
    return MapUpdate(**(fields | changes))
