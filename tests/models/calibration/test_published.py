from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.calibration.published import PublishedForce, PublishSettings
from slopewise.models.errors import ParameterError

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

    assert not out.judge(covariance(0.03), 3, 0.0)  # too few stops
    assert out.judge(covariance(0.03), 8, 0.0)
    assert out.judge(covariance(0.08), 9, 0.0)  # between the thresholds it stays
    assert not out.judge(covariance(0.12), 10, 0.0)
    assert not out.judge(covariance(0.08), 11, 0.0)  # and so it does on the return
    assert out.judge(covariance(0.03), 12, 0.0)
    assert not out.judge(covariance(0.03), 13, 0.6)


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
    with pytest.raises(ParameterError, match="least"):
        PublishSettings(least=1.0, most=0.5)
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
    assert out.judge(np.zeros((4, 4)), 9, 0.0)
    for n in range(1, 6):
        out.follow(better)
        np.testing.assert_allclose(out.corner_forces.mean(), force(TRUTH).mean() + 0.02 * n)
    assert not out.judge(np.eye(4), 9, 0.0)
    np.testing.assert_allclose(out.coefficients, TRUTH, atol=1e-9)
    out.follow(TRUTH - np.array([0.0, 0.0, 0.0, 0.1]))
    assert out.coefficients[3] < 0.31
