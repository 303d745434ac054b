from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from slopewise.models.laws.motion_resistance import current_of_motion_resistance
from slopewise.models.terrain.resistances import (
    Drivetrain,
    SteadyStretch,
    TerrainEstimate,
    lateral_resistance_of,
    motion_resistance_of,
    standard_error,
)
from slopewise.models.terrain.settings import ResistanceSettings
from tests.models.terrain.vehicles import vehicle_of

EXACT = ResistanceSettings(pitch_std=0.0, current_std=0.0)
VEHICLE = vehicle_of()
DRIVE = Drivetrain.of(VEHICLE)
G = 9.80665
W = 30.0 * G


def stretch(**columns) -> SteadyStretch:
    n = 50
    base = dict.fromkeys((f.name for f in dataclasses.fields(SteadyStretch)), np.zeros(n))
    base |= {name: np.full(n, value) for name, value in columns.items()}
    return SteadyStretch(**{**base, "time": np.arange(n) * 0.01})


def test_level_straight_is_the_law_of_motion_resistance():
    current = current_of_motion_resistance(0.13, 0.5, 0.044, 78.71, 0.13, W / 2)
    straight = stretch(v_left=0.5, v_right=0.5, current_left=current, current_right=current)
    resistance = motion_resistance_of(straight, DRIVE, EXACT, signed=True)
    assert resistance.value == pytest.approx(0.13)
    assert resistance.std == pytest.approx(0.0, abs=1e-12)


def test_inertia_is_taken_out():
    # 0.0255 of the weight for a quarter of a metre per second squared, in either direction
    for way in (1.0, -1.0):
        current = current_of_motion_resistance(0.13 + 0.25 / G, 0.5, 0.044, 78.71, 0.13, W / 2)
        base = stretch(v_left=0.5, current_left=way * current, current_right=way * current)
        speed = way * (0.4 + 0.25 * base.time)
        straight = dataclasses.replace(base, v_left=speed, v_right=speed)
        resistance = motion_resistance_of(straight, DRIVE, EXACT, signed=True)
        assert resistance.value == pytest.approx(0.13)


def test_what_does_not_average_out():
    # one degree of pitch is 0.01745 of the weight; 0.1 A on both sides is 0.2 · 26.64/294.2
    straight = stretch(v_left=0.5, v_right=0.5, current_left=2.0, current_right=2.0)
    tilted = ResistanceSettings(pitch_std=math.radians(1.0), current_std=0.0)
    resistance = motion_resistance_of(straight, DRIVE, tilted, signed=True)
    assert resistance.std == pytest.approx(0.017453, abs=1e-5)
    offset = ResistanceSettings(pitch_std=0.0, current_std=0.1)
    resistance = motion_resistance_of(straight, DRIVE, offset, signed=True)
    assert resistance.std == pytest.approx(0.018111, abs=1e-5)
    # the offset really shifts it by that
    forward = stretch(v_left=0.5, v_right=0.5, current_left=2.1, current_right=2.1)
    shifted = motion_resistance_of(forward, DRIVE, offset, signed=True)
    first = motion_resistance_of(straight, DRIVE, offset, signed=True)
    assert shifted.value - first.value == pytest.approx(0.018111, abs=1e-5)


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
    options = {"signed": True, "least_inner_speed": 0.03}
    resistance = lateral_resistance_of(spot, VEHICLE, DRIVE, f_r, EXACT, **options)
    assert resistance.value == pytest.approx(0.2, abs=1e-4)
    assert resistance.std == pytest.approx(0.6 / 0.55 * 0.02)  # all of f_r's error
    turn = stretch(
        v_left=0.3,
        v_right=0.7,
        yaw_rate=0.35,
        current_left=(14.71 - 26.968) / k + 0.5,
        current_right=(14.71 + 26.968) / k + 0.5,
    )
    resistance = lateral_resistance_of(turn, VEHICLE, DRIVE, f_r, EXACT, **options)
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
