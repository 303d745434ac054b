"""The moving horizon: what was safe stays safe, without jumps, and says what got worse."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.stops.simulation import SimulatedStop
from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer
from slopewise.planner.horizon.horizon import HorizonSettings
from slopewise.planner.path import PathBatch, batch
from slopewise.planner.pipeline import plan_finalizer
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.profile.smoothing import Smoothed
from tests.planner.driving import (
    SAFE,
    Drive,
    accel_at,
    drives,
    nearest_station,
    really_free,
    speed_at,
)
from tests.planner.generated import between
from tests.planner.scenes import (
    arc,
    min_loads,
    model_of,
    plane,
    stop_on,
    straight,
    tables_with,
    violations,
)

WIDE = (-16.0, 16.0)
CYCLES = 50
EXAMPLES = 15
ALL_NIGHT = settings(settings.get_profile("nightly"), max_examples=250)


def still_safe(last: CycleAnswer, now: CycleAnswer) -> None:
    """If nothing got worse, nothing is worse."""
    message = f"{last.status.value} {last.reason!r}, then {now.status.value} {now.reason!r}"
    if last.status is Status.OK:
        assert now.status is Status.OK, message
    if last.status in SAFE:
        assert now.status in SAFE, message
        assert not now.command.stop


def continuous(drive: Drive, last: SpeedPlan, now: SpeedPlan, place: tuple[float, float]) -> None:
    """Speed continues the previous plan, acceleration changes no faster than the jerk limit."""
    before, after = nearest_station(last, *place), nearest_station(now, *place)
    speed = speed_at(now, after)
    assert speed == pytest.approx(speed_at(last, before), abs=2e-3)
    if now.status is Status.DEGRADED or last.status is Status.DEGRADED or speed < 0.05:
        return
    jerk = drive.tables["limits"]["jerk"]
    step = float(np.max(np.diff(now.station)[:4]))
    change = abs(accel_at(now, after) - accel_at(last, before))
    assert change <= jerk * 2.0 * step / speed + 0.02, (change, speed)


EXCUSED = ("decel", "friction", "speed_limit", "lateral", "wheel_speed", "dip")
"""Kinds of violations that a fallback may have: none of a stop or of its loads."""


def sound(drive: Drive, plan: SpeedPlan) -> None:
    """The checker, with the model's mean, finds nothing against a plan."""
    kinds = violations(plan, drive.tables, drive.ground, jerk=False, slack=2.0)
    if plan.status is Status.DEGRADED:
        kinds = {kind: texts for kind, texts in kinds.items() if kind not in EXCUSED}
    assert not kinds, f"{plan.status.value} {plan.reason}\n{kinds}"


def driven(drive: Drive, cycles: int) -> int:
    """Drive and assert in each cycle; returns in how many of them the vehicle moved."""
    moved, last = 0, None
    for n in range(cycles):
        place = drive.x, drive.y
        now = drive.cycle()
        if now.chosen is not None:
            assert now.chosen.clear_distance <= max(really_free(drive, now.chosen), 0.0) + 5e-3
        if last is not None:
            still_safe(last, now)
            if drive.noise == 0.0 and last.chosen is not None and now.chosen is not None:
                continuous(drive, last.chosen, now.chosen, place)
        if now.chosen is not None and n % 8 == 1 and now.chosen.status is not Status.INFEASIBLE:
            sound(drive, now.chosen)
        last = now
        moved += drive.speed > 0.0
    return moved


@settings(max_examples=EXAMPLES)
@given(drives())
def test_what_is_safe_stays_safe_without_a_jump(drive: Drive) -> None:
    driven(drive, CYCLES)


@settings(max_examples=EXAMPLES)
@given(drives(noise=0.08))
def test_what_is_safe_stays_safe_with_tracking_noise(drive: Drive) -> None:
    driven(drive, CYCLES)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@ALL_NIGHT
@given(st.one_of(drives(), drives(noise=0.08)))
def test_what_is_safe_stays_safe_all_night(drive: Drive) -> None:
    driven(drive, CYCLES)


# ------------------------------------------------------------------------ something got worse


