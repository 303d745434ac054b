from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.calibration.asymmetry import Asymmetry, asymmetry
from slopewise.models.calibration.force_fit import WEAK_PRIOR


def stops(k: float, n: int = 80, seed: int = 0, low: float = -0.25) -> Asymmetry | None:
    rng = np.random.default_rng(seed)
    v, theta = rng.uniform(1.0, 4.0, n), rng.uniform(low, 0.25, n)
    force = (-0.03 * v - 0.35) * theta + 0.015 * v + 0.4 + k * np.maximum(theta, 0.0)
    force += 0.005 * rng.standard_normal(n)
    return asymmetry(v, theta, force, np.full(n, 0.003), WEAK_PRIOR)


@pytest.mark.parametrize("k", [-0.3, 0.2])
def test_it_is_found_with_its_size(k: float) -> None:
    logged = stops(k)
    assert logged is not None
    assert logged.clear
    assert logged.value == pytest.approx(k, abs=4.0 * logged.std)
    assert logged.std < 0.03


def test_symmetric_brakes_are_not_suspected() -> None:
    logged = [stops(0.0, seed=seed) for seed in range(100)]
    scaled = np.array([f.value / f.std for f in logged if f is not None])
    assert len(scaled) == 100
    assert np.std(scaled) == pytest.approx(1.0, abs=0.25)
    assert sum(f.clear for f in logged if f is not None) <= 1


def test_one_side_says_nothing() -> None:
    assert stops(0.3, low=0.0) is None
    assert stops(0.3, n=12) is None
