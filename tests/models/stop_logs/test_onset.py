"""Knees made by closed forms and by an independent integrator, measured back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.stop_logs.onset import fit_knee

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
    assert knee is not None
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
    assert knee is not None
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
