from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.calibration.stopping import stopping_distance, stopping_time

G = 9.80665
TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])


@pytest.mark.parametrize("speed", [1.0, 3.9])
def test_a_plane_is_the_closed_form(speed: float) -> None:
    a = G * ((-0.03 * speed - 0.35) * -0.1 + 0.015 * speed + 0.4 + math.sin(-0.1))
    expected = 0.3 * speed + speed**2 / (2 * a)
    way = stopping_distance(speed, 0.3, TRUTH, np.array([0.0, 1.0]), np.full(2, -0.1))
    assert way == pytest.approx(expected, abs=1e-6)
    assert stopping_time(speed, 0.3, way) == pytest.approx(0.3 + speed / a, abs=1e-6)


def test_a_varying_slope_equals_integration_in_time() -> None:
    station = np.linspace(0.0, 6.0, 61)
    grade = -0.12 + 0.1 * np.sin(station)
    v = 3.5
    m, b = -0.03 * v - 0.35, 0.015 * v + 0.4

    def rates(_: float, y: np.ndarray) -> list[float]:
        theta = float(np.interp(y[0], station, grade))
        return [y[1], -G * (m * theta + b + math.sin(theta))]

    def standstill(_: float, y: np.ndarray) -> float:
        return float(y[1])

    standstill.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(rates, (0, 20), [0.3 * v, v], events=standstill, rtol=1e-9, max_step=0.01)
    assert stopping_distance(v, 0.3, TRUTH, station, grade) == pytest.approx(
        float(run.y[0][-1]), abs=2e-4
    )


def test_brakes_too_weak_for_the_slope_never_stop() -> None:
    weak = np.array([0.0, 0.0, 0.0, 0.1])
    ends = np.array([0.0, 1.0])
    assert stopping_distance(2.0, 0.3, weak, ends, np.full(2, -0.2)) == math.inf
