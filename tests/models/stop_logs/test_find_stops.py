"""Stops in a log and in a stream, and ramped commands."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.calibration.learn import learn
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, Usability, find_stops
from slopewise.models.stop_logs.sinking_commands import sinking_commands
from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from tests.models.calibration.plant import Plant, drive
from tests.world.logs import log
from tests.world.vehicles import BASE

HZ = 50.0
T = np.arange(-2.0, 5.0, 1.0 / HZ)
AT = int(np.argmin(np.abs(T)))  # sample of the stop command


def speed(dead_time: float = 0.3, deceleration: float = 4.0, held: float = 2.0) -> np.ndarray:
    fall = np.maximum(T - dead_time, 0.0)
    v = np.maximum(held - deceleration * fall, 0.0)
    standstill = dead_time + held / deceleration
    return np.where(standstill < T, -0.05 * np.exp(-(T - standstill) / 0.1), v)  # rocks back


def clean_log(**changes: np.ndarray) -> dict[str, np.ndarray]:
    return {"t": T + 100.0, "v": speed(), "v_cmd": np.where(T < -1e-9, 2.0, 0.0)} | changes


def stops_of(columns: dict[str, np.ndarray], usable: np.ndarray | None = None) -> list[StopWindow]:
    usable = np.ones(len(T), bool) if usable is None else usable
    return find_stops(columns, slice(0, len(T)), usable)


def test_a_step_to_zero_is_a_stop_up_to_the_first_crossing() -> None:
    (stop,) = stops_of(clean_log())
    assert stop.verdict is Usability.USABLE
    assert stop.command == AT
    assert T[stop.standstill] == pytest.approx(0.8, abs=1.5 / HZ)
    assert stop.held_speed == pytest.approx(2.0)
    assert T[stop.begin] == pytest.approx(-1.0, abs=1.5 / HZ)
    assert T[stop.end - 1] == pytest.approx(0.8 + 1.5, abs=2.5 / HZ)


def test_a_sensor_that_never_reads_zero_settles() -> None:
    (stop,) = stops_of(clean_log(v=np.maximum(speed(), 0.02)))
    assert stop.verdict is Usability.USABLE
    assert T[stop.standstill] == pytest.approx(0.79, abs=2.0 / HZ)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({"v_cmd": np.where((T < -1e-9) | (T > 0.5), 2.0, 0.0)}, Usability.ABORTED),
        ({"v": speed(deceleration=0.2)}, Usability.UNFINISHED),
        ({"v_cmd": np.clip(-2.0 * T / 0.8, 0.0, 2.0)}, Usability.RAMPED),
        ({"v_cmd": np.where(T < -0.5, 2.0, np.where(T < -1e-9, 0.4, 0.0))}, Usability.RAMPED),
        ({"v_cmd": np.where(T < -1e-9, 2.0, -1.0)}, Usability.REVERSED),
        ({"yaw_rate": np.full(len(T), 0.6)}, Usability.TURNING),
        ({"brake": np.where(T < -1e-9, 0.0, 0.5)}, Usability.PARTIAL),
        ({"brake": np.zeros(len(T))}, Usability.COASTED),
        ({"v": speed(deceleration=100.0)}, Usability.SPARSE),
    ],
)
def test_what_is_no_full_straight_stop_is_found_and_left_out(
    changes: dict[str, np.ndarray], verdict: Usability
) -> None:
    (stop,) = stops_of(clean_log(**changes))
    assert stop.verdict is verdict
    assert not stop.usable


@pytest.mark.parametrize(
    "command",
    [
        np.where(T < -1e-9, 2.0, 0.0),
        np.where(T < -1e-9, 1.5, 0.0),  # off by a factor
        np.clip(-2.0 * T / 0.1, 0.0, 2.0),  # as good as a step
    ],
)
def test_shapes_of_the_command_that_are_steps(command: np.ndarray) -> None:
    (stop,) = stops_of(clean_log(v_cmd=command))
    assert stop.verdict is Usability.USABLE


def test_straight_full_and_unmeasured_channels_do_not_disturb() -> None:
    nothing = np.full(len(T), np.nan)
    full = {"yaw_rate": np.full(len(T), 0.05), "brake": np.where(T < -1e-9, 0.0, 1.0)}
    for changes in (full, {"yaw_rate": nothing, "brake": nothing}):
        assert [s.verdict for s in stops_of(clean_log(**changes))] == [Usability.USABLE]


def test_suspect_samples_spoil_the_stop_they_lie_in() -> None:
    usable = np.ones(len(T), bool)
    usable[AT + 10] = False
    assert [s.verdict for s in stops_of(clean_log(), usable)] == [Usability.SUSPECT]
    usable[:] = True
    usable[AT - 95 : AT - 80] = False
    assert [s.verdict for s in stops_of(clean_log(), usable)] == [Usability.USABLE]


def test_nothing_to_stop() -> None:
    assert stops_of(clean_log(v=speed(held=0.04))) == []
    assert stops_of(clean_log(v_cmd=np.zeros(len(T)))) == []


def test_slow_stops_are_found_and_those_below_a_speed_that_is_asked_for_are_named() -> None:
    slow = clean_log(v=speed(held=0.2, deceleration=0.5))
    assert [s.verdict for s in stops_of(slow)] == [Usability.USABLE]
    everything = np.ones(len(T), bool)
    (stop,) = find_stops(slow, slice(0, len(T)), everything, StopSettings(least_speed=0.3))
    assert stop.verdict is Usability.SLOW
    assert stop.reason == "0.20 m/s, below the least speed of 0.3 m/s"


def test_what_the_noise_at_rest_hides_is_no_stop() -> None:
    noise = 0.04 * np.random.default_rng(2).standard_normal(len(T))
    assert stops_of(clean_log(v=speed(held=0.15) + noise)) == []
    assert len(stops_of(clean_log(v=speed(held=0.35) + noise))) == 1


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_stop_of_forty_seconds_is_one(noise: float) -> None:
    t = np.arange(-2.0, 50.0, 0.05)
    v = np.clip(2.0 - 0.05 * (t - 0.3), 0.0, 2.0)
    v += noise * np.random.default_rng(3).standard_normal(len(t))
    columns = {"t": t, "v": v, "v_cmd": np.where(t < -1e-9, 2.0, 0.0)}
    (stop,) = find_stops(columns, slice(0, len(t)), np.ones(len(t), bool))
    assert stop.verdict is Usability.USABLE
    assert t[stop.standstill] == pytest.approx(40.3, abs=1.0)
    (short,) = find_stops(
        columns, slice(0, len(t)), np.ones(len(t), bool), StopSettings(longest=30.0)
    )
    assert short.verdict is Usability.UNFINISHED


def test_stops_of_a_later_run_keep_their_place() -> None:
    single = clean_log()
    two = {name: np.concatenate((values, values)) for name, values in single.items()}
    n = len(T)
    (stop,) = find_stops(two, slice(n, 2 * n), np.ones(2 * n, bool))
    assert stop.command == n + AT


def test_standstill_is_timed_by_the_noise_that_the_log_has_at_rest() -> None:
    """A sensor that reads a tenth of a metre per second at rest hides no stop of one second."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 20.0, 0.1)
    v = np.clip(1.0 - (t - 2.0) / 0.8, 0.0, 1.0) + np.abs(0.05 * rng.standard_normal(len(t)))
    columns = {"t": t, "v": v, "v_cmd": np.where(t < 2.0, 1.0, 0.0)}
    (stop,) = find_stops(columns, slice(0, len(t)), np.ones(len(t), np.bool_))
    assert t[stop.standstill] == pytest.approx(2.8, abs=0.3)


