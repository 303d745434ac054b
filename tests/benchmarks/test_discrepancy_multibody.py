"""The multi-body car against free bodies, and its sets."""

from __future__ import annotations

import ast
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

pytest.importorskip("vehiclemodels", reason="the extra sim is not installed")

from benchmarks.discovery import (
    model_tables,
    multibody,
    multibody_outcomes,
    multibody_runner,
    multibody_sets,
    sealed,
    vehicle_models,
    worlds,
)
from benchmarks.discovery.multibody import CarNature, drive
from benchmarks.discovery.physics import Floats, Stops
from benchmarks.discovery.tasks import FinishedSet, SetTask
from benchmarks.discovery.world_outcomes import WorldOutcome

G = 9.80665
CAR = vehicle_models.CAR
SPIN = 4.0 * CAR.I_y_w / CAR.R_w**2 / CAR.m
"""Turning wheels as a share of the car's mass."""

FORCE = CarNature().brake + CarNature().resistance


def stops(**changed: list[float]) -> Stops:
    """Level, straight stops at 4 m/s, a minute apart."""
    count = len(next(iter(changed.values()))) if changed else 1
    values = dict.fromkeys(Stops._fields, 0.0) | {"speed": 4.0, "wave_length": 9.0, "friction": 1.0}
    arrays = {name: np.full(count, value) for name, value in values.items()}
    arrays["clock"] = 60.0 * (1.0 + np.arange(count))
    return Stops(**(arrays | {name: np.array(value) for name, value in changed.items()}))


def decelerations(nature: CarNature, scene: Stops, at: tuple[float, float] = (0.2, 0.7)) -> Floats:
    """Mean over the speeds between two shares of the first one [m/s²]."""
    motion = drive(nature, scene)
    found = []
    for i in range(len(scene.speed)):
        v, t = motion.speed[i], motion.time
        inside = (t > 0.0) & (v < at[1] * scene.speed[i]) & (v > at[0] * scene.speed[i])
        found.append(-np.polyfit(t[inside], v[inside], 1)[0])
    return np.array(found)


