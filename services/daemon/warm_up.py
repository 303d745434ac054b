"""Questions that make everything compile that later ones need.

Ground that is level, rough, hilly, unknown in part, of two surfaces, with a step in the way; brakes
as a file has them, calibrated, and learned on a separate surface; many paths and few, with a
name and without, at rest and driving, several times in a row as a robot asks.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects.registry import LAWS, MOTION_LAWS
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Effect
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.map_store import KnownGround
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.messages import Path as Candidate
from slopewise.services.wire.messages import PlanRequest

CLIENT = "warm-up"
"""Name of the client that asks; it is forgotten afterwards."""


def as_learned(parameters: ActiveParameters) -> ActiveParameters:
    """The same with a surface of its own, as if a stop had taught one."""
    braking = parameters.model.braking
    tables = {**braking.terrain, "warm-up": SurfaceBraking(force_std=0.02, class_id=999_999)}
    model = replace(parameters.model, braking=replace(braking, terrain=tables))
    return replace(parameters, model=model, revision=-1 - parameters.revision)


def as_calibrated(parameters: ActiveParameters) -> ActiveParameters:
    """The same with a highest speed driven on each grade and an effect, as logs yield them."""
    braking, effect = parameters.model.braking, parameters.model.effect
    hull = tuple((grade, braking.speed_range[1]) for grade in braking.grade_range)
    braking = replace(braking, speed_by_grade=braking.speed_by_grade or hull)
    law = MOTION_LAWS[0]
    some = Effect(name=law, parameters=dict.fromkeys(LAWS[law].parameters, 0.01))
    model = replace(parameters.model, braking=braking, effect=effect or (some,))
    return replace(parameters, model=model, revision=-1_000_000 - parameters.revision)


def questions() -> Iterator[tuple[KnownGround, PlanRequest]]:
    """Grounds and questions, in order."""
    for ground in _grounds():
        known = KnownGround(ground, 0, time.monotonic())
        for count in (1, 5):
            paths = _fan(count)
            yield known, PlanRequest(speed=0.0, paths=paths)
            yield known, PlanRequest(speed=1.0, paths=paths, clear=15.0)
        for x in (0.0, 0.1, 0.2):
            pose = (x, 0.0, 0.0)
            yield known, PlanRequest(speed=5.0 * x, paths=_fan(5), client=CLIENT, pose=pose)


def run(plans: PlanService) -> None:
    """Plan all of them, so that no question waits for a compiler."""
    known = plans.parameters
    # What stops teach makes surfaces of their own: planned with other kernels than one alone.
    calibrated = as_calibrated(known)
    for parameters in (as_learned(calibrated), calibrated, known):
        plans.learn(parameters)
        for ground, request in questions():
            codec.encode(plans.answer(request, ground, CLIENT), Format.MESSAGEPACK)
    plans.drop(CLIENT)


def _fan(count: int) -> list[Candidate]:
    along = np.linspace(0.0, 20.0, 80)
    bends = 0.004 * np.arange(count)
    return [
        Candidate(name=f"warm-up {i}", points=np.stack([along, bend * along**2], axis=1))
        for i, bend in enumerate(bends)
    ]


def _grounds() -> Iterator[ElevationMap]:
    rows, columns = 49, 193
    level = np.zeros((rows, columns))
    rough = 0.05 * np.random.default_rng(1).standard_normal((rows, columns))
    unknown = level.copy()
    unknown[:, 140:] = np.nan
    x, y = np.meshgrid(0.25 * np.arange(columns), 0.25 * np.arange(rows))
    hills = 1.5 * np.sin((x + 20.0) / 9.0) + 0.9 * np.cos(y / 8.0)
    step = level.copy()
    step[:, 120:] = 0.6
    yield _ground(level)
    yield _ground(rough)
    yield _ground(hills)
    yield _ground(unknown)
    yield _ground(step)
    classes = np.zeros((rows, columns), np.int64)
    classes[:, 60:] = 1
    yield ElevationMap(
        elevation=0.1 * np.linspace(0.0, 48.0, columns)[None, :] + level,
        resolution=0.25,
        origin=(-3.0, -6.0),
        terrain_class=classes,
        class_names=("", "warm-up"),
        height_std=0.02,
    )


def _ground(elevation: Floats) -> ElevationMap:
    return ElevationMap(elevation=elevation, resolution=0.25, origin=(-3.0, -6.0), height_std=0.02)
