from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.calibration.force_fit import WEAK_PRIOR
from slopewise.models.calibration.recursive import Acceptance, RecursiveForce, RecursiveSettings

TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])
START = np.array([0.0, -0.1, 0.0, 0.5])
PRIOR = np.diag(np.square(WEAK_PRIOR))


def stops(n: int, seed: int, truth: np.ndarray = TRUTH, level: bool = False) -> list[tuple]:
    rng = np.random.default_rng(seed)
    v = rng.uniform(1.0, 4.0, n)
    theta = np.zeros(n) if level else rng.uniform(-0.25, 0.25, n)
    force = (truth[0] * v + truth[1]) * theta + truth[2] * v + truth[3]
    force = force + 0.01 * rng.standard_normal(n)
    return list(zip(v.tolist(), theta.tolist(), force.tolist(), [0.002] * n, strict=True))


def followed(some: list[tuple], **settings: object) -> RecursiveForce:
    estimate = RecursiveForce(START, PRIOR, RecursiveSettings(**settings))  # type: ignore[arg-type]
    for stop in some:
        estimate.update(*stop)
    return estimate


def test_without_forgetting_it_is_least_squares() -> None:
    some = stops(50, 0)
    estimate = followed(some, steady=(0.0, 0.0, 0.0, 0.0), gate=1e9)
    x = np.array([(v * g, g, v, 1.0) for v, g, *_ in some])
    noise = 0.002**2 + 0.01**2
    information = x.T @ x / noise + np.linalg.inv(PRIOR)
    expected = np.linalg.solve(
        information, x.T @ [f for _, _, f, _ in some] / noise + np.linalg.solve(PRIOR, START)
    )
    np.testing.assert_allclose(estimate.coefficients, expected, rtol=1e-6)
    np.testing.assert_allclose(estimate.covariance, np.linalg.inv(information), rtol=1e-5)


def test_it_finds_the_truth_and_its_covariance_stays_bounded() -> None:
    errors = []
    for seed in range(20):
        estimate = followed(stops(600, seed))
        errors.append((estimate.coefficients - TRUTH) / np.sqrt(np.diag(estimate.covariance)))
    assert np.mean(np.abs(errors) < 2.0) > 0.9
    assert np.linalg.eigvalsh(estimate.covariance)[0] > 0.0


def test_level_ground_for_hours_washes_no_slope_away() -> None:
    estimate = followed(stops(100, 0))
    before = estimate.coefficients.copy()
    std = np.sqrt(np.diag(estimate.covariance))
    for stop in stops(3000, 1, level=True):
        estimate.update(*stop)
    assert np.all(np.abs(estimate.coefficients[:2] - before[:2]) < std[:2])
    assert np.all(np.sqrt(np.diag(estimate.covariance))[:2] < 1.5 * std[:2])


def test_single_outliers_are_rejected() -> None:
    estimate = followed(stops(100, 0))
    before = estimate.coefficients.copy()
    for factor in (0.5, 1.8, 0.4):
        assert estimate.update(2.0, 0.0, 0.43 * factor, 0.002) is Acceptance.GATED
        np.testing.assert_array_equal(estimate.coefficients, before)
        assert estimate.update(*stops(1, 7)[0]) is Acceptance.ACCEPTED
        before = estimate.coefficients.copy()
    assert estimate.gated == 3


@pytest.mark.parametrize(("factor", "needed"), [(0.6, 2), (1.6, 4)])
def test_a_lasting_change_is_followed_and_weaker_brakes_sooner(factor: float, needed: int) -> None:
    estimate = followed(stops(100, 0))
    outcomes = [estimate.update(*stop) for stop in stops(needed, 3, factor * TRUTH)]
    assert outcomes == [Acceptance.GATED] * (needed - 1) + [Acceptance.CHANGED]
    for stop in stops(60, 4, factor * TRUTH):
        estimate.update(*stop)
    np.testing.assert_allclose(estimate.coefficients[3], factor * TRUTH[3], atol=0.02)


def test_what_says_nothing_is_left_out() -> None:
    estimate = followed(stops(20, 0))
    before = estimate.coefficients.copy()
    for stop in ((0.2, 0.0, 0.4, 0.01), (np.nan, 0.0, 0.4, 0.01), (2.0, 0.0, np.inf, 0.01)):
        assert estimate.update(*stop) is Acceptance.UNINFORMATIVE
    np.testing.assert_array_equal(estimate.coefficients, before)


def test_age_widens_towards_the_beginning_and_no_farther() -> None:
    estimate = followed(stops(100, 0))
    widths = []
    for seconds in (0.0, 600.0, 3600.0, 1e9):
        estimate.age(seconds, 3600.0)
        widths.append(estimate.std(2.0, 0.1))
    assert widths == sorted(widths)
    np.testing.assert_allclose(estimate.covariance, PRIOR, atol=1e-9)
