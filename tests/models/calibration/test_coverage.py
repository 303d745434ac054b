"""Coverage of a log: stopping distances, trained hull and errors of the commanded speed."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import ConvexHull

from slopewise.models.calibration.coverage import covered
from slopewise.models.calibration.force_fit import ForceFit, fit_force
from slopewise.models.calibration.hull import Corner, extrapolated_corners, speed_by_grade
from slopewise.models.calibration.learn import learn
from slopewise.models.calibration.speed_error import SpeedError, speed_error
from slopewise.models.calibration.stopping import stopping_distance, stopping_time
from slopewise.models.errors import ParameterError
from tests.models.calibration.plant import Plant, drive
from tests.models.driven_hull import highest_speed
from tests.world.vehicles import BASE

VEHICLE = Plant(scatter=0.012)


def stops_of(plant: Plant, count: int, seed: int) -> tuple[dict[str, np.ndarray], list[slice]]:
    return drive(plant, count, seed, grades=(-0.2, 0.2))[:2]


def test_a_model_covers_another_log_of_its_vehicle_and_not_of_weaker_brakes() -> None:
    model = replace(BASE, braking=learn(*stops_of(VEHICLE, 30, 1), BASE.braking).braking)
    for vehicle, covers in ((VEHICLE, True), (replace(VEHICLE, b_b=0.25), False)):
        columns, runs = stops_of(vehicle, 30, 2)
        coverage = covered(columns, runs, model, ground=-columns["pitch"])
        assert len(coverage.records) == 30
        assert coverage.covers() is covers
        assert (np.sum(coverage.excess < 0.0) > 1) is not covers
        assert len(set(coverage.session.tolist())) == 30


def test_one_stop_is_enough_and_none_is_not() -> None:
    columns, runs = stops_of(VEHICLE, 1, 3)
    assert len(covered(columns, runs, BASE, ground=-columns["pitch"]).records) == 1
    with pytest.raises(ParameterError, match="at least 1 usable stop"):
        covered(columns | {"v_cmd": columns["v"]}, runs, BASE, ground=-columns["pitch"])


def test_margins_as_long_as_the_stops_are_no_success() -> None:
    # Each stop with 0.6 or 1.7 of the deceleration.
    wild = learn(*stops_of(Plant(outliers=1.0, scatter=0.1, b_b=0.5), 8, 4), BASE.braking)
    assert any("times the length" in w or "would not allow" in w for w in wild.objections)
    assert learn(*stops_of(VEHICLE, 24, 4), BASE.braking).objections == ()


def test_an_implausible_dead_time_is_reported() -> None:
    learned = learn(*stops_of(Plant(dead_time=2.0), 20, 5), BASE.braking)
    assert any("dead time of 2.00" in text or "of 1.99" in text for text in learned.objections)


@pytest.mark.parametrize("by_map", [False, True])
def test_a_grade_of_the_wrong_sign_is_rejected(by_map: bool) -> None:
    columns, runs = stops_of(VEHICLE, 24, 6)
    flipped = columns | {"pitch": -columns["pitch"]}
    learned = learn(flipped, runs, BASE.braking, ground=columns["pitch"] if by_map else None)
    assert any("wrong sign" in text for text in learned.objections)
    if by_map:  # without a map test_margins_as_long_as_the_stops_are_no_success has such a log
        honest = learn(columns, runs, BASE.braking, ground=-columns["pitch"])
        assert honest.objections == ()


def test_a_log_that_loses_samples_in_more_than_half_of_the_stops_is_rejected() -> None:
    columns, runs = stops_of(VEHICLE, 24, 7)
    time, logged = columns["t"].copy(), np.ones(len(columns["t"]), np.bool_)
    for run in runs[:18]:
        command = run.start + int(np.argmax(columns["v_cmd"][run] <= 0.0))
        lost = slice(command + 40, command + 55)  # 0.15 s of the braking
        logged[lost] = False
        time[lost.stop : run.stop] -= 0.15
    ends = np.concatenate(([0], np.cumsum([np.count_nonzero(logged[run]) for run in runs])))
    short = {name: values[logged] for name, values in (columns | {"t": time}).items()}
    parts = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
    assert any("falls of v" in text for text in learn(short, parts, BASE.braking).objections)


G = 9.80665
TRUTH = np.array([-0.03, -0.35, 0.015, 0.40])


@pytest.mark.parametrize("speed", [1.0, 3.9])
def test_a_plane_is_the_closed_form(speed: float) -> None:
    a = G * ((-0.03 * speed - 0.35) * -0.1 + 0.015 * speed + 0.4 + math.sin(-0.1))
    expected = 0.3 * speed + speed**2 / (2 * a)
    way = stopping_distance(speed, 0.3, TRUTH, np.array([0.0, 1.0]), np.full(2, -0.1))
    assert way == pytest.approx(expected, abs=1e-6)
    assert stopping_time(speed, 0.3, way) == pytest.approx(0.3 + speed / a, abs=1e-6)


def test_a_varying_slope_equals_integration_in_time() -> None:
    station = np.linspace(0.0, 6.0, 61)
    grade = -0.12 + 0.1 * np.sin(station)
    v = 3.5
    m, b = -0.03 * v - 0.35, 0.015 * v + 0.4

    def rates(_: float, y: np.ndarray) -> list[float]:
        theta = float(np.interp(y[0], station, grade))
        return [y[1], -G * (m * theta + b + math.sin(theta))]

    def standstill(_: float, y: np.ndarray) -> float:
        return float(y[1])

    standstill.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(rates, (0, 20), [0.3 * v, v], events=standstill, rtol=1e-9, max_step=0.01)
    assert stopping_distance(v, 0.3, TRUTH, station, grade) == pytest.approx(
        float(run.y[0][-1]), abs=2e-4
    )


def test_brakes_too_weak_for_the_slope_never_stop() -> None:
    weak = np.array([0.0, 0.0, 0.0, 0.1])
    ends = np.array([0.0, 1.0])
    assert stopping_distance(2.0, 0.3, weak, ends, np.full(2, -0.2)) == math.inf


KNOWN = np.array([0.0, -0.2, 0.0, 0.4])


def fitted(speed: np.ndarray, grade: np.ndarray) -> ForceFit:
    force = 0.4 - 0.3 * grade + 0.005 * np.random.default_rng(1).standard_normal(len(speed))
    return fit_force(speed, grade, force, np.full(len(speed), 0.004), KNOWN)


def test_slow_downhill_and_fast_uphill_leaves_two_corners() -> None:
    rng = np.random.default_rng(0)
    speed = rng.uniform(1.0, 4.0, 60)
    grade = 0.2 * (speed - 2.5) / 1.5 + 0.02 * rng.standard_normal(60)
    fit = fitted(speed, grade)
    corners = extrapolated_corners(speed, grade, fit)
    assert [(c.speed > 2.5, c.grade > 0.0) for c in corners] == [(False, True), (True, False)]
    middle = float(fit.force_std(2.5, 0.0)[0])
    assert all(c.std > 2.0 * middle for c in corners)


def test_a_filled_rectangle_has_none_and_a_line_has_all() -> None:
    v, theta = (a.ravel() for a in np.meshgrid(np.linspace(1, 4, 6), np.linspace(-0.2, 0.2, 6)))
    assert extrapolated_corners(v, theta, fitted(v, theta)) == ()
    line = np.zeros_like(v)
    assert len(extrapolated_corners(v, line, fitted(v, line))) == 4


@pytest.mark.parametrize("slanted", [False, True])
def test_corners_are_named(slanted: bool) -> None:
    if slanted:
        slow, runs, _ = drive(Plant(), 12, 1, speeds=(0.8, 1.4), grades=(-0.22, -0.12))
        fast, more, _ = drive(Plant(), 12, 2, speeds=(3.2, 4.0), grades=(0.05, 0.2))
        fast["t"] = fast["t"] + slow["t"][-1] + 10.0
        fast["run"] = np.char.add("b", fast["run"])
        n = len(slow["t"])
        log = {name: np.concatenate((slow[name], fast[name])) for name in slow}
        runs = [*runs, *(slice(n + r.start, n + r.stop) for r in more)]
    else:
        log, runs, _ = drive(Plant(), 60, 3)
    learned = learn(log, runs, BASE.braking)
    notes = [w for w in learned.warnings if "no stop was near" in w]
    assert bool(notes) is slanted
    hull = learned.braking.speed_by_grade
    assert (hull is not None) is slanted
    if hull is not None:
        assert "plans are no faster than what was driven" in notes[0]
        records = [r for r in learned.surfaces[0].records if r.kept]
        speed, grade = (
            np.array([getattr(r, n) for r in records]) for n in ("onset_speed", "grade")
        )
        assert np.all(speed <= highest_speed(hull, grade) + 0.05)
        # Fast downhill was not driven; fast uphill was.
        slow, fast = highest_speed(hull, np.array([-0.2, 0.15]))
        assert slow < 0.7 * learned.braking.speed_range[1]
        assert fast == pytest.approx(learned.braking.speed_range[1], abs=0.05)


def test_a_hull_of_few_corners_is_inside_of_that_of_all() -> None:
    rng = np.random.default_rng(5)
    grade = rng.uniform(-0.25, 0.25, 4000)
    speed = rng.uniform(0.5, 1.0, 4000) * (4.0 - 30.0 * grade**2 - 3.0 * np.maximum(-grade, 0.0))
    fit = fitted(speed, grade)
    ends = (float(speed.min()), float(speed.max())), (float(grade.min()), float(grade.max()))
    corners = (*extrapolated_corners(speed, grade, fit), Corner(4.0, -0.25, 0.4, 0.1))
    hull = speed_by_grade(speed, grade, *ends, corners)
    assert hull is not None
    assert 2 <= len(hull) <= 8
    faces = ConvexHull(np.column_stack((grade, speed))).equations
    at = np.linspace(*ends[1], 200)
    limit = np.array([min((-f[2] - f[0] * g) / f[1] for f in faces if f[1] > 1e-9) for g in at])
    reach = 0.1 * (ends[0][1] - ends[0][0]), 0.1 * (ends[1][1] - ends[1][0])
    around = np.max(
        [np.interp(at + d, at, limit) for d in np.linspace(-reach[1], reach[1], 41)], axis=0
    )
    assert np.all(highest_speed(hull, at) <= around + reach[0] + 1e-3)
    assert np.all(highest_speed(hull, at) >= limit - 0.15)


HZ = 50.0


def noisy_drive(
    commands: list[float],
    each: float = 8.0,
    *,
    bias: float = 0.0,
    waves: float = 0.0,
    noise: float = 0.0,
    hz: float = HZ,
    seed: int = 0,
) -> dict[str, np.ndarray]:
    """One command after the other; speeds follow within a second."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, each * len(commands), 1.0 / hz)
    v_cmd = np.array(commands)[np.minimum((t / each).astype(int), len(commands) - 1)]
    v, held = np.empty_like(t), 0.0
    for i, estimate in enumerate(v_cmd):
        held += (estimate + bias - held) * min(5.0 / hz, 1.0)
        v[i] = held
    # Waves of seconds, Ornstein and Uhlenbeck's, of a given standard deviation.
    wave, keep = 0.0, np.exp(-1.0 / (1.0 * hz))
    for i in range(len(t)):
        wave = keep * wave + np.sqrt(1.0 - keep**2) * waves * rng.standard_normal()
        v[i] += wave + noise * rng.standard_normal()
    return {"t": t, "v": v, "v_cmd": v_cmd}


