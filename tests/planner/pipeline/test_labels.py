"""Labels of limiting bounds, and the ranking of plans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.planner.horizon.answer import HorizonSettings, PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.kernels.limits import PlanningLimits, planning_limits
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.labels import labels, segment_limits
from slopewise.planner.pipeline.ranking import rank, ranking_cost, travel_cost
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.verify.track import Track
from tests.planner.scenes import G, model_of, plane, straight, tables_with

# ---------------------------------------------------------------------------------- labels


N = 40
SCALARS: PlanningLimits = planning_limits(
    model_of(tables_with(limits=tables_with()["limits"] | {"decel": 3.5}))
)


def sampled(seed: int) -> tuple[Track, dict[str, np.ndarray]]:
    rng = np.random.default_rng(seed)
    zeros = np.zeros(N)
    track = Track(
        np.arange(N) * 0.25,
        rng.uniform(-0.3, 0.3, N),
        zeros,
        zeros,
        zeros,
        rng.uniform(-0.03, 0.03, N),
        rng.uniform(0.1, 0.5, N),
        zeros,
        zeros,
        zeros,
        np.full(N, rng.uniform(0.0, 1.5)),
        np.full(N, np.inf),
        zeros,
        np.full(N, np.inf),
    )
    return track, {
        "speed_sq": rng.uniform(0.0, 16.0, N),
        "accel_max": rng.uniform(0.0, 1.5, N),
        "demand": rng.uniform(-0.1, 0.5, N),
    }


def limits_of(track: Track, arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return segment_limits(track, *arrays.values(), track.lower_intercept, SCALARS)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_limits_hold_at_both_ends_at_any_speed_up_to_the_profile(seed: int, share: float) -> None:
    track, arrays = sampled(seed)
    accel, decel = limits_of(track, arrays)
    assert np.all(accel >= 0.0)
    assert np.all(decel >= 0.0)
    assert np.all(decel <= SCALARS.decel)
    speed = share * np.sqrt(arrays["speed_sq"])
    ends = (slice(None, -1), slice(1, None))
    # The ground of either end holds on the whole segment, so at the speed of the other end as well.
    for end, v in ((end, speed[first_speed]) for end in ends for first_speed in ends):
        assert np.all(accel <= arrays["accel_max"][end])
        with np.errstate(divide="ignore"):
            powered = G * (SCALARS.specific_power / v - arrays["demand"][end])
        assert np.all((accel <= powered + 1e-12) | (accel == 0.0))
        onset = np.maximum(v, track.slowest[end])
        force = (
            track.lower_slope[end] * onset + track.lower_intercept[end] + np.sin(track.grade[end])
        )
        assert np.all((decel <= G * force + 1e-12) | (decel == 0.0))


def test_limits_are_no_lower_than_need_be() -> None:
    """On even ground at an even speed they are the law itself."""
    track, arrays = sampled(0)
    even = {name: np.full(N, values[0]) for name, values in arrays.items()}
    even |= {"speed_sq": np.full(N, 9.0), "accel_max": np.full(N, 5.0), "demand": np.full(N, 0.1)}
    flat = Track(*(np.full(N, values[0]) for values in track))._replace(grade=np.zeros(N))
    flat = flat._replace(lower_slope=np.full(N, -0.02), lower_intercept=np.full(N, 0.3))
    accel, decel = limits_of(flat, even)
    np.testing.assert_allclose(accel, G * (SCALARS.specific_power / 3.0 - 0.1))
    np.testing.assert_allclose(decel, G * (0.3 - 0.06))


@pytest.mark.parametrize(
    ("speed_sq", "accel", "smoothed", "expected"),
    [
        (4.0, 0.0, True, Limiting.LATERAL),  # at the bound
        (1.0, 1.0, True, Limiting.ACCEL),
        (1.0, -1.5, True, Limiting.DECEL),
        (1.0, 0.3, True, Limiting.JERK),
        (1.0, 0.3, False, Limiting.ACCEL),
        (1.0, -0.3, True, Limiting.JERK),
    ],
)
def test_each_label(speed_sq: float, accel: float, smoothed: bool, expected: Limiting) -> None:
    names = labels(
        np.full(3, speed_sq),
        np.full(3, accel),
        np.full(3, 4.0),
        np.full(3, int(Limiting.LATERAL)),
        np.full(2, 1.0),
        np.full(2, 1.5),
        1.0,
        smoothed,
    )
    assert set(names) == {int(expected)}


def test_weak_drive_is_traction() -> None:
    names = labels(
        np.ones(3),
        np.full(3, 0.4),
        np.full(3, 4.0),
        np.zeros(3, np.int64),
        np.full(2, 0.4),
        np.full(2, 1.5),
        1.0,
        True,
    )
    assert set(names) == {int(Limiting.TRACTION)}


# --------------------------------------------------------------------------------- ranking


PATHS = [straight(11.9, name="short"), straight(12.0, name="wide")]
"""The longer one has stations a little farther apart, so more is left behind its last stop."""

DEAR = PlannerSettings(margin_weight=100.0)


def two(settings: PlannerSettings) -> list[SpeedPlan]:
    return CandidatePlanner(model_of(tables_with()), settings).plan(plane(), PATHS)


def test_cost_is_time_plus_missed_distance_less_margin() -> None:
    plan, _ = two(PlannerSettings())
    settings = PlannerSettings(horizon_penalty=3.0, margin_weight=0.7, margin_enough=100.0)
    missed = plan.station[-1] - plan.progress
    cost = plan.travel_time + 3.0 * missed
    assert travel_cost(plan, settings) == pytest.approx(cost)
    assert ranking_cost(plan, settings) == pytest.approx(cost - 0.7 * plan.least_margin)
    enough = replace(settings, margin_enough=0.1)
    assert ranking_cost(plan, enough) == pytest.approx(cost - 0.07)
    assert ranking_cost(plan, PlannerSettings()) == travel_cost(plan, PlannerSettings())


def test_a_plan_at_rest_has_all_the_margin_that_counts() -> None:
    plan, _ = two(PlannerSettings())
    still = replace(plan, speed=np.zeros_like(plan.speed))
    assert ranking_cost(still, DEAR) == pytest.approx(travel_cost(still, DEAR) - 100.0)


@pytest.mark.parametrize(
    ("settings", "best"), [(PlannerSettings(), "short"), (DEAR, "wide")], ids=["time", "margin"]
)
def test_plan_and_horizon_choose_by_the_same_weights(settings: PlannerSettings, best: str) -> None:
    plans = two(settings)
    assert plans[1].least_margin > plans[0].least_margin
    assert rank(plans, settings)[0].candidate == best
    horizon = Horizon(model_of(tables_with()), HorizonSettings(budget=60.0), settings)
    answer = horizon.step(PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0), PATHS, plane())
    assert answer.chosen is not None
    assert answer.chosen.candidate == best