def stream(plant: Plant, stops: int = 60, seed: int = 0) -> tuple[list[StreamedStop], np.ndarray]:
    log, _, truth = drive(plant, stops, seed)
    feed = StopStream(plant.dead_time, mount=plant.mount, dive=plant.dive)
    rows = zip(*(log[name].tolist() for name in ("t", "v", "v_cmd", "pitch")), strict=True)
    streamed = [stop for row in rows if (stop := feed.feed(*row)) is not None]
    return streamed, truth.speed


@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_every_stop_is_measured(noise: float) -> None:
    plant = Plant(speed_noise=noise, scatter=0.0, dive=np.deg2rad(0.3), mount=np.deg2rad(1.0))
    streamed, speed = stream(plant)
    assert len(streamed) == 60
    np.testing.assert_allclose([s.onset_speed for s in streamed], speed, atol=5 * noise)
    error = [s.force_ratio / plant.force(s.grade, s.onset_speed) - 1.0 for s in streamed]
    assert abs(np.mean(error)) < 0.01
    assert np.std(error) < 0.03
    assert np.mean([s.dead_time for s in streamed]) == pytest.approx(plant.dead_time, abs=0.01)


def test_its_noise_is_what_it_claims() -> None:
    plant = Plant(speed_noise=0.02, scatter=0.0, pitch_noise=1e-4, undulation=0.0)
    streamed, _ = stream(plant, 150)
    scaled = [(s.force_ratio - plant.force(s.grade, s.onset_speed)) / s.force_std for s in streamed]
    assert 0.7 < np.std(scaled) < 1.4


