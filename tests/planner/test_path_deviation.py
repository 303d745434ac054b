"""A given path is never replaced in silence: how far plans lead from it, and what limits that."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.path import EvenPath, batch, resample
from slopewise.planner.path_deviation import path_deviation
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from tests.planner.given_paths import given_paths, largest_distance, samples
from tests.planner.scenes import ATV, model_of, plane, straight, tables_with

FLAT = ElevationMap(elevation=np.zeros((600, 600)), resolution=0.5, origin=(-150.0, -150.0))
LIMIT = 0.299  # a quarter of what is 1.0 m of track and 0.196 m of tyre wide
IN_ORDER = ("cusps", "crossing", "zigzag", "alternating")
"""Kinds whose parts come so near each other that the nearest place need not be the same part."""


def planned(points: np.ndarray, limit: float | None = None) -> SpeedPlan:
    tables = ATV if limit is None else tables_with(limits={"max_path_deviation": limit})
    return CandidatePlanner(model_of(tables)).plan(FLAT, [CandidatePath("p", points)])[0]


def line_of(plan: SpeedPlan) -> np.ndarray:
    return np.stack((plan.x, plan.y), axis=1)


@pytest.mark.parametrize(
    ("count", "limit"),
    [
        (220, None),
        pytest.param(1000, None, marks=pytest.mark.nightly),
        pytest.param(1000, 0.1, marks=pytest.mark.nightly),
    ],
)
def test_every_deviation_is_reported_and_within_the_limit_or_the_path_is_refused(
    count: int, limit: float | None
) -> None:
    outcome: Counter[str] = Counter()
    malformed = ""
    for kind, points in given_paths(count):
        try:
            plan = planned(points, limit)
        except ParameterError as error:
            malformed += "" if error.field.startswith("p.points[") else str(error)
            outcome[f"{kind} refused"] += 1
            continue
        outcome[f"{kind} planned"] += 1
        deviation, true = plan.path_deviation, largest_distance(points, line_of(plan))
        assert deviation is not None
        assert true <= deviation.limit + 1e-3 == (limit or LIMIT) + 1e-3
        assert true - 0.003 <= deviation.largest <= deviation.limit
        if kind not in IN_ORDER:
            assert deviation.largest <= true + 0.005
        k = int(np.argmax(deviation.distance))
        assert deviation.distance[k] == deviation.largest
        assert (deviation.station, deviation.x, deviation.y) == (
            plan.station[k],
            plan.x[k],
            plan.y[k],
        )
    print(dict(sorted(outcome.items())))
    assert not malformed
    assert sum(n for name, n in outcome.items() if "planned" in name) > 0.8 * count


@pytest.mark.parametrize("pattern", [[0, 1, 0, -1], [1, 1, -1, -1]])
def test_a_slalom_is_not_taken_for_noise(pattern: list[int]) -> None:
    i = np.arange(40)
    points = np.stack([1.0 * i, np.resize(pattern, 40)], axis=1) @ [[0.8, 0.6], [-0.6, 0.8]]
    plan = planned(points)
    assert largest_distance(points, line_of(plan)) <= LIMIT
    # It was a straight line at 4 m/s.
    assert plan.speed.max() < 2.5
    assert np.abs(plan.curvature).max() > 0.8
    assert np.all(plan.speed**2 * np.abs(plan.curvature) <= 2.0 + 1e-6)


def test_a_line_within_the_limit_is_the_one_that_it_would_be_without() -> None:
    for _, points in given_paths(66, seed=2):
        try:
            free, limited = (
                resample(CandidatePath("p", points), 0.25, limit) for limit in (9e9, LIMIT)
            )
        except ParameterError:
            continue
        assert free.given is not None
        if free.given.deviation <= LIMIT:
            np.testing.assert_array_equal(free.points, limited.points)


def test_a_smaller_limit_holds_and_corners_are_then_sharper() -> None:
    corner = np.array([(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (18.0, 9.0), (18.0, 0.0)])
    wavy = np.stack([np.arange(30.0), np.resize([0.0, 0.8, 0.0, -0.8], 30)], axis=1)
    wide, narrow = (planned(wavy, limit) for limit in (0.3, 0.06))
    assert largest_distance(wavy, line_of(wide)) <= 0.3
    assert largest_distance(wavy, line_of(narrow)) <= 0.06
    assert np.abs(narrow.curvature).max() > np.abs(wide.curvature).max()
    assert narrow.speed.max() <= wide.speed.max()
    for limit in (0.3, 0.1, 0.05):
        assert (
            largest_distance(corner, resample(CandidatePath("c", corner), 0.25, limit).points)
            <= limit
        )


def test_what_cannot_be_followed_is_refused_with_place_and_size() -> None:
    there = np.arange(0.0, 5.0, 0.1)
    back = np.stack([np.concatenate([there, there[::-1], there]), np.zeros(150)], axis=1)
    with pytest.raises(ParameterError, match=r"turns round at \(\S+, \S+\); split it there"):
        planned(back)
    rng = np.random.default_rng(5)
    wild = np.stack([np.linspace(0.0, 12.0, 240), rng.normal(0.0, 0.05, 240)], axis=1)
    with pytest.raises(ParameterError) as caught:
        planned(wild, 0.05)
    assert re.match(r"p\.points\[\d+\]", caught.value.field)
    place = re.search(r"at \((\S+), (\S+)\) .* is (\d+\.\d\d) m off", caught.value.expected)
    assert place
    assert "within 0.05 m (limits.max_path_deviation)" in caught.value.expected
    assert float(place[3]) > 0.05
    assert -0.1 <= float(place[1]) <= 12.1


def test_a_line_that_turns_round_between_short_steps_is_refused() -> None:
    """Reversed exactly, a line has no curvature: it was planned at 2.7 m/s."""
    way = np.arange(2.0, 5.0, 0.1)
    to_and_fro = np.concatenate([way, way[-2::-1], way[1:]])
    with pytest.raises(ParameterError, match="without cusps"):
        planned(np.stack([to_and_fro, np.full(len(to_and_fro), 0.5)], axis=1))


def test_stations_that_lie_off_their_path_are_refused_wherever_they_come_from() -> None:
    wavy = np.stack([np.arange(40.0), np.resize([0.0, 1.0, 0.0, -1.0], 40)], axis=1)
    away = resample(CandidatePath("away", wavy @ [[0.8, 0.6], [-0.6, 0.8]]), 0.25)
    assert away.given is not None
    assert away.given.deviation > LIMIT
    with pytest.raises(ParameterError, match="away"):
        CandidatePlanner(model_of(ATV)).plan(FLAT, [away])
    state = PlanarState(
        x=float(away.points[0, 0]), y=float(away.points[0, 1]), heading=0.9, speed=0
    )
    paths = batch([away], 0.25)
    answer = Horizon(model_of(ATV)).step(state, paths, FLAT)
    assert answer.chosen is None
    assert "from the path that was given, 0.299 m at most" in answer.reason


def test_lanes_side_by_side_are_compared_each_with_its_own() -> None:
    x = np.arange(0.0, 20.0, 0.25)
    turn = np.array([1.0 / 3.0, 2.0 / 3.0])
    end = np.stack([20.0 + 0.1 * np.sin(np.pi * turn), 0.15 * (1 - np.cos(np.pi * turn))], axis=1)
    lanes = [np.stack([x, 0 * x], 1), end, np.stack([x[::-1], 0 * x + 0.3], 1)]
    given = np.concatenate(lanes)
    line = given.copy()
    line[30:50, 1] += 0.25  # nearer to the lane back than to its own
    deviation = path_deviation(given, *line.T, np.arange(len(line)), 1.0)
    assert deviation.largest == pytest.approx(0.25, abs=1e-3)
    assert 30 <= deviation.station <= 50


def test_deviation_of_a_known_pair_of_lines_is_its_distance() -> None:
    given = np.array([(0.0, 0.0), (10.0, 0.0)])
    x, y = np.array([0.0, 4.0, 5.0, 6.0, 10.0]), np.array([0.0, 0.0, 0.7, 0.0, 0.0])
    deviation = path_deviation(given, x, y, x, 1.0)
    assert (deviation.largest, deviation.station, deviation.x, deviation.y) == (
        pytest.approx(0.7),
        5.0,
        5.0,
        0.7,
    )
    # The other way round: a place of the given line that no vertex of the planned one is near.
    deviation = path_deviation(np.stack((x, y), 1), np.array([0.0, 10.0]), np.zeros(2), x[:2], 1.0)
    assert deviation.largest == pytest.approx(0.7)


# ------------------------------------------------------------------------------- moving horizon


def driven(horizon: Horizon, points: np.ndarray, cycles: int) -> list[SpeedPlan]:
    """The plans of a vehicle that follows its path for some cycles; `points` may change."""
    plans, state = [], PlanarState(x=points[0, 0], y=points[0, 1], heading=0.0, speed=0.0)
    for _ in range(cycles):
        answer = horizon.step(state, [CandidatePath("p", points)], FLAT)
        assert answer.chosen is not None
        plans.append(plan := answer.chosen)
        nearest = np.argmin(np.hypot(plan.x - state.x, plan.y - state.y))
        ahead = plan.time[nearest] + 0.3
        x, y, v = (np.interp(ahead, plan.time, a) for a in (plan.x, plan.y, plan.speed))
        heading = np.arctan2(
            np.interp(ahead + 0.1, plan.time, plan.y) - y,
            np.interp(ahead + 0.1, plan.time, plan.x) - x,
        )
        state = PlanarState(x=float(x), y=float(y), heading=float(heading), speed=float(v))
    return plans


def test_a_horizon_reports_how_far_the_rest_of_the_path_is_off() -> None:
    x = np.arange(0.0, 31.0, 1.0)
    points = np.stack([x, 0.4 * np.sin(x / 2.0) * (x < 15.0)], axis=1)
    for plan in driven(Horizon(model_of(ATV)), points, 25):
        deviation = plan.path_deviation
        assert deviation is not None
        left = samples(points)
        left = left[left[:, 0] >= plan.x[0]]
        assert deviation.largest == pytest.approx(largest_distance(left, line_of(plan)), abs=0.005)
        assert deviation.largest <= deviation.limit == pytest.approx(LIMIT)
    assert plan.path_deviation is not None
    assert plan.path_deviation.largest < 0.01


def test_a_horizon_does_not_go_on_along_a_line_that_its_path_has_left() -> None:
    tables = tables_with(limits={"max_path_deviation": 0.05})
    horizon, model = Horizon(model_of(tables)), model_of(tables)
    state = PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0)
    first = horizon.step(state, [straight(30.0)], FLAT).chosen
    assert first is not None
    # The same name, and within what is the same path, but farther off than a plan may lead.
    moved = CandidatePath("straight", np.array([(0.0, 0.09), (30.0, 0.09)]))
    speed = float(np.interp(0.2, first.x, first.speed))
    state = PlanarState(x=0.2, y=0.0, heading=0.0, speed=speed)
    answer = horizon.step(state, [moved], FLAT)
    assert answer.chosen is not None
    assert not answer.kept
    deviation = answer.chosen.path_deviation
    assert deviation is not None
    assert deviation.largest <= deviation.limit == model.max_path_deviation
    np.testing.assert_allclose(answer.chosen.y, 0.09, atol=0.05)


def test_a_path_ahead_of_the_vehicle_is_compared_from_its_first_point_on() -> None:
    state = PlanarState(x=-0.8, y=0.0, heading=0.0, speed=0.0)
    answer = Horizon(model_of(ATV)).step(state, [straight(20.0)], FLAT)
    assert answer.chosen is not None
    assert answer.chosen.path_deviation is not None
    assert answer.chosen.path_deviation.largest < 1e-6
    assert answer.chosen.x[0] == pytest.approx(-0.8)


def test_even_stations_are_the_path_that_is_given() -> None:
    even = EvenPath("even", np.stack([np.arange(0.0, 20.0, 0.25), np.zeros(80)], axis=1), None)
    plan = CandidatePlanner(model_of(ATV)).plan(plane(), [even])[0]
    assert plan.path_deviation is not None
    assert plan.path_deviation.largest == 0.0
    np.testing.assert_array_equal(plan.columns()["path_deviation"], np.zeros(80))
