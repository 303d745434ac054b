"""What observations do to parameters, group by group, without a wire."""

from __future__ import annotations

import dataclasses
import itertools
import time
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Effect, Model
from slopewise.models.surface_braking import UphillBraking
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.observation_filter import ObservationFilter, columns_of
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.observations import DriveSamples, StopObservation, TerrainLabel
from tests.models.terrain import plant
from tests.services.robot_plant import G, Surface, Vehicle

SEQUENCE = itertools.count(1)


def atv() -> Model:
    return read_model(find_model("atv"))


def husky() -> Model:
    return read_model(find_model("husky"))


def learner(model: Model | None = None, named: bool = False, **settings: Any) -> Learner:
    # Tests make stops faster than vehicles do; what is too fast has tests of its own.
    return Learner(model or atv(), Learning(**{"stops_at_once": 1000, **settings}), lambda: named)


def samples(columns: dict[str, Any], source: str = "robot", surface: str = "") -> DriveSamples:
    return DriveSamples(
        source=source,
        sequence=next(SEQUENCE),
        time=0.0,
        columns=list(columns),
        values=np.stack(list(columns.values())),
        surface=surface,
    )


def stop(force: float, surface: str = "", speed: float = 2.0, **more: Any) -> StopObservation:
    return StopObservation(
        source="robot",
        sequence=next(SEQUENCE),
        time=0.0,
        speed=speed,
        grade=0.0,
        deceleration=force * G,
        deceleration_std=0.02,
        surface=surface,
        **more,
    )


def label(surface: str, probability: float = 1.0) -> TerrainLabel:
    return TerrainLabel(
        source="camera", sequence=next(SEQUENCE), time=0.0, surface=surface, probability=probability
    )


def level_force(one: Learner, surface: str = "") -> float:
    braking = one.active()[0].braking
    return (braking.on(surface) if surface else braking).level_force(2.0)


# ---------------------------------------------------------------------- intake


def judged(
    intake: ObservationFilter, sequence: int, sent: float, now: float, source: str = "a"
) -> str:
    one = TerrainLabel(source=source, sequence=sequence, time=sent, surface="x")
    reason = intake.check("terrain", one, now)
    if not reason:
        intake.accept("terrain", one)
    return reason


def test_each_observation_counts_once_and_in_order() -> None:
    intake = ObservationFilter(2.0, {"terrain:b": 7})
    assert [judged(intake, n, 0.0, 0.0) for n in (1, 3, 3, 2, 4)] == [
        "",
        "",
        "duplicate",
        "out_of_order",
        "",
    ]
    assert judged(intake, 7, 0.0, 0.0, "b") == "duplicate", "heard in another life"
    assert judged(intake, 8, 0.0, 0.0, "b") == ""


@given(epoch=st.floats(-1e9, 1e9), delays=st.lists(st.floats(0.0, 5.0), min_size=1, max_size=50))
def test_any_epoch_and_any_usual_delay_will_do(epoch: float, delays: list[float]) -> None:
    intake = ObservationFilter(6.0)
    for n, delay in enumerate(delays):
        assert judged(intake, n, epoch + 10.0 * n, 10.0 * n + delay) == ""
    assert intake.jumped == {}


def test_a_clock_that_is_set_is_believed_once_it_is_steady() -> None:
    intake = ObservationFilter(2.0)
    assert judged(intake, 1, 0.0, 0.0) == ""
    noise = [judged(intake, 2, 1000.0 * n, float(n)) for n in range(1, 20)]
    assert set(noise) == {"future"}, "a clock that jumps about is never believed"
    steady = [judged(intake, 2 + n, 5000.0 + n, 20.0 + n) for n in range(5)]
    assert steady == ["future"] * 4 + [""]
    assert intake.jumped == {"a": 24.0}
    assert judged(intake, 30, 5010.0, 30.0) == ""


def test_sources_do_not_pile_up() -> None:
    intake = ObservationFilter(2.0)
    for n in range(3000):
        judged(intake, 1, 0.0, 0.0, f"source {n}")
    assert judged(intake, 1, 0.0, 0.0, "source 0") == "", "forgotten"
    assert judged(intake, 1, 0.0, 0.0, "source 2999") == "duplicate"


def test_columns_are_checked_before_anything_is_learned() -> None:
    _, columns = Vehicle().stop(Surface(0.3), 2.0)
    assert list(columns_of(samples(columns), "obs/drive")) == list(columns)
    big = samples({name: np.arange(20_001.0) * 1e-4 for name in columns})
    with pytest.raises(InputError, match="at most 20000 samples"):
        columns_of(big, "obs/drive")
    twice = msgspec.structs.replace(samples(columns), columns=["t", "v", "v_cmd", "v"])
    with pytest.raises(InputError, match="columns"):
        columns_of(twice, "obs/drive")


