"""A vehicle that is not on its paths: planned for within the limits of pose, stopped beyond."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.planner.horizon.answer import (
    FULL_STOP,
    MAX_HEADING_ERROR,
    CycleAnswer,
    HorizonSettings,
)
from slopewise.planner.plan import Status
from tests.planner.driving import Drive
from tests.planner.scenes import plane, straight, tables_with

TRACKS = (0.45, 0.6, 1.0)
"""Track widths of which half is at most the limit of the settings [m]."""


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


@pytest.mark.parametrize("track", TRACKS)
@pytest.mark.parametrize("course", [0.0, 2.5])
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


@pytest.mark.parametrize("track", TRACKS)
@pytest.mark.parametrize("course", [0.0, 2.5])
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


def test_a_candidate_that_fits_is_driven_instead_of_the_plan_so_far() -> None:
    drive = vehicle_at(1.0, 0.0, 0.0)
    drive.cycle()
    drive.heading = 0.5
    fits = straight(20.0, 0.5).points + np.array([drive.x, drive.y])
    drive.paths = [straight(25.0), CandidatePath("turned", fits)]
    answer = drive.cycle()
    assert (answer.chosen.candidate, answer.kept) == ("turned", False)
    assert "0.3 rad at most" in answer.ranking[-1].reason


def test_limits_of_the_pose_are_made_tighter_only() -> None:
    with pytest.raises(ParameterError, match=r"turned: expected .* <= 0.3"):
        HorizonSettings(turned=0.31)
    assert HorizonSettings(beside=0.1).for_track(1.0).beside == 0.1
    assert HorizonSettings(beside=3.0).for_track(1.5).beside == 0.75
