from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.terrain.phases import MotionPhases, Phase
from slopewise.models.terrain.settings import MotionSettings

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
