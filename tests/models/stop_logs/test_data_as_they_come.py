"""Slow sensors, stops cut short, driving backwards, other commands, and bodies that oscillation."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slopewise.models.calibration.learn import learn, measure_log
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs import random_effects, unit_suspects
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, Usability, find_stops
from slopewise.models.stop_logs.held_values import fresh_samples, held_period
from slopewise.models.stop_logs.measured_log import MeasuredLog
from slopewise.models.stop_logs.random_effects import Bounds
from tests.models.calibration.plant import Plant, drive
from tests.models.stop_logs import sprung_plant
from tests.models.stop_logs.sprung_plant import Sprung
from tests.world.vehicles import BASE

Log = tuple[dict[str, np.ndarray], list[slice]]


@pytest.fixture(scope="module")
def stops() -> Log:
    """Twenty clean stops at 20 Hz."""
    return drive(Plant(hz=20.0, speed_noise=0.01), 20, 3)[:2]


def measured(columns: dict[str, np.ndarray], runs: list[slice], **settings: float) -> MeasuredLog:
    return measure_log(columns, runs, BASE.braking, min_stops=int(settings.get("fewest", 0)))


def windows(columns: dict[str, np.ndarray], runs: list[slice]) -> list[StopWindow]:
    usable = np.ones(len(columns["t"]), bool)
    return [w for run in runs for w in find_stops(columns, run, usable)]


def repeated(columns: dict[str, np.ndarray], times: int) -> dict[str, np.ndarray]:
    """The log with every row `times` over, on a clock as much finer, the speed held."""
    step = 0.05 / times
    log = {name: np.repeat(values, times) for name, values in columns.items()}
    return log | {"t": log["t"] + step * np.tile(np.arange(times), len(columns["t"]))}


def test_repeated_speeds_are_not_counted_and_change_nothing(stops: Log) -> None:
    columns, runs = stops
    fast = repeated(columns, 5)
    many = [slice(5 * run.start, 5 * run.stop) for run in runs]
    assert held_period(fast, many) == pytest.approx(0.05)
    assert held_period(columns, runs) == 0.0
    assert fresh_samples(fast, many).sum() == pytest.approx(len(columns["t"]), abs=2)
    plain, slow = measured(columns, runs), measured(fast, many)
    assert any("new value every 0.05 s, in rows every 0.01 s" in note for note in slow.notes)
    for a, b in zip(plain.measured.records, slow.measured.records, strict=True):
        assert b.knee.samples == pytest.approx(a.knee.samples, abs=2)
        assert b.force_ratio == pytest.approx(a.force_ratio, abs=0.02)
        assert b.samples.distance == pytest.approx(a.samples.distance, abs=0.02)


def test_a_sensor_of_one_hertz_at_ten_is_found_out() -> None:
    columns, runs, _ = drive(Plant(hz=10.0, speed_noise=0.01), 12, 3)
    slow = columns | {"v": columns["v"].copy()}
    for run in runs:
        slow["v"][run] = np.repeat(columns["v"][run][::10], 10)[: run.stop - run.start]
    with pytest.raises(
        ParameterError, match=r"new values of v while it braked|record the speed more often"
    ):
        measured(slow, runs, fewest=8)


def test_quantised_and_noisy_speeds_are_not_slow() -> None:
    t = np.arange(0.0, 8.0, 0.02)
    v = np.clip(3.0 - 0.4 * (t - 0.5), 0.2, 3.0)
    noisy = v + 0.01 * np.random.default_rng(1).standard_normal(len(t))
    for speed in (np.round(v, 2), noisy):
        assert held_period({"t": t, "v": speed}, [slice(0, len(t))]) == 0.0
        assert fresh_samples({"t": t, "v": speed}, [slice(0, len(t))]).all()


def test_stops_cut_short_are_marked_and_keep_their_distance(stops: Log) -> None:
    columns, runs = stops
    log = columns | {"v_cmd": columns["v_cmd"].copy(), "session": np.full(len(columns["t"]), "a")}
    by_command = {w.command: w for w in windows(columns, runs)}
    for w in list(by_command.values())[:5]:
        middle = w.command + int(0.9 * (w.standstill - w.command))
        log["v_cmd"][middle : w.end] = 1.0
    log_stops = measured(log, runs)
    short = [s for s, _ in log_stops.distances if s.cut_short]
    assert len(short) == len(log_stops.measured.bounds)
    assert 4 <= len(short) <= 5
    assert len(log_stops.measured.records) == 15
    plain = {r.samples.window.command: r for r in measured(columns, runs).measured.records}
    for record in log_stops.measured.bounds:
        s, before = record.samples, plain[record.samples.window.command]
        assert s.window.verdict is Usability.ABORTED
        assert s.window.reason.startswith("next command after ")
        assert 0.1 < s.speed_left < 0.7 * s.window.held_speed
        assert s.distance < before.samples.distance
        assert s.session == "a"
        assert record.force_ratio == pytest.approx(before.force_ratio, abs=5.0 * record.force_std)
    assert any("5 stops were cut short" in note for note in log_stops.notes)


def test_bounds_count_where_the_fit_contradicts_them_only() -> None:
    rng = np.random.default_rng(4)
    design, noise = np.ones((20, 1)), np.full(20, 0.01)
    observed = 0.4 + 0.01 * rng.standard_normal(20)
    prior = np.zeros(1), np.eye(1)
    plain = random_effects.fit(design, observed, noise, *prior)

    def fitted(*bounds: float) -> random_effects.LinearFit:
        k = len(bounds)
        given = Bounds(np.ones((k, 1)), np.array(bounds), np.full(k, 0.01))
        return random_effects.fit_with_bounds(design, observed, noise, *prior, given)

    obeyed = fitted(*[0.4] * 50)
    assert obeyed.coefficients == plain.coefficients
    assert fitted(2.0).coefficients == plain.coefficients  # no stop is five times as strong
    raised = fitted(0.44, 0.44, 0.44)
    assert plain.coefficients[0] + 0.001 < raised.coefficients[0] < 0.44
    assert len(raised.residuals) == 20
    assert raised.gain.shape == (1, 20)


def backwards(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return columns | {name: -columns[name] for name in ("v", "v_cmd", "pitch")}


def test_stops_driven_backwards_have_the_same_forces(stops: Log) -> None:
    columns, runs = stops
    ahead, back = measured(columns, runs), measured(backwards(columns), runs)
    assert [r.force_ratio for r in back.measured.records] == [
        r.force_ratio for r in ahead.measured.records
    ]
    assert {r.samples.window.direction for r in back.measured.records} == {-1}


def test_the_mount_offset_of_a_vehicle_that_backs_up_has_the_other_sign(stops: Log) -> None:
    columns, runs = stops
    half = columns["run"].astype(int) < 10
    mixed = {n: np.where(half, columns[n], v) for n, v in backwards(columns).items()}
    mixed["pitch"] = mixed["pitch"] + 0.03
    ground = np.where(half, -columns["pitch"], -columns["pitch"])
    by_map = measure_log(mixed, runs, BASE.braking, ground=ground, min_stops=8)
    assert by_map.mount.offset == pytest.approx(0.03, abs=0.003)
    grounds = [r.ground - r.samples.grade for r in by_map.measured.records]
    assert max(float(np.abs(g).max()) for g in grounds) < 1e-9


def test_reversals_and_ramps_are_stops_where_there_are_no_others(stops: Log) -> None:
    columns, runs = stops
    driven = columns["v_cmd"] > 0.0
    reversed_ = columns | {"v_cmd": np.where(driven, columns["v_cmd"], -1.0)}
    assert {w.verdict for w in windows(reversed_, runs)} == {Usability.REVERSED}
    used = measured(reversed_, runs, fewest=8)
    assert len(used.measured.records) == 20
    assert any("20 of 20 stops are commands to drive the other way" in n for n in used.notes)

    ramped = columns | {"v_cmd": columns["v_cmd"].copy()}
    for run in runs:
        t = columns["t"][run]
        begin = float(t[np.argmin(columns["v_cmd"][run] > 0.0)])
        held = float(columns["v_cmd"][run][0])
        ramped["v_cmd"][run] = held * np.clip(1.0 - (t - begin) / 0.4, 0.0, 1.0)
    assert {w.verdict for w in windows(ramped, runs)} == {Usability.RAMPED}
    by_ramp = measured(ramped, runs, fewest=8)
    assert any("20 of 20 stops begin with a command that comes down" in n for n in by_ramp.notes)
    # The command began to fall one sample after the step: the same stops, as late.
    plain = measured(columns, runs)
    for a, b in zip(plain.distances, by_ramp.distances, strict=True):
        assert b[0].clock == pytest.approx(a[0].clock, abs=0.051)
    settings = StopSettings(ramps=True)
    usable = np.ones(len(columns["t"]), bool)
    (first,) = find_stops(ramped, runs[0], usable, settings)
    assert first.usable


def test_a_command_to_back_up_before_standstill_cuts_the_stop_short(stops: Log) -> None:
    columns, runs = stops
    (w,) = windows(columns, runs[:1])
    log = columns | {"v_cmd": columns["v_cmd"].copy()}
    log["v_cmd"][w.standstill - 2 : runs[0].stop] = -1.0
    assert windows(log, runs[:1])[0].verdict is Usability.ABORTED


def test_applied_brakes_are_the_command_of_a_log_without_one(stops: Log) -> None:
    columns, runs = stops
    brake = np.where(columns["v_cmd"] > 0.0, 0.02, 1.0)  # a pressure sensor with an offset
    log = columns | {"v_cmd": np.full(len(brake), np.nan), "brake": brake}
    expected = [(w.command, w.standstill) for w in windows(columns, runs)]
    assert [(w.command, w.standstill) for w in windows(log, runs) if w.usable] == expected
    assert {s.brake_level for s, _ in measured(log, runs).distances} == {1.0}
    assert np.isnan(measured(columns, runs).distances[0][0].brake_level)


def test_a_refusal_explains_each_kind_with_its_first_stop(stops: Log) -> None:
    columns, runs = stops
    log = columns | {"yaw_rate": np.full(len(columns["t"]), 0.6)}
    with pytest.raises(ParameterError) as refused:
        measured(log, runs, fewest=8)
    at = columns["t"][windows(columns, runs)[0].command]
    text = refused.value.expected
    assert f"20 turning (first at {at:.2f} s of run 0: mean yaw rate 0.60 rad/s; try: " in text


def test_mean_grades_and_sparse_stops_are_among_the_distances() -> None:
    columns, runs, truth = drive(Plant(hz=10.0, pitch_noise=0.0), 30, 5, speeds=(0.3, 1.5))
    log_stops = measured(columns, runs)
    assert len(log_stops.measured.records) < len(log_stops.distances) == len(log_stops.windows)
    for stop, grade in log_stops.distances:
        k = int(stop.run)
        assert stop.distance == pytest.approx(truth.distance[k], abs=0.08)
        assert grade == pytest.approx(truth.grade[k], abs=0.02)


@pytest.mark.parametrize("gyro", [False, True])
def test_the_swing_of_a_soft_body_is_taken_out(gyro: bool) -> None:
    columns, runs = sprung_plant.drive(Sprung(), 30, 3, gyro=gyro)
    oscillation = measured(columns, runs).measured.oscillation
    assert oscillation is not None
    if gyro:
        assert oscillation.height == pytest.approx(0.8, rel=0.15)
    else:
        assert oscillation.gain == pytest.approx(0.8 * 0.006, rel=0.15)
        assert oscillation.frequency == pytest.approx(2.0 * np.pi * 1.6, rel=0.1)
    learned = learn(columns, runs, BASE.braking)
    assert learned.dead_time.value == pytest.approx(0.3, abs=0.003)
    fit = learned.surfaces[0].fit
    error = fit.coefficients - np.array([-0.03, -0.05, 0.015, 0.40])
    assert np.all(np.abs(error) < 3.0 * np.sqrt(np.diag(fit.covariance)))
    assert any("swings on its springs" in warning for warning in learned.warnings)


@pytest.mark.parametrize(("lag", "dive"), [(0.0, 0.0), (0.05, 0.006), (0.2, 0.006)])
def test_a_stiff_body_and_brakes_that_build_up_are_no_swing(lag: float, dive: float) -> None:
    plant = dataclasses.replace(Sprung(), height=0.0, dive=dive, lag=lag)
    assert measured(*sprung_plant.drive(plant, 20, 5)).measured.oscillation is None


def joint(**factors: float) -> dict[str, np.ndarray]:
    t = np.arange(0.0, 20.0, 0.1)
    v = 2.0 + 0.1 * np.sin(t)
    return {"t": t} | {
        name: factors.get(name, 1.0) * v for name in ("v", "v_cmd", "v_left", "v_right")
    }


@pytest.mark.parametrize(
    ("factors", "suspect"),
    [
        ({}, None),
        ({"v": 3.6}, "v"),
        ({"v": 1.0 / 0.514444}, "v"),
        ({"v": 2.0, "v_cmd": 4.0}, None),  # a command that is not followed
        ({"v_left": 1.0 / 0.28, "v_right": 1.0 / 0.28}, None),  # rad/s or km/h: ambiguous
        ({"v_cmd": 3.6, "v_left": 3.6, "v_right": 3.6}, "v_cmd"),
    ],
)
def test_a_speed_is_held_against_command_and_wheels(
    factors: dict[str, float], suspect: str | None
) -> None:
    assert [name for name, _ in unit_suspects.find(joint(**factors))] == [suspect] * bool(suspect)


def test_a_small_pitch_next_to_a_yaw_in_degrees_is_in_degrees() -> None:
    t = np.arange(0.0, 20.0, 0.1)
    channels = {"t": t, "pitch": 0.3 + 0.0 * t, "yaw": (36.0 * t) % 360.0}
    assert [name for name, _ in unit_suspects.find(channels)] == ["pitch", "yaw"]
    channels["yaw"] = np.deg2rad(channels["yaw"])
    assert list(unit_suspects.find(channels)) == []
