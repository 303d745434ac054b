"""The engine's car and the rocking car against closed forms and the formula plant."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.discrepancy import effect_plant, engine_car, rocking_car, world_logs
from benchmarks.discrepancy.blind_run import COEFFICIENTS
from benchmarks.discrepancy.naming_benchmark import compared
from benchmarks.discrepancy.plant_physics import Physics, Stops
from benchmarks.discrepancy.world_changes import Changes, draw_stops
from benchmarks.discrepancy.world_logs import WorldLog
from tests.benchmarks.driven_stops import G, decelerations, stops

PLAIN = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "b_b": 0.4, "rolling": 0.03, "mount": 0.0}


def plain_cars() -> list[tuple[ModuleType, object, float]]:
    """Worlds, their cars with 0.4 of brakes and the share of mass that their wheels add."""
    engine = engine_car.draw_car(np.random.default_rng(3))
    rocking = rocking_car.draw_car(np.random.default_rng(3))
    rocking = replace(rocking, **PLAIN, counts=0, play=0.0, roof=rocking.height)
    engine = replace(engine, **PLAIN, sensor=0.0)
    return [(engine_car, engine, engine.spin), (rocking_car, rocking, rocking.axle_share)]


CARS = plain_cars()


@pytest.mark.parametrize(
    ("world", "car", "spin"),
    [CARS[0], pytest.param(*CARS[1], marks=pytest.mark.nightly)],
    ids=["engine", "rocking"],
)
def test_cars_and_effects_keep_the_laws_of_free_bodies(
    world: ModuleType, car: object, spin: float
) -> None:
    def driven(changes: Changes, **changed: float | list[float]) -> np.ndarray:
        scene = stops(**changed)
        return decelerations(world.drive(car, changes, scene, before=0.2), scene)

    grade = [-0.15, 0.0, 0.15]
    force = 0.43 + np.sin(grade)
    np.testing.assert_allclose(driven(Changes(), grade=grade), G * force / (1 + spin), rtol=0.02)
    # Straight against the wind, and with it; a place where the ground slows; brakes that lose.
    windy = driven(Changes(air=0.03, wind=5.0), heading=[0.0, np.pi], speed=3.0)
    lost = driven(Changes(patch=(50.0, 0.0, 20.0, 0.06), factor=(1.0, 0.8)), x=[45.0, 5.0])
    level = G * 0.43 / (1 + spin)
    for decel, relative in zip(windy, (6.3, -3.7), strict=True):
        added = 0.03 * abs(relative) * relative / (1 + spin)
        assert decel - level == pytest.approx(added, rel=0.15)
    np.testing.assert_allclose(lost - level, np.array([0.06, -0.08]) * G / (1 + spin), rtol=0.1)


@pytest.mark.nightly  # by day the laws of free bodies, above
@pytest.mark.parametrize(("world", "car", "spin"), CARS, ids=["engine", "rocking"])
def test_calibrated_base_law_holds_on_other_stops(
    world: ModuleType, car: object, spin: float
) -> None:
    base = world_logs.calibration_of(world.drive, car, 0.0, np.random.default_rng(7))
    scene: Stops = draw_stops(4, 0.43, 0.0, np.random.default_rng(8))
    still = np.zeros_like(scene.speed)
    scene = scene._replace(delay=still, wave=still, roll=still)
    motion = world.drive(car, Changes(), scene, before=0.2)
    at_command = int(np.searchsorted(motion.time, 0.0))
    # Bodies on springs show a little more than the grade, to the calibration, too.
    grade = motion.grade[:, :at_command].mean(axis=1)
    known = scene._replace(speed=motion.speed[:, at_command], grade=grade)
    rolling = (motion.time >= 0.0) & (motion.time < motion.rest[:, None] - 0.1)

    def disagreement(law: dict[str, float]) -> float:
        formula = effect_plant.speeds(Physics(**law), known, motion.time)
        return float(np.sqrt(np.mean((motion.speed - formula)[rolling] ** 2)))

    law = {key: base[key] for key in COEFFICIENTS}
    # Days differ by 2 % of the force: downhill some 0.1 m/s at the end of a stop.
    assert disagreement(law) < 0.25
    assert disagreement(law | {"b_b": 0.85 * law["b_b"]}) > 0.5
    assert np.all(np.linalg.eigvalsh(base["covariance"]) >= 0.0)


@pytest.mark.parametrize(
    ("kind", "verdict", "names", "axis", "expected"),
    [
        ("single", "missing_effect", ("brake_lag",), "", (True, False)),
        ("single", "missing_effect", ("brake_lag", "surface_patch"), "", (False, True)),
        ("single", "ambiguous", ("brake_lag",), "", (False, False)),
        ("clean", "none", (), "", (True, False)),
        ("clean", "missing_effect", ("brake_lag",), "", (False, True)),
        ("drift", "parameter_drift", (), "", (True, False)),
        ("outside", "unknown", (), "battery", (True, False)),
        ("outside", "unknown", (), "speed", (False, False)),
    ],
)
def test_answers_are_compared_with_the_truth(
    kind: str, verdict: str, names: tuple[str, ...], axis: str, expected: tuple[bool, bool]
) -> None:
    truth = (("brake_lag",),) if kind == "single" else ()
    axes = ("battery",) if kind == "outside" else ()
    log = WorldLog(kind, truth, axes, {}, {})
    assert compared(log, verdict, names, axis) == expected
