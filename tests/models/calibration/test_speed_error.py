"""How well speeds are driven: noise, bias, waves and outliers put in, and what comes out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.calibration.speed_error import SpeedError, speed_error

HZ = 50.0


def drive(
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
    estimate = estimate_of(drive(STEPS * 6, waves=0.1))
    assert estimate is not None
    assert estimate.value == pytest.approx(0.1, rel=0.25)
    assert abs(estimate.bias) < 0.03
    assert estimate.stretches == 48
    assert estimate.seconds == pytest.approx(48 * 5.5, rel=0.1)


def test_noise_of_the_sensor_is_mostly_none() -> None:
    estimate = estimate_of(drive(STEPS * 3, noise=0.05))
    assert estimate is not None
    assert estimate.value < 0.02


def test_always_too_fast_counts_and_always_too_slow_does_not() -> None:
    fast, slow = (estimate_of(drive(STEPS * 3, bias=b, waves=0.03)) for b in (0.15, -0.15))
    assert fast is not None
    assert slow is not None
    assert fast.value == pytest.approx(0.15 + 0.03, abs=0.02)
    assert slow.value == pytest.approx(0.03, abs=0.012)
    assert slow.bias == pytest.approx(-0.15, abs=0.02)


def test_a_tenth_of_nonsense_changes_little() -> None:
    log = drive(STEPS * 6, waves=0.05)
    clean = estimate_of(log)
    wild = np.random.default_rng(1).random(len(log["t"]) // 100) < 0.1
    wild = np.repeat(wild, 100)
    log["v"] = np.where(np.pad(wild, (0, len(log["t"]) - len(wild))), 0.0, log["v"])
    estimate = estimate_of(log)
    assert clean is not None
    assert estimate is not None
    assert estimate.value == pytest.approx(clean.value, rel=0.5)


@pytest.mark.parametrize(
    "log",
    [
        drive([0.0] * 10),
        drive([0.2] * 10),
        drive(STEPS * 6, each=2.5),
        drive([1.0, 2.0, 1.0, 2.0]),
        drive(STEPS, each=3.0),
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
    log = drive(STEPS * 3, waves=0.02)
    assert estimate_of({**log, "v": 2.0 * log["v"]}) is None


def test_suspect_samples_are_left_out() -> None:
    log = drive(STEPS * 6, waves=0.02)
    usable = np.ones(len(log["t"]), bool)
    for part in range(0, len(usable), 3 * len(usable) // 60):
        usable[part : part + 20] = False
        log["v"][part : part + 20] = np.nan
    estimate = estimate_of(log, usable)
    assert estimate is not None
    assert estimate.value == pytest.approx(0.02, rel=0.4)


@given(st.sampled_from([5.0, 10.0, 20.0, 100.0]), st.integers(0, 5))
def test_it_does_not_depend_on_the_sample_rate(hz: float, seed: int) -> None:
    estimate = estimate_of(drive(STEPS * 4, waves=0.08, hz=hz, seed=seed))
    assert estimate is not None
    assert estimate.value == pytest.approx(0.08, rel=0.4)
