"""The moving horizon: what was safe stays safe, without jumps, and says what got worse."""

from __future__ import annotations

import re
from copy import copy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.horizon.answer import FULL_STOP, CycleAnswer
from slopewise.planner.horizon.horizon import HorizonSettings
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import PathBatch, batch
from slopewise.planner.pipeline import plan_finalizer
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.profile.smoothing import Smoothed
from tests.world.driving import (
    SAFE,
    Drive,
    accel_at,
    drives,
    nearest_station,
    really_free,
    speed_at,
)
from tests.world.generated import between, by_day_and_night
from tests.world.ground import arc, plane, straight
from tests.world.plans import stop_on, violations
from tests.world.vehicles import model_of, tables_with

WIDE = (-16.0, 16.0)
CYCLES = 50


def still_safe(last: CycleAnswer, now: CycleAnswer) -> None:
    """If nothing got worse, nothing is worse."""
    message = f"{last.status.value} {last.reason!r}, then {now.status.value} {now.reason!r}"
    if last.status is Status.OK:
        assert now.status is Status.OK or resettled(now), message
    if last.status in SAFE:
        assert now.status in SAFE or resettled(now), message
        assert not now.command.stop


def resettled(now: CycleAnswer) -> bool:
    """The body on its springs was rolled in from a place farther on, where waves swing it more.

    It is rolled over two wheelbases before the first station, which do not settle it on waves as
    long as a bounce; what roughness allows then differs by a few millimetres a second.
    """
    lacking = re.search(r"the plan so far lacks speed by ([\d.e-]+) in", now.reason)
    plan = now.chosen
    return (
        now.status is Status.DEGRADED
        and lacking is not None
        and float(lacking[1]) < 0.02
        and plan is not None
        and int(Limiting.ROUGHNESS) in plan.limiting
    )


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


BETWEEN_STATIONS = ("traction",)
"""What the drive may lack between two stations, on waves of four cells: the vehicle is slower."""

EXCUSED = ("decel", "friction", "speed_limit", "lateral", "wheel_speed", "dip")
"""Kinds of violations that a fallback may have: none of a stop or of its loads."""


def sound(drive: Drive, plan: SpeedPlan) -> None:
    """The checker, with the model's mean, finds nothing against a plan."""
    kinds = violations(plan, drive.tables, drive.ground, jerk=False, slack=2.0)
    excused = BETWEEN_STATIONS + (EXCUSED if plan.status is Status.DEGRADED else ())
    kinds = {kind: texts for kind, texts in kinds.items() if kind not in excused}
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


@by_day_and_night(3, 250)
@given(drives(), st.sampled_from([0.0, 0.08]))
def test_what_is_safe_stays_safe_without_a_jump(drive: Drive, noise: float) -> None:
    """Tracked exactly, or with noise."""
    drive.noise = noise
    driven(drive, CYCLES)


def emergency_end(drive: Drive, plan: SpeedPlan) -> float:
    """Station at which full braking from where the vehicle is ends, offset included."""
    station = nearest_station(plan, drive.x, drive.y)
    if drive.speed == 0.0:
        return station
    stop = stop_on(plan, drive.tables, station, drive.speed)
    return station + stop.distance + drive.tables["braking"]["distance_offset"]


CHANGES = st.sampled_from(["clear", "hole", "weaker", "limit"])


@by_day_and_night(6, 250)
@given(drives(), CHANGES, between(0.5, 8.0), st.integers(5, 20))
def test_what_got_worse_is_answered_safely_and_labelled(
    drive: Drive, change: str, ahead: float, when: int
) -> None:
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
        rows = np.stack((*drive.paths.rows[:2], limit, drive.paths.rows[3]))
        drive.paths = replace(drive.paths, rows=rows)
    for n in range(8):
        now = drive.horizon.step(
            drive.state(), drive.paths, drive.ground, clear=drive.clear + drive.front
        )
        drive.answers.append(now)
        plan = now.chosen
        assert plan is not None
        if now.status is Status.INFEASIBLE:
            assert now.command == FULL_STOP
        else:
            if n in (0, 1, 6):
                sound(drive, plan)
            assert plan.clear_distance <= max(really_free(drive, plan), 0.0) + 5e-3
            assert emergency_end(drive, plan) <= plan.clear_distance + 5e-3
        drive.move(now)
    if Status.INFEASIBLE not in {a.status for a in drive.answers}:
        driven(drive, 5)


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
    drive = moving()
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


