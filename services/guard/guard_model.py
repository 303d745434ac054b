"""Worst case of a vehicle model: the numbers that stops behind the guard are computed from.

A field of a model that is not used here cannot change a stop of the guard; the fields that it
knows are listed in ``tests/services/guard/test_guard_model.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.force_design import corner_design
from slopewise.models.input_errors import InputErrors, input_errors
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_promise import promised
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.model_file import read_model
from slopewise.services.physics.force import NO_FRICTION_LIMIT, applied_share

QUANTILE = 0.977
"""Of the stop distances that a model file promises [1]: that of two standard deviations."""
SPREAD = 2.0
"""Standard deviations by which force and dead time may be worse than their mean: one stop in 40."""

_MIN_FORCE_SHARE = 0.1
"""Share of the force that scatter leaves at least, so that the strongest force is finite [1]."""


class BrakeTable(NamedTuple):
    """Brakes of R surfaces, F_b/W = (m_m v + b_m) θ + (m_b v + b_b), with the spread taken off.

    Columns (R,), in the order of the model file after the base.
    """

    m_m: Floats  # m_m, b_m, m_b, b_b: coefficients downhill and on level ground [s/m], [1]
    b_m: Floats
    m_b: Floats
    b_b: Floats
    up_m: Floats  # up_m, up_b: m_m and b_m uphill [s/m], [1]
    up_b: Floats
    dead_time: Floats  # longest dead time, brake lag included [s]
    offset: Floats  # safety distance that is added to every stop [m]
    speed_error: Floats  # speed by which the vehicle may be faster than commanded [m/s]
    slowest: Floats  # slowest, fastest: trained speed range [m/s]
    fastest: Floats
    # grade_min, grade_max, roll_min, roll_max: trained slopes, uphill and left side up [rad]
    grade_min: Floats
    grade_max: Floats
    roll_min: Floats
    roll_max: Floats
    friction: Floats  # friction, level: cap of the force, share of the brakes that is applied [1]
    level: Floats
    rolling: Floats  # motion resistance in place of the share that is not applied [1]
    # stronger, extra: factor and addition by which the force may exceed this one, for loads [1]
    stronger: Floats
    extra: Floats


class GuardModel(NamedTuple):
    """Worst case of one vehicle; SI."""

    promised: Model  # the model file's, its brakes as it promises them
    tables: tuple[BrakeTable, ...]  # by the model file, and as learned; the worst of them holds
    vehicle: Vehicle  # sizes
    backward: Vehicle  # the vehicle in reverse: its rear axle leads
    motion: registry.MotionTerms
    errors: InputErrors  # of pose and time
    speed: float  # speed, lateral: limits of speed and lateral acceleration [m/s], [m/s²]
    lateral: float
    turn_axis: float  # place abeam of which turns have their centre, behind mid-wheelbase [m]

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Names of the R surfaces, "" is the base."""
        return "", *self.promised.braking.terrain


class GuardScene(NamedTuple):
    """Vehicle and ground."""

    model: GuardModel  # worst case of the vehicle
    ground: ElevationMap  # map
    # distance to which the path of the middle of the wheelbase is known to be free [m]
    clear: float


def read_guard_model(path: Path) -> GuardModel:
    """Worst case of the model in a file."""
    return guard_model(read_model(path))


def guard_model(model: Model) -> GuardModel:
    """Worst case of a model."""
    mean, model = model.braking, promised(model, QUANTILE, as_mean=True)
    braking, limits, geometry = model.braking, model.limits, model.steering_geometry
    motion, rolling = registry.motion(model.effect), model.terrain.rolling_while_braking
    rows = [
        _worst_case(braking.on(name), mean.on(name), rolling, motion)
        for name in ("", *braking.terrain)
    ]
    return GuardModel(
        promised=model,
        tables=(BrakeTable(*np.array(rows).T),),
        vehicle=model.vehicle,
        backward=_backward(model.vehicle),
        motion=motion,
        errors=input_errors(model.tracking, QUANTILE),
        speed=limits.speed,
        lateral=limits.lateral_accel,
        turn_axis=geometry.centre_offset + geometry.body_offset,
    )


def _backward(vehicle: Vehicle) -> Vehicle:
    """The vehicle with its rear axle as the leading one, for motion in reverse."""
    front = vehicle.front_brake_share
    rear = None if front is None else 1.0 - front
    return replace(vehicle, cg_x=vehicle.wheelbase - vehicle.cg_x, front_brake_share=rear)


def _worst_case(
    b: Braking, mean: Braking, rolling: float, motion: registry.MotionTerms
) -> tuple[float, ...]:
    """Row of one surface in a :class:`BrakeTable`."""
    uphill, grades, rolls, margin = b.uphill or b, b.grade_range, b.trained_roll, 0.0
    if b.extrapolate:
        # Steeper ground than trained is driven with less force, everywhere: on the safe side.
        margin = b.extrapolation_margin
        grades = rolls = (-0.5 * math.pi, 0.5 * math.pi)
    worse, scatter = SPREAD * b.force_std, SPREAD * b.force_scatter
    share = max(1.0 - margin, 1e-9) * max(1.0 - scatter, _MIN_FORCE_SHARE)
    friction = NO_FRICTION_LIMIT if b.sliding_friction is None else b.sliding_friction
    row = {
        "m_m": share * b.m_m,
        "b_m": share * b.b_m,
        "m_b": share * b.m_b,
        "b_b": share * b.b_b - worse,
        "up_m": share * uphill.m_m,
        "up_b": share * uphill.b_m,
        # A lag makes stops longer by no more than the same time at held speed.
        "dead_time": b.dead_time + motion.lag + SPREAD * b.dead_time_std,
        "offset": b.distance_offset,
        "speed_error": b.speed_error,
        "slowest": b.speed_range[0],
        "fastest": b.speed_range[1],
        "grade_min": grades[0],
        "grade_max": grades[1],
        "roll_min": rolls[0],
        "roll_max": rolls[1],
        "friction": min(friction, motion.friction),
        "level": applied_share(b),
        "rolling": rolling,
        "stronger": (1.0 + margin) * (1.0 + scatter) / share,
        "extra": 2.0 * worse + 2.0 * given_up(mean, b),
    }
    return tuple(row[name] for name in BrakeTable._fields)


def given_up(mean: Braking, weaker: Braking) -> float:
    """Largest F_b/W [1] by which a model's mean is above weaker brakes, where it was trained.

    Stops are as much stronger than their mean as a promise is weaker.
    """
    corners = corner_design(mean.speed_range, mean.grade_range)
    forces = []
    for on in (mean, weaker):
        uphill = on.uphill or on
        sides = np.array(
            [[on.m_m, on.b_m, on.m_b, on.b_b], [uphill.m_m, uphill.b_m, on.m_b, on.b_b]]
        )
        forces.append(np.sum(corners * sides[(corners[:, 1] > 0.0).astype(int)], axis=1))
    return max(float(np.max(forces[0] - forces[1])), 0.0)