STEPS = [1.0, 2.0, 0.0, 3.0, 1.5, 2.5, 0.0, 3.5, 1.0, 2.0]


def estimate_of(log: dict[str, np.ndarray], usable: np.ndarray | None = None) -> SpeedError | None:
    count = len(log["t"])
    return speed_error(log, [slice(0, count)], np.ones(count, bool) if usable is None else usable)


def test_waves_of_the_controller_are_the_error() -> None:
    estimate = estimate_of(noisy_drive(STEPS * 6, waves=0.1))
    assert estimate.value == pytest.approx(0.1, rel=0.25)
    assert abs(estimate.bias) < 0.03
    assert estimate.stretches == 48
    assert estimate.seconds == pytest.approx(48 * 5.5, rel=0.1)


def test_noise_of_the_sensor_is_mostly_none() -> None:
    estimate = estimate_of(noisy_drive(STEPS * 3, noise=0.05))
    assert estimate.value < 0.02


def test_always_too_fast_counts_and_always_too_slow_does_not() -> None:
    fast, slow = (estimate_of(noisy_drive(STEPS * 3, bias=b, waves=0.03)) for b in (0.15, -0.15))
    assert slow is not None
    assert fast.value == pytest.approx(0.15 + 0.03, abs=0.02)
    assert slow.value == pytest.approx(0.03, abs=0.012)
    assert slow.bias == pytest.approx(-0.15, abs=0.02)


