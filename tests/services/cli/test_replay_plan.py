"""`slopewise replay --plan` on recordings of a drive toward a wall, with maps that move along."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from rosbags.rosbag2 import StoragePlugin, Writer

from slopewise.services.io.bag_drive import ODOMETRY
from slopewise.services.io.bags import GRID_MAP, PATH, typestore
from slopewise.services.io.model_file import find_model, read_model
from tests.services import grid_maps
from tests.services.command_line import here, one_line_of
from tests.services.ros.ros_messages import odometry

ATV = read_model(find_model("atv"))
WALL, CELL = 14.0, 0.2  # [m]
SPEED, BRAKES_AT, DECELERATION = 1.8, 11.8, 3.0
"""Of the driver [m/s], [m], [m/s²]."""
Message = tuple[float, str, str, Any]


def map_around(x: float) -> Any:
    """12 m by 8 m of level ground, 3 m more of it ahead, with the part of the wall on it."""
    centre = round(x / CELL) * CELL + 3.0
    east = centre + CELL * (29.5 - np.arange(60))
    heights = np.broadcast_to(
        np.where(np.abs(east - WALL - 0.3) < 0.3, 0.8, 0.0)[:, None], (60, 40)
    )
    return grid_maps.grid_map(heights, CELL, (centre, 0.0), frame="odom", start=(7, 3))


def drive(*, frame: str = "odom", late: float = 0.0) -> Iterator[Message]:
    """Odometry at 20 Hz, a map a second from 0.5 s on, a path at 1 s, one that is broken at 2 s.

    Its stamps are `late` [s] before arrival.
    """
    x, speed = 0.0, SPEED
    for k in range(180):
        t = 0.05 * k
        if k % 20 == 10:
            yield t, "/elevation", GRID_MAP, map_around(x)
        if k == 20:
            line = np.stack([np.linspace(-1.0, 20.0, 60), np.zeros(60)], axis=1)
            yield t, "/plan", PATH, grid_maps.path(line, "odom")
        if k == 40:
            yield t, "/broken", PATH, grid_maps.path(np.zeros((1, 2)), "odom")
        yield t, "/odom", ODOMETRY, odometry(speed, x, 100.0 + t - late, frame)
        speed = max(speed - 0.05 * DECELERATION * (x >= BRAKES_AT), 0.0)
        x += 0.05 * speed


def recorded(folder: Path, messages: Iterator[Message]) -> Path:
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for t, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=typestore())
            data = typestore().serialize_cdr(message, kind)
            writer.write(connections[topic], round(1e9 * (100.0 + t)), data)
    return folder


def replayed(bag: Path, *options: object) -> dict[str, Any]:
    done = here("replay", bag, "--plan", "--model", "atv", "--json", *options)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def test_the_driver_would_have_been_slowed_before_the_wall(tmp_path: Path) -> None:
    bag, page = recorded(tmp_path / "drive", drive()), tmp_path / "page.html"
    summary = replayed(bag, "--speed-up", "inf", "--report", page)
    assert summary["missing"] == {"no map yet": 5, "no path yet": 5}
    assert summary["cycles"] == 80
    assert summary["received"]["maps"] == 9
    assert any(kind.startswith("unusable: /broken") for kind in summary["received"])
    first = summary["slowed"][0]
    # With the model's mean, a stop from the driver's speed ends at the wall if it begins here.
    braking = ATV.braking
    stop = SPEED * braking.dead_time + braking.distance_offset
    stop += SPEED**2 / (2.0 * 9.80665 * (braking.m_b * SPEED + braking.b_b))
    latest = WALL - ATV.vehicle.shape.front - stop
    assert latest - 3.0 < SPEED * first["begin"] <= latest
    assert "under the front left wheel at x 13.7" in " ".join(
        row["example"] for row in summary["statuses"]
    )
    assert {row["status"] for row in summary["guard"]} >= {"pass", "slow"}
    assert 0.0 < summary["latency"]["median"] <= summary["latency"]["max"]
    text = page.read_text()
    assert "slowed in" in text
    assert "under the front left wheel at x 13.7" in text


def test_late_odometry_slows_sooner(tmp_path: Path) -> None:
    slowed = [
        replayed(recorded(tmp_path / f"{late}", drive(late=late)), "--speed-up", "inf")["slowed"][0]
        for late in (0.0, 0.5)
    ]
    # The vehicle may be 0.9 m farther along than its pose, where it is commanded for as well.
    assert 0.1 < slowed[0]["begin"] - slowed[1]["begin"] < 0.9


def test_cycles_continue_where_odometry_is_missing(tmp_path: Path) -> None:
    silent = (m for m in drive() if m[1] != "/odom" or not 3.02 < m[0] < 5.97)
    summary = replayed(recorded(tmp_path / "drive", silent), "--speed-up", "inf")
    # From 3.1 to 5.9 s: up to 1 s on a state that gets older, then none.
    assert summary["missing"]["no odometry for 1 s"] == 19
    assert summary["cycles"] == 80 - 19


def test_a_step_of_the_recorders_clock_is_not_waited_for(tmp_path: Path) -> None:
    step = 1.7e9  # [s], of a robot that gets the time late
    stepped = (
        (
            t + step * later,
            topic,
            kind,
            odometry(SPEED, SPEED * t, 100.0 + t + step) if later and topic == "/odom" else message,
        )
        for t, topic, kind, message in drive()
        for later in [t > 3.02]
    )
    summary = replayed(recorded(tmp_path / "drive", stepped), "--speed-up", "4")
    silent = summary["missing"]["no odometry for 1 s"]
    assert silent == pytest.approx(10.0 * step - 10.0, abs=3.0)
    assert summary["cycles"] == pytest.approx(80 + 10, abs=1)


def test_stamps_of_another_clock_are_reported(tmp_path: Path) -> None:
    known = "odometry"
    unknown = "odometry with stamps of another clock: its age is unknown"
    for late, names in ((100.0, {unknown}), (0.0, {known})):
        summary = replayed(recorded(tmp_path / f"{late}", drive(late=late)), "--speed-up", "inf")
        assert {kind for kind in summary["received"] if kind.startswith(known)} == names
    # Once a stamp was of the recorder's clock, a later step of the clock is an age.
    jump = (
        (t, topic, kind, odometry(SPEED, SPEED * t, 98.0 + t) if at_end else message)
        for t, topic, kind, message in drive()
        for at_end in [topic == "/odom" and 5.0 < t < 5.5]
    )
    summary = replayed(recorded(tmp_path / "jump", jump), "--speed-up", "inf")
    assert unknown not in summary["received"]
    assert summary["slowed"][0]["begin"] < 5.2


def test_odometry_that_is_not_finite_has_no_place(tmp_path: Path) -> None:
    nan = (
        (t, topic, kind, odometry(SPEED, float("nan"), 100.0 + t) if lost else message)
        for t, topic, kind, message in drive()
        for lost in [topic == "/odom" and 3.0 < t < 3.5]
    )
    bag = recorded(tmp_path / "drive", nan)
    first = replayed(bag, "--speed-up", "inf", "--report", tmp_path / "page.html")["slowed"][0]
    assert first["x"] is None
    assert "state.x is nan" in first["reason"]


def test_a_replay_keeps_the_rate_of_the_recording(tmp_path: Path) -> None:
    import time

    bag = recorded(tmp_path / "drive", drive())
    begin = time.monotonic()
    replayed(bag, "--speed-up", "4")
    assert time.monotonic() - begin > (9.0 - 1.0) / 4.0


def test_maps_in_two_frames_are_refused(tmp_path: Path) -> None:
    def moved(message: Message) -> Message:
        if message[1] == "/elevation" and message[0] > 4.0:
            message[3].header.frame_id = "map"
        return message

    bag = recorded(tmp_path / "drive", map(moved, drive()))
    done = here("replay", bag, "--plan", "--model", "atv", "--speed-up", "inf")
    one_line_of(done, "topic /elevation, header.frame_id: expected frame odom")


def test_unusable_messages_are_named(tmp_path: Path) -> None:
    broken = (m for m in drive() if m[1] != "/plan")
    done = here("replay", recorded(tmp_path / "a", broken), "--plan", "--model", "atv")
    one_line_of(done, "unusable: /broken: points: expected at least")
    bag = recorded(tmp_path / "b", drive())
    done = here("replay", bag, "--plan", "--model", "atv", "--speed-up", "inf")
    assert "unusable: /broken: points: expected at least" in done.stdout
    data = next(bag.glob("*.mcap")).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) // 2])
    one_line_of(here("replay", cut, "--plan", "--model", "atv"), "`mcap recover` keeps")


def test_what_cannot_be_replayed_is_one_line(tmp_path: Path) -> None:
    bag = recorded(tmp_path / "drive", drive(frame="base"))
    done = here("replay", bag, "--plan", "--model", "atv", "--speed-up", "inf")
    one_line_of(done, "header.frame_id: expected frame odom as the map has it, got base")
    line = np.array([[0.0, 0.0], [9.0, 0.0]])
    early = {"one": [("map",)], "two": [("map",), ("odom",)], "of a pose": [("odom", "map")]}
    for name, frames in early.items():
        paths = [(0.0, "/plan", PATH, grid_maps.path(line, *of)) for of in frames]
        bag = recorded(tmp_path / name, iter([*paths, *(m for m in drive() if m[1] != "/plan")]))
        done = here("replay", bag, "--plan", "--model", "atv", "--speed-up", "inf")
        one_line_of(
            done, "topic /plan, header.frame_id: expected frame odom as the map has it, got map"
        )
    only_maps = recorded(tmp_path / "maps", (m for m in drive() if m[1] == "/elevation"))
    done = here("replay", only_maps, "--plan", "--model", "atv")
    one_line_of(done, "expected a topic of nav_msgs/msg/Odometry, got /elevation")
    one_line_of(here("replay", bag, "--plan"), "expected --model as well")
    one_line_of(here("replay", bag, "--report", "a.html"), "expected --plan as well")
