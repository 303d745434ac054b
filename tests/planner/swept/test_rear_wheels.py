"""A pit on which only the inner rear wheel of a turning vehicle stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import slopewise
from slopewise.models.parameters import Steering, Tracking

CELL = 0.1  # [m]


def plan_past_pit(radius: float, gap: float, tracking: Tracking | None) -> slopewise.SpeedPlan:
    """A left turn, its reference the rear axle, whose inner wheel passes a pit at a distance."""
    model = slopewise.read_model("ugv")
    steering = Steering(kind="ackermann", reference="rear_axle", max_angle=0.6)
    model = replace(model, steering=steering, tracking=tracking)
    turned = np.arange(0.0, 1.2, CELL / radius)
    straight = np.column_stack((np.arange(0.0, 10.0, CELL), np.zeros(100)))
    arc = np.column_stack((10.0 + radius * np.sin(turned), radius * (1.0 - np.cos(turned))))
    middle = radius - 0.5 * model.vehicle.track_width - gap - 1.0
    x, y = np.meshgrid(np.arange(-5.0, 28.0, CELL), np.arange(-6.0, 22.0, CELL))
    away = np.hypot(x - 10.0 - middle * np.sin(0.6), y - radius + middle * np.cos(0.6))
    ground = slopewise.ElevationMap(
        elevation=np.where(away < 1.0, -1.5, 0.0), resolution=CELL, origin=(-5.0, -6.0)
    )
    path = slopewise.CandidatePath("p", np.concatenate((straight, arc)))
    (plan,) = slopewise.plan(model, ground, [path], start_speed=0.0)
    return plan


@pytest.mark.parametrize("radius", [6.0, 8.0, 12.0])
def test_a_pit_under_the_inner_rear_wheel_alone_is_met(radius: float) -> None:
    tracking = Tracking(cross_track_std=0.05, cross_track_per_curvature=0.1, heading_std=0.02)
    assert plan_past_pit(radius, -0.1, None).status.value == "blocked"
    assert plan_past_pit(radius, 0.1, tracking).status.value == "blocked"
    assert plan_past_pit(radius, 0.5, tracking).status.value == "ok"
