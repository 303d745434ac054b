"""Onset of the brakes: speed before it, dead time, and random effects from stop to stop."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.dead_time import dead_time, held_weights, sharpen
from slopewise.models.stop_logs.onset import HELD, Knee, fit_knee

G = 9.80665


def stop_on_a_plane(
    force: float, grade: float, dead_time: float, held: float = 3.0, hz: float = 100.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    a = G * (force + np.sin(grade))
    rest = dead_time + held / a
    t = np.arange(-0.5, rest + 0.5, 1.0 / hz)
    v = np.clip(held - a * (t - dead_time), 0.0, held)
    return t, v, np.full(len(t), grade), rest


@pytest.mark.parametrize("grade", [-0.2, 0.0, 0.15])
@pytest.mark.parametrize("dead_time", [0.1, 0.3, 0.5])
def test_without_noise_it_is_exact(grade: float, dead_time: float) -> None:
    knee = fit_knee(*stop_on_a_plane(0.42, grade, dead_time))
    assert knee.force_ratio == pytest.approx(0.42, abs=2e-3)
    assert knee.onset_time == pytest.approx(dead_time, abs=3e-3)
    assert knee.onset_speed == pytest.approx(3.0, abs=2e-3)
    assert knee.mean_grade == pytest.approx(grade, abs=1e-12)


def test_a_slope_that_varies_along_the_stop_is_taken_as_it_is() -> None:
    m, b, dead_time, held = -0.4, 0.42, 0.3, 3.0

    def theta(s: float) -> float:
        return -0.15 + 0.08 * np.sin(2.0 * s)

    def rates(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -G * (m * theta(y[0]) + b + np.sin(theta(y[0])))]

    def standstill(_: float, y: np.ndarray) -> float:
        return float(y[1])

    standstill.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        rates,
        (0, 9),
        [held * dead_time, held],
        events=standstill,
        rtol=1e-10,
        atol=1e-12,
        dense_output=True,
    )
    rest = dead_time + float(run.t[-1])
    t = np.arange(-0.5, rest, 0.01)
    braking = t > dead_time
    s = np.where(braking, run.sol(np.maximum(t - dead_time, 0.0))[0], held * t)
    v = np.where(braking, run.sol(np.maximum(t - dead_time, 0.0))[1], held)
    grade = np.array([theta(x) for x in s])
    knee = fit_knee(t, v, grade, rest, slope=m)
    assert knee.force_ratio == pytest.approx(m * knee.mean_grade + b, abs=1.5e-3)
    assert knee.onset_time == pytest.approx(dead_time, abs=3e-3)


def test_its_covariance_is_what_repetitions_show() -> None:
    rng = np.random.default_rng(0)
    t, v, grade, rest = stop_on_a_plane(0.4, -0.1, 0.3)
    knees = [fit_knee(t, v + 0.04 * rng.standard_normal(len(t)), grade, rest) for _ in range(300)]
    values = np.array([(k.onset_speed, k.onset_time, k.force_ratio) for k in knees if k])
    claimed = np.mean([np.sqrt(np.diag(k.covariance)) * 0.04 for k in knees if k], axis=0)
    np.testing.assert_allclose(np.std(values, axis=0), claimed, rtol=0.2)
    truth = np.array([3.0, 0.3, 0.4])
    assert np.all(np.abs(np.mean(values, axis=0) - truth) < 4.0 * claimed / np.sqrt(len(values)))


def test_what_shows_no_fall_has_no_knee() -> None:
    t, v, grade, rest = stop_on_a_plane(0.4, 0.0, 0.3)
    assert fit_knee(t[:3], v[:3], grade[:3], rest) is None
    late = np.where(t < 0.0, 3.0, 0.0)
    assert fit_knee(t, late, grade, 0.01) is None


NOISE = 0.04


def fitted_knees(
    creep: np.ndarray, seed: int = 0, weights: np.ndarray | None = None
) -> list[Knee | None]:
    rng = np.random.default_rng(seed)
    estimates = []
    for i, slope in enumerate(creep):
        v = rng.uniform(1.0, 3.0)
        t = np.arange(-1.0, 0.3 + v / (0.4 * G) + 0.2, 0.01)
        before = v + slope * (t - 0.3)
        speed = np.where(t < 0.3, before, np.maximum(v - 0.4 * G * (t - 0.3), 0.0))
        speed = speed + NOISE * rng.standard_normal(len(t))
        weight = HELD if weights is None else float(weights[i])
        estimates.append(
            fit_knee(t, speed, np.zeros(len(t)), 0.3 + v / (0.4 * G), held_weight=weight)
        )
    assert all(estimates)
    return estimates


def spread(weights: np.ndarray) -> float:
    return float(NOISE / np.sqrt(np.median(weights)))


def test_speeds_that_are_held_are_known_to_be() -> None:
    weights = held_weights(fitted_knees(np.zeros(60)), np.full(60, NOISE))
    assert spread(weights) < 0.01


@pytest.mark.parametrize("std", [0.05, 0.2])
def test_a_creep_that_is_there_is_found(std: float) -> None:
    creep = std * np.random.default_rng(5).standard_normal(80)
    weights = held_weights(fitted_knees(creep), np.full(80, NOISE))
    assert spread(weights) == pytest.approx(std, rel=0.35)
    coasting = held_weights(fitted_knees(np.full(80, -std)), np.full(80, NOISE))
    assert spread(coasting) == pytest.approx(std, rel=0.2)


def test_a_stop_of_its_own_kind_is_left_alone() -> None:
    creep = np.zeros(40)
    creep[7] = 0.3
    weights = held_weights(fitted_knees(creep), np.full(40, NOISE))
    assert weights[7] == HELD
    assert spread(np.delete(weights, 7)) < 0.02


def test_few_stops_and_missing_ones_say_nothing() -> None:
    some = fitted_knees(np.zeros(20))
    np.testing.assert_array_equal(held_weights(some, np.full(20, NOISE)), HELD)
    gaps = [*fitted_knees(np.zeros(40)), None]
    weights = held_weights(gaps, np.full(40, NOISE))
    assert weights[-1] == HELD
    assert (weights[:-1] > HELD).all()


def test_it_sharpens_the_force_without_bias() -> None:
    creep = np.zeros(150)
    plain = fitted_knees(creep)
    sharp = fitted_knees(creep, weights=held_weights(plain, np.full(150, NOISE)))
    errors = [
        np.array([k.force_ratio - 0.4 for k in some if k is not None]) for some in (plain, sharp)
    ]
    assert np.std(errors[1]) < np.std(errors[0])
    assert abs(np.mean(errors[1])) < 4.0 * np.std(errors[1]) / np.sqrt(150)
    claimed = NOISE * np.sqrt([k.covariance[2, 2] for k in sharp if k is not None])
    assert 0.85 < np.std(errors[1] / claimed) < 1.2


def knees(seed: int, dead_time_std: float = 0.0, stops: int = 60, noise: float = 0.05) -> list:
    rng = np.random.default_rng(seed)
    fits = []
    for _ in range(stops):
        held = rng.uniform(1.0, 4.0)
        delay = 0.25 + dead_time_std * rng.standard_normal()
        rest = delay + held / (0.4 * G)
        t = np.arange(-1.0, rest + 0.3, 0.01)
        v = np.clip(held - 0.4 * G * (t - delay), 0.0, held) + noise * rng.standard_normal(len(t))
        fits.append(fit_knee(t, v, np.zeros(len(t)), rest))
    assert all(fits)
    return fits


@pytest.mark.parametrize("dead_time_std", [0.0, 0.03])
def test_common_dead_time_and_its_jitter(dead_time_std: float) -> None:
    fits = [dead_time(knees(seed, dead_time_std), np.full(60, 0.05)) for seed in range(6)]
    for fit in fits:
        assert fit.value == pytest.approx(0.25, abs=max(4.0 * fit.std, 1e-4))
        assert fit.std < 0.008
    assert np.mean([fit.between_stops for fit in fits]) == pytest.approx(dead_time_std, abs=0.008)


def test_knowing_it_sharpens_the_force_and_keeps_it_honest() -> None:
    some, noise = knees(3), np.full(60, 0.05)
    sharp = sharpen(some, noise, dead_time(some, noise))
    alone = 0.05 * np.sqrt([k.covariance[2, 2] for k in some])
    assert np.all(sharp.force_std < 0.8 * alone)
    scaled = (sharp.force_ratio - 0.4) / sharp.force_std
    assert 0.75 < np.std(scaled) < 1.3


def test_an_onset_of_its_own_is_left_alone() -> None:
    some = knees(4)
    late = np.arange(-1.0, 3.0, 0.01)
    v = np.clip(3.0 - 0.4 * G * (late - 1.5), 0.0, 3.0)
    odd = fit_knee(late, v, np.zeros(len(late)), 1.5 + 3.0 / (0.4 * G))
    assert odd is not None
    common = dead_time([*some, odd], np.full(61, 0.05))
    assert common.value == pytest.approx(0.25, abs=0.01)
    assert sharpen([*some, odd], np.full(61, 0.05), common).force_ratio[-1] == odd.force_ratio


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


@pytest.mark.parametrize("scatter", [0.0, pytest.param(0.1, marks=pytest.mark.nightly), 0.5])
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
