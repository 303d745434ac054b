"""The body on a line, against its own equation solved by scipy, and on circles in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.input_errors import InputErrors
from slopewise.models.steering import SteeringGeometry, steering_angle
from slopewise.services.check.body_on_line import body_along
from slopewise.services.check.checked_drive import turning_along
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.check.plan_line import line_of
from tests.services.check.drives import at, ground, model_with, round_turn, trapezoid

RADIUS = 4.0
CORNERS = {
    # Outer front corner: 0.598 m outward, 1.48 m ahead of the rear axle, 0.88 m of mid-wheelbase.
    ("skid_steer", "mid"): np.hypot(0.88, RADIUS + 0.598),
    ("ackermann", "mid"): np.hypot(1.48, np.sqrt(RADIUS**2 - 0.6**2) + 0.598),
    ("ackermann", "rear_axle"): np.hypot(1.48, RADIUS + 0.598),
}


def test_the_heading_solves_its_equation() -> None:
    """dβ/ds = κ − sin β / e, from the steady turn that the line begins with."""
    s, rod = np.linspace(0.0, 12.0, 241), 0.7
    heading = 0.8 * np.sin(0.9 * s) + 0.2 * s
    turn = np.interp(rod, s, heading)
    solution = solve_ivp(
        lambda at, beta: 0.72 * np.cos(0.9 * at) + 0.2 - np.sin(beta) / rod,
        (0.0, 12.0),
        [np.arcsin(turn)],
        t_eval=s,
        rtol=1e-9,
        atol=1e-9,
    )
    geometry = SteeringGeometry(centre_offset=rod)
    body = body_along((s, s, heading), s, np.zeros_like(s), geometry, InputErrors())
    np.testing.assert_allclose(heading - body.heading, solution.y[0], atol=2e-3)


def test_steering_on_a_circle() -> None:
    s, _ = trapezoid(1.0, length=8.0)
    geometry = SteeringGeometry(centre_offset=0.6, arm=1.2)
    line = line_of(round_turn(s, s, RADIUS), 0.0, geometry)
    turning = turning_along(line, geometry)
    assert steering_angle(1.0 / RADIUS, geometry) == pytest.approx(
        np.arctan2(2.0 * 0.6 / RADIUS, np.sqrt(1.0 - (0.6 / RADIUS) ** 2))
    )
    np.testing.assert_allclose(turning.curvature[-1], 1.0 / RADIUS, rtol=1e-3)
    assert np.abs(turning.rate).max() < 0.02


@pytest.mark.parametrize("kind", CORNERS)
def test_the_outer_front_corner_strikes_a_round_wall(kind: tuple[str, str]) -> None:
    """5 cm within its circle, and not 9 cm beyond it: the foot of a wall is a cell wide."""
    steering, reference = kind
    drive = "skid_steer" if steering == "skid_steer" else "ackermann"
    model = model_with(
        vehicle={"drive": drive}, steering={"kind": steering, "reference": reference}
    )
    s, v = trapezoid(1.0, length=9.0, stop_at=7.0)
    for more, strikes in ((-0.05, True), (0.09, False)):
        wall = at(lambda x, y, r=CORNERS[kind] + more: np.hypot(x, y - RADIUS) > r, 0.5)
        heights = ground(wall, resolution=0.05, size=8.0)
        report = check_plan_on_map(round_turn(s, v, RADIUS), model, heights)
        assert ("body" in report.worst()) is strikes, report.violations[:3]
