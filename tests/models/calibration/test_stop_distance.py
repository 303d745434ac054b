"""The promised stop distance: its distribution, its table, and the line that plans keep to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.arrays import Floats, Ints
from slopewise.models.calibration import distance_model
from slopewise.models.calibration.distance_model import fit_distance
from slopewise.models.calibration.distance_table import (
    LearnedDistance,
    Stops,
    SurfaceLaw,
    learn_distance,
)
from slopewise.models.calibration.promise import beyond_interval, effective_count, promise_of
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_distance import StopDistance
from slopewise.models.stop_promise import promised_braking, promised_line

G = 9.80665
LAW = SurfaceLaw(np.array([-0.02, -0.3, -0.01, 0.45]), 0.25)
SPEEDS, GRADES = (0.8, 5.0), (-0.15, 0.15)


def stop_distance(speed: Floats, grade: Floats, force: Floats, delay: Floats) -> Floats:
    """Closed form of a stop on an even slope [m]."""
    return speed * delay + speed**2 / (2.0 * G * (force + np.sin(grade)))


def forces(speed: Floats, grade: Floats) -> Floats:
    m_m, b_m, m_b, b_b = LAW.coefficients
    return (m_m * speed + b_m) * grade + m_b * speed + b_b


def generate(
    n: int, m: int, rng: np.random.Generator, session: float = 0.05
) -> tuple[Floats, Floats, Floats, Ints]:
    """Speed, grade, distance and session of stops that scatter within sessions and between."""
    speed, grade = rng.uniform(*SPEEDS, n), rng.uniform(*GRADES, n)
    owner = np.arange(n) % m
    day = np.exp(session * rng.standard_normal(m))[owner]
    scatter = np.exp(0.03 * rng.standard_t(6, n))
    force = forces(speed, grade) * day * scatter
    return speed, grade, stop_distance(speed, grade, force, np.full(n, 0.25)), owner


def learned(n: int, m: int, seed: int, session: float = 0.05) -> LearnedDistance:
    rng = np.random.default_rng(seed)
    speed, grade, actual, owner = generate(n, m, rng, session)
    level = np.ones(n)
    predicted = LAW.features(speed, grade, level).distance
    stops = Stops(speed, grade, level, actual, predicted, owner.astype(str))
    return learn_distance(stops, LAW, (SPEEDS, GRADES))


def braking(table: StopDistance) -> Braking:
    names = ("m_m", "b_m", "m_b", "b_b")
    return Braking(
        **dict(zip(names, LAW.coefficients.tolist(), strict=True)),
        dead_time=LAW.dead_time,
        speed_range=SPEEDS,
        grade_range=GRADES,
        distance=table,
    )


@pytest.mark.parametrize("seeds", [3, pytest.param(50, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(("n", "m"), [(8, 1), (15, 3), (40, 8)])
def test_stops_of_new_sessions_keep_the_promise(n: int, m: int, seeds: int) -> None:
    beyond = {0.9: [], 0.99: []}  # type: dict[float, list[float]]
    for seed in range(seeds):
        distribution = learned(n, m, seed)
        speed, grade, actual, _ = generate(4000, 400, np.random.default_rng(1000 + seed))
        for quantile, shares in beyond.items():
            line = promised_line(braking(distribution.table), 0.0, quantile)
            x = np.column_stack((speed * grade, grade, speed, np.ones_like(speed)))
            allowed = stop_distance(
                speed, grade, x @ np.array(line.coefficients), np.full(4000, line.dead_time)
            )
            shares.append(float(np.mean(actual > allowed + line.constant)))
    for quantile, shares in beyond.items():
        assert np.mean(shares) <= 1.2 * (1.0 - quantile)


def test_more_sessions_and_less_scatter_make_it_shorter() -> None:
    few, many = learned(40, 1, 1), learned(40, 8, 1)
    similar = learned(40, 8, 1, session=0.0)
    worst = [distribution.table.worst(0.99) for distribution in (few, many, similar)]
    assert worst[0] > worst[1] > worst[2] > 1.0


def test_a_stop_that_fits_no_other_lengthens_the_promise_and_is_weighed() -> None:
    rng = np.random.default_rng(3)
    speed, grade, actual, owner = generate(40, 4, rng)
    at = LAW.features(speed, grade, np.ones(40))
    ratio = np.log(actual / at.distance)
    plain = fit_distance(at, ratio, owner)
    ratio[7] += 0.6
    outlier = fit_distance(at, ratio, owner)
    quantiles = np.array([0.5, 0.999])
    before, after = plain.log_ratio(at, quantiles), outlier.log_ratio(at, quantiles)
    assert np.abs(after[0] - before[0]).max() < 0.03  # the median moves by less than 3 %
    assert np.all(after[1] > before[1])
    assert np.all(after[1] >= ratio[7] - 0.1)  # never below the worst stop seen


@pytest.mark.parametrize("outlier", [0.0, 0.6, -2.0])
def test_points_dropped_early_would_have_counted_for_nothing(
    outlier: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    speed, grade, actual, owner = generate(30, 12, np.random.default_rng(5))
    at = LAW.features(speed, grade, np.ones(30))
    ratio = np.log(actual / at.distance)
    ratio[::4] += outlier
    quantiles = np.array([0.5, 0.999])
    quick = fit_distance(at, ratio, owner)
    monkeypatch.setattr(distance_model, "_HOPELESS", np.inf)
    full = fit_distance(at, ratio, owner)
    assert len(quick.weight) == len(full.weight)
    assert quick.log_ratio(at, quantiles) == pytest.approx(full.log_ratio(at, quantiles), abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.6, 0.9, 0.99, 0.999, 0.9999]))
def test_the_line_of_a_plan_allows_no_less_than_the_table(seed: int, quantile: float) -> None:
    rng = np.random.default_rng(seed)
    speeds = np.sort(rng.uniform(0.5, 6.0, 4))
    grades = np.array([-0.15, 0.0, 0.15])
    slope = rng.uniform(-0.1, 0.1, (3, 1))
    middle = 1.05 + rng.uniform(0.0, 0.2) + slope * np.sign(rng.normal()) + 0.1 / speeds
    rows = [middle * (1.0 + 0.1 * k) for k in range(3)]
    table = StopDistance(
        quantiles=(0.5, 0.99, 0.9999),
        speeds=tuple(speeds.tolist()),
        grades=tuple(grades.tolist()),
        levels=(1.0,),
        stop_factor=tuple(tuple(row) for block in rows for row in block.tolist()),
    )
    line = promised_line(braking(table), 0.0, quantile)
    theta, v = (a.ravel() for a in np.meshgrid(grades, speeds, indexing="ij"))
    x = np.column_stack((v * theta, theta, v, np.ones_like(v)))
    force = x @ np.array(line.coefficients)
    assert np.all(force <= forces(v, theta) + 1e-9)  # never stronger than the mean
    allowed = stop_distance(v, theta, force, np.full(len(v), line.dead_time)) + line.constant
    mean = stop_distance(v, theta, forces(v, theta), np.full(len(v), LAW.dead_time))
    required = table.row(quantile).ravel() * mean
    assert np.all(allowed >= required * (1.0 - 1e-6))
    assert np.median(allowed / required) < 1.25


def test_plans_have_the_promise_as_a_margin_and_keeps_the_mean() -> None:
    base = braking(learned(40, 4, 5).table)
    promise = promised_braking(base, 0.0, 0.999)
    assert promise.distance is None
    assert promise.covariance is not None
    assert (promise.m_m, promise.b_m, promise.m_b, promise.b_b) == (
        base.m_m,
        base.b_m,
        base.m_b,
        base.b_b,
    )
    line = promised_line(base, 0.0, 0.999)
    phi = np.array([2.0 * 0.1, 0.1, 2.0, 1.0])
    margin = 3.0902323 * np.sqrt(phi @ np.array(promise.covariance) @ phi)
    given_up = phi @ (LAW.coefficients - np.array(line.coefficients))
    assert margin == pytest.approx(given_up, rel=1e-6)
    as_mean = promised_braking(base, 0.0, 0.999, as_mean=True)
    assert as_mean.b_b == pytest.approx(line.coefficients[3])


def test_a_model_without_a_table_stays_as_it_is() -> None:
    plain = dataclasses.replace(braking(learned(8, 1, 1).table), distance=None)
    assert promised_braking(plain, 0.0, 0.99) is plain


def test_what_stops_support_is_counted() -> None:
    promise = promise_of(learned(40, 4, 2), 0.99)
    assert promise.counted_here == pytest.approx(40 / 41)
    assert promise.counted_new == pytest.approx(4 / 5)
    assert (promise.more_stops, promise.more_sessions) == (59, 95)
    assert promise.held_out == 40
    assert promise.interval[0] <= promise.held_out_beyond / 40 <= promise.interval[1]
    assert "drive 59 more stops" in promise.sentence()
    alone = promise_of(learned(8, 1, 2), 0.99)
    assert alone.interval is None
    assert "other days" in alone.sentence()


def test_the_interval_is_that_of_clopper_and_pearson() -> None:
    low, high = beyond_interval(2, 40)
    assert (low, high) == pytest.approx((0.0061, 0.1692), abs=1e-4)  # published tables
    values = np.repeat([0.0, 1.0, 2.0], 10)
    assert effective_count(values, np.repeat([0, 1, 2], 10), 30) == pytest.approx(3.0)
    rng = np.random.default_rng(0)
    assert effective_count(rng.standard_normal(300), np.repeat(np.arange(3), 100), 300) > 100.0


def test_a_table_out_of_order_is_refused() -> None:
    with pytest.raises(ParameterError, match="quantile"):
        StopDistance(
            quantiles=(0.5, 0.9),
            speeds=(1.0,),
            grades=(0.0,),
            levels=(1.0,),
            stop_factor=((1.2,), (1.1,)),
        )