# ---------------------------------------------------------------------- braking


def test_brakes_that_answer_late_are_planned_for_after_two_stops() -> None:
    one, vehicle = learner(), Vehicle(dead_time=0.7, seed=2)
    told = []
    for _ in range(8):
        _, columns = vehicle.stop(Surface(0.43), 2.5)
        one.observe(samples(columns), "obs/drive")
        told.append(one.active()[0].braking.dead_time)
    assert told[0] == 0.3
    assert told[1] > 0.5
    assert told[-1] == pytest.approx(0.7, abs=0.05)
    notes = one.state.group("braking").describe("braking").notes
    assert notes["estimate b_b"] + 2.0 * notes["estimate m_b"] == pytest.approx(0.43, rel=0.06)
    assert level_force(one) < 0.43, "the first stops looked weak, and what rises, rises slowly"


def test_brakes_that_answer_early_get_no_credit() -> None:
    one = learner()
    for _ in range(6):
        one.observe(stop(0.43, dead_time=0.1), "obs/stop")
    assert one.active()[0].braking.dead_time == 0.3


def test_predictions_are_made_before_the_stop_is_learned_from() -> None:
    one = learner()
    one.observe(stop(0.12, distance=2.9, dead_time=0.3), "obs/stop")
    seen = one.stops[-1]
    assert seen.actual == 2.9
    assert seen.predicted == pytest.approx(2.0**2 / (2 * G * 0.43) + 2.0 * 0.3 + 0.2, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"uphill": UphillBraking(m_m=0.0, b_m=0.0)}, "uphill"),
        ({"level": 0.5}, "brake level"),
        ("aerodynamic_drag", "aerodynamic_drag"),
        ("turning_resistance", "turning_resistance"),
    ],
)
def test_models_that_would_count_force_twice_learn_no_braking(change: Any, word: str) -> None:
    model = atv()
    if isinstance(change, str):
        name = "c" if change == "aerodynamic_drag" else "k"
        effect = Effect(name=change, parameters={name: 0.01})
        model = dataclasses.replace(model, effect=(effect,))
    else:
        model = dataclasses.replace(model, braking=dataclasses.replace(model.braking, **change))
    one = learner(model)
    assert word in one.state.unsupported_reason
    one.observe(stop(0.8), "obs/stop")
    assert one.active()[0] == model
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    assert learner(dataclasses.replace(atv(), effect=(lag,))).state.unsupported_reason == ""


def test_switched_off_nothing_is_learned() -> None:
    one = learner(enabled=False)
    for _ in range(3):
        assert one.observe(stop(0.1), "obs/stop") == (set(), one.state.unsupported_reason)
    assert one.active()[0] == atv()


@pytest.mark.parametrize(("deceleration", "grade"), [(19.0, 0.0), (2.0, 0.5)])
def test_stops_that_no_brakes_can_make_teach_nothing(deceleration: float, grade: float) -> None:
    one = learner()
    before = one.active()[0]
    for _ in range(6):
        told = StopObservation(
            source="robot",
            sequence=next(SEQUENCE),
            time=0.0,
            speed=2.0,
            grade=grade,
            deceleration=deceleration,
        )
        changed, reason = one.observe(told, "obs/stop")
        assert changed == set()
        assert "F_b/W" in reason
    assert one.active()[0] == before
    assert one.counters["stops_implausible"] == 6


def test_there_is_an_end_of_surfaces() -> None:
    one = learner(named=True)
    for n in range(32):
        one.observe(stop(0.3, f"s{n}"), "obs/stop")
    with pytest.raises(ParameterError, match="no slot is free"):
        one.observe(stop(0.3, "more"), "obs/stop")
    assert len(one.active()[0].braking.terrain) == 32


def test_new_surfaces_begin_below_everything_known_and_rise_by_steps() -> None:
    one = learner(named=True, rise=0.02)
    for i in range(14):
        speed = 1.2 + 0.4 * (i % 5)
        one.observe(stop(0.2 + 0.015 * (speed - 2.0), "ice", speed), "obs/stop")
    one.observe(stop(0.5, "gravel"), "obs/stop")
    assert level_force(one, "gravel") <= 0.6 * level_force(one, "ice") + 0.02 + 1e-9
    forces = []
    for _ in range(5):
        one.observe(stop(0.5, "gravel"), "obs/stop")
        forces.append(level_force(one, "gravel"))
    assert np.all(np.diff(forces) <= 0.02 + 1e-9)
    assert np.all(np.diff(forces) > 0.0)


