"""Commands that ramp down before they are 0 are reported."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.calibration.learn import learn
from slopewise.models.stop_logs.find_stops import find_stops
from slopewise.models.stop_logs.sinking_commands import sinking_commands
from tests.models.discrepancy.logs import log
from tests.models.models_for_tests import BASE


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
