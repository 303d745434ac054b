"""A share of the obstacle benchmark: no large obstacle is passed, few small ones are blocked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.obstacles import obstacle_benchmark
from benchmarks.obstacles.cases import Block, ObstacleCase, Slope, cases, map_of, path_of, size_of
from benchmarks.obstacles.obstacle_benchmark import PlannedOutcome, must_block, must_pass, outcomes
from slopewise.services.io.model_file import read_model, shipped_models

MODELS = {name: read_model(shipped_models()[name]) for name in ("atv", "husky")}
CASES = 128
QUAD = MODELS["atv"].vehicle


@pytest.fixture(scope="module")
def planned() -> list[PlannedOutcome]:
    return outcomes(cases(CASES, MODELS, seed=5), MODELS)


def test_no_large_obstacle_is_passed_and_few_small_ones_are_blocked(
    planned: list[PlannedOutcome],
) -> None:
    large = [o for o in planned if must_block(o.case)]
    assert len(large) > 0.2 * CASES
    assert not [o.case for o in large if not o.is_blocked]
    small = [o for o in planned if must_pass(o.case)]
    assert len(small) > 0.2 * CASES
    assert sum(o.is_blocked for o in small) <= 0.05 * len(small)
    result = obstacle_benchmark.summary(planned)
    assert result["all"]["cases"] == CASES
    assert sum(row["cases"] for row in result["kinds"].values()) == CASES


def test_oblique_ditch_that_lifts_single_wheels_is_blocked() -> None:
    model = MODELS["husky"]
    longer = replace(model.vehicle, max_step=0.0494, wheel_travel=0.0494)
    ditch = Block(0.0, 0.0, -0.45000373, 0.36717564, 60.0, -0.02844622)
    size = size_of(ditch, longer)
    assert size.step < 0.6
    assert size.articulation > obstacle_benchmark.TOO_LARGE
    case = ObstacleCase(
        "ditch", "husky", ditch, Slope(0.0, 0.0), 0.05, 2.20885169, 2014385351, size, size
    )
    (planned,) = outcomes([case], {"husky": replace(model, vehicle=longer)})
    assert planned.is_blocked


LIMIT, CLEAR = QUAD.shape.max_step, QUAD.shape.clearance


@pytest.mark.parametrize("height", [0.5 * LIMIT, -0.5 * LIMIT, 2.0 * LIMIT])
def test_a_long_step_has_its_height(height: float) -> None:
    size = size_of(Block(60.0, 0.0, 0.0, 60.0, 60.0, height), QUAD)
    assert size.step == pytest.approx(abs(height) / LIMIT, rel=1e-3)
    assert size.articulation == pytest.approx(0.0, abs=1e-9)


def test_a_wheel_sinks_into_a_narrow_gap_by_the_height_of_its_arc() -> None:
    size = size_of(Block(0.0, 0.0, 0.0, 0.1, 60.0, -1.0), QUAD)
    sinks = QUAD.wheel_radius - np.sqrt(QUAD.wheel_radius**2 - 0.1**2)
    assert size.step == pytest.approx(sinks / LIMIT, rel=0.05)


def test_between_the_wheels_the_clearance_applies() -> None:
    size = size_of(Block(0.0, 0.0, 0.0, 0.2, 0.2, 1.5 * CLEAR), QUAD)
    assert (size.step, size.underside) == (0.0, pytest.approx(1.5))


def test_at_the_side_the_distance_applies() -> None:
    half = 0.5 * QUAD.shape.width
    size = size_of(Block(0.0, 2.0 * half + 0.1, 0.0, 0.3, 0.1, 1.0), QUAD)
    assert (size.step, size.lateral) == (0.0, pytest.approx(0.5))
    assert size_of(Block(0.0, 2.0, 0.0, 0.3, 0.1, 0.1), QUAD).largest == 0.0


def test_one_wheel_on_a_rock_articulates_by_its_height() -> None:
    size = size_of(Block(0.0, 0.5, 0.0, 0.3, 0.2, 0.8 * LIMIT), QUAD)
    assert size.articulation == pytest.approx(0.8, rel=1e-3)


def test_a_map_shows_the_case_along_its_path() -> None:
    (case,) = cases(1, MODELS, seed=2)
    vehicle = MODELS[case.vehicle].vehicle
    ground, path = map_of(case, vehicle), path_of(case, vehicle)
    assert ground.contains(*path.points.T).all()
    assert ground.resolution == case.resolution
    bare = map_of(replace(case, block=replace(case.block, height=0.0)), vehicle)
    largest = np.abs(ground.elevation - bare.elevation).max()
    assert largest == pytest.approx(abs(case.block.height), rel=0.05)
