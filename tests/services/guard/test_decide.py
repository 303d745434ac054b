"""Decisions on single commands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.guard.decide import BaseCommand, GuardDecision, decide, guard_decision
from slopewise.services.guard.guard_model import GuardScene, read_guard_model
from slopewise.services.io.model_file import find_model, read_model
from tests.services.guard.guard_fixtures import ATV, FLAT, MODEL, ground_with, map_of, motion, slope

STILL = BaseCommand(0.0, 0.0)


def decided(
    speed: float,
    requested: float,
    rate: float = 0.0,
    clear: float = 1e9,
    ground: ElevationMap = FLAT,
    x: float = 0.0,
    **changes: float,
) -> GuardDecision:
    scene = GuardScene(MODEL, ground, clear)
    values = {"hold_time": 0.1, "late": 0.02, "load": 0.5} | changes
    return decide(scene, motion(speed, x), BaseCommand(requested, rate), **values)


def test_command_that_can_be_stopped_passes() -> None:
    assert decided(2.0, 2.5, 0.3) == GuardDecision("pass", BaseCommand(2.5, 0.3), False, "")


def test_command_that_is_too_fast_is_limited_on_the_same_arc() -> None:
    result = decided(0.5, 4.0, 0.8, clear=2.0)
    assert result.action == "slow"
    assert 0.5 < result.command.speed < 2.5
    assert result.command.yaw_rate / result.command.speed == pytest.approx(0.8 / 4.0)
    assert "clear distance ends 2.00 m ahead" in result.reason


def test_vehicle_that_is_too_fast_brakes() -> None:
    result = decided(3.0, 3.0, clear=1.5)
    assert (result.action, result.command, result.brake) == ("stop", STILL, True)


@pytest.mark.parametrize("clear", [0.8, 1.5, 3.0, 6.0])
def test_base_at_the_allowed_speed_stops_before_the_end(clear: float) -> None:
    """The worst of bases reaches each allowed speed instantly; then a stop in closed form."""
    place, speed = 0.0, 0.0
    for _ in range(200):
        result = decided(speed, 4.0, clear=clear - place, x=place)
        if result.action == "stop":
            break
        speed = result.command.speed
        place += 0.1 * speed
        braking = speed * 0.3 + speed**2 / (2 * 9.80665 * (0.015 * max(speed, 1.0) + 0.40))
        assert place + braking <= clear + 1e-6
    assert place > clear - 1.0


@pytest.mark.parametrize(
    ("height", "reasons"),
    [
        (np.nan, ("ground is unknown",)),
        (1.5, ("ground is steeper", "an obstacle")),
        (-2.0, ("steeper", "a step at a wheel")),
    ],
)
def test_unknown_ground_obstacles_and_steep_ground_end_the_arc(
    height: float, reasons: tuple[str, ...]
) -> None:
    ground = ground_with(height, first=100)  # from x = 5 m on
    result = decided(3.0, 4.0, ground=ground, x=0.5)
    assert result.action in ("slow", "stop")
    assert any(reason in result.reason for reason in reasons)
    assert decided(3.9, 3.9, ground=ground, x=2.0).action == "stop"
    assert decided(1.0, 1.0, ground=ground, x=-15.0).action == "pass"


def test_off_the_map_nothing_moves() -> None:
    assert decided(0.0, 1.0, x=500.0).action == "stop"
    assert "ground is unknown" in decided(0.0, 0.0, 0.5, x=500.0).reason


@pytest.mark.parametrize(("requested", "rate"), [(0.0, -99.0), (0.1, 12.5)])
def test_turns_are_limited_by_the_rim_speed(requested: float, rate: float) -> None:
    assert decided(0.0, 0.0, 0.5) == GuardDecision("pass", BaseCommand(0.0, 0.5), False, "")
    result = decided(0.0, requested, rate)
    rim = result.command.speed + 0.5 * abs(result.command.yaw_rate) * MODEL.vehicle.track_width
    assert (result.action, result.reason) == ("slow", "a wheel would be faster than it can")
    assert rim == pytest.approx(MODEL.vehicle.max_wheel_speed)


@pytest.mark.parametrize(("speed", "requested", "rate"), [(1.0, 3.5, 3.5), (0.6, 0.8, 5.0)])
def test_lateral_acceleration_in_turns_is_limited(
    speed: float, requested: float, rate: float
) -> None:
    """Also on a radius of 15 cm: lateral acceleration is speed times yaw rate."""
    result = decided(speed, requested, rate)
    assert result.action == "slow"
    assert result.command.speed * result.command.yaw_rate <= MODEL.lateral + 1e-9


FAST_IN_TURNS = [(4.0, 0.2, 8.0), (3.0, 0.0, 12.0), (2.0, 1.0, 3.0), (3.0, 3.0, -4.0)]
"""Speeds of the base, and commands that turn it more than it may at that speed."""


@pytest.mark.parametrize(("speed", "requested", "rate"), [*FAST_IN_TURNS, (-3.0, -1.0, 4.0)])
def test_a_base_that_is_still_fast_turns_no_more_than_its_speed_allows(
    speed: float, requested: float, rate: float
) -> None:
    result = decided(speed, requested, rate)
    assert result.action == "slow"
    assert abs(result.command.speed) <= abs(requested)
    assert result.command.yaw_rate * rate > 0.0
    assert abs(speed * result.command.yaw_rate) == pytest.approx(MODEL.lateral)


@pytest.mark.parametrize("drive", ["ackermann", "skid_steer"])
def test_steered_wheels_may_lead_a_base_that_is_still_fast_onto_a_tighter_arc(drive: str) -> None:
    heights = np.zeros((200, 400))
    heights[82:88, 96:100] = 1.5  # 4 m to 5 m ahead, 3 m to 4.5 m to the right
    steered = read_guard_model(find_model("ugv"))
    model = steered._replace(vehicle=replace(steered.vehicle, drive=drive))
    scene = GuardScene(model, map_of(heights), 1e9)
    values = {"hold_time": 0.1, "late": 0.02, "load": 0.5}
    before = (BaseCommand(2.4, -0.52),)
    result = decide(scene, motion(6.0), BaseCommand(2.4, 0.0), before=before, **values)
    assert result.action == ("stop" if drive == "ackermann" else "pass")
    assert decide(scene, motion(6.0), before[0], **values).action == "slow"
    turning = motion(6.0)._replace(yaw_rate=-1.0)  # as measured, with any commands before
    assert decide(scene, turning, BaseCommand(2.4, 0.0), **values).action == result.action


@pytest.mark.parametrize(("speed", "requested", "rate"), FAST_IN_TURNS)
def test_a_base_that_is_still_fast_does_not_tip_over(
    speed: float, requested: float, rate: float
) -> None:
    """Where the model allows any lateral acceleration its height alone limits turns: free body."""
    model, vehicle = MODEL._replace(lateral=1e3), MODEL.vehicle
    scene = GuardScene(model, FLAT, 1e9)
    command = BaseCommand(requested, rate)
    result = decide(scene, motion(speed), command, hold_time=0.1, late=0.02, load=0.5)
    lateral = abs(result.command.yaw_rate) * max(speed, result.command.speed)
    side = 1.0 - 2.0 * vehicle.cg_z / vehicle.track_width * lateral / 9.80665
    assert result.action == "stop" or side >= 0.5 * MODEL.promised.limits.min_load


@pytest.mark.parametrize("lateral", [2.5, 1e3])
@pytest.mark.parametrize(("speed", "requested", "rate"), [*FAST_IN_TURNS, (7.0, 3.5, 0.7)])
def test_steered_wheels_do_not_tip_over_a_base_that_is_still_fast(
    speed: float, requested: float, rate: float, lateral: float
) -> None:
    """They keep the curvature of the command, up to that of an axle around its inner wheel."""
    model = read_guard_model(find_model("ugv"))._replace(lateral=lateral)
    vehicle, command = model.vehicle, BaseCommand(requested, rate)
    scene = GuardScene(model, FLAT, 1e9)
    result = decide(scene, motion(speed), command, hold_time=0.1, late=0.02, load=0.5)
    given, turn = result.command
    assert given > 0.0 or turn == 0.0
    curvature = min(abs(turn / given), 2.0 / vehicle.track_width) if given else 0.0
    acceleration = curvature * max(speed, given) ** 2
    side = 1.0 - 2.0 * vehicle.cg_z / vehicle.track_width * acceleration / 9.80665
    assert acceleration <= lateral + 1e-9
    assert side >= 0.5 * model.promised.limits.min_load


def test_a_base_that_still_turns_drives_no_faster_than_its_turn_allows() -> None:
    scene = GuardScene(MODEL, FLAT, 1e9)
    values = {"hold_time": 0.1, "late": 0.02, "load": 0.5}
    turning = motion(0.5)._replace(yaw_rate=2.0)
    result = decide(scene, turning, BaseCommand(3.0, 0.0), **values)
    assert (result.action, result.command.speed) == ("slow", pytest.approx(MODEL.lateral / 2.0))
    before = (BaseCommand(0.0, 2.0),)
    assert decide(scene, motion(0.5), BaseCommand(3.0, 0.0), before=before, **values) == result
    assert decided(0.5, 3.0).action == "pass"


@pytest.mark.parametrize("is_measured", [True, False])
def test_steered_wheels_of_a_tight_turn_limit_the_speed_that_a_base_gains(
    is_measured: bool,
) -> None:
    """Wheels keep the curvature of an earlier command, or as measured, until they straighten."""
    model = read_guard_model(find_model("ugv"))
    scene = GuardScene(model, FLAT, 1e9)
    turning = motion(1.0)._replace(yaw_rate=1.0 if is_measured else 0.0)
    before = () if is_measured else (BaseCommand(1.0, 0.0), BaseCommand(1.0, 1.0))
    values = {"hold_time": 0.1, "late": 0.02, "load": 0.5, "before": before}
    result = decide(scene, turning, BaseCommand(4.0, 0.0), **values)
    assert (result.action, result.command.speed**2) == ("slow", pytest.approx(model.lateral))


def test_reverse_driving_is_decided_by_the_ground_behind() -> None:
    ground = ground_with(np.nan, last=72)  # up to x = -2 m
    assert decided(0.0, -3.0, ground=ground).action == "slow"
    assert decided(0.0, 3.0, ground=ground).action == "pass"
    reversed_ = decided(2.0, -1.0)
    assert (reversed_.action, reversed_.command) == ("slow", STILL)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf")])
def test_values_that_are_not_finite_are_a_stop(wrong: float) -> None:
    turning, limits = motion(1.0)._replace(yaw_rate=wrong), {"hold_time": 0.1, "late": 0.02}
    scene, forward = GuardScene(MODEL, FLAT, 1e9), BaseCommand(1.0, 0.0)
    assert decide(scene, turning, forward, load=0.5, **limits).action == "stop"
    for values in ((wrong, 1.0), (1.0, wrong), (1.0, 1.0, wrong)):
        assert decided(*values).action == "stop"
    for before in ((wrong, 0.0), (1.0, wrong)):
        asked = (0.0, 0.0, 0.0), 1.0, (1.0, 0.0)
        assert (
            guard_decision(read_model(ATV), FLAT, *asked, before=[(0.5, 0.0), before]).action
            == "stop"
        )


@pytest.mark.parametrize("heading", [0.0, 0.4, 0.785])
@pytest.mark.parametrize("std", [0.0, 0.02])
def test_a_step_above_five_times_the_noise_of_the_map_is_a_stop(heading: float, std: float) -> None:
    """Of 0.2 m, 0.093 m are the limit; the same noise alone passes."""
    y, x = np.mgrid[0:100, 0:120] * 0.1
    noise = np.random.default_rng(5).normal(0.0, std, x.shape)
    across = (x - 8.0) * np.cos(heading) + (y - 5.0) * np.sin(heading)
    for height, action in ((0.2, "stop"), (0.0, "pass")):
        ground = ElevationMap(
            elevation=np.where(across > 0.0, height, 0.0) + noise,
            resolution=0.1,
            origin=(0.0, 0.0),
            height_std=std,
        )
        decision = guard_decision(read_model(ATV), ground, (7.0, 5.0, 0.0), 1.5, (1.5, 0.0))
        assert decision.action == action


def test_vehicle_may_have_reached_the_speed_given_since_the_measurement() -> None:
    assert decided(1.0, 1.0, clear=3.0, late=0.2).action == "pass"
    assert decided(1.0, 1.0, clear=3.0, late=0.2, reached=4.0).action == "stop"
    back = decided(0.0, -1.0, clear=3.0, late=0.2, reached=1.0)
    assert back.reason == "it has to stand before it drives back"


WRONG = {"pose": "abc", "speed": None, "command": (1.0, "x"), "before": [(1.0,)], "age": "now"}


@pytest.mark.parametrize("name", list(WRONG))
def test_arguments_that_are_no_numbers_are_named(name: str) -> None:
    values: dict[str, Any] = {"pose": (0.0, 0.0, 0.0), "speed": 1.0, "command": (1.0, 0.0)}
    with pytest.raises(ParameterError, match=name):
        guard_decision(read_model(ATV), FLAT, **(values | {name: WRONG[name]}))


@pytest.mark.parametrize("speed", [1e300, -1e300, 1e155])
def test_a_speed_that_no_vehicle_has_is_a_stop(speed: float) -> None:
    assert decided(speed, 1.0, 0.3).brake


@pytest.mark.parametrize("seed", range(16))
def test_reverse_is_decided_as_forward_by_the_turned_vehicle(seed: int) -> None:
    """On planes with friction: the axle that trails is the one that brakes unload."""
    rng = np.random.default_rng(seed)
    model = read_model(ATV)
    v, braking = model.vehicle, replace(model.braking, sliding_friction=rng.uniform(0.5, 0.9))
    cg_x, front, rear = rng.uniform(0.35, 0.65) * v.wheelbase, 0.2, 0.5
    share = rng.choice([None, 0.7])
    v = replace(v, cg_x=cg_x, cg_z=0.9, front_overhang=front, rear_overhang=rear)
    v = replace(v, front_brake_share=share)
    turned = replace(v, cg_x=v.wheelbase - cg_x, front_overhang=rear, rear_overhang=front)
    turned = replace(turned, front_brake_share=share and 1.0 - share)
    north, east = 0.25 * np.mgrid[0:120, 0:120]
    rise = rng.uniform(-0.2, 0.2, 2)
    ground = ElevationMap(
        elevation=rise[0] * east + rise[1] * north, resolution=0.25, origin=(-15.0, -15.0)
    )
    heading, speed, rate = rng.uniform(-3.0, 0.0), rng.uniform(0.0, 3.5), rng.uniform(-0.6, 0.6)
    requested = speed + 0.5
    forth = guard_decision(
        replace(model, vehicle=v, braking=braking),
        ground,
        (0.0, 0.0, heading),
        speed,
        (requested, rate),
    )
    back = guard_decision(
        replace(model, vehicle=turned, braking=braking),
        ground,
        (0.0, 0.0, heading + np.pi),
        -speed,
        (-requested, rate),
    )
    assert (back.action, back.reason) == (forth.action, forth.reason)
    expected = -forth.command.speed, forth.command.yaw_rate
    assert back.command == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("turns", [-7, 4, 1000])
def test_a_heading_may_count_any_number_of_turns(turns: int) -> None:
    ground = slope(0.1)
    for heading in np.linspace(-3.0, 3.0, 7):
        once, later = (
            guard_decision(read_model(ATV), ground, (0.0, 0.0, at), 2.0, (2.5, 0.3))
            for at in (heading, heading + turns * 2.0 * np.pi)
        )
        assert (later.action, later.reason) == (once.action, once.reason)
        assert later.command == pytest.approx(once.command, abs=1e-6)


def test_front_axle_keeps_its_load_in_a_stop_in_reverse() -> None:
    """Down 25 %: 1 − h (0.40 + 0.015 · 2 + 0.41 · 0.245) / (c cos θ) of it is negative."""
    model, grade = read_model(ATV), np.arctan(0.25)
    model = replace(model, vehicle=replace(model.vehicle, cg_x=0.46, cg_z=0.9))
    ground = slope(-grade)
    back = guard_decision(model, ground, (0.0, 0.0, np.pi), -2.0, (-2.0, 0.0))
    assert back.reason == "an axle or a side would lose its load"
    assert back.command.speed == 0.0