def test_a_limit_that_sinks_on_the_way_is_braked_for_without_an_emergency_stop() -> None:
    """The segment that is driven stays faster than its bound until its end, for several cycles."""
    drive = Drive(tables_with(limits={"speed": 1.0}), plane(), batch([straight(20.0)], 0.25))
    for _ in range(30):
        drive.cycle()
    limit = drive.speed - 0.05
    drive.horizon.learn(model_of(tables_with(limits={"speed": limit})))
    answers = [drive.cycle() for _ in range(12)]
    assert f"above {limit:.2f} m/s (speed_limit): brakes" in answers[0].reason
    assert not any(answer.command.stop for answer in answers)
    assert drive.speed <= limit


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


def test_two_paths_of_nearly_equal_cost_are_not_taken_in_turns() -> None:
    fan = [arc(25.0, k, name=f"{k:+}") for k in (-0.03, 0.03, -0.031, 0.031)]
    drive = Drive(tables_with(), plane(y=WIDE), batch(fan, 0.25), noise=0.09)
    wavering = np.random.default_rng(3)
    names = []
    for _ in range(40):
        drive.clear = 24.0 + wavering.uniform(0.0, 0.1, 4)
        names.append(drive.cycle().chosen.candidate)
    assert len(set(names)) == 1


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


LATE = HorizonSettings(budget=1e-6)


def test_a_planner_that_is_always_late_drives_on_as_the_way_is_seen() -> None:
    drive = Drive(tables_with(), plane(), batch([straight(40.0)], 0.25), settings=LATE)
    for _ in range(200):
        drive.clear = drive.x + 6.0
        answer = drive.cycle()
        assert not answer.command.stop
        assert drive.speed > 0.0 or drive.x > 38.5, answer.reason
    assert drive.x > 38.5
    assert any("; stops at" in a.reason for a in drive.answers if a.status is Status.DEGRADED)


@pytest.mark.parametrize("cycles", [12, 80])
def test_a_smooth_plan_that_runs_out_is_replaced_by_one_that_is_late(cycles: int) -> None:
    """While it brakes before the end of what was free, and at rest there."""
    drive = Drive(tables_with(), plane(), batch([straight(40.0)], 0.25), clear=7.0)
    for _ in range(cycles):
        drive.cycle()
    speed = drive.speed
    assert (speed > 0.0) == (cycles < 80)
    drive.horizon.settings, drive.clear = LATE, 40.0
    answers = [drive.cycle() for _ in range(60)]
    assert not any(a.command.stop for a in answers)
    assert answers[0].kept == (speed > 0.0), "a smooth plan is not left as long as it speeds up"
    assert drive.x > 12.0
    assert min(drive.speed, *(a.command.speed for a in answers)) >= 0.5 * speed


def test_a_smooth_plan_is_driven_on_where_one_without_smoothing_leads_no_farther() -> None:
    drive = Drive(tables_with(), plane(), batch([straight(40.0)], 0.25), clear=7.0)
    for _ in range(5):
        drive.cycle()
    drive.horizon.settings = LATE
    while drive.speed > 0.0:
        answer = drive.cycle()
        assert (answer.status, answer.kept) == (Status.BLOCKED, True)


