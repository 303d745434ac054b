from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs.dead_time import dead_time, sharpen
from slopewise.models.stop_logs.onset import fit_knee

G = 9.80665


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
