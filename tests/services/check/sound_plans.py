"""Sound plans of three vehicles: of our planner, with other settings, resumed, and plain ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Model
from slopewise.models.steering import Steering
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.model_file import read_model, shipped_models
from slopewise.services.io.plan_file import driven
from slopewise.services.jobs.demo import hillside
from tests.services.check.drives import ground, trapezoid

Columns = dict[str, Any]
Mutation = Callable[[Columns, np.random.Generator], Columns | None]
SPACING = 0.25  # [m] of the plans' rows
_ARCS = ((-3.0, -0.2, 3.0), (3.0, 0.2, 6.0))  # course [rad], curvature [1/m], length [m]


@dataclass(frozen=True)
class Base:
    """A sound plan of one vehicle on one ground."""

    columns: Columns
    model: Model
    heights: ElevationMap
    clear: float = np.inf
    quantile: float = 0.999


def hills(seed: int, size: float = 40.0, resolution: float = 0.25) -> ElevationMap:
    """Ground of a few long waves, within the trained grades."""
    rng = np.random.default_rng(seed)
    along = resolution * np.arange(int(size / resolution))
    x, y = np.meshgrid(along, along)
    z = np.zeros_like(x)
    for _ in range(3):
        length, course = rng.uniform(14.0, 30.0), rng.uniform(0.0, np.pi)
        phase = 2.0 * np.pi * (x * np.cos(course) + y * np.sin(course)) / length
        z += 0.09 * length / (2.0 * np.pi) * np.sin(phase + rng.uniform(0.0, 2.0 * np.pi))
    return ElevationMap(elevation=z, resolution=resolution, origin=(0.0, 0.0))


def arc(name: str, start: tuple[float, float], course: float, turn: float, length: float) -> Any:
    """A path of constant curvature [1/m]."""
    s = np.arange(0.0, length + 1e-9, 0.2)
    heading = course + turn * s
    steps = 0.2 * np.stack((np.cos(heading), np.sin(heading)), axis=1)[:-1]
    points = np.asarray(start) + np.concatenate(([(0.0, 0.0)], np.cumsum(steps, axis=0)))
    return CandidatePath(name, points)


@cache
def vehicle(name: str) -> Model:
    """A shipped vehicle; or the quad with steered wheels, tracking errors and latency."""
    model = read_model(shipped_models()["atv" if name == "car" else name])
    if name != "car":
        return model
    return replace(
        model,
        vehicle=replace(model.vehicle, drive="ackermann"),
        steering=Steering(kind="ackermann", max_rate=0.3),
        tracking=Tracking(
            cross_track_std=0.05,
            cross_track_per_curvature=0.1,
            heading_std=0.02,
            along_track_std=0.08,
            latency=0.1,
            latency_std=0.03,
        ),
    )


@cache
def bases() -> tuple[Base, ...]:
    """Turns and straight drives of three vehicles that end, or are blocked."""
    sound = []
    for name, seed, place, turn, length, options in (
        ("atv", 1, (12.0, 12.0), 0.12, 14.0, {"start_speed": 1.0}),
        ("husky", 2, (20.0, 12.0), -0.2, 7.0, {}),
        ("ugv", 3, (12.0, 20.0), 0.06, 16.0, {"start_speed": 2.0}),
        ("atv", 2, (14.0, 18.0), -0.1, 18.0, {"clear": 10.0}),
        ("husky", 0, (37.0, 31.0), 0.03, 10.0, {}),
    ):
        where = hills(seed) if seed else hillside()
        planner = CandidatePlanner(vehicle(name), None, Uncertainty())
        path = arc(f"{name} {seed}", place, 0.3 if seed else 0.0, turn, length)
        (plan,) = planner.plan(where, [path], **options)
        sound.append(Base(driven(plan), vehicle(name), where, options.get("clear", np.inf)))
    return tuple(sound)


def clean_plans() -> list[tuple[str, Base]]:
    """Short plans of our planner, with other settings, resumed, and a trapezoid."""
    rng, out = np.random.default_rng(8), []
    for name, seed in (("atv", 1), ("husky", 2), ("ugv", 3), ("atv", 0), ("car", 1)):
        model, where = vehicle(name), hills(seed) if seed else hillside()
        margins = Uncertainty()
        for kind, planner, quantile in (
            ("ours", CandidatePlanner(model, None, margins), margins.quantile),
            ("osqp", CandidatePlanner(model, PlannerSettings(solver="osqp")), 0.5),
            (
                "not smoothed",
                CandidatePlanner(model, PlannerSettings(smooth=False, spacing=0.4)),
                0.5,
            ),
        ):
            paths = [
                arc(f"{kind} {i}", tuple(rng.uniform(8.0, 30.0, 2)), *rng.uniform(*_ARCS))
                for i in range(6)
            ]
            starts: tuple[Any, ...] = ({}, {"start_speed": 0.8, "clear": 5.0})
            for half, options in zip((paths[::2], paths[1::2]), starts, strict=True):
                for plan in planner.plan(where, half, **options):
                    if plan.status.value in ("ok", "blocked"):
                        clear = options.get("clear", np.inf)
                        out.append((kind, Base(driven(plan), model, where, clear, quantile)))
        out += [("horizon", base) for base in resumed(model, where, rng)]
        out += [("trapezoid", base) for base in trapezoids(model, rng)]
    return out


def resumed(model: Model, where: ElevationMap, rng: np.random.Generator) -> list[Base]:
    """Plans of five cycles, each resumed on the one before."""
    sound, horizon = [], Horizon(model)
    path = arc("resumed", (10.0, 10.0), 0.7, float(rng.uniform(-0.1, 0.1)), 9.0)
    x, y, heading, speed = 10.0, 10.0, 0.7, 0.5
    for _ in range(5):
        answer = horizon.step(PlanarState(x=x, y=y, heading=heading, speed=speed), [path], where)
        plan = answer.plans[0]
        if plan.status.value in ("ok", "blocked"):
            sound.append(Base(driven(plan), model, where, quantile=0.5))
        k = min(3, len(plan.x) - 2)
        x, y, speed = float(plan.x[k]), float(plan.y[k]), float(plan.speed[k])
        heading = float(np.arctan2(plan.y[k + 1] - plan.y[k], plan.x[k + 1] - plan.x[k]))
    return sound


def trapezoids(model: Model, rng: np.random.Generator) -> list[Base]:
    """Plain plans on level ground, at a half of what the limits allow."""
    sound, limits = [], model.limits
    for _ in range(3):
        top, spacing = float(rng.uniform(0.3, 0.6)) * limits.speed, float(rng.uniform(0.1, 0.5))
        s, v = trapezoid(
            top,
            accel=0.5 * min(limits.accel, limits.decel),
            length=9.0,
            stop_at=6.0,
            spacing=spacing,
        )
        course = float(rng.uniform(-0.5, 0.5))
        columns = {"x": np.cos(course) * s, "y": np.sin(course) * s, "speed": v}
        sound.append(Base(columns, model, ground(size=16.0), quantile=0.5))
    return sound
