from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.terrain.gyro_bias import GyroBias


def test_first_samples_give_their_mean_and_its_standard_error():
    random = np.random.default_rng(1)
    values = 0.03 + 0.01 * random.normal(size=400)
    gyro = GyroBias()
    for value in values:
        gyro.update(value, 0.01)
    assert gyro.bias == pytest.approx(np.mean(values), rel=1e-9)
    assert gyro.bias_std == pytest.approx(np.std(values) / 20.0, rel=1e-6)


def test_drift_is_followed_and_the_past_forgotten():
    gyro = GyroBias(memory=5.0)
    for _ in range(3000):
        gyro.update(0.1, 0.01)
    for _ in range(3000):
        gyro.update(-0.1, 0.01)
    assert gyro.bias == pytest.approx(-0.1, abs=0.001)


def test_before_the_first_rest_nothing_is_known():
    gyro = GyroBias()
    assert gyro.bias == 0.0
    assert gyro.bias_std == np.inf
