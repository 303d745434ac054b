"""Stops drawn by hand, each found where it was drawn and judged for what it is."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, Usability, find_stops

HZ = 50.0
T = np.arange(-2.0, 5.0, 1.0 / HZ)
AT = int(np.argmin(np.abs(T)))  # sample of the stop command


def speed(dead_time: float = 0.3, deceleration: float = 4.0, held: float = 2.0) -> np.ndarray:
    fall = np.maximum(T - dead_time, 0.0)
    v = np.maximum(held - deceleration * fall, 0.0)
    standstill = dead_time + held / deceleration
    return np.where(standstill < T, -0.05 * np.exp(-(T - standstill) / 0.1), v)  # rocks back


def log(**changes: np.ndarray) -> dict[str, np.ndarray]:
    return {"t": T + 100.0, "v": speed(), "v_cmd": np.where(T < -1e-9, 2.0, 0.0)} | changes


def stops_of(columns: dict[str, np.ndarray], usable: np.ndarray | None = None) -> list[StopWindow]:
    usable = np.ones(len(T), bool) if usable is None else usable
    return find_stops(columns, slice(0, len(T)), usable)


def test_a_step_to_zero_is_a_stop_up_to_the_first_crossing() -> None:
    (stop,) = stops_of(log())
    assert stop.verdict is Usability.USABLE
    assert stop.command == AT
    assert T[stop.standstill] == pytest.approx(0.8, abs=1.5 / HZ)
    assert stop.held_speed == pytest.approx(2.0)
    assert T[stop.begin] == pytest.approx(-1.0, abs=1.5 / HZ)
    assert T[stop.end - 1] == pytest.approx(0.8 + 1.5, abs=2.5 / HZ)


def test_a_sensor_that_never_reads_zero_settles() -> None:
    (stop,) = stops_of(log(v=np.maximum(speed(), 0.02)))
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
        ({"v": speed(deceleration=40.0)}, Usability.SPARSE),
    ],
)
def test_what_is_no_full_straight_stop_is_found_and_left_out(
    changes: dict[str, np.ndarray], verdict: Usability
) -> None:
    (stop,) = stops_of(log(**changes))
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
    (stop,) = stops_of(log(v_cmd=command))
    assert stop.verdict is Usability.USABLE


def test_straight_full_and_unmeasured_channels_do_not_disturb() -> None:
    nothing = np.full(len(T), np.nan)
    full = {"yaw_rate": np.full(len(T), 0.05), "brake": np.where(T < -1e-9, 0.0, 1.0)}
    for changes in (full, {"yaw_rate": nothing, "brake": nothing}):
        assert [s.verdict for s in stops_of(log(**changes))] == [Usability.USABLE]


def test_suspect_samples_spoil_the_stop_they_lie_in() -> None:
    usable = np.ones(len(T), bool)
    usable[AT + 10] = False
    assert [s.verdict for s in stops_of(log(), usable)] == [Usability.SUSPECT]
    usable[:] = True
    usable[AT - 95 : AT - 80] = False
    assert [s.verdict for s in stops_of(log(), usable)] == [Usability.USABLE]


def test_nothing_to_stop() -> None:
    assert stops_of(log(v=speed(held=0.04))) == []
    assert stops_of(log(v_cmd=np.zeros(len(T)))) == []


def test_slow_stops_are_found_and_those_below_a_speed_that_is_asked_for_are_named() -> None:
    slow = log(v=speed(held=0.2, deceleration=0.5))
    assert [s.verdict for s in stops_of(slow)] == [Usability.USABLE]
    everything = np.ones(len(T), bool)
    (stop,) = find_stops(slow, slice(0, len(T)), everything, StopSettings(least_speed=0.3))
    assert stop.verdict is Usability.SLOW
    assert stop.reason == "0.20 m/s, below the least speed of 0.3 m/s"


def test_what_the_noise_at_rest_hides_is_no_stop() -> None:
    noise = 0.04 * np.random.default_rng(2).standard_normal(len(T))
    assert stops_of(log(v=speed(held=0.15) + noise)) == []
    assert len(stops_of(log(v=speed(held=0.35) + noise))) == 1


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
    single = log()
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