def emergency(drive: Drive, plan: SpeedPlan) -> tuple[float, SimulatedStop]:
    """Station at which full braking from where the vehicle is ends, offset included; the stop."""
    station = nearest_station(plan, drive.x, drive.y)
    if drive.speed == 0.0:
        return station, stop_on(plan, drive.tables, station, 1e-3)
    stop = stop_on(plan, drive.tables, station, drive.speed)
    return station + stop.distance + drive.tables["braking"]["distance_offset"], stop


CHANGES = st.sampled_from(["clear", "hole", "weaker", "limit"])


@settings(max_examples=EXAMPLES)
@given(drives(), CHANGES, between(0.5, 8.0), st.integers(5, 20))
def test_what_got_worse_is_answered_safely_and_labelled(
    drive: Drive, change: str, ahead: float, when: int
) -> None:
    answered_safely(drive, change, ahead, when)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@ALL_NIGHT
@given(drives(), CHANGES, between(0.5, 8.0), st.integers(5, 20))
def test_what_got_worse_is_answered_safely_all_night(
    drive: Drive, change: str, ahead: float, when: int
) -> None:
    answered_safely(drive, change, ahead, when)


def answered_safely(drive: Drive, change: str, ahead: float, when: int) -> None:
    """After a change for the worse: in every cycle a safe answer, or an emergency stop."""
    driven(drive, when)
    last = drive.answers[-1]
    if last.chosen is None or drive.speed < 0.1:
        return
    name = last.chosen.candidate
    j = drive.paths.names.index(name)
    if change == "clear":
        drive.clear = travelled(drive, j) + ahead
    elif change == "hole":
        station = nearest_station(last.chosen, drive.x, drive.y) + ahead
        x, y = (np.interp(station, last.chosen.station, v) for v in (last.chosen.x, last.chosen.y))
        drive.ground = with_hole(drive.ground, float(x), float(y))
    elif change == "weaker":
        drive.tables["braking"]["b_b"] *= 0.8
        drive.horizon.learn(model_of(drive.tables))
    else:
        limit = np.full(drive.paths.x.shape, np.inf)
        limit[int(travelled(drive, j) / 0.25) + int(ahead / 0.25) :] = 0.5
        drive.paths = replace(drive.paths, speed_limit=limit)
    for n in range(8):
        now = drive.horizon.step(
            drive.state(), drive.paths, drive.ground, clear=drive.clear + drive.front
        )
        drive.answers.append(now)
        plan = now.chosen
        assert plan is not None
        if now.status is Status.INFEASIBLE:
            assert now.command == FULL_STOP
            assert not could_have_stopped(drive, plan)
        else:
            if n in (0, 1, 6):
                sound(drive, plan)
            assert plan.clear_distance <= max(really_free(drive, plan), 0.0) + 5e-3
            end, _ = emergency(drive, plan)
            assert end <= plan.clear_distance + 5e-3
        drive.move(now)
    if Status.INFEASIBLE not in {a.status for a in drive.answers}:
        driven(drive, 5)


def could_have_stopped(drive: Drive, plan: SpeedPlan) -> bool:
    """There was distance to spare, and the wheels would have stayed down."""
    if drive.tables["braking"].get("extrapolate") or drive.uncertainty.slope_std > 0.0:
        return False
    end, stop = emergency(drive, plan)
    if not stop.stopped:
        return False
    limit = drive.tables["limits"]["min_load"]
    loads = min_loads(plan, drive.tables, stop)
    return min(plan.clear_distance - end, *(load - limit for load in loads)) > 0.1


def travelled(drive: Drive, j: int) -> float:
    """Station of the vehicle on a candidate, about, in the plan view [m]."""
    x, y = drive.paths.x[:, j], drive.paths.y[:, j]
    k = int(np.argmin(np.hypot(x - drive.x, y - drive.y)))
    return 0.25 * k


def with_hole(ground: ElevationMap, x: float, y: float, radius: float = 0.6) -> ElevationMap:
    """The same ground, unknown around a place."""
    rows, columns = ground.elevation.shape
    east = ground.origin[0] + ground.resolution * np.arange(columns)
    north = ground.origin[1] + ground.resolution * np.arange(rows)
    inside = np.hypot(east[None, :] - x, north[:, None] - y) < radius
    return replace(ground, elevation=np.where(inside, np.nan, ground.elevation))


