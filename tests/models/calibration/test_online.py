"""Stops learned while driving: stream, recursive fit and change detection."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.calibration.force_fit import WEAK_PRIOR
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.calibration.online import OnlineBraking
from slopewise.models.calibration.recursive import Acceptance, RecursiveForce, RecursiveSettings
from slopewise.models.force_design import corner_design
from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from tests.models.calibration.plant import Plant, drive
from tests.world.vehicles import BASE

KNOWN = replace(BASE.braking, b_b=0.37, covariance=None)


def driven(plant: Plant, count: int, seed: int) -> list[StreamedStop]:
    log, _, _ = drive(plant, count, seed)
    stream = StopStream(KNOWN.dead_time)
    rows = zip(*(log[n].tolist() for n in ("t", "v", "v_cmd", "pitch")), strict=True)
    return [stop for row in rows if (stop := stream.feed(*row)) is not None]


def learned(online: OnlineBraking, surface: str = "") -> LearnedForce:
    return online.learned()[surface]


def test_it_learns_while_driving() -> None:
    plant = Plant()
    online = OnlineBraking(KNOWN)
    assert not online.learned()
    done = [online.take(stop) for stop in driven(plant, 120, 0)]
    assert len(done) == 120
    assert sum(stop is Acceptance.ACCEPTED for stop in done) > 110
    v, theta = np.meshgrid(np.linspace(1, 4, 5), np.linspace(-0.25, 0.25, 5))
    m_m, b_m, m_b, b_b = online.coefficients()
    force = (m_m * v + b_m) * theta + m_b * v + b_b
    assert np.max(np.abs(force / plant.force(theta, v) - 1.0)) < 0.06
    assert learned(online).valid
    assert learned(online).accepted > 110


def test_stops_whose_grade_has_the_wrong_sign_raise_no_force() -> None:
    online = OnlineBraking(KNOWN)
    corners = corner_design(KNOWN.speed_range, KNOWN.grade_range)
    first = corners @ online.coefficients()
    for stop in driven(Plant(b_b=0.45), 120, 0):
        flipped = replace(
            stop, grade=-stop.grade, force_ratio=stop.force_ratio + 2.0 * math.sin(stop.grade)
        )
        online.take(flipped)
    assert np.all(corners @ online.coefficients() <= first + 1e-9)
    assert not learned(online).valid


def test_a_stop_with_samples_lost_is_discarded() -> None:
    def stops(lost: int) -> int:
        stream, time = StopStream(0.3), np.arange(0.0, 8.0, 0.02)
        speed = np.clip(2.0 - 4.0 * (time - 4.3), 0.0, 2.0)
        logged = np.r_[:225, 225 + lost : len(time)]
        command = np.where(time < 4.0, 2.0, 0.0)[logged]
        rows = zip(time[: len(logged)], speed[logged], command, strict=True)
        return sum(stream.feed(*row, 0.0) is not None for row in rows)

    assert stops(0) == 1
    assert stops(15) == 0


def test_a_sample_is_processed_in_microseconds() -> None:
    log, _, _ = drive(Plant(), 60, 0)
    rows = list(zip(*(log[n].tolist() for n in ("t", "v", "v_cmd", "pitch")), strict=True))
    stream, online = StopStream(KNOWN.dead_time), OnlineBraking(KNOWN)
    begin = time.process_time()
    for row in rows:
        if (stop := stream.feed(*row)) is not None:
            online.take(stop)
    assert (time.process_time() - begin) / len(rows) < 20e-6


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
    assert learned(online).valid
    for k in range(60):
        weak = k % every == 0
        online.take(streamed(0.24 if weak else 0.40, 40.0 + k, rng))
        if k > every:
            assert level_force(online) < 0.26
            assert not learned(online).valid


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


TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])
START = np.array([0.0, -0.1, 0.0, 0.5])
PRIOR = np.diag(np.square(WEAK_PRIOR))


def stops(n: int, seed: int, truth: np.ndarray = TRUTH, level: bool = False) -> list[tuple]:
    rng = np.random.default_rng(seed)
    v = rng.uniform(1.0, 4.0, n)
    theta = np.zeros(n) if level else rng.uniform(-0.25, 0.25, n)
    force = (truth[0] * v + truth[1]) * theta + truth[2] * v + truth[3]
    force = force + 0.01 * rng.standard_normal(n)
    return list(zip(v.tolist(), theta.tolist(), force.tolist(), [0.002] * n, strict=True))


def followed(some: list[tuple], **settings: object) -> RecursiveForce:
    estimate = RecursiveForce(START, PRIOR, RecursiveSettings(**settings))  # type: ignore[arg-type]
    for stop in some:
        estimate.update(*stop)
    return estimate


def test_without_forgetting_it_is_least_squares() -> None:
    some = stops(50, 0)
    estimate = followed(some, steady=(0.0, 0.0, 0.0, 0.0), gate=1e9)
    x = np.array([(v * g, g, v, 1.0) for v, g, *_ in some])
    noise = 0.002**2 + 0.01**2
    information = x.T @ x / noise + np.linalg.inv(PRIOR)
    expected = np.linalg.solve(
        information, x.T @ [f for _, _, f, _ in some] / noise + np.linalg.solve(PRIOR, START)
    )
    np.testing.assert_allclose(estimate.coefficients, expected, rtol=1e-6)
    np.testing.assert_allclose(estimate.covariance, np.linalg.inv(information), rtol=1e-5)


def test_it_finds_the_truth_and_its_covariance_stays_bounded() -> None:
    errors = []
    for seed in range(20):
        estimate = followed(stops(600, seed))
        errors.append((estimate.coefficients - TRUTH) / np.sqrt(np.diag(estimate.covariance)))
    assert np.mean(np.abs(errors) < 2.0) > 0.9
    assert np.linalg.eigvalsh(estimate.covariance)[0] > 0.0


def test_level_ground_for_hours_washes_no_slope_away() -> None:
    estimate = followed(stops(100, 0))
    before = estimate.coefficients.copy()
    std = np.sqrt(np.diag(estimate.covariance))
    for stop in stops(3000, 1, level=True):
        estimate.update(*stop)
    assert np.all(np.abs(estimate.coefficients[:2] - before[:2]) < std[:2])
    assert np.all(np.sqrt(np.diag(estimate.covariance))[:2] < 1.5 * std[:2])


def test_single_outliers_are_rejected() -> None:
    estimate = followed(stops(100, 0))
    before = estimate.coefficients.copy()
    for factor in (0.5, 1.8, 0.4):
        assert estimate.update(2.0, 0.0, 0.43 * factor, 0.002) is Acceptance.GATED
        np.testing.assert_array_equal(estimate.coefficients, before)
        assert estimate.update(*stops(1, 7)[0]) is Acceptance.ACCEPTED
        before = estimate.coefficients.copy()
    assert estimate.gated == 3


@pytest.mark.parametrize(("factor", "needed"), [(0.6, 2), (1.6, 4)])
def test_a_lasting_change_is_followed_and_weaker_brakes_sooner(factor: float, needed: int) -> None:
    estimate = followed(stops(100, 0))
    outcomes = [estimate.update(*stop) for stop in stops(needed, 3, factor * TRUTH)]
    assert outcomes == [Acceptance.GATED] * (needed - 1) + [Acceptance.CHANGED]
    for stop in stops(60, 4, factor * TRUTH):
        estimate.update(*stop)
    np.testing.assert_allclose(estimate.coefficients[3], factor * TRUTH[3], atol=0.02)


def test_what_says_nothing_is_left_out() -> None:
    estimate = followed(stops(20, 0))
    before = estimate.coefficients.copy()
    for stop in ((0.2, 0.0, 0.4, 0.01), (np.nan, 0.0, 0.4, 0.01), (2.0, 0.0, np.inf, 0.01)):
        assert estimate.update(*stop) is Acceptance.UNINFORMATIVE
    np.testing.assert_array_equal(estimate.coefficients, before)


def test_age_widens_towards_the_beginning_and_no_farther() -> None:
    estimate = followed(stops(100, 0))
    widths, x = [], np.array([0.2, 0.1, 2.0, 1.0])
    for seconds in (0.0, 600.0, 3600.0, 1e9):
        estimate.age(seconds, 3600.0)
        widths.append(x @ estimate.covariance @ x)
    assert widths == sorted(widths)
    np.testing.assert_allclose(estimate.covariance, PRIOR, atol=1e-9)