def test_the_world_knows_nothing_of_the_product() -> None:
    for module in (multibody, vehicle_models):
        assert module.__file__ is not None
        tree = ast.parse(Path(module.__file__).read_text())
        named = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        named += [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
        assert not {name.split(".")[0] for name in named} & {"models", "planner", "services"}
        of_the_plant = [
            a.name
            for n in ast.walk(tree)
            if isinstance(n, ast.ImportFrom) and n.module == "plant"
            for a in n.names
        ]
        assert set(of_the_plant) <= {"GRAVITY", "DrivenStops"}


def test_compiled_slopes_are_those_of_the_package() -> None:
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    rng = np.random.default_rng(4)
    state = vehicle_models.rolling_state(CAR, 3.0, 0.4, 0.05, 0.02)
    state[6:] += 0.01 * rng.standard_normal(23)
    here = np.array(vehicle_models.car_slopes(state.copy(), np.zeros(2), CAR))
    there = vehicle_dynamics_mb(list(state), [0.0, 0.0], setup_vehicle_parameters(2))
    np.testing.assert_allclose(here, there, rtol=1e-12, atol=1e-9)


def test_torque_and_gravity_brake_as_free_bodies() -> None:
    grade = [-0.15, 0.0, 0.15]
    nature = CarNature(assist=0.0)
    found = decelerations(nature, stops(grade=grade))
    np.testing.assert_allclose(found, G * (FORCE + np.sin(grade)) / (1.0 + SPIN), rtol=0.02)


def test_work_of_the_brakes_is_the_energy_of_the_car() -> None:
    """Level, from 5 m/s: what was moving is what force over distance took."""
    scene = stops(speed=[5.0])
    motion = drive(CarNature(assist=0.0), scene)
    told = CarNature().delay + 2.0 * CarNature().build_up
    braked = float(motion.distance[0]) - 5.0 * told
    energy = 0.5 * 25.0 * (1.0 + SPIN)
    assert energy == pytest.approx(G * FORCE * braked, rel=0.015)


def test_finer_steps_change_no_distance() -> None:
    scene = multibody_sets.MULTIBODY.scene(12, 0.01, np.random.default_rng(2))
    for nature in (CarNature(), CarNature(friction=0.4, assist=multibody_sets.EAGER)):
        coarse, fine = drive(nature, scene), drive(nature, scene, finer=2.0)
        np.testing.assert_allclose(coarse.distance, fine.distance, atol=1e-3)


def test_wheels_lock_at_the_friction_of_the_ground() -> None:
    nature = CarNature(brake=0.8, friction=0.3)
    found = decelerations(nature, stops())
    assert found[0] == pytest.approx(0.3 * G, rel=0.03)
    rolling = decelerations(CarNature(brake=0.6), stops())
    assert rolling[0] == pytest.approx(G * 0.62 / (1.0 + SPIN), rel=0.03)


def test_effects_act_as_their_physics_has_them() -> None:
    light, heavy = decelerations(CarNature(payload=200.0, payload_run=1), stops(speed=[4.0] * 2))
    assert heavy / light == pytest.approx(CAR.m / (CAR.m + 200.0), rel=0.02)
    plain = light
    against, behind = decelerations(
        CarNature(air=40.0, wind=6.0), stops(heading=[0.0, np.pi]), (0.4, 0.6)
    )
    for found, relative in ((against, 8.0), (behind, -4.0)):
        force = 40.0 * abs(relative) * relative / CAR.m / (1.0 + SPIN)
        assert found - plain == pytest.approx(force, rel=0.15)
    viscous = decelerations(CarNature(driveline=5.0), stops(), (0.4, 0.6))[0]
    force = 4.0 * 5.0 * 2.0 / CAR.R_w**2 / CAR.m / (1.0 + SPIN)
    assert viscous - plain == pytest.approx(force, rel=0.1)
    across, along = decelerations(CarNature(furrows=0.1), stops(heading=[0.0, 0.5 * np.pi]))
    assert across - along == pytest.approx(0.1 * G / (1.0 + SPIN), rel=0.05)
    hot = decelerations(CarNature(fading=0.2, cooling=1e5), stops(speed=[4.0] * 12))
    assert np.all(np.diff(hot) < 0.0)
    # 20 % of the brakes are gone at last, 4 % when half of the first stop is done.
    assert hot[-1] / hot[0] == pytest.approx(
        (0.42 * 0.804 + 0.02) / (0.42 * 0.956 + 0.02), abs=0.02
    )
    ice = CarNature(slippery=((0.0, 0.0, 10.0, 0.3),))
    inside, outside = decelerations(ice, stops(x=[0.0, 50.0]))
    assert inside == pytest.approx(0.3 * G, rel=0.05)
    assert outside == pytest.approx(plain, rel=0.01)


def test_the_body_dives_turns_and_comes_to_rest() -> None:
    motion = drive(CarNature(), stops(curvature=[0.0, 0.04], speed=[4.0] * 2))
    braking = (motion.time > 0.5) & (motion.speed[0] > 0.5)
    assert np.deg2rad(0.8) < -float(np.mean(motion.grade[0][braking])) < np.deg2rad(2.5)
    command = int(np.searchsorted(motion.time, 0.0))
    assert motion.yaw_rate[1, command] == pytest.approx(0.16, rel=0.1)
    assert motion.yaw[1, command + 40] > 0.0
    np.testing.assert_array_equal(motion.speed[motion.time > motion.rest[:, None]], 0.0)
    np.testing.assert_allclose(motion.station[:, -1], motion.distance, atol=1e-6)
    assert np.all(motion.deceleration > 3.0)


def test_orders_hold_every_effect_and_halves_share_no_seed() -> None:
    halves = [multibody_outcomes.multibody_orders(1.0, half) for half in ("tuning", "sealed")]
    assert {o.seed % 2 for o in halves[0]} == {1}
    assert {o.seed % 2 for o in halves[1]} == {0}
    for orders in halves:
        assert len(orders) == 12 * 3 * 5 + 60
        assert {o.what for o in orders} == {"", *multibody_outcomes.NAMES}
    few = multibody_outcomes.multibody_orders(0.01, "tuning")
    assert {(o.what, o.strength) for o in few if o.what} == {
        (what, "medium") for what in multibody_outcomes.NAMES
    }


def test_a_run_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def fake(
        task: SetTask, _: object, promise: Callable[[str], None], *, with_peers: bool
    ) -> FinishedSet:
        assert not with_peers
        assert task.multibody is not None
        order = task.multibody
        made.append(order.what)
        promise("digest")
        outcome = WorldOutcome(
            order.what or "clean",
            order.seed,
            0.01,
            0.02,
            "missing_effect",
            ("surface_patch", "brake_lag"),
            False,
            True,
            0.2,
            0.1,
            0.05,
            0.67,
            None,
            1.0,
            "",
            order.strength,
        )
        return FinishedSet(task, sealed.Seal("", "", ""), multibody=outcome)

    monkeypatch.setattr(multibody_runner, "do", fake)
    screen = Console(file=io.StringIO(), width=200)
    file = tmp_path / "outcomes.jsonl"
    areas = ("slippery area", "two slippery areas")
    first = multibody_runner.run("tuning", 0.01, file, screen, areas)
    assert sorted(made) == sorted(areas)
    # The last line is cut off by an interruption.
    file.write_bytes(file.read_bytes()[:-5])
    again = multibody_runner.run("tuning", 0.01, file, screen, areas)
    assert again == first
    assert len(made) == 3
    multibody_runner.show(again, screen)
    outcomes = [done.multibody for done in again if done.multibody is not None]
    named = {m.what: m for m in multibody_outcomes.multibody_metrics(outcomes)}
    assert named["right name, medium and large"].hits == 0
    assert named["right name, or it and the build-up that is there, all"].hits == 2
    assert named["wrong name given with confidence"].hits == 2


def test_a_set_from_end_to_end() -> None:
    """Weaker brakes: driven, measured, investigated in a process of its own, judged."""
    order = next(
        o
        for o in multibody_outcomes.multibody_orders(0.2, "tuning")
        if o.what == "weaker brakes" and o.strength == "large"
    )
    configured = {"m_m": 0.0, "b_m": -0.1, "m_b": 0.0, "b_b": 0.427, "dead_time": 0.19}
    found = worlds.make(multibody_sets.MULTIBODY, order, lambda _: configured, 40)
    assert found.truth()["nature"]["repair"] < 0.8
    assert len(np.unique(found.columns["run"])) == 40
    tables = model_tables.tables_of(found.configured, multibody_sets.car_table())
    finding = sealed.investigate_job(sealed.SealedLog(found.columns, tables))
    assert finding.verdict != "fault", finding.text
    outcome = worlds.judge(multibody_sets.MULTIBODY, found, finding)
    assert outcome.before > 1.5 * outcome.floor
    assert "step_change" in outcome.named
    assert outcome.closed is not None
    assert outcome.closed > 0.8