def test_a_deficit_has_amount_place_and_reason() -> None:
    drive = Drive(tables_with(), plane(), batch([straight(30.0)], 0.25))
    for _ in range(40):
        drive.cycle()
    assert drive.speed > 3.0
    drive.clear = drive.x + 3.0
    answer = drive.cycle()
    assert answer.status is Status.INFEASIBLE
    assert answer.command == FULL_STOP
    assert answer.deficit is not None
    assert answer.deficit.bound == "overrun"
    assert answer.deficit.amount > 1.0
    assert "the plan so far lacks overrun" in answer.reason
    assert drive.cycle().deficit is None


def test_braking_harder_than_planned_continues_as_long_as_needed() -> None:
    """No emergency stop where hard braking is enough, in any of the cycles that it takes."""
    limits = {"speed": 2.0, "accel": 1.0, "decel": 1.0, "jerk": 1.0}
    braking = {"b_b": 0.5, "dead_time": 0.0, "distance_offset": 0.0, "speed_range": [0.0, 2.0]}
    drive = Drive(
        tables_with(limits=limits, braking=braking), plane(), batch([straight(8.0)], 0.25)
    )
    for _ in range(13):
        drive.cycle()
    assert drive.speed > 1.2
    drive.clear = drive.x + 0.9
    statuses = []
    while drive.speed > 0.0:
        answer = drive.cycle()
        statuses.append(answer.status)
        assert answer.status is not Status.INFEASIBLE
        assert answer.chosen.speed[0] > 0.0
    assert statuses[0] is Status.DEGRADED
    assert drive.x < drive.clear


def test_an_alternative_is_selected_when_the_driven_path_is_blocked() -> None:
    fan = [straight(30.0), arc(30.0, 0.02, name="left")]
    drive = Drive(tables_with(), plane(), batch(fan, 0.25), clear=np.array([30.0, 29.0]))
    for _ in range(15):
        drive.cycle()
    assert drive.answers[-1].chosen.candidate == "straight"
    drive.clear = np.array([drive.x + 5.0, 29.0])
    answer = drive.cycle()
    assert answer.chosen.candidate == "left"
    assert answer.status in SAFE


# ---------------------------------------------------------------------------------- flapping


def test_two_paths_of_nearly_equal_cost_are_not_taken_in_turns() -> None:
    fan = [arc(25.0, k, name=f"{k:+}") for k in (-0.03, 0.03, -0.031, 0.031)]
    drive = Drive(tables_with(), plane(y=WIDE), batch(fan, 0.25), noise=0.09)
    wavering = np.random.default_rng(3)
    names = []
    for _ in range(40):
        drive.clear = 24.0 + wavering.uniform(0.0, 0.1, 4)
        names.append(drive.cycle().chosen.candidate)
    assert len(set(names)) == 1


def test_a_much_better_path_is_taken() -> None:
    fan = [straight(25.0), arc(25.0, 0.01, name="free")]
    drive = Drive(tables_with(), plane(), batch(fan, 0.25), clear=np.array([6.0, 5.0]))
    for _ in range(10):
        drive.cycle()
    assert drive.answers[-1].chosen.candidate == "straight"
    drive.clear = np.array([6.0, 25.0])
    assert drive.cycle().chosen.candidate == "free"


# ------------------------------------------------------------------------------------- budget


def fan_of(count: int, length: float = 25.0) -> PathBatch:
    curvatures = np.linspace(-0.04, 0.04, count)
    return batch([arc(length, k + 1e-4, name=f"c{i}") for i, k in enumerate(curvatures)], 0.25)


def test_without_time_fewer_are_smoothed_and_all_verified() -> None:
    ranked, plans = {}, {}
    for budget in (60.0, 1e-6):
        settings_ = HorizonSettings(budget=budget, smoothed=4)
        drive = Drive(tables_with(), plane(y=WIDE), fan_of(24), clear=20.0, settings=settings_)
        for _ in range(5):
            answer = drive.cycle()
        ranked[budget], plans[budget] = answer.ranking, answer.plans
    assert len(plans[60.0]) == 4
    assert all(plan.status is Status.BLOCKED for plan in plans[60.0])
    assert len(plans[1e-6]) == 2
    assert all(plan.status is Status.DEGRADED for plan in plans[1e-6])
    assert all("not smoothed within 0.001 ms" in plan.reason for plan in plans[1e-6])
    for ranking in ranked.values():
        assert sorted(r.candidate for r in ranking) == sorted(f"c{i}" for i in range(24))
        assert all(np.isfinite(r.cost) for r in ranking)


