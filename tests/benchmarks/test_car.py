"""The multi-body car against free bodies, and its sets; by night: compiling takes half a minute.

By day the plant of `test_effect_plant.py` is driven, measured, investigated and scored.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("vehiclemodels", reason="the extra sim is not installed")

from benchmarks.discrepancy import blind_run, car_outcomes, car_sets, multibody, vehicle_models
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
    scene = car_sets.draw_stops(12, 0.01, np.random.default_rng(2))
    for nature in (CarNature(), CarNature(friction=0.4, assist=car_sets.EAGER)):
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


def test_specs_hold_every_effect_and_halves_share_no_seed() -> None:
    for half, parity in zip(car_outcomes.HALVES, (1, 0), strict=True):
        specs = car_outcomes.car_specs(1.0, half)
        assert {s.seed % 2 for s in specs} == {parity}
        assert len(specs) == 12 * 3 * 5 + 60
        assert {s.what for s in specs} == {"", *car_outcomes.CAR_NAMES}


@pytest.mark.nightly
def test_a_set_from_end_to_end() -> None:
    """Weaker brakes: driven, measured, investigated, scored."""
    specs = car_outcomes.car_specs(0.2, "tuning")
    spec = next(s for s in specs if (s.what, s.strength) == ("weaker brakes", "large"))
    configured = {"m_m": 0.0, "b_m": -0.1, "m_b": 0.0, "b_b": 0.427, "dead_time": 0.19}
    hidden = car_sets.make(spec, 40, configured)
    assert hidden.nature.repair < 0.8
    tables = blind_run.tables_of(hidden.configured, car_sets.car_table())
    finding = blind_run.investigate_log(blind_run.SealedLog(hidden.columns, tables))
    assert finding.verdict != "fault", finding.text
    outcome = car_sets.score_set(hidden, finding)
    assert "step_change" in outcome.named
    assert outcome.closed is not None
    assert outcome.closed > 0.8