def test_another_path_without_smoothing_is_better_than_standing() -> None:
    fan = [straight(30.0), arc(30.0, 0.02, name="left")]
    drive = Drive(tables_with(), plane(), batch(fan, 0.25), clear=np.array([5.0, 0.0]))
    for _ in range(60):
        drive.cycle()
    assert drive.speed == 0.0
    drive.horizon.settings = LATE
    drive.clear = np.array([5.0, 29.0])
    answer = drive.cycle()
    assert answer.chosen.candidate == "left"
    assert answer.command.speed > 0.0


@cache
def at_full_speed() -> Drive:
    drive = Drive(tables_with(), plane(), batch([straight(40.0)], 0.25))
    for _ in range(45):
        drive.cycle()
    assert drive.speed > 3.0
    return drive


def moving() -> Drive:
    """A drive at full speed on level ground."""
    drive = copy(at_full_speed())
    drive.horizon, drive.answers = copy(drive.horizon), list(drive.answers)
    return drive


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("x", np.nan, "state.x"),
        ("y", np.inf, "state.y"),
        ("heading", np.nan, "state.heading"),
        ("speed", np.inf, "state.speed"),
        ("speed", -0.5, "backwards"),
        ("speed", 1e200, "no vehicle has"),
    ],
)
def test_an_impossible_state_is_answered_with_full_braking(
    field: str, value: float, reason: str
) -> None:
    drive = moving()
    drive.state = lambda: replace(Drive.state(drive), **{field: value})
    answer = drive.cycle()
    assert (answer.status, answer.command) == (Status.DEGRADED, FULL_STOP)
    assert reason in answer.reason


def test_without_a_candidate_it_brakes_on_the_path_so_far() -> None:
    drive = moving()
    drive.paths = []
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


@pytest.mark.parametrize("missing", [0.0, 0.5])
def test_where_all_new_candidates_end_too_soon_it_stops_on_the_path_so_far(missing: float) -> None:
    """Whether or not the vehicle has the speed of its plan."""
    drive = moving()
    former = drive.answers[-1].chosen
    drive.speed -= missing
    while drive.speed > 1.0:
        drive.paths = [CandidatePath("new", straight(drive.x + 0.5).points)]
        speed, answer = drive.speed, drive.cycle()
        assert (answer.chosen.candidate, answer.command.stop) == (former.candidate, False)
        assert "no candidate can be stopped on: stops on the path driven so far" in answer.reason
        assert drive.speed < speed


@pytest.mark.parametrize("clear", [-50.0, 0.3, 1.5])
@pytest.mark.parametrize("offset", [0.0, 0.4])
@pytest.mark.parametrize(("name", "missing"), [("straight", 0.5), ("new", 0.5), ("new", 0.0)])
def test_it_does_not_stop_beyond_what_is_free_now_on_the_path_so_far(
    name: str, missing: float, offset: float, clear: float
) -> None:
    """The path that it drove may be offered again: shorter, by another name, a little off it."""
    drive = moving()
    assert drive.answers[-1].chosen.candidate == "straight"
    drive.speed -= missing
    points = straight(40.0).points + np.array([0.0, offset])
    drive.paths, drive.clear = [CandidatePath(name, points)], drive.x + clear
    assert drive.cycle().command.stop


UNKNOWN = plane(unknown=lambda x, y: x < 44.0)


@pytest.mark.parametrize(
    ("paths", "ground", "clear", "speed", "status"),
    [
        ([], plane(), np.inf, 2.0, Status.DEGRADED),
        ([straight(20.0)], plane(), 0.0, 0.0, Status.BLOCKED),
        ([straight(20.0)], plane(), -1.0, 0.0, Status.BLOCKED),
        ([straight(20.0)], plane(), -1.0, 1.0, Status.INFEASIBLE),
        ([straight(20.0)], UNKNOWN, np.inf, 0.0, Status.BLOCKED),
        ([straight(20.0)], UNKNOWN, np.inf, 2.0, Status.INFEASIBLE),
    ],
)
def test_with_nowhere_to_go_it_stays_or_brakes_fully(
    paths: list[CandidatePath], ground: ElevationMap, clear: float, speed: float, status: Status
) -> None:
    answer = Drive(tables_with(), ground, paths, clear=clear, speed=speed).cycle()
    assert answer.status is status
    assert answer.command.speed == 0.0
    assert answer.command.stop == (speed > 0.0)


