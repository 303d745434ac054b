"""Estimator of resistances and slip track, its filter, and the bias of the gyro."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from slopewise.models.errors import ParameterError
from slopewise.models.terrain.estimator import DriveSample, GyroBias, TerrainEstimator
from slopewise.models.terrain.observation import TerrainEstimate
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.settings import FilterSettings
from slopewise.models.terrain.slip_track_filter import SlipTrackFilter, steady_state_variance
from tests.models.terrain import plant
from tests.models.terrain.vehicles import estimator_of, observe, samples_of, vehicle_of

LATE = DriveSample(0.0, 9.0, -9.0, 9.0, 9.0, 9.0, 0.0, 0.0)

GROUNDS = [plant.ASPHALT, plant.DIRT, plant.PLOWED, plant.SAND]


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("spot", [True, False], ids=["on the spot", "in a turn"])
@pytest.mark.parametrize("signed", [True, False], ids=["signed", "magnitudes"])
def test_a_square_determines_all_three(ground, spot, signed):
    rate = np.pi / 4 if spot else 0.35
    log = plant.drive(plant.square(on_the_spot=spot, rate=rate), ground, gyro_bias=0.05)
    if not signed:
        log["current_left"], log["current_right"] = (
            np.abs(log["current_left"]),
            np.abs(log["current_right"]),
        )
    estimator = estimator_of()
    estimates = observe(estimator, log)
    f_r, mu_t, b_s = estimates[-1].known.values
    deviations = estimates[-1].known.stds
    assert f_r == pytest.approx(ground.f_r, abs=0.01)
    assert mu_t == pytest.approx(ground.mu_t, abs=0.01)
    assert b_s == pytest.approx(ground.slip_track, abs=0.06)
    truths = (ground.f_r, ground.mu_t, ground.slip_track)
    for value, truth, std in zip((f_r, mu_t, b_s), truths, deviations, strict=True):
        assert abs(value - truth) < 4.0 * std
        assert 0.0 < std < 0.05 + 0.36 * truth
    turn = Phase.SPOT if spot else Phase.TURN
    assert sum(o.phase is turn for o in estimates) == 4
    assert estimator.bias.bias == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize("rate", [0.35, -0.35])
@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_left_and_right_forward_and_back_are_the_same_ground(rate, speed):
    legs = plant.square(rate=rate, speed=speed, on_the_spot=False)
    for signed in (True, False):
        log = plant.drive(legs, plant.DIRT, pitch=0.05, roll=0.1)
        if not signed:
            log["current_left"] = np.abs(log["current_left"])
            log["current_right"] = np.abs(log["current_right"])
        f_r, mu_t, b_s = observe(estimator_of(), log)[-1].known.values
        assert f_r == pytest.approx(0.13, abs=0.01)
        # noise of a magnitude near 0 does not average out
        assert mu_t == pytest.approx(0.20, abs=0.01 if signed else 0.02)
        assert b_s == pytest.approx(1.15, abs=0.06)


def test_a_pivot_turn_determines_the_slip_track_only():
    rate = 2.0 * 0.5 / 1.15  # the inner wheels stand
    log = plant.drive(plant.square(on_the_spot=False, rate=rate), plant.DIRT)
    turns = [o for o in observe(estimator_of(), log) if o.phase is Phase.TURN]
    assert len(turns) == 4
    assert turns[-1].measured.slip_track.value == pytest.approx(1.15, abs=0.06)
    assert np.isnan(turns[-1].measured.lateral_resistance.value)
    assert turns[-1].measured.lateral_resistance.note == "inner wheels stand"


@pytest.mark.parametrize("pitch", [-0.15, 0.15])
def test_slope_and_idle_current_are_taken_out(pitch):
    log = plant.drive(plant.square(), plant.DIRT, pitch=pitch, roll=0.1)
    f_r, mu_t, _ = observe(estimator_of(), log)[-1].known.values
    assert f_r == pytest.approx(0.13, abs=0.01)  # sin(0.15) would be 0.15 more or less
    assert mu_t == pytest.approx(0.20, abs=0.01)
    # a vehicle file without the idle current: by hand τ k_t 2 I / (r W) = 0.0810 more
    vehicle = vehicle_of(plant.Body(idle_current=0.0))
    blind = TerrainEstimator(vehicle, slip_track=1.1, motion_resistance=TerrainEstimate(0.1, 0.1))
    assert observe(blind, log)[-1].known.values[0] - f_r == pytest.approx(0.0913, abs=0.002)


def test_downhill_magnitudes_of_currents_are_ignored():
    log = plant.drive([(2, 0, 0), (10, 0.5, 0.0)], plant.DIRT, pitch=0.3)
    assert log["current_left"].min() < -1.0  # the motors brake
    estimates = observe(estimator_of(), log)
    assert estimates[-1].known.values[0] == pytest.approx(0.13, abs=0.02)
    log["current_left"] = np.abs(log["current_left"])
    log["current_right"] = np.abs(log["current_right"])
    estimates = observe(estimator_of(), log)
    assert np.isnan(estimates[-1].measured.motion_resistance.value)
    assert "downhill" in estimates[-1].measured.motion_resistance.note


def test_stuck_is_named_and_not_averaged_in():
    legs = [*plant.square(sides=2)[:-1], (0.5, 0.0, 0.0), (10.0, 0.0, np.nan), (0.5, 0.0, 0.0)]
    estimator = estimator_of()
    log = plant.drive(legs, plant.DIRT)
    estimates = observe(estimator, log)
    stuck = [o for o in estimates if o.phase is Phase.STUCK]
    assert stuck
    begin = 2.0 + 2 * (8 + 0.3 + 2 + 0.3) + 0.5
    assert stuck[0].begin == pytest.approx(begin + 0.7, abs=0.3)
    assert sum(o.end - o.begin for o in stuck) > 9.0
    assert estimates[-1].known.values[2] == pytest.approx(1.15, abs=0.06)
    assert estimator.filter.slip_track == pytest.approx(1.15, abs=0.06)
    # the same filter without the phases would have followed the spinning wheels
    assert np.isnan(stuck[0].measured.values).all()


def test_a_change_of_ground_is_followed_within_two_turns():
    legs = plant.square(sides=8)
    change = 2.0 + 4 * 10.6

    def ground(s):
        return plant.ASPHALT if s < change else plant.SAND

    estimates = [
        o for o in observe(estimator_of(), plant.drive(legs, ground)) if o.phase is Phase.SPOT
    ]
    before, after = estimates[:4], estimates[4:]
    assert before[-1].measured.slip_track.value == pytest.approx(1.0, abs=0.06)
    assert after[1].measured.slip_track.value == pytest.approx(1.62, abs=0.08)
    assert after[1].known.values[0] == pytest.approx(0.30, abs=0.02)
    assert after[1].known.values[1] == pytest.approx(0.11, abs=0.01)


def test_before_the_first_straight_the_assumed_resistance_is_reported():
    estimates = observe(estimator_of(), plant.drive([(1, 0, 0), (5, 0.0, 0.8)], plant.DIRT))
    assert estimates[0].measured.lateral_resistance.note == "f_r assumed"
    assert estimates[0].measured.lateral_resistance.std > 0.1


def test_unusable_samples_and_gaps_end_a_stretch():
    log = plant.drive([(2, 0, 0), (4, 0.5, 0.0)], plant.DIRT)
    rows = samples_of(log)
    reference = estimator_of()
    assert sum(reference.update(row) is not None for row in rows) + bool(reference.finish()) == 1
    holed = estimator_of()
    estimates = [holed.update(row, usable=not 400 <= i < 410) for i, row in enumerate(rows)]
    estimates.append(holed.finish())
    ends = [o for o in estimates if o is not None]
    assert len(ends) == 2
    assert ends[0].end < 4.0
    assert ends[1].begin > 4.1
    gap = estimator_of()
    estimates = [gap.update(row) for i, row in enumerate(rows) if not 400 <= i < 500]
    assert len([o for o in [*estimates, gap.finish()] if o is not None]) == 2


def test_late_samples_and_numbers_that_are_none_change_nothing():
    log = plant.drive(plant.square(sides=2), plant.DIRT)
    rows = samples_of(log)
    clean, troubled = estimator_of(), estimator_of()
    expected = [clean.update(row) for row in rows]
    estimates = []
    for row in rows:
        estimates.append(troubled.update(row))
        assert troubled.update(LATE._replace(time=row.time - 0.02)) is None
        assert troubled.update(row) is None  # a second time
        assert troubled.update(row._replace(time=np.nan)) is None
    assert troubled.filter.slip_track == clean.filter.slip_track
    assert repr([o for o in estimates if o]) == repr([o for o in expected if o])
    holed = estimator_of()
    for i, row in enumerate(rows):
        broken = list(row)
        if 300 <= i < 320:
            broken[1 + i % 7] = np.nan
        holed.update(DriveSample(*broken))
    assert np.isfinite(holed.known.values).all()
    assert holed.known.values == pytest.approx(clean.known.values, abs=0.03)


@given(
    st.lists(
        st.tuples(
            st.floats(0.0, 1.0),
            st.floats(-2, 2),
            st.floats(-2, 2),
            st.floats(-3, 3),
            st.floats(-50, 50),
            st.floats(-50, 50),
            st.floats(-1, 1),
            st.floats(-1, 1),
        ),
        max_size=60,
    )
)
def test_any_samples_leave_sound_numbers(steps):
    estimator = estimator_of()
    now = 0.0
    estimates = []
    for step in steps:
        now += step[0]
        estimates.append(estimator.update(DriveSample(now, *step[1:])))
    estimates.append(estimator.finish())
    assert estimator.filter.variance > 0.0
    assert np.isfinite(estimator.filter.inverse)
    assert np.isfinite(estimator.bias.bias)
    for observation in estimates:
        if observation is not None:
            assert observation.end >= observation.begin
            for value, std in zip(observation.known.values, observation.known.stds, strict=True):
                assert np.isnan(value) or std >= 0.0


def test_a_vehicle_without_motor_constants_is_refused():
    import dataclasses

    for name in ("motor_torque_constant", "gear_ratio"):
        vehicle = dataclasses.replace(vehicle_of(), **{name: None})
        with pytest.raises(ParameterError, match=f"vehicle.{name}: expected a number"):
            TerrainEstimator(vehicle, slip_track=1.1, motion_resistance=TerrainEstimate(0.1, 0.1))


def test_first_samples_give_their_mean():
    random = np.random.default_rng(1)
    values = 0.03 + 0.01 * random.normal(size=400)
    gyro = GyroBias()
    assert gyro.bias == 0.0
    for value in values:
        gyro.update(value, 0.01)
    assert gyro.bias == pytest.approx(np.mean(values), rel=1e-9)


def test_drift_is_followed_and_the_past_forgotten():
    gyro = GyroBias(memory=5.0)
    for _ in range(3000):
        gyro.update(0.1, 0.01)
    for _ in range(3000):
        gyro.update(-0.1, 0.01)
    assert gyro.bias == pytest.approx(-0.1, abs=0.001)


PRINT = FilterSettings()


def settled(difference: float, settings: FilterSettings) -> float:
    """Variance after very many samples."""
    observer = SlipTrackFilter(1.0, settings)
    for _ in range(20_000):
        observer.update(difference, 0.8, settings.sample_time)
    return observer.variance


@pytest.mark.parametrize("difference", [0.3, 0.785, 1.2, -1.2, 2.0])
@pytest.mark.parametrize("settings", [PRINT, FilterSettings(yaw_rate_std=0.02, sample_time=0.1)])
def test_variance_settles_at_the_riccati_solution(difference, settings):
    # scipy solves the same equation by another way, for the variance before a sample
    before = solve_discrete_are(
        [[1.0]], [[difference]], [[settings.process_variance]], [[settings.yaw_rate_std**2]]
    )[0, 0]
    ours, after = steady_state_variance(difference, settings)
    assert ours == pytest.approx(before, rel=1e-9)
    assert settled(difference, settings) == pytest.approx(after, rel=1e-9)


def test_print_settles_near_its_figure_at_one_metre_and_twenty():
    # Slip 4.1: 0.0025; by hand H² = Q R/(P² − P Q) = 9e-6/6e-6, H = 1.2247
    assert steady_state_variance(math.sqrt(1.5))[0] == pytest.approx(0.0025, rel=1e-12)
    assert steady_state_variance(1.2)[0] == pytest.approx(0.00255, abs=1e-5)


@given(st.floats(0.1, 3.0), st.floats(0.3, 2.0), st.floats(1e-4, 1.0), st.floats(0.001, 0.5))
def test_one_sample_is_bayes_rule(difference, slip_track, variance, elapsed):
    # product of two normal densities on a fine grid, by quadrature
    observer = SlipTrackFilter(slip_track, FilterSettings(initial_std=math.sqrt(variance)))
    predicted = variance + 0.01 * elapsed
    width = 8.0 * math.sqrt(predicted) + 2.0 * abs(0.7 / difference - 1.0 / slip_track)
    x = np.linspace(1.0 / slip_track - width, 1.0 / slip_track + width, 200_001)
    prior, likelihood = (x - 1.0 / slip_track) ** 2 / predicted, (0.7 - difference * x) ** 2 / 0.09
    density = np.exp(-0.5 * (prior + likelihood - np.min(prior + likelihood)))
    density /= np.trapezoid(density, x)
    mean = np.trapezoid(x * density, x)
    observer.update(difference, 0.7, elapsed)
    assert observer.inverse == pytest.approx(mean, abs=2e-3 * math.sqrt(predicted))
    spread = np.trapezoid((x - mean) ** 2 * density, x)
    assert observer.variance == pytest.approx(spread, rel=2e-2)


def test_the_spread_it_claims_is_the_spread_it_has():
    # the truth walks at random, as the model of Slip (5) says: normalised errors have variance 1
    random = np.random.default_rng(2)
    errors = []
    for _ in range(300):
        x = 1.0 + 0.3 * random.normal()
        observer = SlipTrackFilter(1.0)
        for _ in range(60):
            x += 0.01 * random.normal()
            observer.update(1.2, 1.2 * x + random.normal(0.0, 0.3), 0.01)
        errors.append((observer.inverse - x) / math.sqrt(observer.variance))
    assert np.var(errors) == pytest.approx(1.0, abs=0.25)


def test_no_turning_is_an_infinite_slip_track():
    observer = SlipTrackFilter(1.0)
    for _ in range(2000):
        observer.update(1.2, -0.1, 0.01)
    assert observer.slip_track == math.inf
    assert observer.slip_track_std == math.inf