def test_a_tenth_of_nonsense_changes_little() -> None:
    log = noisy_drive(STEPS * 6, waves=0.05)
    clean = estimate_of(log)
    wild = np.random.default_rng(1).random(len(log["t"]) // 100) < 0.1
    wild = np.repeat(wild, 100)
    log["v"] = np.where(np.pad(wild, (0, len(log["t"]) - len(wild))), 0.0, log["v"])
    estimate = estimate_of(log)
    assert estimate.value == pytest.approx(clean.value, rel=0.5)


@pytest.mark.parametrize(
    "log",
    [
        noisy_drive([0.0] * 10),
        noisy_drive([0.2] * 10),
        noisy_drive(STEPS * 6, each=2.5),
        noisy_drive([1.0, 2.0, 1.0, 2.0]),
        noisy_drive(STEPS, each=3.0),
        {
            "t": np.arange(0, 80, 0.02),
            "v": np.arange(0, 80, 0.02) / 20,
            "v_cmd": np.arange(0, 80, 0.02) / 20,
        },
    ],
    ids=["stands", "crawls", "never settles", "few stretches", "few seconds", "ramp"],
)
def test_a_short_log_has_no_estimate(log: dict[str, np.ndarray]) -> None:
    assert estimate_of(log) is None


def test_commands_in_other_units_are_no_commands() -> None:
    log = noisy_drive(STEPS * 3, waves=0.02)
    assert estimate_of({**log, "v": 2.0 * log["v"]}) is None


def test_suspect_samples_are_left_out() -> None:
    log = noisy_drive(STEPS * 6, waves=0.02)
    usable = np.ones(len(log["t"]), bool)
    for part in range(0, len(usable), 3 * len(usable) // 60):
        usable[part : part + 20] = False
        log["v"][part : part + 20] = np.nan
    estimate = estimate_of(log, usable)
    assert estimate.value == pytest.approx(0.02, rel=0.4)


@pytest.mark.parametrize("hz", [5.0, 10.0, 20.0, 100.0])
@pytest.mark.parametrize("seed", range(2))
def test_it_does_not_depend_on_the_sample_rate(hz: float, seed: int) -> None:
    estimate = estimate_of(noisy_drive(STEPS * 4, waves=0.08, hz=hz, seed=seed))
    assert estimate.value == pytest.approx(0.08, rel=0.4)
