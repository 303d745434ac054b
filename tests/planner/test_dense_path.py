"""Dense and noisy polylines, as a robot's planner samples them or a drive records them."""

from __future__ import annotations

import time

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.followed_line import line_limits
from slopewise.planner.path import resample
from slopewise.planner.raw_polyline import clean, noise
from tests.planner.test_path import LIMIT, circle, path_of, planned
from tests.world.vehicles import ATV, model_of

NOISE = 0.01
"""Of the points [m]."""


def sine(count: int, length: float = 50.0) -> np.ndarray:
    """Bends that the highest speed just allows: (count, 2) points."""
    x = np.linspace(0.0, length, count)
    return np.stack([x, 2.0 * np.sin(0.2 * x)], axis=1)


def recorded(count: int, seed: int, *, sideways_only: bool) -> np.ndarray:
    """The same with noise, along no axis but y or in both."""
    errors = NOISE * np.random.default_rng(seed).standard_normal((count, 2))
    if sideways_only:
        errors[:, 0] = 0.0
    return sine(count) + errors


@pytest.mark.parametrize("sideways_only", [False, True])
@pytest.mark.parametrize("count", [2_000, 10_000, 50_000])
def test_a_dense_noisy_path_is_driven_like_the_clean_one(count: int, sideways_only: bool) -> None:
    plan, clean_plan = planned(recorded(count, 1, sideways_only=sideways_only)), planned(sine(250))
    assert plan.travel_time <= clean_plan.travel_time / 0.93
    assert plan.path_deviation.largest <= LIMIT
    # The points themselves are up to four standard deviations from any line.
    assert 2.0 * NOISE <= plan.path_deviation.largest <= 6.0 * NOISE


@pytest.mark.parametrize("noisy", [0.0, NOISE])
def test_the_time_for_a_path_grows_no_faster_than_its_points(noisy: float) -> None:
    limits, seconds = line_limits(model_of(ATV)), []
    for count in (5_000, 50_000):
        points = sine(count) + noisy * np.random.default_rng(2).standard_normal((count, 2))
        path, taken = CandidatePath("dense", points), []
        for _ in range(3):
            start = time.process_time()
            resample(path, 0.25, limits)
            taken.append(time.process_time() - start)
        seconds.append(min(taken))
    # A spline through all points took 50 times as long for 10 times as many.
    assert seconds[1] <= 20.0 * seconds[0]


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 4.0, np.pi / 2.0])
def test_noise_to_one_side_is_noise_whatever_the_heading(angle: float) -> None:
    points = np.stack([0.1 * np.arange(200.0), np.zeros(200)], axis=1)
    points[:, 1] += NOISE * np.random.default_rng(3).standard_normal(200)
    turned = points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert noise(turned) == pytest.approx(NOISE, rel=0.15)


def test_averaged_points_keep_ends_limits_and_the_curve() -> None:
    points = circle(5.0, 0.002, 2.0)
    limit = np.where(np.arange(len(points)) == 1234, 0.5, 3.0)
    cleaned, lowest, given, ends = clean(points, limit, None, 0.05)
    assert len(cleaned) < 0.1 * len(points)
    np.testing.assert_array_equal(cleaned[[0, -1]], points[[0, -1]])
    np.testing.assert_array_equal(given, points)
    assert not ends
    assert np.abs(np.hypot(*cleaned.T) - 5.0).max() < 1e-4
    nearest = np.argmin(np.hypot(*(cleaned - points[1234]).T))
    assert lowest[nearest] == 0.5
    assert (lowest == 0.5).sum() == 1


def test_sparse_points_are_not_averaged() -> None:
    points = circle(5.0, 0.05, 2.0)
    np.testing.assert_array_equal(clean(points, None, None, 0.05)[0], points)


def test_a_vehicle_that_stood_while_it_recorded_stood_in_one_place() -> None:
    way = sine(500)
    stood = np.repeat(np.arange(500), np.where(np.arange(500) == 250, 400, 1))
    points = way[stood] + NOISE * np.random.default_rng(4).standard_normal((len(stood), 2))
    plan = planned(points)
    assert plan.status.value == "ok"
    assert plan.travel_time <= planned(way).travel_time / 0.8


@pytest.mark.parametrize("noisy", [0.0, NOISE])
def test_a_dense_path_that_turns_round_is_planned_up_to_the_given_tip(noisy: float) -> None:
    ahead = np.stack([np.arange(0.0, 9.0, 0.002), np.zeros(4500)], axis=1)
    back = np.stack([ahead[:2000:-1, 0], np.linspace(0.0, 0.5, 2499)], axis=1)
    points = np.concatenate([ahead, back])
    points += noisy * np.random.default_rng(5).standard_normal(points.shape)
    plan = planned(points)
    assert plan.status.value == "blocked"
    assert "turns round at" in plan.reason
    end = np.array([plan.x[-1], plan.y[-1]])
    assert np.hypot(*(points - end).T).min() == 0.0
    assert np.hypot(*(end - ahead[-1])) <= 0.002 + 5.0 * noisy


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        (path_of(*([(2.0, 3.0)] * 5_000)), "2 distinct points"),
        (CandidatePath("back", sine(50_000), yaw=np.full(50_000, np.pi)), "driven backwards$"),
        (CandidatePath("back", sine(50_000), yaw=np.full(50_000, 180.0)), "than a turn: degrees"),
    ],
    ids=["one place", "backwards", "degrees"],
)
def test_dense_paths_are_refused_like_sparse_ones(path: CandidatePath, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        resample(path, 0.25)