def rows(release: float = 9.0, gap: float = 0.0) -> list[tuple[float, float, float, float]]:
    t = np.arange(-1.0, 3.0, 0.02)
    v = np.clip(2.0 - 4.0 * (t - 0.3), 0.0, 2.0)
    command = np.where((t < 0.0) | (t > release), 2.0, 0.0)
    t = np.where(t > 0.5, t + gap, t)
    return list(zip(t.tolist(), v.tolist(), command.tolist(), [0.0] * len(t), strict=True))


def count(samples: list[tuple[float, float, float, float]]) -> int:
    feed = StopStream(0.3)
    return sum(feed.feed(*row) is not None for row in samples)


def test_aborted_stops_and_stops_with_gaps_are_none() -> None:
    assert count(rows()) == 1
    assert count(rows(release=0.5)) == 0
    assert count(rows(gap=1.0)) == 0


def test_bad_samples_are_ignored_or_end_the_stop() -> None:
    valid_rows = rows()
    doubled = [row for row in valid_rows for _ in range(2)]
    assert count(doubled) == 1
    late = [*valid_rows[:60], valid_rows[10], *valid_rows[60:]]
    assert count(late) == 1
    broken = list(valid_rows)
    broken[65] = (broken[65][0], float("nan"), 0.0, 0.0)
    assert count(broken) == 0
    no_pitch = [(t, v, c, float("nan")) for t, v, c, _ in valid_rows]
    assert count(no_pitch) == 0


def sunk_to(share: float, seconds: float = 0.4) -> tuple[dict[str, np.ndarray], list[slice]]:
    """A log whose commands sink to a share of what they were before each falls to 0."""
    columns, runs = log("clean")
    columns = dict(columns)
    command, t = columns["v_cmd"].copy(), columns["t"]
    for i in np.flatnonzero((command[1:] <= 0.0) & (command[:-1] > 0.0)) + 1:
        before = (t > t[i] - seconds) & (np.arange(len(t)) < i) & (command > 0.0)
        command[before] *= np.linspace(1.0, share, before.sum())
    columns["v_cmd"] = command
    return columns, runs


def warnings_of(columns: dict[str, np.ndarray], runs: list[slice]) -> tuple[str, ...]:
    usable = np.ones(len(columns["t"]), np.bool_)
    return sinking_commands(columns, [w for run in runs for w in find_stops(columns, run, usable)])


def test_commands_that_fall_at_once_are_as_they_should_be() -> None:
    assert warnings_of(*log("clean")) == ()


@pytest.mark.parametrize("share", [0.9, 0.7])
def test_ramped_commands_are_reported_with_their_share(share: float) -> None:
    (warning,) = warnings_of(*sunk_to(share))
    assert f"to {100 * share:.0f} % of what it had been" in warning


def test_a_calibration_warns_of_them() -> None:
    warned = learn(*sunk_to(0.8), BASE.braking).warnings
    assert any("commanded speed sank" in warning for warning in warned)
    assert not any("sank" in warning for warning in learn(*log("clean"), BASE.braking).warnings)
