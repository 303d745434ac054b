"""What the guard does with a command; and with what it heard, or did not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slopewise.services.guard.arc import PlanarPose
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import (
    BaseCommand,
    GuardDecision,
    GuardScene,
    VehicleMotion,
    decide,
)
from slopewise.services.guard.ground import GuardGround, ground_of
from slopewise.services.guard.model_reader import read_guard_model, rows_of
from slopewise.services.guard.obedience import Obedience
from slopewise.services.guard.settings import (
    GuardJudgement,
    GuardSettings,
    GuardTiming,
    read_guard_settings,
)
from slopewise.services.io.model_file import find_model
from slopewise.services.wire.messages import MapUpdate
from slopewise.services.wire.parameter_messages import ParameterGroup
from tests.services.faults import fault_in

MODEL = read_guard_model(find_model("atv"))
FLAT = GuardGround(np.zeros((200, 400)), 0.25, (-20.0, -25.0))
SHIPPED = Path(__file__).parents[3] / "configs" / "guard.toml"


def judged(
    speed: float,
    wanted: float,
    rate: float = 0.0,
    clear: float = 1e9,
    ground: GuardGround = FLAT,
    x: float = 0.0,
) -> GuardDecision:
    scene = GuardScene(MODEL, (rows_of(MODEL),), ground, clear)
    motion = VehicleMotion(PlanarPose(x, 0.0, 0.0), speed)
    return decide(scene, motion, BaseCommand(wanted, rate), stands=0.1, late=0.02, load=0.5)


def test_what_can_be_stopped_passes() -> None:
    found = judged(2.0, 2.5, 0.3)
    assert (found.action, found.command, found.brake) == ("pass", BaseCommand(2.5, 0.3), False)


def test_what_cannot_is_slowed_and_turns_as_it_was_to() -> None:
    found = judged(0.5, 4.0, 0.8, clear=2.0)
    assert found.action == "slow"
    assert 0.5 < found.command.speed < 2.5
    assert found.command.yaw_rate / found.command.speed == pytest.approx(0.8 / 4.0)
    assert "clear distance ends 2.00 m ahead" in found.reason


def test_too_late_is_a_stop() -> None:
    found = judged(3.0, 3.0, clear=1.5)
    assert (found.action, found.command, found.brake) == ("stop", BaseCommand(0.0, 0.0), True)


@pytest.mark.parametrize("clear", [0.8, 1.5, 3.0, 6.0])
def test_who_drives_at_what_is_allowed_stops_before_the_end(clear: float) -> None:
    """The worst of bases: at once as fast as it may be; then a stop in closed form."""
    place, speed = 0.0, 0.0
    for _ in range(200):
        found = judged(speed, 4.0, clear=clear - place, x=place)
        if found.action == "stop":
            break
        speed = found.command.speed
        place += 0.1 * speed
        braking = speed * 0.3 + speed**2 / (2 * 9.80665 * (0.015 * max(speed, 1.0) + 0.40))
        assert place + braking <= clear + 1e-6
    assert place > clear - 1.0


def test_unknown_ground_obstacles_and_steep_ground_end_the_way() -> None:
    for change, words in (
        (np.nan, "ground is unknown"),
        (1.5, "ground is steeper|an obstacle"),
        (-2.0, "steeper"),
    ):
        heights = np.zeros((200, 400))
        heights[:, 100:] = change  # from x = 5 m on
        ground = GuardGround(heights, 0.25, (-20.0, -25.0))
        found = judged(3.0, 4.0, ground=ground, x=0.5)
        assert found.action in ("slow", "stop")
        assert any(word in found.reason for word in words.split("|"))
        assert judged(3.9, 3.9, ground=ground, x=2.0).action == "stop"
        assert judged(1.0, 1.0, ground=ground, x=-15.0).action == "pass"


def test_off_the_map_nothing_moves() -> None:
    assert judged(0.0, 1.0, x=500.0).action == "stop"


def test_turns_that_tip_are_slowed() -> None:
    found = judged(1.0, 3.5, 3.5)
    assert found.action == "slow"
    speed, rate = found.command
    assert speed * rate <= MODEL.lateral + 1e-9


def test_tight_turns_count_as_tight_as_they_are() -> None:
    """A radius of 15 cm: lateral acceleration is speed times yaw rate, however tight."""
    found = judged(0.6, 0.8, 5.0)
    assert found.command.speed * found.command.yaw_rate <= MODEL.lateral + 1e-9


def test_backwards_counts_what_is_behind() -> None:
    heights = np.zeros((200, 400))
    heights[:, :72] = np.nan  # up to x = -2 m
    ground = GuardGround(heights, 0.25, (-20.0, -25.0))
    assert judged(0.0, -3.0, ground=ground).action == "slow"
    assert judged(0.0, 3.0, ground=ground).action == "pass"
    turned = judged(2.0, -1.0)
    assert (turned.action, turned.command) == ("slow", BaseCommand(0.0, 0.0))


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_numbers_that_are_none(bad: float) -> None:
    assert judged(bad, 1.0).action == "stop"
    assert judged(1.0, bad).action == "stop"
    assert judged(1.0, 1.0, bad).action == "stop"


def guard(**changes: object) -> Guard:
    settings = GuardSettings(model="atv", **changes)  # type: ignore[arg-type]
    return Guard(settings, MODEL, FLAT)


def feed(it: Guard, now: float, speed: float = 1.0, wanted: float = 1.0, number: int = 0) -> None:
    sequence = number or round(1000 * now)
    it.motions.take(VehicleMotion(PlanarPose(0.0, 0.0, 0.0), speed), now, "r", sequence)
    it.commands.take((BaseCommand(wanted, 0.0), sequence), now, "p", sequence)


def test_silence_is_a_stop_and_lasts_until_rest() -> None:
    it = guard()
    assert it.word(0.0).decision.reason == "no odometry"
    it = guard()
    feed(it, 1.0, speed=0.0)
    assert it.word(1.01).decision.action == "pass"
    feed(it, 1.1)
    it.commands.drop()
    assert it.word(1.11).decision.reason == "no command"
    feed(it, 1.2)
    assert it.word(1.21).decision.action == "stop"  # it still moves
    feed(it, 1.3, speed=0.0)
    assert it.word(1.31).decision.action == "pass"
    assert it.word(1.31 + 0.21).decision.reason == ("odometry is 0.22 s old (arrival), limit 0.2 s")


def test_repeated_and_late_commands_do_not_count() -> None:
    it = guard()
    feed(it, 1.0, number=5)
    assert not it.commands.take((BaseCommand(4.0, 0.0), 5), 1.05, "p", 5)
    assert not it.commands.take((BaseCommand(4.0, 0.0), 3), 1.05, "p", 3)
    assert it.commands.take((BaseCommand(0.5, 0.0), 9), 1.05, "p", 9)
    assert it.counters["command lost"] == 3
    assert it.counters["command repeated or late"] == 2
    assert it.commands.take((BaseCommand(0.5, 0.0), 1), 3.0, "p", 1)  # silent for long: begun anew


def test_a_clear_distance_shrinks_as_the_vehicle_goes() -> None:
    it = guard(judgement=GuardJudgement(awaits_clear=True))
    feed(it, 1.0, speed=0.0)
    assert it.word(1.0).decision.reason == "no clear distance"
    assert it.clear(5.0, 1.0, "s", 1)
    assert it.word(1.01).decision.action == "pass"
    it.motions.take(VehicleMotion(PlanarPose(4.0, 0.0, 0.0), 3.0), 1.1, "r", 2000)
    assert it.word(1.11).decision.action == "stop"
    assert not it.clear(float("nan"), 1.2, "s", 2)


def test_it_holds_at_rest() -> None:
    it = guard()
    feed(it, 1.0, speed=0.0, wanted=0.0)
    word = it.word(1.0).decision
    assert (word.action, word.brake) == ("pass", True)


def test_a_base_that_does_not_obey_is_stopped() -> None:
    it = guard(timing=GuardTiming(command=0.5, motion=0.5))
    feed(it, 0.0, speed=0.0)
    for k in range(1, 60):
        feed(it, 0.05 * k, speed=2.5, wanted=1.0)
        word = it.word(0.05 * k).decision
    assert word.action == "stop"
    assert "faster than it was told" in word.reason


def test_obedience_gives_brakes_their_time() -> None:
    watched = Obedience(dead_time=0.3, decel=1.0)
    for k in range(200):
        now, limit = 0.05 * k, 3.0 if k < 100 else 1.0
        watched.told(limit, now)
        speed = 3.0 if k < 108 else max(3.0 - 1.05 * 0.05 * (k - 108), 1.0)
        assert watched.disobeys(speed, now) == 0.0


def group(**values: float) -> ParameterGroup:
    return ParameterGroup(
        group="braking",
        version=2,
        valid=True,
        age=0.0,
        fingerprint="f",
        cause="c",
        who="w",
        values={"m_m": -0.03, "b_m": -0.35, "m_b": 0.015, "b_b": 0.40} | values,
    )


def test_what_was_learned_can_make_stops_longer_and_not_shorter_unless_trusted() -> None:
    it = guard()
    for trusted, weak, strong in ((False, True, False), (True, True, True)):
        found = {}
        for name, b_b in (("file", 0.40), ("weak", 0.25), ("strong", 0.60)):
            it = guard(judgement=GuardJudgement(awaits_clear=True, trust_learned=trusted))
            it.learned.take(group(b_b=b_b))
            it.learn()
            it.motions.take(VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 0.0), 1.0)
            it.clear(4.0, 1.0, "s", 1)
            it.commands.take((BaseCommand(4.0, 0.0), 1), 1.0)
            found[name] = it.word(1.0).decision.command.speed
        assert (found["weak"] < found["file"]) == weak
        assert (found["strong"] > found["file"]) == strong


def test_maps_and_patches() -> None:
    def update(**changes: object) -> MapUpdate:
        fields: dict[str, object] = {
            "source": "s",
            "sequence": 1,
            "elevation": np.zeros((6, 8)),
            "resolution": 0.5,
            "origin": (1.0, 2.0),
        }
        return MapUpdate(**(fields | changes))  # type: ignore[arg-type]

    whole = ground_of(update(), None)
    patched = ground_of(
        update(elevation=np.full((2, 2), 1.0), origin=(2.0, 2.5), patch=True), whole
    )
    assert patched.elevation[1:3, 2:4].tolist() == [[1.0, 1.0], [1.0, 1.0]]
    assert patched.elevation.sum() == 4.0
    from slopewise.models.errors import ParameterError

    for bad, known in (
        ({"patch": True}, None),
        ({"elevation": np.zeros((1, 3))}, None),
        ({"patch": True, "origin": (1.2, 2.0)}, whole),
        ({"patch": True, "origin": (3.0, 2.0)}, whole),
        ({"terrain_class": np.full((6, 8), 3.0), "class_names": ["", "a"]}, None),
    ):
        with pytest.raises(ParameterError):
            ground_of(update(**bad), known)


def test_the_shipped_settings_are_the_defaults() -> None:
    assert read_guard_settings(SHIPPED) == GuardSettings(model="atv")


@pytest.mark.parametrize(
    ("text", "field", "words"),
    [
        ("", "model", "expected"),
        ("model = 'atv'\n[timing]\ncommand = 3.0\n", "timing.command", "<= 1"),
        ("model = 'atv'\n[ros]\noutput = 'cmd_vel_nav'\n", "ros.output", "another topic"),
        ("model = 'atv'\n[zenoh]\nmode = 'router'\n", "zenoh.mode", "client"),
        ("model = 'atv'\n[judge]\n", "judge", "unknown key"),
    ],
)
def test_settings_that_cannot_be_used(tmp_path: Path, text: str, field: str, words: str) -> None:
    file = tmp_path / "guard.toml"
    file.write_text(text)
    with fault_in(file, field, words):
        read_guard_settings(file)