def test_a_plan_made_without_time_is_driven_safely() -> None:
    settings_ = HorizonSettings(budget=1e-6)
    drive = Drive(tables_with(), plane(0.1, y=WIDE), fan_of(5), clear=15.0, settings=settings_)
    for n in range(70):
        answer = drive.cycle()
        assert answer.status in (Status.DEGRADED, Status.BLOCKED)
        assert not answer.command.stop
        if n % 6 == 0:
            sound(drive, answer.chosen)
    assert 14.0 < np.hypot(drive.x, drive.y) < 15.0


# ------------------------------------------------------------------------------ faults inside


def moving(**options: Any) -> Drive:
    """A drive at full speed on level ground."""
    drive = Drive(tables_with(), plane(), batch([straight(40.0)], 0.25), **options)
    for _ in range(45):
        drive.cycle()
    assert drive.speed > 3.0
    return drive


@pytest.mark.parametrize("field", ["x", "y", "heading", "speed"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_state_that_is_no_number_is_answered_with_full_braking(field: str, value: float) -> None:
    drive = moving()
    drive.state = lambda: replace(Drive.state(drive), **{field: value})
    answer = drive.cycle()
    assert (answer.status, answer.command) == (Status.DEGRADED, FULL_STOP)
    assert f"state.{field}" in answer.reason


def test_driving_backwards_is_answered_with_full_braking() -> None:
    drive = moving()
    drive.state = lambda: replace(Drive.state(drive), speed=-0.5)
    answer = drive.cycle()
    assert answer.command == FULL_STOP
    assert "backwards" in answer.reason


@pytest.mark.parametrize("none", [[], batch([straight(9.0)], 0.25)])
def test_without_a_candidate_it_brakes_on_the_path_so_far(none: Any) -> None:
    drive = moving()
    if isinstance(none, PathBatch):
        none = PathBatch((), none.x[:, :0], none.y[:, :0], none.count[:0], None)
    drive.paths = none
    clear = drive.answers[-1].chosen.clear_distance + drive.x
    speeds = []
    while drive.speed > 0.0:
        answer = drive.cycle()
        assert answer.status is Status.DEGRADED
        assert "no candidate is offered" in answer.reason
        assert not answer.command.stop
        assert answer.chosen.clear_distance + drive.x < clear + 1.0
        sound(drive, answer.chosen)
        speeds.append(drive.speed)
    assert np.max(-np.diff(speeds)) <= drive.tables["limits"]["decel"] * 0.1 + 1e-3
    assert drive.cycle().command.speed == 0.0


def test_without_a_candidate_and_without_a_plan_it_brakes_fully() -> None:
    drive = Drive(tables_with(), plane(), [], speed=2.0)
    answer = drive.cycle()
    assert (answer.status, answer.chosen, answer.command) == (Status.DEGRADED, None, FULL_STOP)


def test_all_blocked_by_a_wall_is_a_labelled_stop() -> None:
    drive = Drive(tables_with(), plane(y=WIDE), fan_of(5), clear=0.0)
    answer = drive.cycle()
    assert answer.status is Status.BLOCKED
    assert answer.command.speed == 0.0
    drive = moving()
    drive.clear = 0.0
    answer = drive.cycle()
    assert (answer.status, answer.command) == (Status.INFEASIBLE, FULL_STOP)
    assert "beyond the clear distance" in answer.reason


def test_a_start_above_every_bound_brakes_and_says_so() -> None:
    drive = Drive(tables_with(), plane(y=WIDE), fan_of(5, 40.0), speed=6.0)
    answer = drive.cycle()
    assert answer.status is Status.DEGRADED
    assert "starts at 6.00 m/s, above 4.00 m/s" in answer.reason
    assert answer.command.accel < -drive.tables["limits"]["decel"]
    drive = Drive(tables_with(), plane(y=WIDE), fan_of(5, 3.0), speed=6.0)
    answer = drive.cycle()
    assert (answer.status, answer.command) == (Status.INFEASIBLE, FULL_STOP)


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ({"x": -3.0}, "begins 3.00 m ahead"),
        ({"x": 5.0, "y": 2.0}, "2.00 m beside"),  # words: ok
        ({"x": 5.0, "heading": 3.0}, "172° off the heading"),
        ({"x": 25.5}, "beside the vehicle"),
        ({"x": 24.995}, "the path ends here"),
    ],
)
def test_a_path_out_of_reach_is_refused_with_a_reason(place: dict[str, float], reason: str) -> None:
    drive = Drive(
        tables_with(), plane(), [straight(24.9 if "25" in str(place) else 25.0)], speed=1.0
    )
    for name, value in place.items():
        setattr(drive, name, value)
    answer = drive.cycle()
    assert (answer.status, answer.command) == (Status.DEGRADED, FULL_STOP)
    assert reason in answer.ranking[0].reason
    assert reason in answer.reason


