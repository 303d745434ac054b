from __future__ import annotations

import numpy as np
import pytest

from models.calibration.force_fit import ForceFit, fit_force
from models.calibration.hull import extrapolated_corners
from models.calibration.learn import learn
from tests.models.calibration.plant import Plant, drive
from tests.models.models_for_tests import BASE

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
    said = [w for w in learn(log, runs, BASE.braking).warnings if "no stop was near" in w]
    assert bool(said) is slanted
