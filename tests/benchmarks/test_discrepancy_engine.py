"""The physics engine's vehicle against free bodies, and its sets."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.discovery import engine, engine_outcomes, engine_sets, sealed, worlds
from benchmarks.discovery.physics import Floats, Stops

G = 9.80665
SPIN = 4.0 * 0.6 * 12.0 / engine.MASS


def stops(**changed: list[float]) -> Stops:
    """Level, straight stops at 3 m/s, a minute apart."""
    count = len(next(iter(changed.values()))) if changed else 1
    values = dict.fromkeys(Stops._fields, 0.0) | {"speed": 3.0, "wave_length": 9.0, "friction": 1.0}
    arrays = {name: np.full(count, value) for name, value in values.items()}
    arrays["clock"] = 60.0 * (1.0 + np.arange(count))
    return Stops(**(arrays | {name: np.array(value) for name, value in changed.items()}))


def decelerations(nature: engine.Nature, scene: Stops, at: tuple[float, float]) -> Floats:
    """Mean over the speeds between two shares of the first one [m/s²]."""
    motion = engine.drive(nature, scene)
    found = []
    for i in range(len(scene.speed)):
        v, t = motion.speed[i], motion.time
        inside = (t > 0.0) & (v < at[1] * scene.speed[i]) & (v > at[0] * scene.speed[i])
        found.append(-np.polyfit(t[inside], v[inside], 1)[0])
    return np.array(found)


def test_torque_and_leaning_gravity_brake_as_free_bodies() -> None:
    grade = [-0.15, 0.0, 0.15]
    nature = engine.Nature()
    found = decelerations(nature, stops(grade=grade), (0.2, 0.8))
    force = (nature.brake + nature.resistance) / (1.0 + SPIN)
    np.testing.assert_allclose(found, G * (force + np.sin(grade) / (1.0 + SPIN)), rtol=0.03)


def test_a_heavier_body_stops_by_its_mass() -> None:
    light, heavy = decelerations(
        engine.Nature(payload=100.0, payload_run=1), stops(speed=[3.0, 3.0]), (0.2, 0.8)
    )
    assert heavy / light == pytest.approx(500.0 / 600.0, rel=0.03)


def test_air_and_bearings_slow_by_speed() -> None:
    fast = stops(speed=[4.0])
    onset = engine.Nature().delay + engine.Nature().build_up

    def braked(nature: engine.Nature) -> tuple[float, float]:
        motion = engine.drive(nature, fast)
        held = float(np.interp(0.0, motion.time, motion.speed[0]))
        return held, float(motion.rest[0]) - onset

    held, plain = braked(engine.Nature())
    a = held / plain
    held, by_air = braked(engine.Nature(air=20.0))
    c = 20.0 / engine.MASS / (1.0 + SPIN)
    assert by_air == pytest.approx(np.arctan(held * np.sqrt(c / a)) / np.sqrt(a * c), abs=0.012)
    held, by_torque = braked(engine.Nature(bearing=4.0))
    k = 4.0 * 4.0 / engine.RADIUS**2 / engine.MASS / (1.0 + SPIN)
    assert by_torque == pytest.approx(np.log1p(held * k / a) / k, abs=0.012)
    assert by_torque < 0.9 * held / a


def test_hot_and_slippery_brake_less() -> None:
    four = stops(speed=[4.0] * 4)
    hot = decelerations(engine.Nature(fading=0.01, cooling=1e4), four, (0.2, 0.8))
    assert np.all(np.diff(hot) < -0.02 * hot[0])
    ice = stops(speed=[3.0, 3.0], x=[0.0, 50.0])
    found = decelerations(engine.Nature(slippery=(0.0, 0.0, 10.0, 0.25)), ice, (0.2, 0.8))
    assert found[0] < 0.75 * found[1]
    assert found[0] == pytest.approx(0.25 * G, rel=0.15)


def test_the_body_dives_and_rocks_back() -> None:
    motion = engine.drive(engine.Nature(), stops())
    braking = (motion.time > 0.4) & (motion.speed[0] > 0.5)
    dive = -float(np.mean(motion.grade[0][braking]))
    assert np.deg2rad(0.6) < dive < np.deg2rad(2.0)
    assert -0.3 < float(motion.speed[0].min()) < -0.005
    assert motion.rest[0] < 1.2


def test_sets_of_every_effect_and_their_judgement() -> None:
    orders = engine_outcomes.engine_orders(0.01)
    assert {o.what for o in orders} == {"", *engine_outcomes.NAMES}
    configured = {"m_m": 0.0, "b_m": -0.06, "m_b": 0.001, "b_b": 0.417, "dead_time": 0.221}
    order = next(o for o in orders if o.what == "weaker brakes")
    found = worlds.make(engine_sets.ENGINE, order, lambda _: configured, 24)
    assert len(np.unique(found.columns["run"])) == len(found.stops.speed)
    run, factor = float(found.nature.payload_run), found.nature.repair
    share = 0.417 / (0.417 + 0.0) * factor
    named = {"name": "step_change", "parameters": {}, "confidence": 1.0, "alternatives": []}
    right = worlds.judge(
        engine_sets.ENGINE,
        found,
        sealed.InquiryFinding(
            "missing_effect",
            (named,),
            braking=configured,
            added=(("step_change", {"scale": share, "run": run}),),
        ),
    )
    assert right.right
    assert right.before > 1.5 * right.floor
    assert right.closed is not None
    assert right.closed > 0.7
