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
    for i, told in enumerate(v_cmd):
        held += (told + bias - held) * min(5.0 / hz, 1.0)
        v[i] = held
    # Waves of seconds, Ornstein and Uhlenbeck's, of a standard deviation of their own.
    wave, keep = 0.0, np.exp(-1.0 / (1.0 * hz))
    for i in range(len(t)):
        wave = keep * wave + np.sqrt(1.0 - keep**2) * waves * rng.standard_normal()
        v[i] += wave + noise * rng.standard_normal()
    return {"t": t, "v": v, "v_cmd": v_cmd}


STEPS = [1.0, 2.0, 0.0, 3.0, 1.5, 2.5, 0.0, 3.5, 1.0, 2.0]


def found(log: dict[str, np.ndarray], good: np.ndarray | None = None) -> SpeedError | None:
    count = len(log["t"])
    return speed_error(log, [slice(0, count)], np.ones(count, bool) if good is None else good)


def test_waves_of_the_controller_are_the_error() -> None:
    told = found(drive(STEPS * 6, waves=0.1))
    assert told is not None
    assert told.value == pytest.approx(0.1, rel=0.25)
    assert abs(told.bias) < 0.03
    assert told.stretches == 48
    assert told.seconds == pytest.approx(48 * 5.5, rel=0.1)


def test_noise_of_the_sensor_is_mostly_none() -> None:
    told = found(drive(STEPS * 3, noise=0.05))
    assert told is not None
    assert told.value < 0.02


def test_always_too_fast_counts_and_always_too_slow_does_not() -> None:
    fast, slow = (found(drive(STEPS * 3, bias=b, waves=0.03)) for b in (0.15, -0.15))
    assert fast is not None
    assert slow is not None
    assert fast.value == pytest.approx(0.15 + 0.03, abs=0.02)
    assert slow.value == pytest.approx(0.03, abs=0.012)
    assert slow.bias == pytest.approx(-0.15, abs=0.02)


def test_a_tenth_of_nonsense_changes_little() -> None:
    log = drive(STEPS * 6, waves=0.05)
    clean = found(log)
    wild = np.random.default_rng(1).random(len(log["t"]) // 100) < 0.1
    wild = np.repeat(wild, 100)
    log["v"] = np.where(np.pad(wild, (0, len(log["t"]) - len(wild))), 0.0, log["v"])
    told = found(log)
    assert clean is not None
    assert told is not None
    assert told.value == pytest.approx(clean.value, rel=0.5)


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
def test_too_little_tells_nothing(log: dict[str, np.ndarray]) -> None:
    assert found(log) is None


def test_commands_in_other_units_are_no_commands() -> None:
    log = drive(STEPS * 3, waves=0.02)
    assert found({**log, "v": 2.0 * log["v"]}) is None


def test_suspect_samples_are_left_out() -> None:
    log = drive(STEPS * 6, waves=0.02)
    good = np.ones(len(log["t"]), bool)
    for part in range(0, len(good), 3 * len(good) // 60):
        good[part : part + 20] = False
        log["v"][part : part + 20] = np.nan
    told = found(log, good)
    assert told is not None
    assert told.value == pytest.approx(0.02, rel=0.4)


@given(st.sampled_from([5.0, 10.0, 20.0, 100.0]), st.integers(0, 5))
def test_it_hardly_depends_on_the_rate_of_samples(hz: float, seed: int) -> None:
    told = found(drive(STEPS * 4, waves=0.08, hz=hz, seed=seed))
    assert told is not None
    assert told.value == pytest.approx(0.08, rel=0.4)
