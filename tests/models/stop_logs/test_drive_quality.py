"""Faults put into a clean log, and found where they were put."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs.drive_quality import (
    SuspectKind,
    find_suspects,
    stretches_of,
    usable,
)

HZ = 50


def clean(seed: int = 0, *, noise: float = 0.02) -> dict[str, np.ndarray]:
    """One minute: hold 2 m/s, stop, hold, stop."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0, 1.0 / HZ)
    phase = t % 20.0
    v_cmd = np.where(phase < 12.0, 2.0, 0.0)
    v = np.where(phase < 12.3, 2.0, np.maximum(2.0 - 4.0 * (phase - 12.3), 0.0))
    yaw = 0.5 * np.sin(0.3 * t)
    x = np.cumsum(v) / HZ
    return {
        "run": np.full(len(t), "1"),
        "t": t,
        "v": v + noise * rng.standard_normal(len(t)),
        "v_cmd": v_cmd,
        "pitch": 0.1 * np.sin(0.2 * t) + 0.1 * noise * rng.standard_normal(len(t)),
        "yaw": yaw,
        "yaw_rate": np.gradient(yaw, t),
        "x": x,
        "y": np.zeros_like(x),
        "accel_z": 9.81 + noise * rng.standard_normal(len(t)),
    }


def suspects_of(columns: dict[str, np.ndarray]) -> list[tuple[str, SuspectKind, int, int]]:
    runs = (slice(0, len(columns["t"])),)
    return [(s.channel, s.kind, s.start, s.stop) for s in find_suspects(columns, runs)]


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.06])
def test_a_clean_log_is_clean_with_noise_and_without(noise: float) -> None:
    assert suspects_of(clean(noise=noise)) == []


def test_frozen_encoder_is_found_where_it_freezes() -> None:
    log = clean()
    log["v"][1300:1400] = log["v"][1300]
    ((channel, kind, start, stop),) = suspects_of(log)
    assert (channel, kind) == ("v", SuspectKind.FROZEN)
    assert abs(start - 1300) <= 1
    assert abs(stop - 1400) <= 1


def test_speed_that_ignores_the_stop_command_is_frozen_even_without_noise() -> None:
    log = clean(noise=0.0)
    log["v"][600:900] = 2.0
    assert ("v", SuspectKind.FROZEN) in {(channel, kind) for channel, kind, *_ in suspects_of(log)}


@pytest.mark.parametrize("value", [-1000.0, 999.0, 99.99])
def test_a_sentinel_within_the_limit_is_far_from_all_else(value: float) -> None:
    log = clean()
    rng = np.random.default_rng(1)
    log["current_left"] = 6.0 + 2.0 * rng.standard_normal(len(log["t"]))
    log["current_left"][400:420] = value
    assert suspects_of(log) == [("current_left", SuspectKind.SENTINEL, 400, 420)]
    # A motor that draws that much anyway has measured it.
    log["current_left"] = 0.6 * abs(value) + 0.2 * abs(value) * np.sin(log["t"])
    log["current_left"][400] = value
    assert suspects_of(log) == []


def test_nan_and_sentinels() -> None:
    log = clean()
    log["yaw_rate"][10:20] = np.nan
    log["v"][700:703] = -1000.0
    marks = suspects_of(log)
    assert ("yaw_rate", SuspectKind.NOT_FINITE, 10, 20) in marks
    assert ("v", SuspectKind.SENTINEL, 700, 703) in marks


def test_one_wild_sample_is_a_jump() -> None:
    log = clean()
    log["v"][555] = 5.0
    assert ("v", SuspectKind.JUMP, 555, 556) in suspects_of(log)


def test_samples_lost_without_a_gap_in_time_are_a_step_that_no_vehicle_makes() -> None:
    log = clean()
    logged = np.ones(len(log["t"]), np.bool_)
    logged[625:640] = False  # 1.2 m/s of the first stop
    log["t"] = np.where(np.arange(len(logged)) >= 640, log["t"] - 0.3, log["t"])
    assert suspects_of({name: values[logged] for name, values in log.items()}) == [
        ("v", SuspectKind.STEP, 624, 626)
    ]
    # A sensor with a value every 0.3 s, in rows every 0.02 s, changes by as much.
    slow = clean(noise=0.0)
    slow["v"] = slow["v"][np.arange(len(slow["t"])) // 15 * 15]
    assert suspects_of(slow) == []


def test_gaps_matter_to_every_channel() -> None:
    log = clean()
    keep = np.r_[0:1000, 1100:3000]
    log = {name: values[keep] for name, values in log.items()}
    stretches = find_suspects(log, (slice(0, len(keep)),))
    assert [(s.kind, s.start, s.stop) for s in stretches] == [(SuspectKind.GAP, 999, 1001)]
    assert not usable(len(keep), stretches, ["v"])[999:1001].any()
    assert usable(len(keep), stretches, ["v"]).sum() == len(keep) - 2


@pytest.mark.parametrize(
    ("channel", "factor", "message"),
    [
        ("pitch", 57.3, "degrees"),
        ("yaw_rate", 57.3, "degrees per second"),
        ("v", 1.0 / 0.514444, "knots"),
        ("v", 3.6, "km/h"),
        ("accel_z", 1.0 / 9.80665, "g"),
    ],
)
def test_units_are_suspected(channel: str, factor: float, message: str) -> None:
    log = clean()
    log[channel] = log[channel] * factor
    units = [
        s for s in find_suspects(log, (slice(0, len(log["t"])),)) if s.kind is SuspectKind.UNITS
    ]
    assert [s.channel for s in units] == [channel]
    assert message in units[0].reason


def test_runs_are_checked_separately() -> None:
    log = {name: np.concatenate((values, values)) for name, values in clean().items()}
    n = len(log["t"]) // 2
    log["t"][n:] += 100.0
    assert not find_suspects(log, (slice(0, n), slice(n, 2 * n)))


def test_stretches_of_a_mask() -> None:
    assert stretches_of(np.array([1, 1, 0, 1], bool)) == [(0, 2), (3, 4)]
    assert stretches_of(np.zeros(3, bool)) == []


def joined_with_set_points() -> dict[str, np.ndarray]:
    """A minute of measured wheels, then ten seconds of set points, on one clock and as one run."""
    measured = clean()
    held = {name: values[: 10 * HZ].copy() for name, values in clean(seed=1).items()}
    rng = np.random.default_rng(3)
    for log, noise in ((measured, 0.02), (held, 0.0)):
        steady = np.where(log["v_cmd"] > 0.0, 2.0, 0.0)
        for side in ("v_left", "v_right"):
            log[side] = steady + noise * rng.standard_normal(len(steady))
    held["t"] = held["t"] + 60.0
    return {name: np.concatenate([measured[name], held[name]]) for name in measured}


def test_set_points_behind_measured_wheels_are_no_frozen_encoders() -> None:
    log = joined_with_set_points()
    assert [entry for entry in suspects_of(log) if entry[0].startswith("v_")] == []


def test_one_wheel_that_freezes_is_found_and_both_where_the_command_changes() -> None:
    log = joined_with_set_points()
    log["v_left"][200:400] = log["v_left"][200]
    assert ("v_left", SuspectKind.FROZEN) in {entry[:2] for entry in suspects_of(log)}
    log = joined_with_set_points()
    for side in ("v_left", "v_right"):
        log[side][400:700] = log[side][400]  # through the stop command at the 600th sample
    assert {e[0] for e in suspects_of(log) if e[1] is SuspectKind.FROZEN} == {"v_left", "v_right"}
