"""Lines of vehicles that follow given polylines: corners, posts, smooth curves, turning round."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.followed_line import GivenPoints, LineLimits, line_limits
from slopewise.planner.path import resample
from tests.planner.test_path import circle, curvature_of, line_of, planned
from tests.world.vehicles import ATV, model_of


@pytest.mark.parametrize("step", [0.05, 0.1, 0.25, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("curvature", [0.0, 0.15])
def test_a_path_that_turns_round_is_planned_up_to_there(step: float, curvature: float) -> None:
    ways = ((9.0, 1.0), (3.0, -1.0), (6.0, 1.0))
    points, heading = [np.zeros(2)], 0.0
    for length, gear in ways:
        for _ in np.arange(step, length + 1e-9, step):
            heading += gear * curvature * step
            angle = heading + (0.0 if gear > 0.0 else np.pi)
            points.append(points[-1] + step * np.array([np.cos(angle), np.sin(angle)]))
    given = np.array(points)
    tip = given[round(9.0 / step)]
    plan = planned(given)
    assert plan.status.value == "blocked"
    assert f"turns round at ({tip[0]:.2f}, {tip[1]:.2f})" in plan.reason
    np.testing.assert_array_equal(line_of(plan)[-1], tip)
    assert plan.progress > plan.station[-1] - 1.0
    # It is driven as fast as the same path without the rest.
    alone = planned(given[: round(9.0 / step) + 1])
    np.testing.assert_array_equal(plan.speed, alone.speed)


@pytest.mark.parametrize("turn", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("half", [0.2, 0.5, 1.0])
def test_a_corner_is_as_curved_as_the_best_parabola_and_cut_as_far(
    turn: float, half: float
) -> None:
    way = np.array([[-5.0, 0.0], [0.0, 0.0], [5.0 * np.cos(turn), 5.0 * np.sin(turn)]])
    given = GivenPoints(way, way, np.array([0.0, 5.0, 10.0]), 0.25, LineLimits(wheelbase=1.0))
    line = given.line(half)
    along = np.linspace(-half, half, 4001)
    ahead = np.maximum(along, 0.0)
    x, y = np.minimum(along, 0.0) + ahead * np.cos(turn), ahead * np.sin(turn)
    (ddx, dx, _), (ddy, dy, _) = (np.polyfit(along, axis, 2) for axis in (x, y))
    best = 2.0 * (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
    assert given.mean(half).sharpest == pytest.approx(best, rel=0.05)
    cut = 5.0 / 16.0 * half * np.sin(0.5 * turn)
    assert np.hypot(*line.points.T).min() == pytest.approx(cut, rel=0.05)


@pytest.mark.parametrize("spacing", [0.05, 0.1, 0.17, 0.2, 0.25])
@pytest.mark.parametrize("radius", [2.0, 4.0])
def test_stations_are_no_sharper_than_their_mean(radius: float, spacing: float) -> None:
    points = circle(radius, 0.1, 2.0)
    along = 0.1 * np.arange(len(points))
    given = GivenPoints(points, points, along, spacing, LineLimits(wheelbase=2.0))
    line = given.line(1.0)
    assert curvature_of(line.points).max() <= 1.005 * given.mean(1.0).sharpest


@pytest.mark.parametrize("radius", [4.0, 8.0, 30.0])
@pytest.mark.parametrize("step", [0.05, 0.2])
def test_smooth_dense_paths_are_planned_on_their_smooth_curve(radius: float, step: float) -> None:
    path = CandidatePath("arc", circle(radius, step, 2.0))
    limits = line_limits(model_of(ATV))
    np.testing.assert_array_equal(resample(path, 0.25).points, resample(path, 0.25, limits).points)


def test_posts_of_a_slalom_are_rounded_at_the_speed_of_their_corners() -> None:
    posts = np.stack([1.5 * np.arange(16.0), np.resize([0.0, 0.4, 0.0, -0.4], 16)], axis=1)
    plan = planned(posts)
    model = model_of(ATV)
    given, half = posts, 0.5 * model.vehicle.wheelbase
    for i in range(2, 14):
        ends = [
            given[i] + half * (e - given[i]) / np.hypot(*(e - given[i]))
            for e in given[[i - 1, i + 1]]
        ]
        a, b = given[i] - ends[0], ends[1] - given[i]
        sharpness = abs(a[0] * b[1] - a[1] * b[0]) / half**2 * 15.0 / 16.0 / half
        k = int(np.argmin(np.hypot(*(line_of(plan) - given[i]).T)))
        assert plan.speed[k] ** 2 * sharpness <= 1.05 * model.limits.lateral_accel
    assert plan.speed.max() > 1.0
