"""Plans of a planner that is wrong in one place, on real ground, for the checker to find.

Whether a mutant is unsafe is decided without the checker: it counts if the verifier of the planner,
with the honest model, finds its speeds wrong on the stations and slopes of the honest plan of the
same path. One whose mistake makes it slower, or that keeps within the bounds, is safe; so is one
that stops on slopes less than a tenth beyond the trained range, where checkers may disagree. Of the
mutants the checker gets positions, speeds and the clear distance, nothing else.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline import time_optimal_batch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.verify.terms import terms_of
from slopewise.planner.verify.verifier import check as verify
from slopewise.planner.verify.verifier import track_of
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.io.model_file import read_model, shipped_models
from tests.planner.test_real_terrain import PLACES, candidates, ground_of

FASTER = 1.05
UNSAFE = {
    "overrun": 0.03,
    "axle_load": 0.03,
    "side_load": 0.03,
    "lateral": 0.1,
    "speed": 0.02,
    "wheel_speed": 0.02,
    "decel": 0.1,
    "accel": 0.1,
}
"""Violations from which a mutant is unsafe, in m, shares, m/s² and m/s."""

STEEP = 0.1
"""Share by which slopes are beyond the trained ones where the path ends for certain."""


@dataclass(frozen=True)
class Question:
    """One path on one map, as planners are asked and the checker is."""

    place: str
    model: Model
    ground: ElevationMap
    path: CandidatePath
    clear: float

    def plan(self) -> SpeedPlan:
        planner = CandidatePlanner(self.model)
        (plan,) = planner.plan(self.ground, [self.path], clear=self.clear)
        return plan


@cache
def model_of(vehicle: str) -> Model:
    """A shipped vehicle that may change its speed quickly, so that bounds decide how fast it is."""
    model = read_model(shipped_models()[vehicle])
    return dataclasses.replace(
        model, limits=dataclasses.replace(model.limits, accel=3.0, decel=8.0, jerk=20.0)
    )


def questions(place: str, vehicle: str, data: Path, seed: int) -> Iterator[Question]:
    """Every other one into a path that is known to be free for a part only."""
    ground = ground_of(place, data)
    for i, path in enumerate(candidates(place, ground, seed)):
        clear = PLACES[place].lengths[0] / 2.0 if i % 2 else np.inf
        yield Question(place, model_of(vehicle), ground, path, clear)


def stripped(plan: SpeedPlan, name: str) -> ExternalPlan:
    """The columns that the checker gets."""
    return ExternalPlan(name=name, x=plan.x, y=plan.y, speed=plan.speed)


def faster(question: Question) -> SpeedPlan:
    """The honest plan, driven 5 % faster."""
    plan = question.plan()
    return dataclasses.replace(plan, speed=FASTER * plan.speed)


def grade_flipped(question: Question) -> SpeedPlan:
    """Uphill and downhill confused inside the planner."""
    honest = time_optimal_batch.terrain_profile

    def flipped(*arguments: Any) -> Any:
        profile = honest(*arguments)
        return dataclasses.replace(profile, grade=-profile.grade, sin_grade=-profile.sin_grade)

    with _instead(time_optimal_batch, "terrain_profile", flipped):
        return question.plan()


def shifted(question: Question) -> SpeedPlan:
    """The map taken to lie a cell further along x."""
    ground = question.ground
    x, y = ground.origin
    moved = dataclasses.replace(ground, origin=(x + ground.resolution, y))
    return dataclasses.replace(question, ground=moved).plan()


def stronger(question: Question) -> SpeedPlan:
    """PathForce taken to be a tenth stronger than they are."""
    braking = question.model.braking
    names = ("m_m", "b_m", "m_b", "b_b")
    more = {name: 1.1 * getattr(braking, name) for name in names}
    tables = {
        surface: dataclasses.replace(
            table, **{n: 1.1 * getattr(table, n) for n in names if getattr(table, n) is not None}
        )
        for surface, table in braking.terrain.items()
    }
    braking = dataclasses.replace(braking, terrain=tables, **more)
    model = dataclasses.replace(question.model, braking=braking)
    return dataclasses.replace(question, model=model).plan()


MUTATIONS: dict[str, Callable[[Question], SpeedPlan]] = {
    "5 % faster": faster,
    "grade flipped": grade_flipped,
    "ground shifted by a cell": shifted,
    "brakes 10 % stronger": stronger,
}


def matters(mutant: SpeedPlan, honest: SpeedPlan, question: Question) -> bool:
    """Whether the verifier finds the mutant's speeds unsafe on the honest plan's ground."""
    n = len(honest.station)
    if len(mutant.station) != n or not np.allclose(mutant.x, honest.x):
        return False  # a stop between two stations moved one of them
    if not (mutant.speed > 1.01 * honest.speed).any():
        return False
    model = question.model
    spacing = PlannerSettings().spacing_on(question.ground.resolution, model.vehicle)
    part = batch([question.path], spacing)
    solved = time_optimal_batch.time_optimal_batch(question.ground, part, model)
    # With the whole of the force: the planner takes what crests leave of it at the highest speed.
    ground = solved.bounds.even_ground
    violation = verify(
        track_of(solved.profile, ground, 0, part.speed_limit),
        np.ascontiguousarray(mutant.speed**2),
        _reach(honest, question),
        float(ground.distance_offset[0]),
        terms_of(model, ground.motion, ground.errors)._replace(between=0),
    ).violation
    return any(amount > UNSAFE.get(kind, np.inf) for kind, amount in violation._asdict().items())


def _reach(honest: SpeedPlan, question: Question) -> float:
    """Station that stops must not pass, in clear cases: unknown, or a tenth too steep."""
    end = float(honest.station[-1])
    clear = min(question.clear - question.model.vehicle.shape.front, end)
    row = int(np.searchsorted(honest.station, honest.clear_distance - 1e-9))
    limiting = Limiting(int(honest.limiting[row]))
    if honest.clear_distance >= clear - 1e-6 or row + 1 >= len(honest.station):
        return clear
    if limiting is Limiting.UNKNOWN_TERRAIN:
        return float(honest.station[row + 1])
    braking = question.model.braking
    beyond = np.zeros_like(honest.station)
    for values, bounds in (
        (honest.grade, braking.grade_range),
        (honest.roll, braking.trained_roll),
    ):
        for sign, bound in zip((-1.0, 1.0), bounds, strict=True):
            beyond = np.maximum(beyond, sign * values / abs(bound) - 1.0)
    steep = np.flatnonzero(beyond > STEEP)
    return min(clear, float(honest.station[steep[0]])) if len(steep) else clear


@contextlib.contextmanager
def _instead(module: Any, name: str, value: object) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, name, value)
        yield
