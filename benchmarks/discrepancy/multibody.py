"""A car of another author, with brakes and effects added from outside.

Chassis, springs and tyres are CommonRoad's multi-body model (:mod:`.vehicle_models`): Pacejka's
tyre, load transfer, a body that pitches and rolls. Added here are torques at the wheels (hydraulic
brakes, drive, rolling, driveline) and accelerations of the bodies (gravity along grade and roll,
air). None of the effects is a term of a braking model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .effect_plant import GRAVITY, DrivenStops
from .multibody_kernels import CarPush, stop_car
from .plant_physics import Floats, Stops
from .vehicle_models import CAR, loaded, on_ground, rolling_state

BEFORE = 1.2
"""Logged time before each command [s]."""

MAX_CURVATURE = 0.05
"""Curvature up to which this car is steered [1/m]."""

_SAMPLE = 0.02  # [s], as of :mod:`.sensing`
_SETTLE = 0.5  # [s] at speed before the log begins
_MAX_STOP = 8.0  # [s]
_BODY_RETURN = 0.15  # [s] time constant of the body's attitude after standstill
_AREAS = 2  # slippery ones at most


@dataclass(frozen=True, slots=True, kw_only=True)
class CarNature:
    """True parameters of this world; the defaults are a car without effects.

    Attributes:
        brake: torque of all wheels at the rims over the dry weight, on level ground [1].
        assist: that share per grade [1/rad]; brakes that sense the slope press harder downhill.
        front: brake share of the front axle [1].
        resistance: rolling resistance over the dry weight [1].
        friction: peak friction of the tyres on loose ground, 0 for the road [1].
        delay: dead time of the command [s].
        build_up: each of two lags of the brake pressure [s].
        payload: [kg] from run ``payload_run`` on. repair: factor on the brakes from that run on.
        air: force on the body per relative air speed squared [N s²/m²]; wind [m/s] blows against
            a vehicle that heads towards ``wind_from`` [rad].
        driveline: viscous torque of each wheel [N m s].
        fading: largest share of the brakes lost by heat [1], 1 − 1/e of it at ``hot`` [J/kg].
        cooling: time constant of that heat [s].
        glazing: share of the brakes lost per second of the session [1/s].
        furrows: resistance across them over the dry weight, none along [1]; ``furrows_along`` is
            the heading of the largest resistance [rad].
        slippery: x, y, radius [m] and friction [1] of areas, two at most.
    """

    brake: float = 0.42
    assist: float = -0.08
    front: float = 0.66
    resistance: float = 0.02
    friction: float = 0.0
    delay: float = 0.16
    build_up: float = 0.015
    payload: float = 0.0
    repair: float = 1.0
    payload_run: int = 10**9
    air: float = 0.0
    wind: float = 0.0
    wind_from: float = 0.0
    driveline: float = 0.0
    fading: float = 0.0
    hot: float = 20.0
    cooling: float = 150.0
    glazing: float = 0.0
    furrows: float = 0.0
    furrows_along: float = 0.0
    slippery: tuple[tuple[float, float, float, float], ...] = ()


class _Traces(NamedTuple):
    """One stop: rows of speed, station, x, y, yaw, yaw rate, grade, pitch, roll; and its end."""

    rows: Floats
    rest: float
    distance: float
    deceleration: float
    heat: float


def drive(nature: CarNature, stops: Stops, finer: float = 1.0) -> DrivenStops:
    """Drive all stops in their order, sampled at 50 Hz from :data:`BEFORE` each command.

    Args:
        nature: true parameters.
        stops: as driven.
        finer: divides the steps of the integration.
    """
    count = np.arange(-round(BEFORE / _SAMPLE), round(_MAX_STOP / _SAMPLE))
    time: Floats = np.asarray(count * _SAMPLE, np.float64)
    heat, since = 0.0, 0.0
    traces: list[_Traces] = []
    for i in range(len(stops.speed)):
        clock = float(stops.clock[i])
        heat *= math.exp(-(clock - since) / nature.cooling)
        traces.append(_drive_stop(nature, stops, i, heat, time, finer))
        heat, since = traces[-1].heat, clock + min(traces[-1].rest, _MAX_STOP)
    rows = np.stack([trace.rows for trace in traces])
    speed, station, x, y, yaw, rate, grade, pitch, roll = np.moveaxis(rows, 2, 0)
    rest = np.array([trace.rest for trace in traces])
    swing = np.exp(-np.maximum(time - rest[:, None], 0.0) / _BODY_RETURN)
    return DrivenStops(
        time,
        speed,
        station,
        x,
        y,
        yaw,
        rate,
        grade + swing * pitch,
        stops.roll[:, None] + roll,
        rest,
        np.array([trace.distance for trace in traces]),
        np.array([trace.deceleration for trace in traces]),
    )


def _drive_stop(
    nature: CarNature, stops: Stops, i: int, heat: float, time: Floats, finer: float
) -> _Traces:
    late = i >= nature.payload_run
    car = loaded(nature.payload if late else 0.0)
    areas = (*nature.slippery, *[(0.0, 0.0, -1.0, 0.0)] * _AREAS)[:_AREAS]
    grounds = (on_ground(car, nature.friction), *(on_ground(car, area[3]) for area in areas))
    curvature = float(np.clip(stops.curvature[i], -MAX_CURVATURE, MAX_CURVATURE))
    speed, heading = float(stops.speed[i]), float(stops.heading[i])
    start = -(BEFORE + _SETTLE)
    back = start * speed
    # The package's y and yaw are to the right.
    steer = math.atan(-curvature * (car.a + car.b))
    state = rolling_state(car, speed, -(heading + curvature * back), steer, -curvature)
    turn = curvature if abs(curvature) > 1e-9 else 1e-9
    state[0] = stops.x[i] + (math.sin(heading + turn * back) - math.sin(heading)) / turn
    state[1] = -stops.y[i] + (math.cos(heading + turn * back) - math.cos(heading)) / turn
    return _Traces(
        *stop_car(
            state,
            grounds,
            np.array([area[:3] for area in areas]),
            _push(nature, stops, i, late, finer),
            heat,
            time,
            start,
            back,
        )
    )


def _push(nature: CarNature, stops: Stops, i: int, late: bool, finer: float) -> CarPush:
    torque = CAR.m * GRAVITY * CAR.R_w
    strength = float(stops.friction[i]) * (1.0 - nature.glazing * float(stops.clock[i]))
    strength *= nature.repair if late else 1.0
    return CarPush(
        float(stops.speed[i]),
        float(stops.grade[i]),
        float(stops.wave[i]),
        float(stops.wave_length[i]),
        float(stops.wave_phase[i]),
        float(stops.roll[i]),
        nature.delay + float(stops.delay[i]),
        nature.build_up,
        torque * nature.brake * strength,
        torque * nature.assist * strength,
        nature.front,
        torque * nature.resistance,
        torque * nature.furrows,
        nature.furrows_along,
        nature.driveline,
        nature.air,
        nature.wind,
        nature.wind_from,
        nature.fading,
        nature.hot,
        nature.cooling,
        1.0 / finer,
    )
