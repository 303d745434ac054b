"""Requests that load or compile all code that later requests need.

Terrain is level, rough, hilly, partly unknown, of two surfaces, or has a step on the path; brakes
are those of the model file, calibrated, or learned on a separate surface; many paths and few, named
clients and others, at rest and driving, several times in a row as from a robot.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from slopewise.models.effects.registry import LAWS, MOTION_LAWS
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Effect
from slopewise.models.steering import SteeringGeometry
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.body_pose import trailing_heading
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import Path as Candidate
from slopewise.services.wire.plan_messages import PlanRequest

CLIENT = "warm-up"  # name of the client, which is dropped afterwards


def as_learned(parameters: ActiveParameters) -> ActiveParameters:
    """The same with a separate surface, as learned from a stop."""
    braking = parameters.model.braking
    tables = {**braking.terrain, "warm-up": SurfaceBraking(force_std=0.02, class_id=999_999)}
    model = replace(parameters.model, braking=replace(braking, terrain=tables))
    return replace(parameters, model=model, revision=-1 - parameters.revision)


def as_calibrated(parameters: ActiveParameters) -> ActiveParameters:
    """The same with the highest speed driven on each grade and an effect, as from logs."""
    braking, effect = parameters.model.braking, parameters.model.effect
    hull = tuple((grade, braking.speed_range[1]) for grade in braking.grade_range)
    braking = replace(braking, speed_by_grade=braking.speed_by_grade or hull)
    law = MOTION_LAWS[0]
    example = Effect(name=law, parameters=dict.fromkeys(LAWS[law].parameters, 0.01))
    model = replace(parameters.model, braking=braking, effect=effect or (example,))
    return replace(parameters, model=model, revision=-1_000_000 - parameters.revision)


def requests(
    maps: Iterable[ElevationMap] | None = None,
) -> Iterator[tuple[MapSnapshot, PlanRequest]]:
    """Maps, all by default, and requests, in order."""
    for elevation_map in _maps() if maps is None else maps:
        snapshot = MapSnapshot(elevation_map, 0, time.monotonic())
        yield snapshot, PlanRequest(speed=0.0, paths=_fan(1))
        yield snapshot, PlanRequest(speed=1.0, paths=_fan(1), clear=15.0)
        for x in (0.0, 0.1):
            pose = (x, 0.0, 0.0)
            yield snapshot, PlanRequest(speed=5.0 * x, paths=_fan(5), client=CLIENT, pose=pose)


def run(plans: PlanService) -> None:
    """Answer all of them, so that no later request waits for a compiler."""
    initial = plans.parameters
    calibrated = as_calibrated(initial)
    level, *uneven, classes = _maps()
    # A learned surface is separate from the base, and planned with other kernels than one alone.
    for parameters, maps in (
        (as_learned(calibrated), (level, *uneven, classes)),
        (calibrated, (level, classes)),
        (initial, (level, classes)),
    ):
        plans.learn(parameters)
        for snapshot, request in requests(maps):
            codec.encode(plans.answer(request, snapshot, CLIENT), Format.MESSAGEPACK)
    plans.drop(CLIENT)
    # Vehicles with steered wheels only.
    way = np.linspace(0.0, 1.0, 3)[:, None]
    trailing_heading(way, np.zeros_like(way), SteeringGeometry(centre_offset=1.0))


def _fan(count: int) -> list[Candidate]:
    x = np.linspace(0.0, 20.0, 80)
    return [
        Candidate(name=f"warm-up {i}", points=np.stack([x, 0.004 * i * x**2], axis=1))
        for i in range(count)
    ]


def _maps() -> Iterator[ElevationMap]:
    rows, columns = 49, 193
    level = np.zeros((rows, columns))
    rough = 0.05 * np.random.default_rng(1).standard_normal((rows, columns))
    x, y = np.meshgrid(0.25 * np.arange(columns), 0.25 * np.arange(rows))
    hills = 1.5 * np.sin((x + 20.0) / 9.0) + 0.9 * np.cos(y / 8.0)
    unknown, step, classes = level.copy(), level.copy(), np.zeros((rows, columns), np.int64)
    unknown[:, 140:], step[:, 120:], classes[:, 60:] = np.nan, 0.6, 1
    grid: dict[str, Any] = {"resolution": 0.25, "origin": (-3.0, -6.0), "height_std": 0.02}
    for elevation in (level, rough, hills, unknown, step):
        yield ElevationMap(elevation=elevation, **grid)
    slope, names = 0.1 * np.linspace(0.0, 48.0, columns)[None, :] + level, ("", "warm-up")
    yield ElevationMap(elevation=slope, terrain_class=classes, class_names=names, **grid)
