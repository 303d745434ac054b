"""The least-squares baseline on small logs whose truth is plain."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discrepancy import gls_base, gls_scan
from benchmarks.discrepancy.plant_physics import Physics, draw
from benchmarks.discrepancy.sensing import Columns
from tests.benchmarks.driven_stops import measured

BASE = Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
CONFIGURED = {"m_m": 0.001, "b_m": -0.21, "m_b": 0.004, "b_b": 0.46, "dead_time": 0.24}


def logged(truth: Physics, count: int = 50, seed: int = 3) -> Columns:
    """Stops of a plant, measured with 1 cm/s of noise."""
    stops = draw("mixed", count, 0.01, np.random.default_rng(seed))
    return measured(truth, stops, 0.01, np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"step_scale": 0.8, "step_run": 24.0}, ("step_change",)),
        *(
            pytest.param(*case, marks=pytest.mark.nightly)
            for case in (
                ({}, ()),
                ({"drag": 0.05}, ("aerodynamic_drag",)),
                ({"lag": 0.15}, ("brake_lag",)),
                ({"furrow": 0.05, "furrow_direction": 0.7}, ("directional_surface",)),
                ({"cross_slope": 0.5}, ("cross_slope",)),
                ({"turning": 0.3}, ("turning_resistance",)),
                ({"asymmetry": 0.5}, ("grade_asymmetry",)),
            )
        ),
    ],
)
def test_scan_names_plain_effects(fields: dict[str, float], names: tuple[str, ...]) -> None:
    assert gls_scan.name_effects(logged(BASE._replace(**fields)), CONFIGURED) == names


def test_base_is_fitted_with_its_dead_time_and_scatter() -> None:
    fit = gls_base.fit_base(logged(BASE, count=80), CONFIGURED)
    t = fit.traces
    level = np.abs(t.grade) < 0.02
    force = BASE.m_b * t.v_i[:, None] + BASE.b_b + (BASE.m_m * t.v_i[:, None] + BASE.b_m) * t.grade
    assert np.max(np.abs(fit.force - force)[level]) < 0.015
    assert fit.scatter.sample == pytest.approx(0.01, rel=0.5)
    assert fit.scatter.friction == pytest.approx(0.01, rel=0.6)


def test_too_few_stops_are_refused() -> None:
    short = {name: values[:300] for name, values in logged(BASE, count=8).items()}
    with pytest.raises(ValueError, match="eight"):
        gls_scan.name_effects(short, CONFIGURED)
