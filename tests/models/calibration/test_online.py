"""Learning while driving, from samples to coefficients, on the plant that shares no code."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.calibration.online import FifoForce, OnlineBraking
from slopewise.models.calibration.recursive import Acceptance
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.models.surface_braking import SurfaceBraking
from tests.models.calibration.plant import Plant, drive
from tests.models.models_for_tests import BASE

KNOWN = replace(BASE.braking, b_b=0.37, covariance=None)


def rows(plant: Plant, stops: int, seed: int) -> list[tuple[float, ...]]:
    log, _, _ = drive(plant, stops, seed)
    return list(zip(*(log[n].tolist() for n in ("t", "v", "v_cmd", "pitch")), strict=True))


def test_it_learns_while_driving() -> None:
    plant = Plant()
    online = OnlineBraking(KNOWN)
    assert not online.valid()
    done = [stop for row in rows(plant, 120, 0) if (stop := online.feed(*row)) is not None]
    assert len(done) == 120
    assert sum(stop.outcome is Acceptance.ACCEPTED for stop in done) > 110
    v, theta = np.meshgrid(np.linspace(1, 4, 5), np.linspace(-0.25, 0.25, 5))
    m_m, b_m, m_b, b_b = online.coefficients()
    learned = (m_m * v + b_m) * theta + m_b * v + b_b
    assert np.max(np.abs(learned / plant.force(theta, v) - 1.0)) < 0.06
    assert online.valid()
    assert online.counts()[0] > 110


def test_weaker_brakes_are_planned_with_after_two_stops() -> None:
    online = OnlineBraking(KNOWN)
    for row in rows(Plant(), 60, 0):
        online.feed(*row)
    before = online.coefficients()[3]
    worn = Plant(b_b=0.28)
    for t, *row in rows(worn, 3, 5):
        online.feed(1e5 + t, *row)
    assert online.coefficients()[3] < before - 0.08


def test_each_surface_is_followed_on_its_own() -> None:
    known = replace(KNOWN, terrain={"gravel": SurfaceBraking(b_b=0.30)})
    online = OnlineBraking(known)
    for row in rows(Plant(), 40, 0):
        online.feed(*row, surface="clay")
    assert online.counts("clay")[0] > 35
    assert online.counts("gravel") == (0, 0)
    assert online.coefficients("gravel")[3] == pytest.approx(0.30)
    assert online.coefficients("")[3] == pytest.approx(KNOWN.b_b)
    assert online.coefficients("clay")[3] != pytest.approx(KNOWN.b_b, abs=1e-3)


def test_a_sample_is_processed_in_microseconds() -> None:
    samples = rows(Plant(), 60, 0)
    online = OnlineBraking(KNOWN)
    begin = time.process_time()
    for row in samples:
        online.feed(*row)
    assert (time.process_time() - begin) / len(samples) < 20e-6


def test_age_is_never_a_rise() -> None:
    online = OnlineBraking(KNOWN)
    for row in rows(Plant(), 40, 0):
        online.feed(*row)
    before, std = online.coefficients(), np.diag(online.covariance())
    online.age(7200.0)
    v, theta = np.meshgrid([1.0, 4.0], [-0.26, 0.26])

    def force(c: np.ndarray) -> np.ndarray:
        return np.asarray((c[0] * v + c[1]) * theta + c[2] * v + c[3])

    assert np.all(force(online.coefficients()) <= force(before) + 1e-12)
    assert np.all(np.diag(online.covariance()) > std)


def test_the_fifo_forgets_the_oldest() -> None:
    rng = np.random.default_rng(0)
    fifo = FifoForce(np.zeros(4), length=40)
    for k in range(120):
        v, theta = rng.uniform(1, 4), rng.uniform(-0.2, 0.2)
        b_b = 0.4 if k < 60 else 0.3
        force = (-0.03 * v - 0.35) * theta + 0.015 * v + b_b + 0.003 * rng.standard_normal()
        fit = fifo.take(StreamedStop(float(k), v, theta, force, 0.002, 0.3))
    np.testing.assert_allclose(fit.coefficients, [-0.03, -0.35, 0.015, 0.3], atol=0.04)
    assert len(fit.regression.kept) == 40


def streamed(force: float, time_: float, rng: np.random.Generator) -> StreamedStop:
    """A stop with this force on level ground, on a slope as the known brakes have it."""
    v, theta = float(rng.uniform(1, 4)), float(rng.uniform(-0.2, 0.2))
    share = 1.0 + (KNOWN.m_m * v + KNOWN.b_m) * theta / 0.4
    noise = 0.004 * rng.standard_normal()
    return StreamedStop(time_, v, theta, share * force + noise, 0.003, 0.3)


def level_force(online: OnlineBraking) -> float:
    _, _, m_b, b_b = online.coefficients()
    return float(m_b * 4.0 + b_b)


@pytest.mark.parametrize("every", [2, 3, 6])
def test_weak_stops_between_others_are_planned_with(every: int) -> None:
    """Never two in a row, so that they are no change; the estimate of the mean stays above them."""
    rng = np.random.default_rng(every)
    online = OnlineBraking(replace(KNOWN, m_b=0.0))
    for k in range(40):
        online.take(streamed(0.40, float(k), rng))
    assert online.valid()
    for k in range(60):
        weak = k % every == 0
        online.take(streamed(0.24 if weak else 0.40, 40.0 + k, rng))
        if k > every:
            assert level_force(online) < 0.26
            assert not online.valid()


def test_a_single_weak_stop_is_no_state_of_the_brakes_and_the_rest_is_recovered() -> None:
    rng = np.random.default_rng(0)
    online = OnlineBraking(replace(KNOWN, m_b=0.0))
    for k in range(40):
        online.take(streamed(0.40, float(k), rng))
    before = level_force(online)
    online.take(streamed(0.24, 40.0, rng))
    assert level_force(online) == pytest.approx(before, abs=0.02)
    for k in range(2):
        online.take(streamed(0.24 if k else 0.40, 41.0 + k, rng))
    assert level_force(online) < 0.26
    stops = 0
    while level_force(online) < 0.38:
        online.take(streamed(0.40, 50.0 + stops, rng))
        stops += 1
        assert stops < 60
    assert stops > 30  # 24 that forget, then a hundredth of the weight each


def test_no_number_of_stops_makes_brakes_of_another_vehicle() -> None:
    rng = np.random.default_rng(1)
    online = OnlineBraking(replace(KNOWN, m_b=0.0, b_b=0.4))
    for k in range(3000):
        online.take(streamed(1.15, float(k), rng))
    assert level_force(online) <= 1.5 * 0.4 + 1e-9


@pytest.mark.nightly
def test_false_stops_never_publish_more_than_the_share() -> None:
    rng = np.random.default_rng(2)
    online = OnlineBraking(replace(KNOWN, m_b=0.0, b_b=0.4))
    for k in range(100_000):
        force = 0.4 if rng.random() < 0.2 else float(rng.choice([0.05, 0.4, 0.8, 1.2, 3.0]))
        online.take(streamed(force, float(k), rng))
        assert level_force(online) <= 1.5 * 0.4 + 1e-9
