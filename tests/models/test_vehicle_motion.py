"""Steering and input errors against exact kinematics and drawn errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.input_errors import Tracking, input_errors, lateral_band
from slopewise.models.steering import (
    Steering,
    body_heading_offset,
    steering_angle,
    steering_geometry,
)

L = 1.2


@pytest.mark.parametrize(
    ("steering", "front", "rear"),
    [
        (Steering(kind="ackermann"), 0.5, 0.0),
        (Steering(kind="ackermann", reference="rear_axle"), 0.5, 0.0),
        (Steering(kind="ackermann"), -0.3, 0.0),
        (Steering(kind="double_ackermann"), 0.4, -0.4),
    ],
)
def test_a_steady_turn_is_that_of_the_bicycle(
    steering: Steering, front: float, rear: float
) -> None:
    """Two wheels that roll without side slip, in time; curvature and heading of the reference."""
    geometry = steering_geometry(steering, "ackermann", L)
    ahead = 0.0 if steering.reference == "rear_axle" else 0.5 * L  # of the reference, from the rear
    slip = math.atan(ahead / L * math.tan(front) + (1.0 - ahead / L) * math.tan(rear))

    def rates(_: float, state: np.ndarray) -> list[float]:
        direction = state[2] + slip
        rate = math.cos(slip) * (math.tan(front) - math.tan(rear)) / L
        return [math.cos(direction), math.sin(direction), rate]

    at = (
        solve_ivp(
            rates, (0.0, 2.0), [0.0, 0.0, 0.0], t_eval=[0.0, 1.0, 2.0], rtol=1e-10, atol=1e-12
        )
        .y[:2]
        .T
    )
    a, b = at[1] - at[0], at[2] - at[1]
    cross = a[0] * b[1] - a[1] * b[0]
    curvature = 2.0 * cross / (np.linalg.norm(a) * np.linalg.norm(b) * np.linalg.norm(a + b))
    offset = body_heading_offset(curvature, geometry.centre_offset)
    assert offset == pytest.approx(slip, abs=1e-6)
    assert steering_angle(curvature, geometry) == pytest.approx(front, abs=1e-6)


def test_the_min_radius_belongs_to_the_greatest_angle() -> None:
    for kind in ("ackermann", "double_ackermann"):
        geometry = steering_geometry(Steering(kind=kind, max_angle=0.5), "ackermann", L)
        assert steering_angle(geometry.max_curvature, geometry) == pytest.approx(0.5)
    given = steering_geometry(Steering(kind="ackermann", min_radius=3.0), "ackermann", L)
    assert given.max_curvature == pytest.approx(1.0 / 3.0)
    assert math.isinf(steering_geometry(None, "skid_steer", L).max_curvature)
    assumed = steering_geometry(None, "ackermann", L)
    assert 1.0 / assumed.max_curvature == pytest.approx(1.853, abs=1e-3)
    assert "0.6 rad" in assumed.assumed


@pytest.mark.parametrize("heading_std", [0.0, 0.02, 0.09, 0.3])
@pytest.mark.parametrize("quantile", [0.9, 0.99])
def test_the_band_is_left_no_more_often_than_promised(heading_std: float, quantile: float) -> None:
    """Every point of a body 1.5 m ahead and 0.9 m behind, 200,000 draws."""
    rng, count = np.random.default_rng(8), 200_000
    tracking = Tracking(cross_track_std=0.08, heading_std=heading_std)
    errors = input_errors(tracking, quantile)
    across, turned = 0.08 * rng.normal(size=count), heading_std * rng.normal(size=count)
    for x in (1.5, -0.9):
        left = np.abs(across + x * np.sin(turned)) > lateral_band(errors, x)
        assert left.mean() <= (1.0 - quantile) + 3.0 * math.sqrt((1.0 - quantile) / count)
    farthest = np.abs(across) + 1.5 * np.abs(np.sin(turned)) > lateral_band(errors, 1.5)
    noise = 3.0 * math.sqrt((1.0 - quantile) / count)
    assert farthest.mean() <= 1.0 - quantile + noise
    if heading_std == 0.0:  # one error alone uses the whole of the promise
        assert farthest.mean() == pytest.approx(1.0 - quantile, abs=noise)
