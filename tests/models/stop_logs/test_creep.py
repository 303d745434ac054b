from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs.creep import held_weights
from slopewise.models.stop_logs.onset import HELD, Knee, fit_knee

G = 9.80665
NOISE = 0.04


def knees(creep: np.ndarray, seed: int = 0, weights: np.ndarray | None = None) -> list[Knee | None]:
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
    weights = held_weights(knees(np.zeros(60)), np.full(60, NOISE))
    assert spread(weights) < 0.01


@pytest.mark.parametrize("std", [0.05, 0.2])
def test_a_creep_that_is_there_is_found(std: float) -> None:
    creep = std * np.random.default_rng(5).standard_normal(80)
    weights = held_weights(knees(creep), np.full(80, NOISE))
    assert spread(weights) == pytest.approx(std, rel=0.35)
    coasting = held_weights(knees(np.full(80, -std)), np.full(80, NOISE))
    assert spread(coasting) == pytest.approx(std, rel=0.2)


def test_a_stop_of_its_own_kind_is_left_alone() -> None:
    creep = np.zeros(40)
    creep[7] = 0.3
    weights = held_weights(knees(creep), np.full(40, NOISE))
    assert weights[7] == HELD
    assert spread(np.delete(weights, 7)) < 0.02


def test_few_stops_and_missing_ones_say_nothing() -> None:
    some = knees(np.zeros(20))
    np.testing.assert_array_equal(held_weights(some, np.full(20, NOISE)), HELD)
    gaps = [*knees(np.zeros(40)), None]
    weights = held_weights(gaps, np.full(40, NOISE))
    assert weights[-1] == HELD
    assert (weights[:-1] > HELD).all()


def test_it_sharpens_the_force_without_bias() -> None:
    creep = np.zeros(150)
    plain = knees(creep)
    sharp = knees(creep, weights=held_weights(plain, np.full(150, NOISE)))
    errors = [
        np.array([k.force_ratio - 0.4 for k in some if k is not None]) for some in (plain, sharp)
    ]
    assert np.std(errors[1]) < np.std(errors[0])
    assert abs(np.mean(errors[1])) < 4.0 * np.std(errors[1]) / np.sqrt(150)
    claimed = NOISE * np.sqrt([k.covariance[2, 2] for k in sharp if k is not None])
    assert 0.85 < np.std(errors[1] / claimed) < 1.2