def test_a_negative_clear_distance_means_that_nothing_is_free() -> None:
    standing = Drive(tables_with(), plane(), [straight(20.0)], clear=-1.0).cycle()
    assert standing.status is Status.BLOCKED
    assert standing.command.speed == 0.0
    rolling = Drive(tables_with(), plane(), [straight(20.0)], clear=-1.0, speed=1.0).cycle()
    assert (rolling.status, rolling.command) == (Status.INFEASIBLE, FULL_STOP)


def test_a_clear_distance_that_is_no_number_blocks_its_candidate_only() -> None:
    paths = batch([straight(20.0), arc(20.0, 0.01, name="other")], 0.25)
    answer = Drive(tables_with(), plane(), paths, clear=np.array([np.nan, 15.0])).cycle()
    assert answer.chosen.candidate == "other"
    assert "not a number" in answer.ranking[-1].reason
    with pytest.raises(ParameterError, match="clear"):
        Drive(tables_with(), plane(), paths, clear=np.ones(3)).cycle()


@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_ground_that_is_all_unknown_is_not_driven_on(speed: float) -> None:
    ground = plane(unknown=lambda x, y: x < 44.0)
    answer = Drive(tables_with(), ground, [straight(20.0)], speed=speed).cycle()
    assert answer.status is (Status.INFEASIBLE if speed else Status.BLOCKED)
    assert answer.command.stop == (speed > 0.0)
    assert answer.command.speed == 0.0


@pytest.mark.parametrize("stations", [0, 1, 2])
def test_a_path_of_too_few_stations_is_refused(stations: int) -> None:
    valid = batch([straight(20.0)], 0.25)
    x, y = (np.hstack((a, a)) for a in (valid.x, valid.y))
    padded = PathBatch(("short", "straight"), x, y, np.array([stations, len(x)]), None)
    answer = Drive(tables_with(), plane(), padded).cycle()
    assert answer.chosen.candidate == "straight"
    assert f"{stations} stations" in answer.ranking[-1].reason
    alone = PathBatch(("short",), x[:stations, :1], y[:stations, :1], np.array([stations]), None)
    answer = Drive(tables_with(), plane(), alone, speed=1.0).cycle()
    assert (answer.status, answer.command) == (Status.DEGRADED, FULL_STOP)


def second_path(change: str) -> PathBatch:
    """Three candidates, of which the second has a fault."""
    paths = fan_of(3)
    x, y = paths.x.copy(), paths.y.copy()
    if change == "number":
        x[40, 1] = np.nan
    if change == "place":
        x[20:23, 1], y[20:23, 1] = x[20, 1], y[20, 1]
    names = ("c0", "c0", "c2") if change == "name" else paths.names
    return replace(paths, x=x, y=y, names=names)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("number", "no numbers"),
        ("place", "the path has two stations in one place"),
        ("name", "another candidate has this name"),
    ],
)
def test_a_faulty_candidate_is_refused_and_another_one_driven(change: str, reason: str) -> None:
    answer = Drive(tables_with(), plane(y=WIDE), second_path(change), speed=1.0).cycle()
    assert answer.status is Status.OK
    assert reason in answer.ranking[-1].reason
    assert [r.reason for r in answer.ranking[:-1]] == ["", ""]


