"""What fresh stops of the engines are held against: the closed form on even slopes."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.calibration.engine_stops import allowed
from benchmarks.calibration.margins import bound
from benchmarks.discovery.plant import DrivenStops
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
def test_allowance_on_even_slopes_is_that_of_the_closed_form(quantile: float) -> None:
    rng = np.random.default_rng(0)
    speed, grade = rng.uniform(1.0, 4.0, 40), rng.uniform(-0.2, 0.2, 40)
    time = np.linspace(-0.5, 4.0, 91)
    station = speed[:, None] * time
    flat = np.zeros_like(station)
    none = np.zeros(40)
    driven = DrivenStops(
        time,
        np.repeat(speed[:, None], 91, axis=1),
        station,
        station,
        flat,
        flat,
        flat,
        flat,
        flat,
        none,
        none,
        none,
    )
    way = allowed(KNOWN, driven, np.repeat(grade[:, None], 91, axis=1), quantile)
    np.testing.assert_allclose(way, bound(KNOWN, speed, grade, quantile), atol=2e-3)
