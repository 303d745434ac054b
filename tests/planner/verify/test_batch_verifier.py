"""Verification of a batch equals that of single plans, candidate by candidate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.planner.path import PathBatch, batch
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch
from slopewise.planner.verify.judge import Violations, check, screen
from slopewise.planner.verify.track import track_of
from tests.world import generated
from tests.world.generated import between
from tests.world.ground import arc, ground_map, plane, straight
from tests.world.vehicles import model_of, tables_with


def verdicts(
    solved: TimeOptimalBatch, paths: PathBatch, speed_sq: np.ndarray, model: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Worst breaches (M, 8) of the batch's judge and of the single one."""
    profile, ground, bounds = solved.profile, solved.ground, solved.bounds
    together = screen(profile, ground, bounds, speed_sq, model, paths.speed_limit)
    single = [
        check(
            track_of(profile, ground, j, paths.speed_limit),
            np.ascontiguousarray(speed_sq[: paths.count[j], j]),
            float(bounds.clear_distance[j]),
            float(ground.distance_offset[j]),
            ground.motion,
            model,
        ).violation
        for j in range(len(paths.names))
    ]
    return together, np.array(single)


def assert_agree(together: np.ndarray, single: np.ndarray) -> None:
    """The same violations; amounts are those of the single verifier, which may find more load
    where nothing is near its limit for the batch."""
    assert together.shape == single.shape == (len(single), len(Violations._fields))
    assert np.array_equal(together.max(axis=1) > 0.0, single.max(axis=1) > 0.0)
    assert together == pytest.approx(single, abs=2e-6)


@settings(max_examples=40)
@given(
    generated.tables(),
    generated.effects(),
    generated.heights(),
    st.lists(between(-0.3, 0.3), min_size=1, max_size=4),
    between(3.0, 12.0),
    between(0.0, 3.0),
    st.sampled_from([0.8, 1.0, 1.0, 1.05, 1.5]),
)
def test_the_batch_is_verified_as_each_candidate_alone(
    tables: Any,
    effects: Any,
    height: Any,
    curvatures: list[float],
    clear: float,
    start: float,
    share: float,
) -> None:
    tables["effect"] = effects
    model = model_of(tables)
    fan = [
        arc(6.0 + i, k, name=f"{i}") if abs(k) > 1e-3 else straight(6.0 + i, name=f"{i}")
        for i, k in enumerate(curvatures)
    ]
    paths = batch(fan, 0.25)
    ground = ground_map(height, x=(-4.0, 16.0), y=(-14.0, 14.0))
    solved = time_optimal_batch(ground, paths, model, start_speed=start, clear=clear)
    assert_agree(*verdicts(solved, paths, share * solved.speed_sq, model))


SIDE = {"min_load": 0.5, "lateral_accel": 9.0}


@pytest.mark.parametrize(
    ("kind", "changes", "share"),
    [
        ("overrun", {"limits": {"decel": 6.0}}, 1.2),
        ("speed", {"limits": {"speed": 1.5}}, 1.2),
        ("lateral", {"limits": {"lateral_accel": 0.3}}, 1.2),
        ("wheel_speed", {"vehicle": {"max_wheel_speed": 2.0}}, 1.2),
        ("accel", {}, 1.2),
        ("decel", {}, 1.2),
        ("wheel_load", {"vehicle": {"cg_z": 1.1}, "limits": {"min_load": 0.15}}, 1.6),
        ("side_load", {"vehicle": {"track_width": 0.4}, "limits": SIDE}, 6.0),
    ],
)
def test_each_kind_of_breach_is_found_in_the_right_candidate(
    kind: str, changes: dict[str, Any], share: float
) -> None:
    model = model_of(tables_with(**changes))
    paths = batch([arc(12.0, 0.15, name="first"), arc(15.0, 0.15, name="second")], 0.25)
    solved = time_optimal_batch(plane(y=(-14.0, 14.0)), paths, model, clear=10.0)
    speed_sq = solved.speed_sq * np.array([1.0, share])
    together, single = verdicts(solved, paths, speed_sq, model)
    assert_agree(together, single)
    assert together[0].max() == 0.0
    assert together[1, Violations._fields.index(kind)] > 0.0
