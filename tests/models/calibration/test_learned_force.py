"""Learned and published force: surfaces, rejections, ages and rate limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.calibration.learned_force import LearnedForce, braking_in_use
from slopewise.models.calibration.online import OnlineBraking
from slopewise.models.calibration.published import PublishedForce, PublishSettings
from slopewise.models.calibration.recursive import Acceptance, RecursiveSettings, at_least_both
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.models.surface_braking import SurfaceBraking

TIGHT = ((1e-4, 0.0, 0.0, 0.0), (0.0, 9e-4, 0.0, 0.0), (0.0, 0.0, 4e-6, 0.0), (0.0, 0.0, 0.0, 4e-5))
PRIOR = Braking(
    m_m=-0.03,
    b_m=-0.35,
    m_b=0.015,
    b_b=0.30,
    dead_time=0.3,
    speed_range=(1.0, 4.0),
    grade_range=(-0.26, 0.26),
    covariance=TIGHT,
    force_std=0.01,
)
CORNERS = [(v, g) for v in PRIOR.speed_range for g in PRIOR.grade_range]


def stop(force: float, speed: float = 2.0, grade: float = 0.0) -> StreamedStop:
    return StreamedStop(0.0, speed, grade, force, 0.002, 0.3)


def braked(online: OnlineBraking, forces: list[float], surface: str = "") -> list[Acceptance]:
    """Stops up and down; each force is that on level ground at 2 m/s."""
    outcomes = []
    for i, level in enumerate(forces):
        v, g = 1.2 + 0.4 * (i % 7), 0.1 * (-1) ** i
        force = level + PRIOR.m_b * (v - 2.0) + (PRIOR.m_m * v + PRIOR.b_m) * g
        outcomes.append(online.take(stop(force, v, g), surface))
    return outcomes


def lower_bounds(braking: Braking, width: float = 3.09) -> list[float]:
    """F_b/W that a plan at that quantile counts on, written out here once more."""
    bounds = []
    for v, g in CORNERS:
        x = np.array([v * g, g, v, 1.0])
        mean = x @ (braking.m_m, braking.b_m, braking.m_b, braking.b_b)
        variance = x @ np.array(braking.covariance) @ x + braking.force_std**2
        bounds.append(float(mean - width * np.sqrt(variance)))
    return bounds


def learning(change: float = 0.15) -> OnlineBraking:
    return OnlineBraking(
        PRIOR, recursive=RecursiveSettings(change=change), publish=PublishSettings(only_valid=True)
    )


def test_nothing_learned_leaves_the_model_as_it_is() -> None:
    assert braking_in_use(PRIOR, learning().learned()) == PRIOR


def test_until_it_is_valid_an_estimate_only_lowers_the_force() -> None:
    online = learning()
    braked(online, [0.45] * 3)
    assert not online.learned()[""].valid
    assert np.all(
        np.array(lower_bounds(braking_in_use(PRIOR, online.learned())))
        <= np.array(lower_bounds(PRIOR)) + 1e-9
    )
    braked(online, [0.45] * 20)
    assert online.learned()[""].valid
    assert min(lower_bounds(braking_in_use(PRIOR, online.learned()))) > min(lower_bounds(PRIOR))


@pytest.mark.parametrize("weaker", [0.20, 0.12, 0.06])
def test_two_stops_on_weaker_ground_are_followed_fully(weaker: float) -> None:
    online = learning()
    braked(online, [0.32] * 12)
    outcomes = [online.take(stop(weaker)) for _ in range(2)]
    assert outcomes == [Acceptance.GATED, Acceptance.CHANGED]
    used = braking_in_use(PRIOR, online.learned())
    assert used.m_b * 2.0 + used.b_b == pytest.approx(weaker, abs=0.02)
    narrow = learning(change=0.0)
    braked(narrow, [0.32] * 12)
    braked(narrow, [weaker] * 2)
    estimate = narrow.learned()[""].estimate
    assert estimate[2] * 2.0 + estimate[3] > weaker + 0.03, "the width of a change is what does it"
    # The published force uses the two stops individually.
    used = braking_in_use(PRIOR, narrow.learned())
    assert used.m_b * 2.0 + used.b_b < estimate[2] * 2.0 + estimate[3]


def test_uncertainty_reverts_the_gain_and_nothing_more() -> None:
    online = learning()
    braked(online, [0.45] * 25)
    fast = lower_bounds(braking_in_use(PRIOR, online.learned()))
    online.inflate()
    inflated = lower_bounds(braking_in_use(PRIOR, online.learned()))
    assert np.all(np.array(inflated) <= fast)
    assert np.all(np.array(inflated) <= np.array(lower_bounds(PRIOR)) + 1e-9)
    assert min(inflated) > 0.5 * min(lower_bounds(PRIOR)), "it must still be able to drive"
    assert online.take(stop(0.10)) is Acceptance.ACCEPTED, "open to the first stop"
    online.inflate("", np.array([0.0, 0.0, 0.0, 0.05]))
    used = braking_in_use(PRIOR, online.learned())
    assert used.b_b + 2.0 * used.m_b <= 0.05 + 1e-9


@given(
    forces=st.lists(st.floats(0.03, 1.0), min_size=1, max_size=30),
    hours=st.floats(0.0, 200.0),
    surface=st.sampled_from(["", "sand"]),
)
def test_growing_older_never_makes_a_plan_faster(
    forces: list[float], hours: float, surface: str
) -> None:
    online = learning()
    braked(online, forces, surface)
    before = braking_in_use(PRIOR, online.learned()).on(surface)
    online.age(3600.0 * hours)
    after = braking_in_use(PRIOR, online.learned(), {surface: 0.01 * hours**0.5}).on(surface)
    lower, higher = np.array(lower_bounds(after)), np.array(lower_bounds(before))
    assert np.all(lower <= higher + 1e-6)


@given(forces=st.lists(st.floats(0.03, 1.0), min_size=1, max_size=30), age=st.floats(0.0, 1e6))
def test_restored_it_is_as_it_was_only_older(forces: list[float], age: float) -> None:
    online, again = learning(), learning()
    braked(online, forces)
    (learned_force,) = online.learned().values()
    again.restore(learned_force, age=age)
    online.age(age)
    (restored,), (aged,) = again.learned().values(), online.learned().values()
    np.testing.assert_allclose(restored.published, aged.published, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(restored.covariance, aged.covariance, rtol=1e-6, atol=1e-12)
    assert (restored.valid, restored.accepted) == (aged.valid, aged.accepted)
    if learned_force.accepted:
        assert again.take(stop(0.3)) == online.take(stop(0.3))


def test_surfaces_learn_separately_and_the_base_does_not_move_those_of_the_file() -> None:
    gravel = SurfaceBraking(b_b=0.25)
    prior = replace(PRIOR, terrain={"gravel": gravel})
    online = OnlineBraking(prior, recursive=RecursiveSettings(change=0.15))
    braked(online, [0.10] * 4)
    braked(online, [0.20] * 4, "sand")
    used = braking_in_use(prior, online.learned())
    assert used.b_b < 0.12
    assert used.on("gravel") == prior.on("gravel")
    assert used.on("model file") == replace(prior, terrain={})
    assert 0.15 < used.on("sand").level_force(2.0) < 0.22
    number = used.terrain["sand"].class_id
    assert number is not None
    assert number > 62, "no number in a map may mean a surface that was learned by name"


@given(a=st.integers(0, 2**31), b=st.integers(0, 2**31))
def test_neither_covariance_is_undercut(a: int, b: int) -> None:
    first, second = (np.random.default_rng(s).normal(size=(4, 4)) for s in (a, b))
    first, second = first @ first.T, second @ second.T
    lower = at_least_both(first, second)
    for force in (first, second):
        assert np.linalg.eigvalsh(lower - force)[0] > -1e-9


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"estimate": (float("nan"), 0.0, 0.0, 0.3)}, "estimate"),
        ({"published": (0.0, 0.0, 0.3)}, "published"),
        ({"published": (0.0, 0.0, 0.0, 1e6)}, "published"),
        ({"covariance": ((0.0,) * 4,) * 3}, "covariance"),
        ({"covariance": ((-1.0, 0.0, 0.0, 0.0), *((0.0,) * 4,) * 3)}, "covariance"),
        ({"accepted": -1}, "accepted"),
    ],
)
def test_what_cannot_have_been_learned_is_refused(changes: dict, field: str) -> None:
    usable = {
        "estimate": (0.0, 0.0, 0.0, 0.3),
        "covariance": TIGHT,
        "published": (0.0, 0.0, 0.0, 0.3),
        "valid": True,
        "accepted": 9,
        "gated": 0,
    }
    LearnedForce(**usable)  # type: ignore[arg-type]
    with pytest.raises(ParameterError) as caught:
        LearnedForce(**usable | changes)  # type: ignore[arg-type]
    assert caught.value.field == field


TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])
SPEEDS, GRADES = (1.0, 4.0), (-0.25, 0.25)
V, THETA = np.meshgrid(np.linspace(*SPEEDS, 9), np.linspace(*GRADES, 9))


def force(c: np.ndarray) -> np.ndarray:
    return np.asarray((c[0] * V + c[1]) * THETA + c[2] * V + c[3])


def published(**settings: float) -> PublishedForce:
    return PublishedForce(TRUTH, SPEEDS, GRADES, PublishSettings(**settings))  # type: ignore[arg-type]


def test_it_starts_from_the_prior() -> None:
    np.testing.assert_allclose(published().coefficients, TRUTH, atol=1e-12)
    assert not published().valid


estimates = st.tuples(
    st.floats(-0.1, 0.1), st.floats(-1.0, 0.5), st.floats(-0.05, 0.05), st.floats(0.1, 0.9)
).map(np.array)


@given(estimates=st.lists(estimates, min_size=1, max_size=5))
def test_down_at_once_up_by_a_step_never_out_of_bounds(estimates: list[np.ndarray]) -> None:
    out = published(rise=0.01)
    for estimate in estimates:
        before = force(out.coefficients)
        out.follow(estimate)
        after = force(out.coefficients)
        assert np.all(after <= before + 0.01 + 1e-9)
        assert np.all(after >= 0.02 - 1e-9)
        assert np.all(after <= 1.2 + 1e-9)
        # Nowhere above the estimate, as far as the estimate is a force that there can be.
        assert np.all(
            after[[0, 0, -1, -1], [0, -1, 0, -1]]
            <= np.maximum(force(estimate)[[0, 0, -1, -1], [0, -1, 0, -1]], 0.02) + 1e-9
        )


def test_a_lasting_rise_is_reached_in_time() -> None:
    out = published(rise=0.01)
    better = TRUTH + np.array([0.0, 0.0, 0.0, 0.05])
    for _ in range(6):
        out.follow(better)
    np.testing.assert_allclose(out.coefficients, better, atol=1e-9)


def test_the_valid_flag_has_hysteresis() -> None:
    out = published(valid_std=0.05, invalid_std=0.10)

    def covariance(share: float) -> np.ndarray:
        return np.diag([0.0, 0.0, 0.0, (share * np.min(out.corner_forces)) ** 2])

    assert not out.update_validity(covariance(0.03), 3, 0.0)  # too few stops
    assert out.update_validity(covariance(0.03), 8, 0.0)
    assert out.update_validity(covariance(0.08), 9, 0.0)  # between the thresholds it stays
    assert not out.update_validity(covariance(0.12), 10, 0.0)
    assert not out.update_validity(covariance(0.08), 11, 0.0)  # and so it does on the return
    assert out.update_validity(covariance(0.03), 12, 0.0)
    assert not out.update_validity(covariance(0.03), 13, 0.6)


def test_age_returns_to_the_default_where_it_is_weaker_only() -> None:
    out = published(rise=1.0)
    out.follow(TRUTH + np.array([0.0, 0.0, 0.0, 0.1]))
    out.age(1e9, 3600.0)
    np.testing.assert_allclose(out.coefficients, TRUTH, atol=1e-9)
    weaker = TRUTH - np.array([0.0, 0.0, 0.0, 0.1])
    out.follow(weaker)
    out.age(1e9, 3600.0)
    np.testing.assert_allclose(out.coefficients, weaker, atol=1e-9)


def test_settings_that_contradict_themselves() -> None:
    with pytest.raises(ParameterError, match="min_force"):
        PublishSettings(min_force=1.0, max_force=0.5)
    with pytest.raises(ParameterError, match="valid_std"):
        PublishSettings(valid_std=0.2)


@given(level=st.floats(0.03, 0.3), steep=st.floats(-1.5, 0.0))
def test_the_lower_bound_at_a_steep_end_is_not_spread_over_level_ground(
    level: float, steep: float
) -> None:
    out = published(rise=1.0)
    out.follow(np.array([0.0, steep, 0.0, level]))
    assert out.coefficients[2] * 2.0 + out.coefficients[3] <= max(level, 0.02) + 1e-9


def test_invalid_values_rise_to_the_default_and_no_rise_is_immediate() -> None:
    out = published(rise=0.02, only_valid=True)
    better = TRUTH + np.array([0.0, 0.0, 0.0, 0.2])
    for _ in range(9):
        out.follow(better)
    np.testing.assert_allclose(out.coefficients, TRUTH, atol=1e-9)
    assert out.update_validity(np.zeros((4, 4)), 9, 0.0)
    for n in range(1, 6):
        out.follow(better)
        np.testing.assert_allclose(out.corner_forces.mean(), force(TRUTH).mean() + 0.02 * n)
    assert not out.update_validity(np.eye(4), 9, 0.0)
    np.testing.assert_allclose(out.coefficients, TRUTH, atol=1e-9)
    out.follow(TRUTH - np.array([0.0, 0.0, 0.0, 0.1]))
    assert out.coefficients[3] < 0.31
