"""The vehicles of the two physics engines against free bodies, and their sets."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")
pytest.importorskip("vehiclemodels", reason="the extra sim is not installed")

from benchmarks.discrepancy import (
    blind_run,
    engine_plant,
    engine_sets,
    multibody,
    multibody_sets,
    vehicle_models,
    world_outcomes,
    worlds,
)
from benchmarks.discrepancy.engine_plant import Nature
from benchmarks.discrepancy.multibody import CarNature
from tests.benchmarks.driven_stops import G, decelerations, stops

ENGINE_SPIN = 4.0 * 0.6 * 12.0 / engine_plant.MASS
CAR = vehicle_models.CAR
CAR_SPIN = 4.0 * CAR.I_y_w / CAR.R_w**2 / CAR.m
"""Turning wheels as a share of the mass."""

FORCE = CarNature().brake + CarNature().resistance


def engine(nature: Nature, **changed: float | list[float]) -> np.ndarray:
    scene = stops(**changed)
    return decelerations(engine_plant.drive(nature, scene), scene, (0.2, 0.8))


def car(
    nature: CarNature, at: tuple[float, float] = (0.2, 0.7), **changed: float | list[float]
) -> np.ndarray:
    scene = stops(**changed)
    return decelerations(multibody.drive(nature, scene), scene, at)


def test_engine_brakes_as_a_free_body() -> None:
    grade = [-0.15, 0.0, 0.15]
    nature = Nature()
    force = (nature.brake + nature.resistance) / (1.0 + ENGINE_SPIN)
    expected = G * (force + np.sin(grade) / (1.0 + ENGINE_SPIN))
    np.testing.assert_allclose(engine(nature, speed=3.0, grade=grade), expected, rtol=0.03)


def test_engine_effects_act_by_their_physics() -> None:
    light, heavy = engine(Nature(payload=100.0, payload_run=1), speed=[3.0, 3.0])
    assert heavy / light == pytest.approx(500.0 / 600.0, rel=0.03)
    hot = engine(Nature(fading=0.01, cooling=1e4), speed=[4.0] * 4)
    assert np.all(np.diff(hot) < -0.02 * hot[0])
    slippery = Nature(slippery=(0.0, 0.0, 10.0, 0.25))
    inside, outside = engine(slippery, speed=3.0, x=[0.0, 50.0])
    assert inside < 0.75 * outside
    assert inside == pytest.approx(0.25 * G, rel=0.15)


def test_engine_air_and_bearings_slow_by_closed_forms() -> None:
    onset = Nature().delay + Nature().build_up

    def braked(nature: Nature) -> tuple[float, float]:
        motion = engine_plant.drive(nature, stops())
        return float(np.interp(0.0, motion.time, motion.speed[0])), float(motion.rest[0]) - onset

    v, time = braked(Nature())
    a = v / time
    v, time = braked(Nature(air=20.0))
    c = 20.0 / engine_plant.MASS / (1.0 + ENGINE_SPIN)
    assert time == pytest.approx(np.arctan(v * np.sqrt(c / a)) / np.sqrt(a * c), abs=0.012)
    v, time = braked(Nature(bearing=4.0))
    k = 4.0 * 4.0 / engine_plant.RADIUS**2 / engine_plant.MASS / (1.0 + ENGINE_SPIN)
    assert time == pytest.approx(np.log1p(v * k / a) / k, abs=0.012)
    assert time < 0.9 * v / a


def test_engine_body_dives_and_rocks_back() -> None:
    motion = engine_plant.drive(Nature(), stops(speed=3.0))
    braking = (motion.time > 0.4) & (motion.speed[0] > 0.5)
    assert np.deg2rad(0.6) < -float(np.mean(motion.grade[0][braking])) < np.deg2rad(2.0)
    assert -0.3 < float(motion.speed[0].min()) < -0.005
    assert motion.rest[0] < 1.2


def test_compiled_car_has_the_slopes_of_the_package() -> None:
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    rng = np.random.default_rng(4)
    state = vehicle_models.rolling_state(CAR, 3.0, 0.4, 0.05, 0.02)
    state[6:] += 0.01 * rng.standard_normal(23)
    compiled = np.array(vehicle_models.car_slopes(state.copy(), np.zeros(2), CAR))
    expected = vehicle_dynamics_mb(list(state), [0.0, 0.0], setup_vehicle_parameters(2))
    np.testing.assert_allclose(compiled, expected, rtol=1e-12, atol=1e-9)


def test_car_brakes_as_a_free_body() -> None:
    grade = [-0.15, 0.0, 0.15]
    expected = G * (FORCE + np.sin(grade)) / (1.0 + CAR_SPIN)
    np.testing.assert_allclose(car(CarNature(assist=0.0), grade=grade), expected, rtol=0.02)
    motion = multibody.drive(CarNature(assist=0.0), stops(speed=5.0))
    braked = float(motion.distance[0]) - 5.0 * (CarNature().delay + 2.0 * CarNature().build_up)
    energy = 0.5 * 25.0 * (1.0 + CAR_SPIN)
    assert energy == pytest.approx(G * FORCE * braked, rel=0.015)


def test_finer_steps_change_no_distance() -> None:
    scene = multibody_sets.MULTIBODY.scene(12, 0.01, np.random.default_rng(2))
    for nature in (CarNature(), CarNature(friction=0.4, assist=multibody_sets.EAGER)):
        coarse, fine = multibody.drive(nature, scene), multibody.drive(nature, scene, finer=2.0)
        np.testing.assert_allclose(coarse.distance, fine.distance, atol=1e-3)


def test_car_effects_act_by_their_physics() -> None:
    assert car(CarNature(brake=0.8, friction=0.3))[0] == pytest.approx(0.3 * G, rel=0.03)
    plain, heavy = car(CarNature(payload=200.0, payload_run=1), speed=[4.0] * 2)
    assert heavy / plain == pytest.approx(CAR.m / (CAR.m + 200.0), rel=0.02)
    windy = car(CarNature(air=40.0, wind=6.0), (0.4, 0.6), heading=[0.0, np.pi])
    for decel, relative in zip(windy, (8.0, -4.0), strict=True):
        force = 40.0 * abs(relative) * relative / CAR.m / (1.0 + CAR_SPIN)
        assert decel - plain == pytest.approx(force, rel=0.15)
    viscous = car(CarNature(driveline=5.0), (0.4, 0.6))[0]
    force = 4.0 * 5.0 * 2.0 / CAR.R_w**2 / CAR.m / (1.0 + CAR_SPIN)
    assert viscous - plain == pytest.approx(force, rel=0.1)
    across, along = car(CarNature(furrows=0.1), heading=[0.0, 0.5 * np.pi])
    assert across - along == pytest.approx(0.1 * G / (1.0 + CAR_SPIN), rel=0.05)
    hot = car(CarNature(fading=0.2, cooling=1e5), speed=[4.0] * 12)
    assert np.all(np.diff(hot) < 0.0)
    # 20 % of the brakes are lost at the end, 4 % in the middle of the first stop.
    expected = (0.42 * 0.804 + 0.02) / (0.42 * 0.956 + 0.02)
    assert hot[-1] / hot[0] == pytest.approx(expected, abs=0.02)
    inside, outside = car(CarNature(slippery=((0.0, 0.0, 10.0, 0.3),)), x=[0.0, 50.0])
    assert inside == pytest.approx(0.3 * G, rel=0.05)
    assert outside == pytest.approx(plain, rel=0.01)


def test_car_body_dives_turns_and_stops() -> None:
    motion = multibody.drive(CarNature(), stops(curvature=[0.0, 0.04]))
    braking = (motion.time > 0.5) & (motion.speed[0] > 0.5)
    assert np.deg2rad(0.8) < -float(np.mean(motion.grade[0][braking])) < np.deg2rad(2.5)
    command = int(np.searchsorted(motion.time, 0.0))
    assert motion.yaw_rate[1, command] == pytest.approx(0.16, rel=0.1)
    assert motion.yaw[1, command + 40] > 0.0
    np.testing.assert_array_equal(motion.speed[motion.time > motion.rest[:, None]], 0.0)
    np.testing.assert_allclose(motion.station[:, -1], motion.distance, atol=1e-6)


def test_size_of_a_car_effect_is_its_share_of_the_force() -> None:
    rng = np.random.default_rng(7)
    scene = multibody_sets.MULTIBODY.scene(30, 0.0, rng)._replace(delay=np.zeros(30))
    where = multibody_sets.circumstances(scene, rng)
    size = multibody_sets.SIZES["weaker brakes"][2]
    nature = multibody_sets.hidden("weaker brakes", size, where)
    assert multibody_sets.strength_of(nature, scene) == pytest.approx(0.12, rel=0.35)


def test_specs_hold_every_effect_and_halves_share_no_seed() -> None:
    assert {s.what for s in world_outcomes.engine_specs(0.01)} == {"", *world_outcomes.ENGINE_NAMES}
    for half, parity in zip(world_outcomes.HALVES, (1, 0), strict=True):
        specs = world_outcomes.multibody_specs(1.0, half)
        assert {s.seed % 2 for s in specs} == {parity}
        assert len(specs) == 12 * 3 * 5 + 60
        assert {s.what for s in specs} == {"", *world_outcomes.CAR_NAMES}


def test_true_finding_closes_the_gap_of_an_engine_set() -> None:
    specs = world_outcomes.engine_specs(0.01)
    spec = next(s for s in specs if s.what == "weaker brakes")
    configured = {"m_m": 0.0, "b_m": -0.06, "m_b": 0.001, "b_b": 0.417, "dead_time": 0.221}
    hidden = worlds.make(engine_sets.ENGINE, spec, lambda _: configured, 24)
    run, scale = float(hidden.nature.payload_run), hidden.nature.repair
    named = {"name": "step_change", "parameters": {}, "confidence": 1.0, "alternatives": []}
    finding = blind_run.Finding(
        "missing_effect",
        (named,),
        braking=configured,
        added=(("step_change", {"scale": scale, "run": run}),),
    )
    outcome = worlds.score_world(engine_sets.ENGINE, hidden, finding)
    assert outcome.right
    assert outcome.before > 1.5 * outcome.floor
    assert outcome.closed is not None
    assert outcome.closed > 0.7


def test_car_set_from_end_to_end() -> None:
    """Weaker brakes: driven, measured, investigated, scored."""
    specs = world_outcomes.multibody_specs(0.2, "tuning")
    spec = next(s for s in specs if (s.what, s.strength) == ("weaker brakes", "large"))
    configured = {"m_m": 0.0, "b_m": -0.1, "m_b": 0.0, "b_b": 0.427, "dead_time": 0.19}
    hidden = worlds.make(multibody_sets.MULTIBODY, spec, lambda _: configured, 40)
    assert hidden.truth()["nature"]["repair"] < 0.8
    tables = blind_run.tables_of(hidden.configured, multibody_sets.car_table())
    finding = blind_run.investigate_log(blind_run.SealedLog(hidden.columns, tables))
    assert finding.verdict != "fault", finding.text
    outcome = worlds.score_world(multibody_sets.MULTIBODY, hidden, finding)
    assert "step_change" in outcome.named
    assert outcome.closed is not None
    assert outcome.closed > 0.8
