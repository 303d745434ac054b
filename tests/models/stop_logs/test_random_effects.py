from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs import random_effects

WIDE = np.diag([1e4, 1e4])
NONE = np.zeros(2)


def line(seed: int, n: int = 80, scatter: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = np.column_stack((rng.uniform(-1, 1, n), np.ones(n)))
    noise = rng.uniform(0.02, 0.2, n)
    spread = np.sqrt(noise**2 + scatter**2)
    return x, x @ [2.0, -1.0] + spread * rng.standard_normal(n), noise


def test_equal_noise_is_ordinary_least_squares() -> None:
    x, y, _ = line(0)
    fit = random_effects.fit(x, y, np.full(len(y), 0.1), NONE, WIDE)
    assert fit.kept.all()
    np.testing.assert_allclose(fit.coefficients, np.linalg.lstsq(x, y, rcond=None)[0], atol=1e-6)


@pytest.mark.parametrize("scatter", [0.0, 0.1, 0.5])
def test_scatter_and_covariance_are_honest(scatter: float) -> None:
    fits = [random_effects.fit(*line(seed, 60, scatter), NONE, WIDE) for seed in range(150)]
    errors = np.array(
        [(f.coefficients - [2.0, -1.0]) / np.sqrt(np.diag(f.covariance)) for f in fits]
    )
    assert np.all(np.mean(np.abs(errors) < 2.0, axis=0) > 0.91)
    assert np.all(np.abs(np.std(errors, axis=0) - 1.0) < 0.2)
    assert np.median([f.scatter for f in fits]) == pytest.approx(scatter, abs=0.03)


def test_gross_errors_change_little_and_are_named() -> None:
    x, y, noise = line(3, 100, 0.05)
    clean = random_effects.fit(x, y, noise, NONE, WIDE)
    y = y.copy()
    y[[5, 40, 77, 80, 99]] += [4.0, -5.0, 4.0, 6.0, 3.0]
    dirty = random_effects.fit(x, y, noise, NONE, WIDE)
    assert np.flatnonzero(~dirty.kept).tolist() == [5, 40, 77, 80, 99]
    shift = np.abs(dirty.coefficients - clean.coefficients) / np.sqrt(np.diag(clean.covariance))
    assert np.all(shift < 1.0)
    assert np.all(dirty.gain[:, ~dirty.kept] == 0.0)


def test_where_nothing_is_observed_the_prior_stays() -> None:
    x, y, noise = line(1)
    x = np.column_stack((np.zeros(len(y)), x[:, 1]))
    prior = np.array([0.7, 0.0])
    fit = random_effects.fit(x, y, noise, prior, np.diag([0.09, 100.0]))
    assert fit.coefficients[0] == pytest.approx(0.7, abs=1e-9)
    assert fit.covariance[0, 0] >= 0.09 - 1e-12


def test_gain_is_the_derivative() -> None:
    x, y, noise = line(2, 30)
    fit = random_effects.fit(x, y, noise, NONE, WIDE)
    bumped = y.copy()
    bumped[7] += 1e-4
    again = random_effects.fit(x, bumped, noise, NONE, WIDE)
    slope = (again.coefficients - fit.coefficients) / 1e-4
    np.testing.assert_allclose(slope, fit.gain[:, 7], rtol=0.05, atol=1e-4)
