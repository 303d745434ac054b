"""The multi-body car against free bodies, and its logs; by night: compiling takes half a minute.

By day the plant of `test_effect_plant.py` is driven, measured, investigated and scored.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("vehiclemodels", reason="the extra sim is not installed")

from benchmarks.discrepancy import blind_run, multibody, multibody_world, vehicle_models
from benchmarks.discrepancy.multibody import CarNature
from tests.benchmarks.driven_stops import G, decelerations, stops

CAR = vehicle_models.CAR
SPIN = 4.0 * CAR.I_y_w / CAR.R_w**2 / CAR.m
"""Turning wheels as a share of the mass."""

FORCE = CarNature().brake + CarNature().resistance


def car(
    nature: CarNature, at: tuple[float, float] = (0.2, 0.7), **changed: float | list[float]
) -> np.ndarray:
    scene = stops(**changed)
    return decelerations(multibody.drive(nature, scene), scene, at)


@pytest.mark.nightly
def test_compiled_car_has_the_slopes_of_the_package() -> None:
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    rng = np.random.default_rng(4)
    state = vehicle_models.rolling_state(CAR, 3.0, 0.4, 0.05, 0.02)
    state[6:] += 0.01 * rng.standard_normal(23)
    compiled = np.array(vehicle_models.car_slopes(state.copy(), np.zeros(2), CAR))
    expected = vehicle_dynamics_mb(list(state), [0.0, 0.0], setup_vehicle_parameters(2))
    np.testing.assert_allclose(compiled, expected, rtol=1e-12, atol=1e-9)


@pytest.mark.nightly
def test_car_brakes_as_a_free_body_at_any_step() -> None:
    grade = [-0.15, 0.0, 0.15]
    expected = G * (FORCE + np.sin(grade)) / (1.0 + SPIN)
    np.testing.assert_allclose(car(CarNature(assist=0.0), grade=grade), expected, rtol=0.02)
    motion = multibody.drive(CarNature(assist=0.0), stops(speed=5.0))
    braked = float(motion.distance[0]) - 5.0 * (CarNature().delay + 2.0 * CarNature().build_up)
    assert pytest.approx(G * FORCE * braked, rel=0.015) == 0.5 * 25.0 * (1.0 + SPIN)
    scene = multibody_world.draw_stops(12, 0.01, np.random.default_rng(2))
    for nature in (CarNature(), CarNature(friction=0.4, assist=multibody_world.EAGER)):
        coarse, fine = multibody.drive(nature, scene), multibody.drive(nature, scene, finer=2.0)
        np.testing.assert_allclose(coarse.distance, fine.distance, atol=1e-3)


@pytest.mark.nightly
def test_effects_act_by_their_physics() -> None:
    assert car(CarNature(brake=0.8, friction=0.3))[0] == pytest.approx(0.3 * G, rel=0.03)
    plain, heavy = car(CarNature(payload=200.0, payload_run=1), speed=[4.0] * 2)
    assert heavy / plain == pytest.approx(CAR.m / (CAR.m + 200.0), rel=0.02)
    windy = car(CarNature(air=40.0, wind=6.0), (0.4, 0.6), heading=[0.0, np.pi])
    for decel, relative in zip(windy, (8.0, -4.0), strict=True):
        force = 40.0 * abs(relative) * relative / CAR.m / (1.0 + SPIN)
        assert decel - plain == pytest.approx(force, rel=0.15)
    viscous = car(CarNature(driveline=5.0), (0.4, 0.6))[0]
    force = 4.0 * 5.0 * 2.0 / CAR.R_w**2 / CAR.m / (1.0 + SPIN)
    assert viscous - plain == pytest.approx(force, rel=0.1)
    across, along = car(CarNature(furrows=0.1), heading=[0.0, 0.5 * np.pi])
    assert across - along == pytest.approx(0.1 * G / (1.0 + SPIN), rel=0.05)
    hot = car(CarNature(fading=0.2, cooling=1e5), speed=[4.0] * 12)
    assert np.all(np.diff(hot) < 0.0)
    # 20 % of the brakes are lost at the end, 4 % in the middle of the first stop.
    expected = (0.42 * 0.804 + 0.02) / (0.42 * 0.956 + 0.02)
    assert hot[-1] / hot[0] == pytest.approx(expected, abs=0.02)
    inside, outside = car(CarNature(slippery=((0.0, 0.0, 10.0, 0.3),)), x=[0.0, 50.0])
    assert (inside, outside) == (pytest.approx(0.3 * G, rel=0.05), pytest.approx(plain, rel=0.01))


@pytest.mark.nightly
def test_body_dives_turns_and_stops() -> None:
    motion = multibody.drive(CarNature(), stops(curvature=[0.0, 0.04]))
    braking = (motion.time > 0.5) & (motion.speed[0] > 0.5)
    assert np.deg2rad(0.8) < -float(np.mean(motion.grade[0][braking])) < np.deg2rad(2.5)
    command = int(np.searchsorted(motion.time, 0.0))
    assert motion.yaw_rate[1, command] == pytest.approx(0.16, rel=0.1)
    assert motion.yaw[1, command + 40] > 0.0
    np.testing.assert_array_equal(motion.speed[motion.time > motion.rest[:, None]], 0.0)
    np.testing.assert_allclose(motion.station[:, -1], motion.distance, atol=1e-6)


@pytest.mark.nightly
def test_a_log_from_end_to_end() -> None:
    """Weaker brakes: driven, measured, investigated."""
    log = multibody_world.make("single", "weaker brakes", 5)
    finding = blind_run.investigate_log(blind_run.SealedLog(log.columns, log.tables))
    assert finding.verdict != "fault", finding.text
    assert "step_change" in finding.names
    before, _, after, floor = finding.gap
    assert after < before - 0.8 * (before - floor)
