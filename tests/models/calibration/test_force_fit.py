from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.calibration.force_fit import design, fit_force, fit_two_stages, with_mount

TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])


def observations(
    n: int, seed: int, noise: float = 0.004, level: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    v = rng.uniform(1.0, 4.0, n)
    theta = np.zeros(n) if level else rng.uniform(-0.25, 0.25, n)
    m_m, b_m, m_b, b_b = TRUTH
    force = (m_m * v + b_m) * theta + m_b * v + b_b
    return v, theta, force + noise * rng.standard_normal(n)


def test_without_noise_it_is_exact() -> None:
    v, theta, force = observations(30, 0, noise=0.0)
    fit = fit_force(v, theta, force, np.full(30, 1e-4), np.zeros(4))
    np.testing.assert_allclose(fit.coefficients, TRUTH, atol=1e-4)
    np.testing.assert_allclose(fit.force_ratio(v, theta), force, atol=1e-5)
    two = fit_two_stages(v, theta, force)
    assert two is not None
    np.testing.assert_allclose(two[1], TRUTH[1], atol=0.1)


def test_one_stage_is_closer_than_the_papers_two() -> None:
    joint, staged = [], []
    for seed in range(60):
        v, theta, force = observations(40, seed)
        fit = fit_force(v, theta, force, np.full(40, 0.004), np.zeros(4))
        two = fit_two_stages(v, theta, force)
        assert two is not None
        joint.append(fit.coefficients - TRUTH)
        staged.append(two - TRUTH)
    assert np.all(np.std(joint, axis=0) < np.std(staged, axis=0))


def test_level_ground_says_nothing_about_slopes() -> None:
    v, theta, force = observations(50, 1, level=True)
    known = np.array([0.01, -0.2, 0.0, 0.5])
    fit = fit_force(v, theta, force, np.full(50, 0.004), known)
    np.testing.assert_allclose(fit.coefficients[:2], known[:2], atol=1e-9)
    np.testing.assert_allclose(fit.coefficients[2:], TRUTH[2:], atol=0.01)
    assert np.all(fit.learned[:2] < 0.01)
    assert np.all(fit.learned[2:] > 0.9)
    assert fit.force_std(2.0, 0.2)[0] > 10 * fit.force_std(2.0, 0.0)[0]


def test_an_error_that_all_stops_share_widens_the_covariance() -> None:
    v, theta, force = observations(60, 2)
    alone = fit_force(v, theta, force, np.full(60, 0.004), np.zeros(4))
    shared = fit_force(
        v, theta, force, np.full(60, 0.004), np.zeros(4), common=(np.full(60, 1.0), 0.01)
    )
    grown = np.diag(shared.covariance - alone.covariance)
    assert grown[3] == pytest.approx(0.01**2, rel=0.05)
    assert np.all(np.abs(grown[:3]) < 1e-6)
    misaligned = with_mount(alone, 0.01)
    # Refitting on grades that are all off by 0.01 shows what the covariance claims.
    shifted = fit_force(
        v, theta + 0.01, force - 0.01 * np.cos(theta), np.full(60, 0.004), np.zeros(4)
    )
    claimed = np.sqrt(np.diag(misaligned.covariance - alone.covariance))
    np.testing.assert_allclose(
        np.abs(shifted.coefficients - alone.coefficients)[2:], claimed[2:], rtol=0.1, atol=2e-5
    )


def test_rows_of_the_design() -> None:
    np.testing.assert_allclose(design(np.array([2.0]), np.array([0.1])), [[0.2, 0.1, 2.0, 1.0]])


def test_two_stages_need_two_grades_and_speeds() -> None:
    v, theta, force = observations(20, 3, level=True)
    assert fit_two_stages(v, theta, force) is None
    v, theta, force = observations(20, 3)
    assert fit_two_stages(np.full(20, 2.0), theta, force) is None
    assert fit_two_stages(v[:6], theta[:6], force[:6]) is None