@pytest.mark.parametrize("speed", [0.1, 0.25])
def test_a_fallback_at_rest_at_once_has_rows_up_to_its_clear_distance(speed: float) -> None:
    """Its second row is moved back to where it ends, the third is 1 cm beyond."""
    paths, tables = batch([straight(8.0)], 0.25), tables_with()
    drive = Drive(tables, plane(), paths, x=0.19, speed=speed, clear=0.74)
    answer = drive.cycle()
    assert answer.status is Status.DEGRADED
    sound(drive, answer.chosen)


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


def with_a_fault(fault: str) -> PathBatch:
    """Three candidates, of which the second one has a fault."""
    paths = fan_of(3)
    rows, count = paths.rows.copy(), paths.count.copy()
    x, y = rows[:2]
    if fault == "number":
        x[40, 1] = np.nan
    if fault == "place":
        x[20:23, 1], y[20:23, 1] = x[20, 1], y[20, 1]
    if fault.isdigit():
        count[1] = int(fault)
    names = ("c0", "c0", "c2") if fault == "name" else paths.names
    return replace(paths, rows=rows, count=count, names=names)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("number", "no numbers"),
        ("place", "the path has two stations in one place"),
        ("name", "another candidate has this name"),
        ("clear", "not a number"),
        ("0", "0 stations"),
        ("2", "2 stations"),
    ],
)
def test_a_faulty_candidate_is_refused_and_another_one_driven(fault: str, reason: str) -> None:
    clear = np.array([np.inf, np.nan if fault == "clear" else np.inf, np.inf])
    drive = Drive(tables_with(), plane(y=WIDE), with_a_fault(fault), clear=clear, speed=1.0)
    answer = drive.cycle()
    assert answer.status is Status.OK
    assert reason in answer.ranking[-1].reason
    assert [r.reason for r in answer.ranking[:-1]] == ["", ""]
    drive.clear = np.ones(2)
    with pytest.raises(ParameterError, match="clear"):
        drive.cycle()


REAL = plan_finalizer.smooth


def fails(*_: Any) -> Smoothed:
    raise RuntimeError("no solution")


def wild(problem: Any, solver: Any) -> Smoothed:
    smoothed = REAL(problem, solver)
    faster = None if smoothed.speed_sq is None else 1.5 * smoothed.speed_sq
    return replace(smoothed, speed_sq=faster)


@pytest.mark.parametrize("fault", [fails, wild])
def test_a_solver_that_fails_or_answers_nonsense_costs_smoothness_only(
    fault: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = moving()
    monkeypatch.setattr(plan_finalizer, "smooth", fault)
    for _ in range(5):
        answer = drive.cycle()
        assert answer.status is Status.OK
        sound(drive, answer.chosen)
    answer = Drive(tables_with(), plane(y=WIDE), fan_of(3)).cycle()
    assert answer.status is Status.DEGRADED
    assert "not smoothed" in answer.reason
    assert not answer.command.stop


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
        drive.paths = PathBatch.of_stations(("route",), x, y, np.array([len(x)]))
        place, last = (drive.x, drive.y), drive.answers[-1:]
        answer = drive.cycle()
        assert answer.status is Status.OK
        if last:
            continuous(drive, last[0].chosen, answer.chosen, place)
    assert drive.x > 20.0


def test_the_plan_is_forgotten_on_reset() -> None:
    drive = moving()
    drive.horizon.forget()
    drive.state = lambda: replace(Drive.state(drive), speed=drive.speed + 0.05)
    answer = drive.cycle()
    assert answer.chosen.speed[0] == pytest.approx(4.0, abs=0.3)
    assert not answer.kept
