"""The allowed distance integrated for the engines' stops is the closed form on uniform slopes."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")
pytest.importorskip("vehiclemodels", reason="the extra sim is not installed")

from benchmarks.calibration.engine_stops import allowed
from benchmarks.calibration.margin_coverage import allowed_distance
from benchmarks.discrepancy.effect_plant import DrivenStops
from slopewise.models.parameters import Braking

KNOWN = Braking(
    m_m=-0.02,
    b_m=-0.3,
    m_b=0.01,
    b_b=0.42,
    dead_time=0.25,
    dead_time_std=0.01,
    force_std=0.008,
    force_scatter=0.01,
    distance_offset=0.05,
    speed_range=(1.0, 4.0),
    grade_range=(-0.26, 0.26),
    covariance=tuple(tuple(1e-5 * float(i == j) for j in range(4)) for i in range(4)),
)


@pytest.mark.parametrize("quantile", [0.5, 0.99, 0.999])
def test_allowed_distance_is_the_closed_form_on_uniform_slopes(quantile: float) -> None:
    rng = np.random.default_rng(0)
    speed, grade = rng.uniform(1.0, 4.0, 40), rng.uniform(-0.2, 0.2, 40)
    time = np.linspace(-0.5, 4.0, 91)
    station = speed[:, None] * time
    flat, none = np.zeros_like(station), np.zeros(40)
    speeds = np.repeat(speed[:, None], 91, axis=1)
    driven = DrivenStops(time, speeds, station, station, *[flat] * 5, none, none, none)
    distance = allowed(KNOWN, driven, np.repeat(grade[:, None], 91, axis=1), quantile)
    expected = allowed_distance(KNOWN, speed, grade, quantile)
    np.testing.assert_allclose(distance, expected, atol=2e-3)
