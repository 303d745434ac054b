"""Grade of the ground under stops, and stretches of a log that are suspect."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs import mount_offset
from slopewise.models.stop_logs.drive_quality import (
    SuspectKind,
    find_suspects,
    stretches_of,
    usable,
)
from slopewise.models.stop_logs.ground_grade import Dive, StopPitch, estimate_dive, shrunk

PER = np.deg2rad(0.3)  # [rad s²/m]


def stops(dive: float, settling: float, seed: int = 0, noise: float = 0.3) -> list[StopPitch]:
    """Bodies that dive on ground that bends; the suspension by small steps, not by the formula."""
    rng = np.random.default_rng(seed)
    stops_list = []
    for _ in range(40):
        held, a = rng.uniform(1.5, 4.0), rng.uniform(2.5, 4.5)
        onset = 0.3
        rest = onset + held / a
        t = np.arange(-1.0, rest + 1.5, 0.01)
        v = np.clip(held - a * (t - onset), 0.0, held)
        s = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.01)))
        q, dive_angle = np.zeros(len(t)), 0.0
        for k, at in enumerate(t):
            now = a if onset < at <= rest else 0.0
            dive_angle += (
                (now - dive_angle) * min(0.01 / settling, 1.0) if settling > 0 else now - dive_angle
            )
            q[k] = dive_angle
        ground = rng.uniform(-0.2, 0.2) + 0.02 * np.sin(s / 2.0 + rng.uniform(0, 6))
        pitch = -ground + dive * q + np.deg2rad(noise) * rng.standard_normal(len(t)) + 0.02
        stops_list.append(StopPitch(t, s, pitch, onset, rest, a))
    return stops_list


@pytest.mark.parametrize("settling", [0.0, 0.1])
@pytest.mark.parametrize("dive", [0.0, PER, -0.5 * PER])
def test_the_dive_is_recovered(dive: float, settling: float) -> None:
    estimate = estimate_dive(stops(dive, settling))
    assert estimate.per_deceleration == pytest.approx(dive, abs=max(3.0 * estimate.std, 0.07 * PER))
    assert estimate.std < 0.1 * PER


def test_felt_deceleration_builds_up_and_fades() -> None:
    t = np.array([-1.0, 0.3, 0.4, 5.0, 5.1, 9.0])
    stop = StopPitch(t, t, t, 0.3, 5.0, 4.0)
    np.testing.assert_allclose(stop.felt_deceleration(0.0), [0, 0, 4, 4, 0, 0])
    soft = stop.felt_deceleration(0.1)
    np.testing.assert_allclose(soft, [0, 0, 4 * (1 - np.exp(-1)), 4, 4 * np.exp(-1), 0], atol=1e-9)
    assert Dive(PER, 0.0, 0.1).pitch(stop)[3] == pytest.approx(4.0 * PER)


def test_nothing_to_see_is_no_dive() -> None:
    assert estimate_dive([]) == Dive()


def test_grades_are_used_as_far_as_they_exceed_their_noise() -> None:
    rng = np.random.default_rng(0)
    slopes = rng.uniform(-0.2, 0.2, 50)
    np.testing.assert_allclose(shrunk(slopes, np.full(50, 0.001)), slopes, atol=1e-4)
    level = 0.01 + 0.002 * rng.standard_normal(50)
    np.testing.assert_allclose(shrunk(level, np.full(50, 0.002)), np.mean(level), atol=5e-4)
    np.testing.assert_allclose(shrunk(level, np.zeros(50)), level, rtol=1e-9)


MOUNT = np.deg2rad(1.0)


def drive(headings: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Straight drives over one tilted, bumpy field in some headings, all through its middle."""
    rng = np.random.default_rng(seed)
    parts = []
    for heading in headings:
        s = np.arange(-15.0, 15.0, 0.1)
        side = rng.uniform(-2.0, 2.0)
        x = s * np.cos(heading) - side * np.sin(heading)
        y = s * np.sin(heading) + side * np.cos(heading)
        gx, gy = 0.1 + 0.05 * np.sin(x / 4.0), -0.05 + 0.05 * np.cos(y / 5.0)
        grade = gx * np.cos(heading) + gy * np.sin(heading)
        pitch = -grade + MOUNT + np.deg2rad(0.3) * rng.standard_normal(len(s))
        parts.append((x, y, np.full(len(s), heading), pitch, grade))
    names = ("x", "y", "heading", "pitch", "grade")
    return dict(zip(names, map(np.concatenate, zip(*parts, strict=True)), strict=True))


def from_headings(d: dict[str, np.ndarray]) -> mount_offset.Mount:
    use = np.ones(len(d["x"]), bool)
    return mount_offset.from_headings(d["pitch"], d["x"], d["y"], d["heading"], use)


@pytest.mark.parametrize("kind", ["out and back", "all over"])
def test_ground_driven_in_several_directions_determines_it(kind: str) -> None:
    some = {"out and back": [0.0, np.pi] * 6, "all over": np.linspace(0, 6, 12)}[kind]
    mount = from_headings(drive(np.array(some)))
    assert mount.known
    assert mount.offset == pytest.approx(MOUNT, abs=max(3.0 * mount.std, np.deg2rad(0.1)))
    assert mount.std < np.deg2rad(0.2)


def test_one_direction_is_not_enough() -> None:
    mount = from_headings(drive(np.zeros(12)))
    assert not mount.known
    assert mount.offset == 0.0
    assert mount.std == mount_offset.TYPICAL_MOUNTING_STD


def test_known_grade_determines_it_and_gaps_do_not_matter() -> None:
    d = drive(np.linspace(0, 6, 5))
    grade = d["grade"].copy()
    grade[::7] = np.nan
    mount = mount_offset.from_grade(d["pitch"], grade, np.ones(len(grade), bool), "map")
    assert mount.source == "map"
    assert mount.offset == pytest.approx(MOUNT, abs=np.deg2rad(0.05))
    nothing = mount_offset.from_grade(d["pitch"], grade * np.nan, np.ones(len(grade), bool), "map")
    assert not nothing.known


def test_heights_give_the_grade() -> None:
    station = np.linspace(0.0, 50.0, 501)
    grade = mount_offset.from_heights(station, station * np.sin(0.1))
    np.testing.assert_allclose(grade, 0.1, atol=1e-9)
    standing = mount_offset.from_heights(np.zeros(10), np.zeros(10))
    assert np.isnan(standing).all()


def test_steady_driving_only() -> None:
    t = np.arange(0.0, 6.0, 0.02)
    v = np.clip(2.0 - 3.0 * (t - 4.0), 0.0, 2.0)
    use = mount_offset.steady(t, v)
    assert use[(t > 0.5) & (t < 3.5)].all()
    assert not use[(t > 4.05) & (t < 4.6)].any()
    assert not use[t > 5.2].any()


def test_the_course_follows_positions_where_there_are_any() -> None:
    s = np.concatenate((np.linspace(0.0, 10.0, 200), np.full(50, 10.0)))
    mount = mount_offset.course(s, s * np.cos(2.0), s * np.sin(2.0))
    np.testing.assert_allclose(mount[:200], 2.0, atol=1e-9)
    assert np.isnan(mount_offset.course(np.zeros(9), np.zeros(9), np.zeros(9))).all()


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
