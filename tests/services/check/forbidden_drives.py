"""Drives that a closed form forbids, as any planner could write them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tests.services.check.drives import at, ground, model_with, round_turn, slope, trapezoid
from tests.services.check.sound_plans import Base


def straight(top: float, surface: Any = None, clear: float = np.inf, **options: Any) -> Base:
    """Along x from the origin with the quad, on cells of 5 cm or 20 cm."""
    fine = {"resolution": options.pop("resolution", 0.2)}
    shape = {k: options.pop(k) for k in ("accel", "decel", "begin", "spacing") if k in options}
    s, v = trapezoid(top, length=12.0, stop_at=options.pop("stop_at", 11.0), **shape)
    columns = {"x": s, "y": np.zeros_like(s), "speed": v, **options}
    return Base(columns, model_with(), ground(surface, size=16.0, **fine), clear)


def turning(top: float, radius: float, spacing: float = 0.1) -> Base:
    s, v = trapezoid(top, length=12.0, stop_at=11.5, spacing=spacing)
    plan = round_turn(s, v, radius)
    return Base({"x": plan.x, "y": plan.y, "speed": v}, model_with(), ground(size=16.0))


def corner(spacing: float) -> Base:
    """A right angle between straight stretches, rows far apart."""
    s = np.arange(0.0, 2.0 * spacing + 1e-9, spacing)
    x, y = np.minimum(s, spacing), np.maximum(s - spacing, 0.0)
    columns = {"x": x, "y": y, "speed": np.array([1.0, 1.0, 0.0])}
    return Base(columns, model_with(), ground(size=30.0))


def bank_in_band(slope: float) -> Base:
    """Level ground under the wheels, and a bank that they reach within the band alone."""
    base = straight(1.0, lambda x, y: slope * np.maximum(y - 0.62, 0.0) + 0.0 * x, resolution=0.05)
    tracking, braking = {"cross_track_std": 0.1}, {"roll_range": (-0.05, 0.05)}
    return replace(base, model=model_with(tracking=tracking, braking=braking))


def wall(height: float) -> Any:
    return at(lambda x, _: np.abs(x - 6.0) < 0.3, height)


FORBIDDEN: dict[str, Callable[[], Base]] = {
    "over a wall": lambda: straight(1.0, wall(0.5), resolution=0.05),
    "through a ditch": lambda: straight(1.0, wall(-0.5), resolution=0.05),
    "off a cliff": lambda: straight(1.0, at(lambda x, _: x > 6.0, -2.0), resolution=0.05),
    "over unknown cells": lambda: straight(1.0, wall(np.nan)),
    "stops in unknown cells": lambda: straight(3.0, at(lambda x, _: x > 11.5, np.nan)),
    "a wheel over a hole": lambda: straight(
        1.0,
        at(lambda x, y: (np.abs(x - 6.0) < 0.4) & (np.abs(y - 0.5) < 0.2), -0.3),
        resolution=0.05,
    ),
    "its wheels along a drop": lambda: straight(
        1.0, at(lambda x, y: y > 0.52, -0.15), resolution=0.05, y=np.full(121, 0.025)
    ),
    "its wheels off a drop over metres": lambda: straight(
        1.0, at(lambda x, y: y < 0.02 * (x - 6.0) - 0.5, -0.15), resolution=0.05
    ),
    "side slopes next to the line": lambda: bank_in_band(0.5),
    "a rock below": lambda: straight(
        1.0, at(lambda x, y: np.hypot(x - 6.0, y) < 0.25, 0.4), resolution=0.05
    ),
    "a rock next to": lambda: straight(
        1.0, at(lambda x, y: (np.abs(x - 6.0) < 0.2) & (y > 0.57), 0.5), resolution=0.05
    ),
    "off the map": lambda: straight(1.0, stop_at=40.0),
    "steeper than trained": lambda: straight(1.0, slope(0.32), accel=0.3),
    "steeper downhill than trained": lambda: straight(1.0, slope(-0.32), accel=0.3),
    "more roll than trained": lambda: straight(1.0, slope(0.0, 0.32)),
    "above the speed limit": lambda: straight(4.5, accel=2.0),
    "degraded above the speed limit": lambda: straight(4.5, begin=4.5, status=["degraded"] * 121),
    "degraded at full speed": lambda: straight(
        6.0, begin=5.0, decel=0.2, status=["degraded"] * 121, stop_at=60.0
    ),
    "speeds up too much": lambda: straight(2.0, accel=1.4),
    "brakes too much": lambda: straight(2.0, decel=2.5),
    "brakes that there are not": lambda: straight(3.0, slope(-0.2), decel=6.0),
    "beyond the clear path": lambda: straight(3.0, clear=11.0),
    "beyond its clear distance": lambda: straight(3.0, clear_distance=np.full(121, 10.0)),
    "above the limit of the path": lambda: straight(2.0, speed_limit=np.full(121, 1.5)),
    "a fast turn": lambda: turning(3.4, 4.0),
    "a turn with sparse rows": lambda: turning(1.0, 4.0, 3.0),
    "a corner between rows 20 m apart": lambda: corner(9.0),
    "a corner between rows 4 m apart": lambda: corner(4.0),
    "rows 4 m apart": lambda: straight(1.0, spacing=4.0),
    "ok, stops half way": lambda: straight(1.0, stop_at=4.0, status=["ok"] * 121),
    "infeasible, braking": lambda: straight(3.0, begin=3.0, status=["infeasible"] * 121),
    "infeasible, at rest": lambda: Base(
        {"x": [1.0], "y": [1.0], "speed": [0.0], "status": ["infeasible"]}, model_with(), ground()
    ),
}
