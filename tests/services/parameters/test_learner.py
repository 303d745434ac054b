"""Changes of parameters by observations, group by group, without a wire."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.models.parameters import Effect, Model
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.terrain_group import TerrainGroup
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.observations import TerrainLabel
from tests.models.terrain import plant
from tests.services.parameters.parameter_fixtures import (
    ATV,
    HUSKY,
    NUMBERS,
    G,
    learner,
    level_force,
    samples,
    started,
    stop,
)
from tests.services.robot_plant import Surface, Vehicle


def label(surface: str, probability: float = 1.0) -> TerrainLabel:
    return TerrainLabel(
        source="camera", sequence=next(NUMBERS), time=0.0, surface=surface, probability=probability
    )


def test_brakes_that_answer_late_are_planned_for_after_two_stops() -> None:
    robot, vehicle = learner(), Vehicle(dead_time=0.7, seed=2)
    dead_times = []
    for _ in range(8):
        _, columns = vehicle.stop(Surface(0.43), 2.5)
        robot.observe(samples(columns), "obs/drive")
        dead_times.append(robot.active()[0].braking.dead_time)
    assert dead_times[0] == 0.3
    assert dead_times[1] > 0.5
    assert dead_times[-1] == pytest.approx(0.7, abs=0.05)
    notes = robot.state.group("braking").describe("braking").notes
    assert notes["estimate b_b"] + 2.0 * notes["estimate m_b"] == pytest.approx(0.43, rel=0.06)
    assert level_force(robot) < 0.43, "the first stops looked weak, and what rises, rises slowly"


def test_brakes_that_answer_early_get_no_credit() -> None:
    robot = learner()
    for _ in range(6):
        robot.observe(stop(0.43, dead_time=0.1), "obs/stop")
    assert robot.active()[0].braking.dead_time == 0.3


def test_predictions_are_made_before_the_stop_is_learned_from() -> None:
    robot = learner()
    robot.observe(stop(0.12, distance=2.9, dead_time=0.3), "obs/stop")
    seen = robot.stops[-1]
    assert seen.actual == 2.9
    assert seen.predicted == pytest.approx(2.0**2 / (2 * G * 0.43) + 2.0 * 0.3 + 0.2, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"uphill": UphillBraking(m_m=0.0, b_m=0.0)}, "uphill"),
        ({"level": 0.5}, "brake level"),
        ("aerodynamic_drag", "aerodynamic_drag"),
        ("turning_resistance", "turning_resistance"),
    ],
)
def test_models_that_would_count_force_twice_learn_no_braking(change: Any, part: str) -> None:
    model = ATV
    if isinstance(change, str):
        name = "c" if change == "aerodynamic_drag" else "k"
        effect = Effect(name=change, parameters={name: 0.01})
        model = dataclasses.replace(model, effect=(effect,))
    else:
        model = dataclasses.replace(model, braking=dataclasses.replace(model.braking, **change))
    robot = learner(model)
    assert part in robot.state.unsupported_reason
    robot.observe(stop(0.8), "obs/stop")
    assert robot.active()[0] == model
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    assert learner(dataclasses.replace(ATV, effect=(lag,))).state.unsupported_reason == ""


def test_switched_off_nothing_is_learned() -> None:
    robot = learner(enabled=False)
    for _ in range(3):
        assert robot.observe(stop(0.1), "obs/stop") == (set(), robot.state.unsupported_reason)
    assert robot.active()[0] == ATV


@pytest.mark.parametrize(("deceleration", "grade"), [(19.0, 0.0), (2.0, 0.5)])
def test_stops_that_no_brakes_can_make_are_not_learned_from(
    deceleration: float, grade: float
) -> None:
    robot = learner()
    before = robot.active()[0]
    for _ in range(6):
        impossible = stop(0.0, grade=grade, deceleration=deceleration)
        changed, reason = robot.observe(impossible, "obs/stop")
        assert changed == set()
        assert "F_b/W" in reason
    assert robot.active()[0] == before
    assert robot.counters["stops_implausible"] == 6


def test_new_surfaces_begin_below_everything_known_and_rise_by_steps() -> None:
    robot = learner(named=True, rise=0.02)
    for i in range(14):
        speed = 1.2 + 0.4 * (i % 5)
        robot.observe(stop(0.2 + 0.015 * (speed - 2.0), "ice", speed), "obs/stop")
    robot.observe(stop(0.5, "gravel"), "obs/stop")
    assert level_force(robot, "gravel") <= 0.6 * level_force(robot, "ice") + 0.02 + 1e-9
    forces = []
    for _ in range(5):
        robot.observe(stop(0.5, "gravel"), "obs/stop")
        forces.append(level_force(robot, "gravel"))
    assert np.all(np.diff(forces) <= 0.02 + 1e-9)
    assert np.all(np.diff(forces) > 0.0)


def test_a_label_of_weaker_terrain_lowers_the_base() -> None:
    robot = learner()
    for _ in range(3):
        robot.observe(stop(0.42), "obs/stop")
    robot.observe(label("ice"), "obs/terrain")
    for _ in range(2):
        robot.observe(stop(0.1), "obs/stop")
    robot.observe(label("asphalt"), "obs/terrain")
    for _ in range(9):
        robot.observe(stop(0.42), "obs/stop")
    assert level_force(robot) > 0.15
    changed, _ = robot.observe(label("ice"), "obs/terrain")
    assert changed == {"braking"}
    assert level_force(robot) <= level_force(robot, "ice") + 1e-9


def test_learned_force_above_another_calibration_is_not_restored() -> None:
    robot = learner(rise=0.1)
    for i in range(20):
        robot.observe(stop(0.55 + 0.015 * (0.4 * (i % 5)), speed=1.5 + 0.4 * (i % 5)), "obs/stop")
    groups = robot.state.group("braking")
    state = groups.state("braking")
    model = ATV
    weaker = dataclasses.replace(model.braking, b_b=0.3)
    again = learner(dataclasses.replace(model, braking=weaker))
    again.state.group("braking").restore("braking", state, 0.0)
    assert level_force(again) <= 0.33 + 1e-9
    same = learner(model)
    same.state.group("braking").restore("braking", state, 0.0)
    assert level_force(same) == pytest.approx(level_force(robot), rel=1e-6)


def driven(robot: Learner, columns: dict[str, Any], begin: float = 0.0) -> list[str]:
    """Outcomes of a drive, part by part."""
    shifted = {name: values + (begin if name == "t" else 0.0) for name, values in columns.items()}
    parts = np.array_split(np.arange(shifted["t"].size), 40)
    return [
        robot.observe(samples({n: v[part] for n, v in shifted.items()}), "obs/drive")[1]
        for part in parts
    ]


def test_a_detected_change_of_terrain_lowers_the_base() -> None:
    robot = learner(HUSKY, rise=0.1, terrains="husky")
    for i in range(16):
        robot.observe(stop(0.9, speed=0.6 + 0.05 * (i % 5)), "obs/stop")
    before = level_force(robot)
    body = plant.Body(idle_current=0.0)
    legs = plant.square(sides=8, on_the_spot=False)
    end = sum(leg[0] for leg in legs)
    grounds = lambda t: plant.ASPHALT if t < 0.5 * end else plant.SAND  # noqa: E731
    outcomes = driven(robot, plant.drive(legs, grounds, body, seed=4))
    assert "the ground changed" in outcomes
    assert outcomes.index("the ground changed") >= 20
    assert level_force(robot) <= before
    assert robot.active()[0].terrain.motion_resistance > 0.2


def test_terrain_parameters_get_slower_immediately_and_faster_by_a_share() -> None:
    group = learner().state.group("terrain")
    nan = (float("nan"), float("nan"))
    assert group.learn(((0.30, 0.01), nan, (1.6, 0.05)))  # type: ignore[attr-defined]
    values = group.describe("terrain").values
    upper = 0.30 + 1.645 * 0.01
    assert values["motion_resistance"] == pytest.approx(upper)
    assert values["slip_track"] == pytest.approx(1.6 + 1.645 * 0.05)
    assert values["lateral_resistance"] == 0.20
    assert group.learn(((0.03, 0.01), nan, nan))  # type: ignore[attr-defined]
    values = group.describe("terrain").values
    assert values["motion_resistance"] == pytest.approx(upper - 0.2 * 0.27)
    assert not group.learn(((9.0, 0.0), (-1.0, 0.0), (99.0, 0.0)))  # type: ignore[attr-defined]
    assert group.describe("terrain").values == pytest.approx(values)
    assert not group.restrict_to_file()
    for _ in range(20):
        group.learn(((0.03, 0.01), nan, nan))  # type: ignore[attr-defined]
    assert group.describe("terrain").values["motion_resistance"] == 0.13
    group.set("terrain", {"motion_resistance": 0.05})
    assert not group.learn(((0.04, 0.001), nan, nan))  # type: ignore[attr-defined]
    assert group.describe("terrain").values["motion_resistance"] == pytest.approx(0.05, abs=1e-4)
    assert group.restrict_to_file()
    assert group.describe("terrain").values["motion_resistance"] == 0.13
    state = group.state("terrain")
    again = learner().state.group("terrain")
    again.restore("terrain", state, 1e9)
    assert again.describe("terrain").values["motion_resistance"] >= 0.13


def terrain_of(group: TerrainGroup) -> tuple[float, ...]:
    terrain = group.apply(HUSKY).terrain
    return (terrain.motion_resistance, terrain.lateral_resistance, terrain.slip_track)


def test_a_vaguer_resistance_lets_the_vehicle_roll_on_faster() -> None:
    unknown, rolling = (float("nan"), float("nan")), []
    for std in (0.0, 0.02, 0.1):
        group = TerrainGroup(HUSKY, Learning())
        group.learn(((0.13, std), unknown, unknown))
        rolling.append(group.apply(HUSKY).terrain.rolling_while_braking)
    assert rolling == pytest.approx([0.13, 0.13 - 1.645 * 0.02, 0.0])


def test_less_resistance_than_the_file_states_counts_for_rolling_alone() -> None:
    unknown, group = (float("nan"), float("nan")), TerrainGroup(HUSKY, Learning())
    for estimate in ((0.3, 0.01), (0.05, 0.01)):
        group.learn((estimate, unknown, unknown))
    again = TerrainGroup(HUSKY, Learning())
    again.restore("terrain", group.state("terrain"), 0.0)
    for terrain in (it.apply(HUSKY).terrain for it in (group, again)):
        assert terrain.rolling_while_braking == pytest.approx(0.05 - 1.645 * 0.01)
        assert terrain.motion_resistance >= HUSKY.terrain.motion_resistance


@given(values=st.lists(st.tuples(*[st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 0.5))] * 3)))
def test_no_terrain_estimate_makes_a_plan_faster_than_the_file(values: Any) -> None:
    prior = HUSKY.terrain
    group = TerrainGroup(HUSKY, Learning())
    for features in values:
        group.learn(features)
        terrain = terrain_of(group)
        file = (prior.motion_resistance, prior.lateral_resistance, prior.slip_track)
        assert all(used >= known for used, known in zip(terrain, file, strict=True))


@pytest.mark.parametrize(
    "state",
    [
        {"values": {"speed": float("nan")}},
        {"values": {"colour": 1.0}},
        {"values": {"speed": -1}},
        {},
        {"values": None},
    ],
)
def test_limits_that_cannot_have_been_set_are_not_restored(state: dict) -> None:
    group = learner().state.group("limits")
    with pytest.raises((ValueError, KeyError, TypeError)):
        group.restore("limits", state, 0.0)
    assert group.describe("limits").values["speed"] == 4.0


def test_limits_follow_a_model_file_that_got_tighter() -> None:
    group = learner().state.group("limits")
    group.set("limits", {"speed": 3.0, "min_load": 0.2})
    state = group.state("limits")
    model = ATV
    tighter = dataclasses.replace(model.limits, speed=2.0, min_load=0.3)
    again = learner(dataclasses.replace(model, limits=tighter)).state.group("limits")
    again.restore("limits", state, 0.0)
    values = again.describe("limits").values
    assert (values["speed"], values["min_load"]) == (2.0, 0.3)


def test_a_missing_terrain_file_is_an_input_error() -> None:
    with pytest.raises(InputError, match="husky"):
        learner(terrains="nonsense")


def with_surfaces(**forces: float) -> Model:
    tables = {name: SurfaceBraking(b_b=b_b) for name, b_b in forces.items()}
    return dataclasses.replace(HUSKY, braking=dataclasses.replace(HUSKY.braking, terrain=tables))


def test_own_samples_give_no_name_and_plans_use_the_weakest_surface_left_open() -> None:
    model = with_surfaces(asphalt=0.18, beach_sand=0.15, dirt_road=0.30, elsewhere=0.1)
    robot = learner(model, terrains="husky")
    assert not robot.active()[0].braking.states_of("")
    driven(robot, plant.drive(plant.square(sides=3), plant.SAND, plant.Body(), seed=2))
    assert robot.ground.surface(time.monotonic()) == ""
    assert robot.ground.description() == "soft"  # the file has no threshold of grip
    assert robot.is_outdated()
    assert robot.active()[0].braking.states_of("") == ("beach_sand",)
    assert "ground is soft: plans count with the base or beach_sand" in robot.flags()
    assert not robot.is_outdated()
    robot.observe(stop(0.5), "obs/stop")
    assert list(robot.state.braking.forces.learned()) == [""]


def test_the_service_publishes_what_the_description_leaves() -> None:
    model = with_surfaces(asphalt=0.18, beach_sand=0.15, elsewhere=0.1)
    service = started("", model, terrains="husky")
    assert not service.active.model.braking.states_of("")
    log = plant.drive([(3.0, 0.0, 0.0)], plant.DIRT)
    receipt = service.observe("drive", samples(log), "obs/drive", time.monotonic())
    assert receipt.status == "taken"
    assert service.active.model.braking.states_of("") == ("asphalt", "beach_sand")
    assert any("plans count with the base or asphalt" in flag for flag in service.active.flags)


def test_a_vehicle_file_that_cannot_be_right_is_flagged() -> None:
    heavy = dataclasses.replace(HUSKY.vehicle, mass=600.0)
    robot = learner(dataclasses.replace(HUSKY, vehicle=heavy))
    driven(robot, plant.drive(plant.square(sides=6), plant.SAND, plant.Body(idle_current=0.0)))
    (flag,) = robot.ground.flags()
    assert "the vehicle file cannot be right" in flag


EVENTS = st.one_of(
    st.tuples(st.just("stop"), st.sampled_from(["", "sand", "ice"]), st.floats(0.03, 1.1)),
    st.tuples(st.just("label"), st.sampled_from(["sand", "ice", "mud"]), st.just(1.0)),
    st.tuples(st.just("unsure"), st.just("mud"), st.just(0.3)),
    st.tuples(st.just("age"), st.just(""), st.floats(1.0, 1e5)),
)


def forces(robot: Learner) -> dict[str, np.ndarray]:
    """F_b/W at the corners of the trained rectangle by surface, as planned with before margins."""
    braking = robot.active()[0].braking
    by_surface = {}
    for name in ("", *braking.terrain):
        b = braking.on(name) if name else braking
        corners = [(v, g) for v in b.speed_range for g in b.grade_range]
        by_surface[name] = np.array(
            [(b.m_m * v + b.b_m) * g + b.m_b * v + b.b_b for v, g in corners]
        )
    return by_surface


@settings(max_examples=60)
@given(events=st.lists(EVENTS, max_size=40), named=st.booleans())
def test_only_stops_make_it_faster_and_they_by_steps(events: list[Any], named: bool) -> None:
    rise, robot = 0.01, learner(named=named)
    known = forces(robot)
    lowest = {"": known[""]}
    for what, surface, value in events:
        if what == "stop":
            robot.observe(stop(value, surface), "obs/stop")
        elif what == "age":
            robot.state.braking.forces._aged -= value  # type: ignore[attr-defined]
            robot.state.braking.forces.age()
        else:
            robot.observe(label(surface, value), "obs/terrain")
        after = forces(robot)
        allowed = rise if what == "stop" else 0.0
        for name, force in after.items():
            if name in known:
                assert np.all(force <= known[name] + allowed + 1e-6), (what, name)
            elif name != "model file":
                # Not known before: no more than the model file, nor what is new ground's share.
                assert np.all(force <= lowest[""] + 1e-6), (what, name)
        known = after
