"""The model's numbers as the kernels want them."""

from __future__ import annotations

import pytest

from slopewise.models.laws import slip_track, tip_over, turning_resistance, wheel_loads
from slopewise.planner.kernels.limits import planning_limits
from tests.planner.scenes import ATV, G, model_of, tables_with


def test_levers_are_those_of_the_wheel_loads() -> None:
    n = planning_limits(model_of(tables_with(vehicle={"cg_x": 0.5, "cg_z": 0.4})))
    # One g of braking on level ground shifts lever times the static load of an axle.
    assert n.rear_lever == pytest.approx(1.0 - wheel_loads.rear_load_share(0, 0, G, 1.2, 0.5, 0.4))
    assert n.front_lever == pytest.approx(
        wheel_loads.front_load_share(0, 0, G, 1.2, 0.5, 0.4) - 1.0
    )
    assert n.side_lever == pytest.approx(1.0 - wheel_loads.right_load_share(0, 0, -G, 1.0, 0.4))
    assert G / n.front_lever * (1.0 - 0.1) == pytest.approx(
        tip_over.drive_accel_limit(0.0, 0.0, 0.5, 0.4, 0.1)
    )


def test_only_skid_steer_vehicles_drag_and_slip_in_turns() -> None:
    skid = planning_limits(model_of(ATV))
    assert skid.turning_drag == turning_resistance.equivalent_drag_ratio(1.0, 0.20, 1.2)
    assert 1.0 + skid.half_slip_track == slip_track.outer_wheel_speed_ratio(1.0, 1.15)
    steered = planning_limits(model_of(tables_with(vehicle={"drive": "ackermann"})))
    assert steered.turning_drag == 0.0
    assert steered.half_slip_track == 0.5


def test_drive_is_reckoned_per_weight() -> None:
    n = planning_limits(model_of(ATV))
    assert n.specific_force == pytest.approx(2500.0 / (500.0 * G))
    assert n.specific_power == pytest.approx(6000.0 / (500.0 * G))
    assert (n.speed, n.accel, n.decel, n.lateral_accel) == (4.0, 1.0, 1.5, 2.0)
    assert (n.min_load, n.resistance, n.max_wheel_speed) == (0.10, 0.13, 6.0)
