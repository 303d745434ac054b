"""A recorded drive through a running service, at its own pace and faster."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import numpy as np
import pytest

from tests.services.command_line import here, one_line_of, slopewise
from tests.services.service_process import Running, running

G = 9.81
DEAD_TIME, FORCE = 0.3, 0.30
"""The vehicle of the log: brakes with an even force, a share of its weight, on level ground."""


def drive(stops: int, rate: float = 50.0) -> str:
    """A log of stops from several speeds; roll is missing once."""
    rows = ["run,t,v,v_cmd,pitch,roll"]
    t = 0.0
    for k in range(stops):
        speed = 1.5 + 0.5 * (k % 4)
        braking = speed / (G * FORCE)
        for since in np.arange(-1.0, DEAD_TIME + braking + 0.3, 1.0 / rate):
            v = speed - G * FORCE * max(since - DEAD_TIME, 0.0)
            told = speed if since < 0.0 else 0.0
            rows.append(f"1,{t:.4f},{max(v, 0.0):.5f},{told:.3f},0.0,0.0")
            t += 1.0 / rate
    rows[30] = rows[30].rpartition(",")[0] + ","
    return "\n".join(rows) + "\n"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory):
    settings = "[learning]\nstops_at_once = 1000"
    with running(tmp_path_factory.mktemp("replay"), planning=settings) as started:
        yield started


def words(service: Running, log: Path, *options: object) -> tuple[object, ...]:
    where = ("--connect", service.endpoint, "--namespace", service.namespace)
    return "replay", log, *where, *options


def stopping_distance(speed: float, values: dict[str, float], dead_time: float) -> float:
    """On level ground, by Braking (7), (8), (12); written out here again."""
    force = values["m_b"] * speed + values["b_b"]
    return speed * dead_time + speed**2 / (2.0 * G * force)


def test_what_was_driven_is_learned_much_faster_than_it_was_driven(
    service: Running, tmp_path: Path
) -> None:
    log = tmp_path / "drive.csv"
    log.write_text(drive(24))
    done = slopewise(*words(service, log, "--speed-up", "inf", "--json"))
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["took"] < 0.2 * told["driven"]
    assert told["version"]["after"] > told["version"]["before"]
    assert {entry["status"] for entry in told["receipts"]} == {"taken"}
    braking = told["learned"]["braking"]
    for speed in (1.5, 3.0):
        true = speed * DEAD_TIME + speed**2 / (2.0 * G * FORCE)
        before = stopping_distance(speed, braking["before"], DEAD_TIME)
        after = stopping_distance(speed, braking["after"], DEAD_TIME)
        assert abs(after - true) < 0.5 * abs(before - true)
        assert after > 0.98 * true


def test_logs_whose_clocks_begin_anew_are_all_taken(service: Running, tmp_path: Path) -> None:
    logs = [tmp_path / name for name in ("one.csv", "two.csv")]
    for log in logs:
        log.write_text(drive(3))
    done = here(*words(service, logs[0], logs[1], "--speed-up", "inf", "--json"))
    told = json.loads(done.stdout)
    assert {entry["status"] for entry in told["receipts"]} == {"taken"}
    batches = sum(entry["batches"] for entry in told["receipts"])
    assert batches <= told["driven"] / 0.25 + 10
    assert told["version"]["after"] >= told["version"]["before"] + 6


def test_a_pace_is_kept(service: Running, tmp_path: Path) -> None:
    log = tmp_path / "drive.csv"
    log.write_text(drive(2))
    begun = time.monotonic()
    done = here(*words(service, log, "--speed-up", "2"))
    took = time.monotonic() - begun
    assert done.returncode == 0, done.stderr
    driven = 2 * (1.3 + DEAD_TIME) + (1.5 + 2.0) / (G * FORCE)
    assert took > 0.5 * driven - 0.3
    assert "what was learned" in done.stdout
    assert math.isclose(driven, 4.4, rel_tol=0.02)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--speed-up", "0"), "--speed-up: expected a factor > 0"),
        (("--speed-up", "nan"), "--speed-up: expected a factor > 0"),
        (("--namespace", "nobody/here", "--timeout", "0.5"), "nobody/here/v1/params: expected"),
    ],
)
def test_mistakes_are_named(
    service: Running, tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    log = tmp_path / "drive.csv"
    log.write_text(drive(1))
    one_line_of(here(*words(service, log, *options)), said)
