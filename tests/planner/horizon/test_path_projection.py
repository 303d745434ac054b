"""Position of the vehicle on a path, and plans from a pose off it."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.horizon.answer import (
    FULL_STOP,
    MAX_HEADING_ERROR,
    CycleAnswer,
    HorizonSettings,
)
from slopewise.planner.horizon.path_cut import cut, passed_stations
from slopewise.planner.horizon.path_projection import locate
from slopewise.planner.path import batch
from slopewise.planner.plan import Status
from tests.world.driving import Drive
from tests.world.ground import plane, straight
from tests.world.vehicles import BASE, tables_with


def located(paths: object, at: tuple[float, float], heading: float = 0.0) -> object:
    return locate(paths.x, paths.y, paths.count, at, heading)


def test_place_on_a_straight_line() -> None:
    paths = batch([straight(10.0), straight(6.0, heading=np.pi / 2, name="up")], 0.25)
    projection = located(paths, (3.1, -0.2))
    assert projection.segment[0] == 12
    assert (projection.x[0], projection.y[0]) == pytest.approx((3.1, 0.0))
    assert projection.along[0] == pytest.approx(3.1)
    assert projection.remaining[0] == pytest.approx(6.9)
    assert projection.lateral_offset[0] == pytest.approx(0.2)
    assert projection.turned == pytest.approx([0.0, np.pi / 2])
    assert projection.along[1] == pytest.approx(-0.2)
    assert projection.lateral_offset[1] == pytest.approx(3.1)


def test_at_a_crossing_the_branch_in_the_heading() -> None:
    """A loop that crosses itself at the origin, first to the east, later to the north."""
    turn = np.linspace(0.0, 1.5 * np.pi, 60)
    loop = np.stack([4.0 + 4.0 * np.sin(turn), 4.0 - 4.0 * np.cos(turn)], axis=1)
    points = np.concatenate([[(-4.0, 0.0)], loop, [(0.0, -4.0)]])
    paths = batch([CandidatePath("loop", points)], 0.25)
    assert located(paths, (0.0, 0.0), 0.0).along[0] == pytest.approx(4.0, abs=0.2)
    south = located(paths, (0.0, 0.0), -np.pi / 2)
    assert south.along[0] > 20.0
    assert south.turned[0] < 0.1


@pytest.mark.parametrize("driven", [0.05, 0.2, 3.1, 9.6, 9.9])
def test_a_trimmed_path_starts_at_the_vehicle_and_keeps_its_end(driven: float) -> None:
    paths = batch([straight(10.0), straight(10.0, name="other", speed_limit=[1.0, 2.0])], 0.25)
    projection = located(paths, (driven, 0.1))
    rest = cut(paths, projection, (driven, 0.1))
    for j in range(2):
        x, n = rest.x[:, j], int(rest.count[j])
        assert n >= 3
        assert x[0] == pytest.approx(driven)
        assert x[n - 1] == pytest.approx(10.0)
        assert np.all(np.diff(x[:n]) > 0.0)
        assert np.diff(x[:n]).max() < 0.25 * 1.3 + 1e-9
    assert rest.speed_limit.shape == rest.x.shape
    assert np.all(rest.speed_limit[:, 1] <= 2.0)


def test_what_is_left_behind_counts_along_the_ground() -> None:
    paths = batch([straight(10.0), straight(10.0, heading=np.pi / 2, name="level")], 0.25)
    slope = 0.3
    east = located(paths, (4.1, 0.0))
    left = passed_stations(paths, east, plane(slope), BASE.vehicle)
    assert left[0] == pytest.approx(4.1 * np.hypot(1.0, slope), abs=1e-9)
    ahead = located(paths, (-0.5, 0.0))
    assert passed_stations(paths, ahead, plane(slope), BASE.vehicle)[0] == pytest.approx(-0.5)


def vehicle_at(track: float, lateral: float, turned: float, course: float = 0.0) -> Drive:
    """A vehicle 5 m along a straight path; ``course``: direction of the path [rad]."""
    tables = tables_with(vehicle={"track_width": track}, terrain={"slip_track": 1.2 * track})
    ground = plane(x=(-30.0, 30.0), y=(-30.0, 30.0))
    drive = Drive(tables, ground, [straight(25.0, course)], speed=1.0)
    drive.x = 5.0 * np.cos(course) - lateral * np.sin(course)
    drive.y = 5.0 * np.sin(course) + lateral * np.cos(course)
    drive.heading = course + turned
    return drive


def refused(answer: CycleAnswer, reason: str) -> bool:
    assert (answer.status, answer.command, answer.chosen) == (Status.DEGRADED, FULL_STOP, None)
    assert reason in answer.reason
    return reason in answer.ranking[0].reason


@pytest.mark.parametrize(("track", "course"), [(0.45, 0.0), (1.0, 2.5)])
def test_within_half_a_track_and_03_rad_the_plan_is_that_of_the_path(
    track: float, course: float
) -> None:
    on_it = vehicle_at(track, 0.0, 0.0, course).cycle()
    assert on_it.status is Status.OK
    for lateral in np.array([-1.0, -0.99, 0.5, 0.99]) * (0.5 * track - 1e-9):
        for turned in np.array([-1.0, -0.99, 0.0, 0.99]) * (MAX_HEADING_ERROR - 1e-9):
            answer = vehicle_at(track, float(lateral), float(turned), course).cycle()
            assert answer.status is Status.OK
            assert answer.chosen.speed == pytest.approx(on_it.chosen.speed, abs=1e-6)
            assert answer.chosen.x == pytest.approx(on_it.chosen.x, abs=1e-9)


@pytest.mark.parametrize(("track", "course"), [(0.45, 0.0), (1.0, 2.5)])
def test_beyond_either_limit_the_vehicle_stops_with_the_reason(track: float, course: float) -> None:
    half = 0.5 * track
    for share in (-3.0, -1.01, 1.001, 2.0):
        for turned in (0.0, 0.29, -0.29):
            answer = vehicle_at(track, share * half, turned, course).cycle()
            assert refused(answer, f"m beside the vehicle, {half:g} m at most")
    for turned in (-3.0, -1.0, -0.301, 0.301, 1.0):
        for share in (0.0, 0.9, -0.9):
            answer = vehicle_at(track, share * half, turned, course).cycle()
            assert refused(answer, "0.3 rad at most")


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ({"y": 0.45, "heading": 1.0}, "57° off the heading (1.000 rad), 0.3 rad at most"),
        ({"y": 0.45, "heading": 90.0}, "rad at most; 90 rad is more than a turn: degrees?"),
        ({"y": 0.3}, "0.30 m beside the vehicle, 0.225 m at most"),
    ],
)
def test_a_plan_that_the_pose_no_longer_fits_is_not_driven_on(
    place: dict[str, float], reason: str
) -> None:
    track = 1.0 if "heading" in place else 0.45
    drive = vehicle_at(track, 0.0, 0.0)
    driven = [drive.cycle() for _ in range(5)]
    assert [a.status for a in driven] == [Status.OK] * 5
    for name, value in place.items():
        setattr(drive, name, value)
    assert refused(drive.cycle(), reason)
    drive.y, drive.heading = 0.0, 0.0
    assert drive.cycle().status is Status.OK


def test_limits_of_the_pose_are_made_tighter_only() -> None:
    assert HorizonSettings(beside=0.1).for_track(1.0).beside == 0.1
    assert HorizonSettings(beside=3.0).for_track(1.5).beside == 0.75
