"""The benchmark of given paths on a small sample, and its followers against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.scene import shipped
from benchmarks.paths.followers import follow_exactly, pursue
from benchmarks.paths.given_lines import KINDS, largest_distance
from benchmarks.paths.paths_benchmark import outcome, plane, planner, summary
from slopewise.models.candidate_path import CandidatePath

BETWEEN_POINTS = {"dubins": (33,), "u-turn": (72,), "spiral": (64,)}
"""Seeds of curves whose few points let who follows them turn more sharply than the smooth curve."""


@pytest.mark.parametrize("seeds", [(), pytest.param((0, 2, 11), marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", KINDS)
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
