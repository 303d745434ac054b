"""Noise, whitening, thresholds and permutations against numbers drawn for the purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import BASE as BASE_NUMBERS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.noise import Noise, shapes, whitener
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.search import screening
from slopewise.models.discrepancy.search.locate import follow, part_of_axis
from slopewise.models.discrepancy.search.refine import fit_with_noise, likely_scatter
from slopewise.models.parameters import Effect
from tests.models.discrepancy.logs import table
from tests.models.models_for_tests import BASE

BASIS = Hypothesis.configured(BASE)
NOISE = Noise(0.03, 0.0, 0.05, 0.004, 0.02)


def sampled(hypothesis: Hypothesis, noise: Noise, seed: int) -> StopTable:
    """The stops of a log with speeds drawn from a hypothesis and a noise."""
    stops = table("clean")
    rng = np.random.default_rng(seed)
    z = shapes(stops, hypothesis)
    stds = np.array([0.0, noise.creep, noise.dead_time_std, noise.scatter])
    effects = rng.standard_normal((len(stops), 4)) * stds
    white = noise.speed * np.sqrt(stops.spread) * rng.standard_normal(stops.binned.shape)
    fall = np.einsum("skm,sm->sk", stops.average, predict(stops, hypothesis))
    level = stops.held[:, None] * (stops.spread > 0.0)
    return replace(stops, binned=level - fall + np.einsum("skp,sp->sk", z, effects) + white)


def test_whitened_residuals_are_independent_with_variance_one() -> None:
    stops = table("clean")
    white = whitener(stops, NOISE, BASIS)
    rows = []
    for seed in range(60):
        stds = sampled(BASIS, NOISE, seed)
        fall = np.einsum("skm,sm->sk", stops.average, predict(stops, BASIS))
        left = np.where(stops.spread > 0.0, stds.binned - stops.held[:, None] + fall, 0.0)
        between, within = white.split(white.bins @ left[:, :, None])
        rows.append(between[:, 0] / np.sqrt(1.0 + NOISE.scatter**2 * white.power))
        used = (stops.spread > 0.0).sum(axis=1)
        # The level is free, so one number per stop carries no information; friction is separate.
        assert np.mean(within**2) * within[:, :, 0].size / (used.sum() - 2 * len(used)) < 1.2
    assert np.var(rows) == pytest.approx(1.0, abs=0.08)


def test_the_noise_is_estimated() -> None:
    noise = fit_with_noise(sampled(BASIS, NOISE, 5), BASIS).noise
    assert noise.speed == pytest.approx(NOISE.speed, rel=0.1)
    assert noise.scatter == pytest.approx(NOISE.scatter, rel=0.35)


def test_scatter_of_known_numbers() -> None:
    rng = np.random.default_rng(1)
    power = np.full(4000, 2.0e4)
    between = np.sqrt(1.0 + 0.02**2 * power) * rng.standard_normal(4000)
    assert likely_scatter(between, power) == pytest.approx(0.02, rel=0.04)


def test_intervals_of_a_lag_cover() -> None:
    truth = BASIS.plus(Effect(name="brake_lag", parameters={"tau": 0.15}))
    inside = 0
    for seed in range(40):
        noise = fit_with_noise(sampled(truth, NOISE, 100 + seed), truth)
        error = noise.hypothesis.free[BASE_NUMBERS] - 0.15
        inside += bool(abs(error) < 1.96 * np.sqrt(noise.covariance[BASE_NUMBERS, BASE_NUMBERS]))
    assert inside >= 34  # 95 % of 40 is 38; fewer than 34 has a chance of 1 in 50


def test_the_threshold_is_that_of_the_largest_of_many() -> None:
    rng = np.random.default_rng(2)
    largest = np.max(rng.standard_normal((2000, 50)) ** 2, axis=1)
    bound = screening.threshold(largest, 0.01)
    # 1 − (1 − p)^50 = 0.01 at p = 0.000201, a chi square of 13.8.
    assert bound == pytest.approx(13.8, abs=1.0)


def test_a_permuted_axis_is_followed_only_where_it_matters() -> None:
    clean = follow(table("clean"), fit_with_noise(table("clean"), BASIS), 1)
    assert clean[0].p_value > 0.02
    pattern = follow(table("cross"), fit_with_noise(table("cross"), BASIS), 1)
    assert pattern[0].axis.name == "roll"
    assert pattern[0].p_value < 1e-3
    low, high = part_of_axis(pattern[0])
    assert low < high
