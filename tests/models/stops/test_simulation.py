"""Simulated stops against closed forms that share no code with the simulation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.parameters import Effect
from slopewise.models.stops.simulation import GroundTrack, RunChannels, replay, simulate_stop
from tests.world.vehicles import BASE, with_braking, with_effect

G = 9.80665
LEVEL = GroundTrack.of_grade(0.0)


def level_force(speed: float) -> float:
    return 0.015 * speed + 0.40


@pytest.mark.parametrize("speed", [1.0, 2.5, 4.0])
def test_level_ground_is_the_closed_form(speed: float) -> None:
    stop = simulate_stop(BASE, LEVEL, speed)
    a = G * level_force(speed)
    assert stop.stopped
    assert stop.distance == pytest.approx(0.3 * speed + speed**2 / (2.0 * a), abs=1e-6)
    assert stop.time[-1] == pytest.approx(0.3 + speed / a, abs=1e-6)


@pytest.mark.parametrize("grade", [-0.2, 0.15])
def test_constant_slope(grade: float) -> None:
    a = G * ((-0.03 * 3.0 - 0.35) * grade + level_force(3.0) + math.sin(grade))
    stop = simulate_stop(BASE, GroundTrack.of_grade(grade), 3.0)
    assert stop.distance == pytest.approx(0.9 + 9.0 / (2.0 * a), abs=1e-6)


def test_drag_is_the_logarithm() -> None:
    a, c, v = G * level_force(4.0), 0.1, 4.0
    stop = simulate_stop(with_effect("aerodynamic_drag", c=c), LEVEL, v)
    assert stop.distance == pytest.approx(1.2 + math.log(1.0 + c * v * v / a) / (2.0 * c), abs=1e-6)


def test_viscous_resistance_is_the_exponential() -> None:
    a, k, v = G * level_force(4.0), G * 0.05, 4.0
    seconds = math.log(1.0 + k * v / a) / k
    distance = v / k - a / k * seconds
    stop = simulate_stop(with_effect("viscous_resistance", c=0.05), LEVEL, v)
    assert stop.time[-1] == pytest.approx(0.3 + seconds, abs=1e-6)
    assert stop.distance == pytest.approx(1.2 + distance, abs=1e-6)


def test_lag_builds_the_force_up() -> None:
    # v(t) = v − F (t − τ (1 − e^(−t/τ))): standstill found by bisection on the closed form.
    a, tau, v = G * level_force(3.0), 0.3, 3.0
    low, high = 0.0, 5.0
    for _ in range(80):
        t = 0.5 * (low + high)
        low, high = (t, high) if a * (t - tau * (1 - math.exp(-t / tau))) < v else (low, t)
    stop = simulate_stop(with_effect("brake_lag", tau=tau), LEVEL, v)
    assert stop.time[-1] == pytest.approx(0.3 + t, abs=1e-5)


def test_friction_caps_the_force() -> None:
    stop = simulate_stop(with_effect("wheel_lockup", mu=0.2), LEVEL, 3.0)
    assert stop.distance == pytest.approx(0.9 + 9.0 / (2.0 * G * 0.2), abs=1e-6)
    unaffected = simulate_stop(with_effect("wheel_lockup", mu=0.9), LEVEL, 3.0)
    assert unaffected.distance == pytest.approx(simulate_stop(BASE, LEVEL, 3.0).distance, abs=1e-9)


def test_fade_weakens_the_next_stop_and_cools() -> None:
    model = with_effect("brake_fade", k=0.05, tau=30.0)
    first = simulate_stop(model, LEVEL, 4.0)
    second = simulate_stop(model, LEVEL, 4.0, heat=first.heat)
    assert first.heat == pytest.approx(8.0, rel=0.05)  # v²/2 per mass, a little of it cooled
    assert second.distance > first.distance + 0.1


def test_brakes_that_do_not_hold_never_stop() -> None:
    stop = simulate_stop(with_braking(b_m=0.0), GroundTrack.of_grade(-0.6), 2.0)
    assert not stop.stopped
    assert stop.distance == math.inf


def test_brake_level_keeps_the_rolling_resistance() -> None:
    force = 0.13 + 0.5 * (level_force(3.0) - 0.13)
    stop = simulate_stop(BASE, LEVEL, 3.0, level=0.5)
    assert stop.distance == pytest.approx(0.9 + 9.0 / (2.0 * G * force), abs=1e-6)


def log_of_a_stop(speed: float, grade: float) -> RunChannels:
    """Samples made by hand: 2 s at speed, then dead time and constant deceleration."""
    t = np.arange(0.0, 6.0, 0.02)
    a = G * ((-0.03 * speed - 0.35) * grade + level_force(speed) + math.sin(grade))
    v = np.clip(speed - a * np.maximum(t - 2.3, 0.0), 0.0, None)
    command = np.where(t < 2.0, speed, 0.0)
    return RunChannels(time=t, speed=v, command=command, pitch=np.full_like(t, -grade))


@pytest.mark.parametrize("grade", [-0.15, 0.0, 0.15])
def test_replay_of_the_models_own_stop_leaves_nothing(grade: float) -> None:
    run = log_of_a_stop(3.0, grade)
    np.testing.assert_allclose(replay(BASE, run), run.speed, atol=1e-4)


def test_replay_shows_what_the_model_misses() -> None:
    run = log_of_a_stop(3.0, 0.0)
    weaker = replace(BASE, effect=(Effect(name="step_change", parameters={"scale": 0.7}),))
    residual = run.speed - replay(weaker, run)
    assert np.all(residual[run.time < 2.3] == 0.0)
    assert residual.min() < -0.5


def test_replay_reads_crests_from_their_column() -> None:
    run = log_of_a_stop(3.0, 0.0)
    light = replace(BASE, effect=(Effect(name="crest_unloading", parameters={"k": 1.0}),))
    even = replay(light, run)
    np.testing.assert_allclose(even, replay(BASE, run))
    crest = replace(run, vertical_curvature=np.full_like(run.time, -0.05))
    # dv/dt = −F (1 − c v²) with c = 0.05/g: v = tanh(artanh(√c v₀) − √c F t)/√c.
    root, force = math.sqrt(0.05 / G), G * level_force(3.0)
    fall = math.atanh(root * 3.0) - root * force * np.maximum(run.time - 2.3, 0.0)
    true = np.tanh(np.maximum(fall, 0.0)) / root
    np.testing.assert_allclose(replay(light, crest), true, atol=3e-4)
