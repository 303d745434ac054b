"""The multi-body car of CommonRoad's vehicle models, compiled.

Source: Althoff and Würsching, CommonRoad: Vehicle Models, 2020, tables 6 and 7; package
commonroad-vehicle-models, vehicle 2 (BMW 320i). Its functions are compiled unchanged.
"""

from __future__ import annotations

from collections import namedtuple
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import njit
from vehiclemodels import vehicle_dynamics_mb as multi_body
from vehiclemodels.init_mb import init_mb
from vehiclemodels.utils import (
    acceleration_constraints,
    steering_constraints,
    tire_model,
    vehicle_dynamics_ks_cog,
)
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from .plant_physics import Floats

_VEHICLE = 2  # number of the package, a BMW 320i
_LOOSE = 1.1
"""Shape C of the tyre's curve on loose or wet ground: friction stays at its peak while sliding."""

WHEELS = slice(23, 27)
"""Wheel speeds in the state, front left, front right, rear left, rear right [rad/s]."""


def _compiled(function: FunctionType, **known: Any) -> Any:
    """Compile a function of the package together with compiled helpers."""
    return njit(FunctionType(function.__code__, function.__globals__ | known, function.__name__))


def _compiled_tyre() -> ModuleType:
    tyre = ModuleType("tyre")
    sign = njit(tire_model.sign)
    for axis in ("longitudinal", "lateral"):
        for name in (f"formula_{axis}", f"formula_{axis}_comb"):
            setattr(tyre, name, _compiled(getattr(tire_model, name), sign=sign))
    return tyre


def _compiled_car() -> Any:
    helpers: dict[str, Any] = {
        "steering_constraints": njit(steering_constraints.steering_constraints),
        "acceleration_constraints": njit(acceleration_constraints.acceleration_constraints),
    }
    slow = _compiled(vehicle_dynamics_ks_cog.vehicle_dynamics_ks_cog, **helpers)
    helpers |= {"vehicle_dynamics_ks_cog": slow, "tireModel": _compiled_tyre()}
    return _compiled(multi_body.vehicle_dynamics_mb, **helpers)


car_slopes = _compiled_car()
"""Derivatives of the 29 states as a list: ``car_slopes(state, inputs, parameters)``.

The frame is the package's: x ahead, y right, z down.
"""


def _numbers(name: str, parameters: Any) -> Any:
    """Parameters of the package as tuples of numbers, which compiled functions accept."""
    values: dict[str, Any] = {}
    for key, value in vars(parameters).items():
        if hasattr(value, "__dict__"):
            inner = _numbers(key, value)
            if len(inner):
                values[key] = inner
        elif value is not None:
            values[key] = float(value)
    return namedtuple(name, values)(**values)


CAR = _numbers("CarParameters", setup_vehicle_parameters(_VEHICLE))
"""Parameters of the unmodified car."""


def loaded(payload: float) -> Any:
    """Parameters of the car with a load in its body [kg]."""
    share = 1.0 + payload / CAR.m_s
    inertias = {name: getattr(CAR, name) * share for name in ("I_Phi_s", "I_y_s", "I_z")}
    return CAR._replace(m=CAR.m + payload, m_s=CAR.m_s + payload, **inertias)


def on_ground(car: Any, friction: float) -> Any:
    """Parameters of a car on ground of another friction; 0 for the road of the tyre's data."""
    if friction == 0.0:
        return car
    tyre = car.tire._replace(p_dx1=friction, p_dy1=0.9 * friction, p_cx1=_LOOSE)
    return car._replace(tire=tyre)


def rolling_state(car: Any, speed: float, heading: float, steer: float, curvature: float) -> Floats:
    """State of a car on an arc, shape (29,), in the package's frame."""
    turn = speed * curvature
    core = [0.0, 0.0, steer, speed, heading, turn, 0.0]
    state = np.array(init_mb(core, car), np.float64)
    # The rear axle does not slip sideways.
    lateral = car.b * turn
    state[10], state[15], state[20] = lateral, lateral + car.a * turn, 0.0
    half = 0.5 * turn * np.array([car.T_f, -car.T_f, car.T_r, -car.T_r])
    state[WHEELS] = (speed + half) / car.R_w
    return state