def test_known_weaker_ground_lowers_the_base_as_soon_as_it_is_named() -> None:
    one = learner()
    for _ in range(3):
        one.observe(stop(0.42), "obs/stop")
    one.observe(label("ice"), "obs/terrain")
    for _ in range(2):
        one.observe(stop(0.1), "obs/stop")
    one.observe(label("asphalt"), "obs/terrain")
    for _ in range(9):
        one.observe(stop(0.42), "obs/stop")
    assert level_force(one) > 0.15
    changed, _ = one.observe(label("ice"), "obs/terrain")
    assert changed == {"braking"}
    assert level_force(one) <= level_force(one, "ice") + 1e-9


def test_another_calibration_in_the_model_file_takes_back_what_was_learned_above_it() -> None:
    one = learner(rise=0.1)
    for i in range(20):
        one.observe(stop(0.55 + 0.015 * (0.4 * (i % 5)), speed=1.5 + 0.4 * (i % 5)), "obs/stop")
    groups = one.state.group("braking")
    state = groups.state("braking")
    model = atv()
    weaker = dataclasses.replace(model.braking, b_b=0.3)
    again = learner(dataclasses.replace(model, braking=weaker))
    again.state.group("braking").restore("braking", state, 0.0)
    assert level_force(again) <= 0.33 + 1e-9
    same = learner(model)
    same.state.group("braking").restore("braking", state, 0.0)
    assert level_force(same) == pytest.approx(level_force(one), rel=1e-6)


@settings(max_examples=25)
@given(
    forces=st.lists(st.floats(0.05, 0.9), max_size=12), ages=st.lists(st.floats(0, 1e6), max_size=4)
)
def test_restored_older_is_never_stronger(forces: list[float], ages: list[float]) -> None:
    one = learner(named=True)
    for i, force in enumerate(forces):
        one.observe(stop(force, ("", "sand")[i % 2]), "obs/stop")
    for name in ("braking", "braking.sand"):
        state, surface = one.state.group(name).state(name), name[8:]
        strongest = level_force(one, surface)
        for age in sorted(ages):
            again = learner(named=True)
            again.state.group(name).restore(name, state, age)
            model, common, _ = again.active()
            force = (model.braking.on(surface) if surface else model.braking).level_force(2.0)
            assert force <= strongest + 1e-6
            strongest = force
            assert common <= 14_400.0


# ---------------------------------------------------------------------- ground and limits


def driven(one: Learner, columns: dict[str, Any], begin: float = 0.0) -> list[str]:
    """What became of a drive, in parts as they come."""
    whole = {name: values + (begin if name == "t" else 0.0) for name, values in columns.items()}
    parts = np.array_split(np.arange(whole["t"].size), 40)
    return [
        one.observe(samples({n: v[part] for n, v in whole.items()}), "obs/drive")[1]
        for part in parts
    ]


def test_ground_that_changes_takes_back_what_the_base_gained() -> None:
    one = learner(husky(), rise=0.1)
    for i in range(16):
        one.observe(stop(0.9, speed=0.6 + 0.05 * (i % 5)), "obs/stop")
    before = level_force(one)
    body = plant.Body()
    legs = plant.square(sides=8, on_the_spot=False)
    end = sum(leg[0] for leg in legs)
    grounds = lambda t: plant.ASPHALT if t < 0.5 * end else plant.SAND  # noqa: E731
    told = driven(one, plant.drive(legs, grounds, body, seed=4))
    assert "the ground changed" in told
    assert told.index("the ground changed") >= 20
    assert level_force(one) <= before
    assert one.active()[0].terrain.motion_resistance > 0.2


def test_terrain_parameters_get_slower_at_once_and_faster_by_a_share() -> None:
    group = learner().state.group("terrain")
    nan = (float("nan"), float("nan"))
    assert group.learn(((0.30, 0.01), nan, (1.6, 0.05)))  # type: ignore[attr-defined]
    values = group.describe("terrain").values
    assert values["motion_resistance"] == pytest.approx(0.31)
    assert values["slip_track"] == pytest.approx(1.65)
    assert values["lateral_resistance"] == 0.20
    assert group.learn(((0.03, 0.01), nan, nan))  # type: ignore[attr-defined]
    values = group.describe("terrain").values
    assert values["motion_resistance"] == pytest.approx(0.31 - 0.2 * 0.27)
    assert not group.learn(((9.0, 0.0), (-1.0, 0.0), (99.0, 0.0)))  # type: ignore[attr-defined]
    assert group.describe("terrain").values == pytest.approx(values)
    assert not group.forget_faster()  # type: ignore[attr-defined]
    for _ in range(20):
        group.learn(((0.03, 0.01), nan, nan))  # type: ignore[attr-defined]
    assert group.describe("terrain").values["motion_resistance"] < 0.06
    assert group.forget_faster()  # type: ignore[attr-defined]
    assert group.describe("terrain").values["motion_resistance"] == 0.13
    state = group.state("terrain")
    again = learner().state.group("terrain")
    again.restore("terrain", state, 1e9)
    assert again.describe("terrain").values["motion_resistance"] >= 0.13


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
    model = atv()
    tighter = dataclasses.replace(model.limits, speed=2.0, min_load=0.3)
    again = learner(dataclasses.replace(model, limits=tighter)).state.group("limits")
    again.restore("limits", state, 0.0)
    values = again.describe("limits").values
    assert (values["speed"], values["min_load"]) == (2.0, 0.3)


