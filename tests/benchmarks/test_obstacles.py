"""Obstacles and given lines: what is passed, blocked and followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.scene import shipped
from benchmarks.obstacles import obstacle_benchmark
from benchmarks.obstacles.cases import Block, ObstacleCase, Slope, cases, map_of, path_of, size_of
from benchmarks.obstacles.obstacle_benchmark import PlannedOutcome, must_block, must_pass, outcomes
from benchmarks.paths.followers import follow_exactly, pursue
from benchmarks.paths.given_lines import KINDS, largest_distance
from benchmarks.paths.paths_benchmark import outcome, plane, planner, summary
from slopewise.models.candidate_path import CandidatePath
from slopewise.services.io.model_file import read_model, shipped_models

MODELS = {name: read_model(shipped_models()[name]) for name in ("atv", "husky")}
CASES = 64
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


BETWEEN_POINTS = {"dubins": (33,), "u-turn": (72,)}
"""Seeds of curves whose few points let who follows them turn more sharply than the smooth curve."""


@pytest.mark.parametrize(
    ("kind", "seeds"),
    [
        *((kind, ()) for kind in KINDS if kind != "spiral"),
        *(pytest.param(kind, (0, 2, 11, 64), marks=pytest.mark.nightly) for kind in KINDS),
    ],
)
def test_paths_of_all_kinds_are_planned_reported_and_driven_within_limits(
    kind: str, seeds: tuple[int, ...]
) -> None:
    seeds = seeds or BETWEEN_POINTS.get(kind, (0,))
    outcomes = [outcome(kind, seed) for seed in seeds]
    row = summary(kind, outcomes)
    assert row["planned"] == len(seeds)
    assert row["untold"] == row["exact: beyond"] == row["pursuit: beyond"] == row["touched"] == 0
    assert all(o.speed > 0.1 for o in outcomes)


def test_followers_feel_a_circle_that_is_driven_too_fast() -> None:
    angle = np.arange(0.0, 3.0, 0.01)
    circle = 5.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    model = shipped("atv")
    plan = planner("atv").plan(plane(0.0, 0.0, 0.5, circle), [CandidatePath("c", circle)])[0]
    slope = np.zeros(2)
    assert follow_exactly(circle, plan, model, slope).lateral == pytest.approx(1.0, abs=0.03)
    fast = replace(plan, speed=1.5 * plan.speed)
    drive = follow_exactly(circle, fast, model, slope)
    assert drive.lateral == pytest.approx(1.5**2, rel=0.03)
    assert drive.beyond(counts_lateral=True)
    # On the side, a part of the load that the height of the centre of gravity moves.
    vehicle, turning = model.vehicle, 1.5**2 * model.limits.lateral_accel
    lost = turning / 9.81 * vehicle.cg_z / (0.5 * vehicle.track_width)
    assert drive.rollover == pytest.approx(lost / (1.0 - model.limits.min_load), rel=0.03)
    pursuit = pursue(circle, fast, model, slope, np.random.default_rng(1))
    assert pursuit.lateral == pytest.approx(1.5**2, rel=0.25)
    stop = replace(plan, stop_distance=plan.stop_distance + 20.0)
    assert follow_exactly(circle, stop, model, slope).stopping > 1.05


def test_distances_of_lines_are_measured_either_way_round() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    assert largest_distance(line, line + np.array([0.0, 0.2])) == pytest.approx(0.2)
    detour = np.array([[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]])
    assert largest_distance(line, detour) == largest_distance(detour, line)
    assert largest_distance(line, detour) == pytest.approx(1.0, abs=0.005)
