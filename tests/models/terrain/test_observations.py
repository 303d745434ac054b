"""Observations of terrain: phases, contacts and resistances."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.laws.slip_track import rotation_centres, slip_track
from slopewise.models.terrain.classes import by_rules
from slopewise.models.terrain.observation import TerrainEstimate
from slopewise.models.terrain.phases import MotionPhases, Phase
from slopewise.models.terrain.resistances import (
    Drivetrain,
    SteadyStretch,
    lateral_resistance_of,
    motion_resistance_of,
    standard_error,
    turning_thrust_of,
)
from slopewise.models.terrain.settings import MotionSettings, ResistanceSettings
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain.vehicles import vehicle_of

B = 0.6


def phases_of(v, dv, w, dt=0.01):
    tracker = MotionPhases(B, MotionSettings())
    return [
        tracker.update(dt, a - 0.5 * d, a + 0.5 * d, rate)
        for a, d, rate in zip(v, dv, w, strict=True)
    ]


@pytest.mark.parametrize("lag", [0.05, 0.15, 0.3])
def test_onset_of_steady_turning_waits_for_the_yaw_rate(lag):
    # ΔV steps at 1 s, the yaw rate follows with a lag: onset when it is within some percent
    t = np.arange(0.0, 6.0, 0.01)
    dv = np.where(t >= 1.0, 0.9, 0.0)
    w = np.where(t >= 1.0, 0.8 * (1.0 - np.exp(-(t - 1.0) / lag)), 0.0)
    phases = phases_of(np.zeros_like(t), dv, w)
    onset = t[[p is Phase.SPOT for p in phases].index(True)]
    assert 0.8 * np.exp(-(onset - 1.0) / lag) < 0.1 * 0.8
    assert onset - 1.0 < 0.8 + 4.0 * lag
    assert all(p is Phase.SPOT for p in phases[int(100 * onset) + 1 :])


def test_speeding_up_is_no_steady_straight():
    t = np.arange(0.0, 6.0, 0.01)
    v = np.clip(0.8 * t, 0.0, 1.6)
    phases = phases_of(v, 0 * t, 0 * t)
    steady = np.array([p is Phase.STRAIGHT for p in phases])
    assert not steady[:100].any()
    assert steady[400:].all()


def test_noise_does_not_end_a_straight_or_a_turn():
    random = np.random.default_rng(1)
    n = 2000
    v = 0.5 + 0.01 * random.normal(size=n)
    phases = phases_of(v, 0.005 * random.normal(size=n), 0.03 * random.normal(size=n))
    assert {*phases[100:]} == {Phase.STRAIGHT}
    w = 0.8 + 0.1 * random.normal(size=n)
    phases = phases_of(np.zeros(n), 0.9 + 0.007 * random.normal(size=n), w)
    assert {*phases[200:]} == {Phase.SPOT}


def test_spinning_is_withheld_at_once_and_named_when_it_lasts():
    t = np.arange(0.0, 6.0, 0.01)
    w = np.where(t < 3.0, 0.8, 0.02)
    tracker = MotionPhases(B, MotionSettings())
    phases, withheld = [], []
    for rate in w:
        phases.append(tracker.update(0.01, -0.45, 0.45, rate))
        withheld.append(tracker.withheld)
    assert phases[299] is Phase.SPOT
    assert not withheld[299]
    assert all(withheld[330:])  # the smoothed rate is low after 0.2 s
    assert Phase.SPOT not in phases[330:]
    assert phases[330] is not Phase.STUCK
    assert {*phases[400:]} == {Phase.STUCK}


def test_turning_against_the_wheels_is_spinning_too():
    tracker = MotionPhases(B, MotionSettings())
    for _ in range(200):
        tracker.update(0.01, -0.45, 0.45, -0.3)
    assert tracker.phase is Phase.STUCK


def test_being_turned_at_rest_is_no_rest():
    n = 300
    assert phases_of(np.zeros(n), np.zeros(n), np.zeros(n))[-1] is Phase.REST
    assert phases_of(np.zeros(n), np.zeros(n), np.full(n, 0.5))[-1] is Phase.OTHER


def test_thresholds_that_cross_are_refused():
    with pytest.raises(ParameterError, match="turn_end: expected at most turn_begin"):
        MotionSettings(turn_begin=0.02)


HUSKY = read_terrains(find_terrains("husky")).classes


def test_centres_by_hand_and_their_distance() -> None:
    # body at 0.5 m/s turning left at 0.4 rad/s; sides at 0.2 and 0.7 m/s
    left, right = rotation_centres(0.2, 0.7, 0.5, 0.4)
    assert (left, right) == pytest.approx((0.75, -0.5))
    assert left - right == pytest.approx(slip_track(0.7, 0.2, 0.4))
    mirrored = rotation_centres(0.7, 0.2, 0.5, -0.4)
    assert mirrored == pytest.approx((0.5, -0.75))


def test_a_slip_track_beyond_1_4_is_sand_whatever_else_holds() -> None:
    odd = (0.05, 0.28, 1.5)  # asphalt except for the slip track
    assert by_rules(HUSKY, odd) == "beach_sand"
    assert by_rules(HUSKY, (0.05, 0.28, 1.39)) == "asphalt"
    names = [by_rules(HUSKY, (f, m, 1.41)) for f in (0.0, 0.2, 0.4) for m in (0.1, 0.2, 0.3)]
    assert set(names) == {"beach_sand"}


def test_deciding_needs_a_rule() -> None:
    sand = HUSKY.terrain[3].slip_track
    assert sand is not None
    with pytest.raises(ParameterError, match="a rule as well"):
        dataclasses.replace(sand, rule=None)


NO_SCATTER = {"motion_scatter": 0.0, "turning_scatter": 0.0, "lateral_scatter": 0.0}
EXACT = ResistanceSettings(pitch_std=0.0, current_std=0.0, **NO_SCATTER)
VEHICLE = vehicle_of()
DRIVE = Drivetrain.of(VEHICLE)
G = 9.80665
W = 30.0 * G


def stretch(**columns) -> SteadyStretch:
    n = 50
    base = dict.fromkeys((f.name for f in dataclasses.fields(SteadyStretch)), np.zeros(n))
    base |= {name: np.full(n, value) for name, value in columns.items()}
    return SteadyStretch(**{**base, "time": np.arange(n) * 0.01})


def rolling_current(resistance: float) -> float:
    """Current of one side [A]: idle current, and f_r r F_z over the torque of an ampere."""
    return 0.5 + resistance * 0.13 * (W / 2) / (78.71 * 0.044)


def test_level_straight_is_the_law_of_motion_resistance():
    current = rolling_current(0.13)
    straight = stretch(v_left=0.5, v_right=0.5, current_left=current, current_right=current)
    resistance = motion_resistance_of(straight, DRIVE, EXACT, signed=True)
    assert resistance.value == pytest.approx(0.13)
    assert resistance.std == pytest.approx(0.0, abs=1e-12)


def test_inertia_is_taken_out():
    # 0.0255 of the weight for a quarter of a metre per second squared, in either direction
    for way in (1.0, -1.0):
        current = rolling_current(0.13 + 0.25 / G)
        base = stretch(v_left=0.5, current_left=way * current, current_right=way * current)
        speed = way * (0.4 + 0.25 * base.time)
        straight = dataclasses.replace(base, v_left=speed, v_right=speed)
        resistance = motion_resistance_of(straight, DRIVE, EXACT, signed=True)
        assert resistance.value == pytest.approx(0.13)


def test_what_does_not_average_out():
    # one degree of pitch is 0.01745 of the weight; 0.1 A on both sides is 0.2 · 26.64/294.2
    straight = stretch(v_left=0.5, v_right=0.5, current_left=2.0, current_right=2.0)
    tilted = ResistanceSettings(pitch_std=math.radians(1.0), current_std=0.0, **NO_SCATTER)
    resistance = motion_resistance_of(straight, DRIVE, tilted, signed=True)
    assert resistance.std == pytest.approx(0.017453, abs=1e-5)
    offset = ResistanceSettings(pitch_std=0.0, current_std=0.1, **NO_SCATTER)
    resistance = motion_resistance_of(straight, DRIVE, offset, signed=True)
    assert resistance.std == pytest.approx(0.018111, abs=1e-5)
    # the offset really shifts it by that
    forward = stretch(v_left=0.5, v_right=0.5, current_left=2.1, current_right=2.1)
    shifted = motion_resistance_of(forward, DRIVE, offset, signed=True)
    first = motion_resistance_of(straight, DRIVE, offset, signed=True)
    assert shifted.value - first.value == pytest.approx(0.018111, abs=1e-5)


def test_pitch_counts_twice_on_slopes_and_none_where_it_swings():
    settings = ResistanceSettings(pitch_std=0.01, current_std=0.0, **NO_SCATTER)
    straight = stretch(v_left=0.5, v_right=0.5, current_left=4.0, current_right=4.0)
    sloping = dataclasses.replace(straight, pitch=straight.pitch - 0.1)
    assert motion_resistance_of(straight, DRIVE, settings, signed=True).std == pytest.approx(0.01)
    assert motion_resistance_of(sloping, DRIVE, settings, signed=True).std == pytest.approx(0.02)
    bump = dataclasses.replace(straight, pitch=0.1 * np.sin(straight.time * 12.0))
    estimate = motion_resistance_of(bump, DRIVE, settings, signed=True)
    assert not estimate.is_known
    assert "slope changes" in estimate.note


def test_spot_and_turn_by_hand():
    # μ_t = 0.2: M_r/B = 0.2 · 294.2 · 0.55/2/0.6 = 26.97 N; f_r = 0.1: 14.71 N a side
    k = 78.71 * 0.044 / 0.13
    f_r = TerrainEstimate(0.1, 0.02)
    spot = stretch(
        v_left=-0.4,
        v_right=0.4,
        yaw_rate=0.7,
        current_left=-(14.71 + 26.968) / k - 0.5,
        current_right=(14.71 + 26.968) / k + 0.5,
    )
    options = {"signed": True, "min_inner_speed": 0.03}
    resistance = lateral_resistance_of(spot, VEHICLE, DRIVE, f_r, EXACT, **options)
    assert resistance.value == pytest.approx(0.2, abs=1e-4)
    assert resistance.std == pytest.approx(0.6 / 0.55 * 0.02)  # all of f_r's error
    # μ_t + (B/L) f_r of the same turn, without knowing f_r; below, of one not on the spot
    thrust = turning_thrust_of(spot, VEHICLE, DRIVE, EXACT)
    assert thrust.value == pytest.approx(0.2 + 0.6 / 0.55 * 0.1, abs=1e-4)
    turn = stretch(
        v_left=0.3,
        v_right=0.7,
        yaw_rate=0.35,
        current_left=(14.71 - 26.968) / k + 0.5,
        current_right=(14.71 + 26.968) / k + 0.5,
    )
    resistance = lateral_resistance_of(turn, VEHICLE, DRIVE, f_r, EXACT, **options)
    thrust = turning_thrust_of(turn, VEHICLE, DRIVE, EXACT)
    assert thrust.value == pytest.approx(0.2 + 0.6 / 0.55 * 0.1, abs=1e-4)
    # the centrifugal force moves 30 · 0.5 · 0.35 · 0.2/0.6 = 1.75 N from side to side
    assert resistance.value == pytest.approx(0.2 - 0.6 / 0.55 * 0.1 * 3.5 / W, abs=1e-4)
    assert resistance.std == pytest.approx(0.6 / 0.55 * 0.02 * 3.5 / W, rel=1e-3)  # nearly exact


def test_standard_error_of_independent_and_of_related_samples():
    random = np.random.default_rng(3)
    white = random.normal(size=(400, 500))
    claimed = np.mean([standard_error(row) for row in white])
    assert claimed == pytest.approx(np.std(white.mean(axis=1)), rel=0.15)
    related = np.empty((400, 500))
    related[:, 0] = white[:, 0]
    for i in range(1, 500):
        related[:, i] = 0.8 * related[:, i - 1] + 0.6 * white[:, i]
    claimed = np.mean([standard_error(row) for row in related])
    assert claimed == pytest.approx(np.std(related.mean(axis=1)), rel=0.15)
    assert np.isnan(standard_error(np.array([1.0])))
    assert standard_error(np.ones(9)) == 0.0