def fails(*_: Any) -> Any:
    raise RuntimeError("no solution")


def raising(*_: Any) -> Any:
    return Smoothed(None, 0, "no profile")


@pytest.mark.parametrize("fault", [fails, raising])
def test_a_solver_that_fails_costs_smoothness_only(
    fault: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan_finalizer, "smooth", fault)
    answer = Drive(tables_with(), plane(y=WIDE), fan_of(3)).cycle()
    assert answer.status is Status.DEGRADED
    assert "not smoothed" in answer.reason
    assert not answer.command.stop
    monkeypatch.undo()
    drive = moving()
    monkeypatch.setattr(plan_finalizer, "smooth", fault)
    for _ in range(10):
        answer = drive.cycle()
        assert (answer.status, answer.kept) == (Status.OK, True)
        sound(drive, answer.chosen)


def test_a_solver_that_answers_nonsense_is_overruled_by_the_verifier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real = plan_finalizer.smooth

    def wild(problem: Any, solver: Any) -> Any:
        smoothed = real(problem, solver)
        faster = None if smoothed.speed_sq is None else 1.5 * smoothed.speed_sq
        return replace(smoothed, speed_sq=faster)

    drive = moving()
    monkeypatch.setattr(plan_finalizer, "smooth", wild)
    for _ in range(10):
        answer = drive.cycle()
        assert answer.status is Status.OK
        sound(drive, answer.chosen)


# ---------------------------------------------------------------------------------- the end


def test_a_path_is_driven_to_its_end_and_stays_ok() -> None:
    drive = Drive(tables_with(), plane(), batch([straight(12.0)], 0.25))
    for _ in range(120):
        assert drive.cycle().status is Status.OK
    assert drive.speed == 0.0
    assert 11.4 < drive.x <= 11.8


def test_a_path_that_is_drawn_farther_each_cycle_is_one_drive() -> None:
    route = batch([straight(40.0)], 0.25)
    drive = Drive(tables_with(), plane(), route)
    for _ in range(80):
        first = max(int(drive.x / 0.25) - 8, 0)
        x, y = route.x[first : first + 60], route.y[first : first + 60]
        drive.paths = PathBatch(("route",), x, y, np.array([len(x)]), None)
        place, last = (drive.x, drive.y), drive.answers[-1:]
        answer = drive.cycle()
        assert answer.status is Status.OK
        if last:
            continuous(drive, last[0].chosen, answer.chosen, place)
    assert drive.x > 20.0


def test_a_speed_limit_that_appears_on_the_driven_path_is_respected() -> None:
    drive = moving()
    limit = np.full(drive.paths.x.shape, np.inf)
    limit[int(drive.x / 0.25) + 32 :] = 1.0
    drive.paths = replace(drive.paths, speed_limit=limit)
    for _ in range(60):
        answer = drive.cycle()
        assert answer.status in SAFE
        beyond = answer.chosen.x >= drive.paths.x[int(np.argmin(limit)) - 1, 0] + 0.25
        assert answer.chosen.speed[beyond].max(initial=0.0) <= 1.0 + 1e-6


def test_a_free_way_is_counted_along_the_ground() -> None:
    slope = 0.25
    drive = Drive(tables_with(), plane(slope), batch([straight(30.0)], 0.25), clear=12.0)
    for _ in range(120):
        assert drive.cycle().status is Status.BLOCKED
    assert drive.speed == 0.0
    along = drive.x * np.hypot(1.0, slope)
    assert 11.2 < along <= 12.0 - drive.tables["braking"]["distance_offset"]


def test_settings_are_validated() -> None:
    with pytest.raises(ParameterError, match="smoothed"):
        HorizonSettings(smoothed=0)
    with pytest.raises(ParameterError, match="budget"):
        HorizonSettings(budget=0.0)


def test_the_plan_is_forgotten_on_reset() -> None:
    drive = moving()
    drive.horizon.forget()
    drive.state = lambda: replace(Drive.state(drive), speed=drive.speed + 0.05)
    answer = drive.cycle()
    assert answer.chosen.speed[0] == pytest.approx(4.0, abs=0.3)
    assert not answer.kept