def test_a_terrain_file_that_is_none_is_said_at_once() -> None:
    with pytest.raises(InputError, match="husky"):
        learner(terrains="nonsense")


def test_own_samples_name_the_ground_with_known_classes() -> None:
    one = learner(husky(), terrains="husky")
    driven(one, plant.drive(plant.square(sides=3), plant.SAND, plant.Body(), seed=2))
    name, probability = (
        one.ground.surface(time.monotonic()),
        one.ground.probability(time.monotonic()),
    )
    assert name == "beach_sand"
    assert probability > 0.8
    one.observe(stop(0.5), "obs/stop")
    assert "braking.beach_sand" in one.state.names()


def test_labels_expire() -> None:
    one = learner(label_for=5.0)
    now = time.monotonic()
    one.observe(label("ice"), "obs/terrain")
    assert one.ground.surface(now + 4.0) == "ice"
    assert one.ground.surface(now + 6.0) == ""
    one.observe(label("ice", 0.5), "obs/terrain")
    assert one.ground.surface(now) == ""


# ---------------------------------------------------------------------- never faster but by stops

EVENTS = st.one_of(
    st.tuples(st.just("stop"), st.sampled_from(["", "sand", "ice"]), st.floats(0.03, 1.1)),
    st.tuples(st.just("label"), st.sampled_from(["sand", "ice", "mud"]), st.just(1.0)),
    st.tuples(st.just("unsure"), st.just("mud"), st.just(0.3)),
    st.tuples(st.just("age"), st.just(""), st.floats(1.0, 1e5)),
)


def forces(one: Learner) -> dict[str, np.ndarray]:
    """F_b/W at the corners of the trained rectangle by surface, as planned with before margins."""
    braking = one.active()[0].braking
    found = {}
    for name in ("", *braking.terrain):
        b = braking.on(name) if name else braking
        corners = [(v, g) for v in b.speed_range for g in b.grade_range]
        found[name] = np.array([(b.m_m * v + b.b_m) * g + b.m_b * v + b.b_b for v, g in corners])
    return found


@settings(max_examples=60)
@given(events=st.lists(EVENTS, max_size=40), named=st.booleans())
def test_only_stops_make_it_faster_and_they_by_steps(events: list[Any], named: bool) -> None:
    rise, one = 0.01, learner(named=named)
    known = forces(one)
    lowest = {"": known[""]}
    for what, surface, value in events:
        if what == "stop":
            one.observe(stop(value, surface), "obs/stop")
        elif what == "age":
            one.state.braking.forces._aged -= value  # type: ignore[attr-defined]
            one.age()
        else:
            one.observe(label(surface, value), "obs/terrain")
        after = forces(one)
        allowed = rise if what == "stop" else 0.0
        for name, force in after.items():
            if name in known:
                assert np.all(force <= known[name] + allowed + 1e-6), (what, name)
            elif name != "model file":
                # Not known before: no more than the model file, nor what is new ground's share.
                assert np.all(force <= lowest[""] + 1e-6), (what, name)
        known = after


# ---------------------------------------------------------------------- sources that begin anew


def test_a_source_that_counts_from_one_again_is_heard_after_a_few_messages_and_flagged() -> None:
    intake = ObservationFilter(2.0, {"terrain:a": 2**53})
    assert [judged(intake, n, float(n), float(n)) for n in range(1, 5)] == [
        "out_of_order",
        "out_of_order",
        "",
        "",
    ]
    assert intake.notices.active() == ["terrain observations of a: the source restarted its count"]


def test_a_sender_whose_machine_was_started_anew_is_heard_with_its_new_clock() -> None:
    intake = ObservationFilter(2.0)
    for n in range(1, 30):
        judged(intake, n, 50_000.0 + n, float(n))
    told = [judged(intake, n, 5.0 + n, 40.0 + n) for n in range(1, 12)]
    assert told[-1] == ""
    assert intake.jumped == {"a": 47.0}


def test_what_was_stored_up_and_sent_late_is_no_new_count() -> None:
    intake = ObservationFilter(2.0)
    for n in range(1, 30):
        judged(intake, n, 10.0 * n, 10.0 * n)
    again = [judged(intake, n, 10.0 * n, 400.0) for n in range(5, 20)]
    assert set(again) <= {"out_of_order", "duplicate"}
