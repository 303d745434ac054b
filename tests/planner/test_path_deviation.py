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
from slopewise.planner.path import batch, resample
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from tests.world.given_paths import given_paths, largest_distance
from tests.world.ground import straight
from tests.world.vehicles import ATV, model_of, tables_with

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
        (140, None),
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
    assert sum(n for name, n in outcome.items() if "planned" in name) > 0.75 * count


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
