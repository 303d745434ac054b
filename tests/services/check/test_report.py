"""Reports: rows, kinds and sizes, columns of plans, statuses, and input that is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import slopewise
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.services.check.external_plan import ExternalPlan, plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from tests.services.check.drives import at, ground, model_with, round_turn, straight, trapezoid
from tests.services.check.test_check import furthest, level_stop, rear_share


def test_violation_names_row_station_kind_and_size() -> None:
    s, v = trapezoid(3.0, begin=1.0)
    report = check_plan_on_map(straight(s, 1.2 * v), model_with(limits={"speed": 3.0}), ground())
    worst = report.worst()["speed_limit"]
    assert worst.candidate == "straight"
    assert worst.station == pytest.approx(s[worst.row], abs=0.1)
    assert worst.size == pytest.approx(0.6, abs=1e-6)
    assert worst.unit == "m/s"
    assert worst.sentence == "3.600 m/s where 3.000 m/s is the highest"
    rows = [violation.row for violation in report.violations]
    assert rows == sorted(rows)


def test_distant_rows_are_one_violation_and_little_work() -> None:
    """Behind the last row as much path is sampled as its step is long: here 900 m."""
    rows = {"x": [5.0, 905.0, 1805.0], "y": [10.0] * 3, "speed": [1.0, 1.0, 0.0]}
    far = ExternalPlan(name="far", **rows)
    report = check_plan_on_map(far, model_with(), ground(), clear=10.0)
    assert {violation.kind for violation in report.violations} == {"spacing"}


def test_report_has_numbers_of_every_row() -> None:
    s, v = trapezoid(3.0)
    report = check_plan_on_map(straight(s, v), model_with(), ground())
    np.testing.assert_allclose(report.station, s, atol=1e-9)
    np.testing.assert_allclose(report.stop_distance, level_stop(v), atol=2e-4)
    moving = v > 0.0
    np.testing.assert_allclose(report.rear_load[moving], rear_share(v)[moving], atol=1e-9)


def test_times_may_be_those_of_a_clock() -> None:
    s, v = trapezoid(3.0)
    rising = np.arange(len(s), dtype=float)
    reports = [
        check_plan_on_map(replace(straight(s, v), time=begin + rising), model_with(), ground())
        for begin in (0.0, 1_764_000_000.0)
    ]
    assert reports[0].violations == reports[1].violations
    assert {violation.kind for violation in reports[0].violations} == {"columns"}


def test_a_plan_that_does_not_rest_at_its_end_overruns_it() -> None:
    s, v = trapezoid(3.0)
    cut = straight(s[:100], v[:100])
    assert "stopping_path" in {
        x.kind for x in check_plan_on_map(cut, model_with(), ground()).violations
    }
    # Nor is there more of it because the plan calls itself a fallback.
    fallback = replace(
        cut, status="degraded", reason="too fast", clear_distance=np.full(100, s[99] + 0.9)
    )
    violations = check_plan_on_map(fallback, model_with(), ground(resolution=0.5)).violations
    assert "stopping_path" in {x.kind for x in violations}
    # A longer clear distance does not make the path longer.
    violations = check_plan_on_map(cut, model_with(), ground(), clear=30.0).violations
    assert "stopping_path" in {x.kind for x in violations}


def test_columns_are_not_needed_and_station_may_begin_anywhere() -> None:
    s, v = trapezoid(3.0)
    clear = furthest(s, v) + 0.05
    for first in (0.0, 5.0):
        plan = straight(s, v, station=s + first, clear_distance=np.full_like(s, clear + first))
        assert check_plan_on_map(plan, model_with(), ground()).valid
        plan = replace(plan, clear_distance=plan.clear_distance - 0.2)
        assert not check_plan_on_map(plan, model_with(), ground()).valid


def test_degraded_plans_may_brake_hard_from_a_start_that_is_too_fast() -> None:
    s, v = trapezoid(4.0, begin=4.0, decel=2.5, stop_at=3.2)
    model = model_with(limits={"speed": 3.0})
    assert {x.kind for x in check_plan_on_map(straight(s, v), model, ground()).violations} == {
        "decel",
        "speed_limit",
    }
    assert check_plan_on_map(straight(s, v, status="degraded"), model, ground()).valid


def test_a_degraded_plan_may_reach_what_is_allowed_within_its_first_row() -> None:
    """It was refused for braking less than it can, which would be too slow at the second one."""
    s, v = trapezoid(2.9, begin=2.9)
    v[0] = 2.92
    model = model_with(limits={"speed": 2.9})
    plan = straight(s, v, status="degraded", reason="starts too fast")
    assert check_plan_on_map(plan, model, ground()).valid
    assert not check_plan_on_map(replace(plan, status="ok", reason=""), model, ground()).valid
    v[1] = 2.92
    assert not check_plan_on_map(replace(plan, speed=v), model, ground()).valid


def test_obstacle_around_the_start_is_ignored_before_the_second_row() -> None:
    s, v = trapezoid(1.0, spacing=0.25)
    for place, is_valid in ((-0.8, True), (-0.6, False), (1.5, False)):
        stone = at(lambda x, y, r=place: (np.abs(x - r) < 0.09) & (np.abs(y) < 0.12), 0.4)
        report = check_plan_on_map(straight(s, v), model_with(), ground(stone, resolution=0.05))
        assert report.valid is is_valid, (place, report.violations[:3])


def test_a_status_switches_no_rule_off() -> None:
    s, v = trapezoid(4.0, begin=4.0, decel=4.0, stop_at=2.0)
    for status in ("ok", "blocked", "degraded", "infeasible"):
        report = check_plan_on_map(straight(s, v, status=status), model_with(), ground(), clear=1.0)
        assert "stopping_path" in {x.kind for x in report.violations}, status
        assert ("decel" in {x.kind for x in report.violations}) is (status != "degraded")


def test_an_infeasible_plan_reports_the_remainder_of_its_one_stop() -> None:
    """It brakes from its first row on: from no other one does a stop begin with a dead time."""
    path = CandidatePath("short", np.array([[0.0, 0.0], [20.0, 0.0]]))
    (plan,) = slopewise.plan(model_with(), ground(), [path], start_speed=3.0, clear=1.5)
    assert plan.status.value == "infeasible"
    shorter = replace(plan, stop_distance=0.8 * plan.stop_distance)
    for given, is_false in ((plan, False), (shorter, True)):
        kinds = {v.kind for v in slopewise.check_plan(given, model_with(), ground()).violations}
        assert "status" in kinds
        assert ("stop_distance" in kinds) is is_false
        assert not {"rear_load", "side_load"} & kinds


def test_a_degraded_plan_that_brakes_too_little_is_not_excused() -> None:
    s, v = trapezoid(4.0, begin=4.0, decel=0.5, stop_at=16.0)
    model = model_with(limits={"speed": 3.0})
    kinds = {
        x.kind
        for x in check_plan_on_map(straight(s, v, status="degraded"), model, ground()).violations
    }
    assert kinds == {"speed_limit"}


def test_columns_are_verified_or_named() -> None:
    s, v = trapezoid(3.0)
    columns = {
        "x": s,
        "y": 0.0 * s,
        "speed": v,
        "payload": s,
        "z": 0.0 * s,
        "status": ["fine"] * len(s),
    }
    report = check_plan_on_map(plan_of_columns(columns), model_with(), ground())
    assert report.valid
    assert report.verified == ("x", "y", "speed", "z")
    assert report.unverified == ("status", "payload")


def test_rows_at_one_place_count_once() -> None:
    s, v = trapezoid(3.0)
    s, v = np.repeat(s, 2), np.repeat(v, 2)
    v[21] = 9.0
    report = check_plan_on_map(straight(s, v), model_with(), ground())
    assert "speed_limit" in {x.kind for x in report.violations}


def test_coarse_maps_show_no_steps_and_the_report_notes_it() -> None:
    s, v = trapezoid(1.0)
    report = check_plan_on_map(straight(s, v), model_with(), ground(resolution=0.5))
    assert sum("steps were not checked" in note for note in report.notes) == 1


@pytest.mark.parametrize("decimals", [2, 3])
def test_rounded_positions_are_not_turns(decimals: int) -> None:
    s, v = trapezoid(2.5)
    plan = round_turn(s, v, 4.0)
    x, y = np.round(plan.x, decimals), np.round(plan.y, decimals)
    assert check_plan_on_map(replace(plan, x=x, y=y), model_with(), ground()).valid


def test_unusable_input_is_an_error() -> None:
    s, v = trapezoid(3.0)
    with pytest.raises(ParameterError, match="clear: expected a distance"):
        check_plan_on_map(straight(s, v), model_with(), ground(), clear=-1.0)


def test_a_plan_that_starts_off_the_map_drives_on_unknown_ground() -> None:
    s, v = trapezoid(3.0)
    report = check_plan_on_map(straight(s + 500.0, v), model_with(), ground())
    assert "unknown_terrain" in {x.kind for x in report.violations}


def test_a_plan_at_rest_is_valid() -> None:
    here = ExternalPlan(name="here", x=[1.0], y=[1.0], speed=[0.0])
    report = check_plan_on_map(here, model_with(), ground())
    assert (report.valid, report.stops) == (True, 0)
    # So is one that stops where it starts.
    x, y = np.array([1.0, 1.0 + 1e-9]), np.ones(2)
    crawls = ExternalPlan(name="crawls", x=x, y=y, speed=np.array([6e-5, 0.0]))
    assert check_plan_on_map(crawls, model_with(), ground()).valid
    with pytest.raises(ParameterError, match="different places"):
        ExternalPlan(name="jumps", x=x, y=y, speed=np.array([6e-3, 0.0]))


def test_bound_before_a_turn_allows_for_stops_that_come_to_the_turn() -> None:
    """A stop from 4 m/s comes to it faster than is allowed there."""
    s, v = trapezoid(0.8, length=8.0, stop_at=7.0)
    heading = np.clip((s[:-1] - 2.0) / 2.0, 0.0, 1.5)
    x, y = (np.append(0.0, np.cumsum(0.1 * part)) for part in (np.cos(heading), np.sin(heading)))
    model = model_with(limits={"min_load": 0.35, "lateral_accel": 9.0})
    for bound, kinds in ((v + 0.2, set()), (4.0, {"speed_bound"})):
        plan = ExternalPlan(name="turn", x=x, y=y, speed=v, speed_bound=np.where(s < 1.5, bound, v))
        report = check_plan_on_map(plan, model, ground())
        assert {violation.kind for violation in report.violations} == kinds


def test_speed_limit_of_a_sharper_path_is_not_known() -> None:
    s, v = trapezoid(2.78, length=12.0, stop_at=11.5)
    limiting = tuple("accel" if slower else "speed_limit" for slower in v < 2.78)
    model = model_with(limits={"speed": 9.0}, braking={"speed_range": (1.0, 9.0)})
    for deviation, refused in ((0.0, True), (0.05, False)):
        away = np.full_like(s, deviation)
        plan = round_turn(s, v, 4.0, path_deviation=away, limiting=limiting)
        kinds = {x.sentence[:24] for x in check_plan_on_map(plan, model, ground()).violations}
        assert ("limiting is speed_limit," in kinds) is refused


def test_brakes_are_checked_from_the_middle_of_a_first_step_in_a_turn() -> None:
    """Rows do not say how the vehicle is turned at the first, and so how steep it is there."""
    model = model_with(limits={"decel": 9.0, "lateral_accel": 9.0, "min_load": 0.02})
    heading = np.minimum(0.25 * np.arange(24) + 0.3, 1.5)
    x, y = (np.append(0.0, np.cumsum(0.1 * part)) for part in (np.cos(heading), np.sin(heading)))
    downhill = ground(lambda east, north: -0.22 * east)
    for braking, kinds in ((2.95, set()), (3.0, {"decel"})):
        energy = np.append(0.64, 0.64 - 0.2 * braking - 0.2 * np.arange(24))
        plan = ExternalPlan(
            name="turn",
            x=x,
            y=y,
            speed=np.sqrt(np.maximum(energy, 0.0)),
            status="degraded",
            reason="starts too fast",
        )
        assert {v.kind for v in check_plan_on_map(plan, model, downhill).violations} == kinds
