from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from slopewise.models.calibration.force_fit import ForceFit, fit_force
from slopewise.models.calibration.hull import Corner, extrapolated_corners, speed_by_grade
from slopewise.models.calibration.learn import learn
from tests.models.calibration.plant import Plant, drive
from tests.models.driven_hull import highest_speed
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
