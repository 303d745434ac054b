"""Worst case of a vehicle model: the numbers that stops behind the guard are computed from.

A field of a model that is not used here cannot change a stop of the guard; the fields that it
knows are listed in ``tests/services/guard/test_guard_model.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.force_design import corner_design
from slopewise.models.input_errors import InputErrors, input_errors
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.stop_promise import promised
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.vehicle import Shape, Vehicle
from slopewise.services.io.model_file import read_model
from slopewise.services.physics.force import NO_FRICTION_LIMIT, applied_share

QUANTILE = 0.977
"""Of the stop distances that a model file promises [1]: that of two standard deviations."""
SPREAD = 2.0
"""Standard deviations by which force and dead time may be worse than their mean: one stop in 40."""

_MIN_FORCE_SHARE = 0.1
"""Share of the force that scatter leaves at least, so that the strongest force is finite [1]."""

T = TypeVar("T", float, Floats)


class GuardSurface(NamedTuple, Generic[T]):
    """Brakes on one surface, F_b/W = (m_m v + b_m) θ + (m_b v + b_b), with the spread taken off.

    Numbers of one surface; or columns (R + 1,) of a table of all R, see :func:`brake_table`.
    """

    m_m: T  # m_m, b_m, m_b, b_b: coefficients downhill and on level ground [s/m], [1], [s/m], [1]
    b_m: T
    m_b: T
    b_b: T
    up_m: T  # up_m, up_b: m_m and b_m uphill [s/m], [1]
    up_b: T
    dead_time: T  # longest dead time, brake lag included [s]
    offset: T  # safety distance that is added to every stop [m]
    speed_error: T  # speed by which the vehicle may be faster than commanded [m/s]
    slowest: T  # slowest, fastest: trained speed range [m/s]
    fastest: T
    # grade_min, grade_max, roll_min, roll_max: trained slopes, uphill and left side up [rad]
    grade_min: T
    grade_max: T
    roll_min: T
    roll_max: T
    friction: T  # friction, level: cap of the force, share of the brakes that is applied [1]
    level: T
    rolling: T  # motion resistance in place of the share that is not applied [1]
    # stronger, extra: factor and addition by which the force may exceed this one, for loads [1]
    stronger: T
    extra: T


SurfaceTable: TypeAlias = GuardSurface[Floats]


class GuardModel(NamedTuple):
    """Worst case of one vehicle; SI."""

    surfaces: dict[str, GuardSurface[float]]  # brakes by surface name, "" is the base
    # tables of the named surfaces, for names and states of terrain classes
    governing: tuple[int, ...]  # index of the surface that each one is, or is a state of
    named: Mapping[str, SurfaceBraking]
    vehicle: Vehicle  # vehicle, shape: sizes
    shape: Shape
    # effects, motion: named effects of the model file, and their motion terms
    effects: tuple[Effect, ...]
    motion: registry.MotionTerms
    scale: float  # factor of the force by lasting effects [1]
    resistance: float  # motion resistance that holds a rolling vehicle [1]
    speed: float  # speed, lateral: limits of speed and lateral acceleration [m/s], [m/s²]
    lateral: float
    decel: float  # service deceleration [m/s²]
    min_load: float  # share of its static load that every axle and side must keep [1]
    turn_axis: float  # place abeam of which turns have their centre, behind mid-wheelbase [m]
    errors: InputErrors  # of pose and time


Tables: TypeAlias = tuple[SurfaceTable, ...]
"""Tables of the same surfaces, by the model file and as learned; of all the worst case holds."""


class GuardScene(NamedTuple):
    """Vehicle and ground."""

    model: GuardModel  # worst case of the vehicle
    tables: Tables  # its surfaces, the first table by the model file
    ground: ElevationMap  # map
    # distance to which the path of the middle of the wheelbase is known to be free [m]
    clear: float


def read_guard_model(path: Path) -> GuardModel:
    """Worst case of the model in a file."""
    return guard_model(read_model(path))


def guard_model(model: Model) -> GuardModel:
    """Worst case of a model."""
    mean = model.braking
    model = promised(model, QUANTILE, as_mean=True)
    braking, terrain, limits, effects = model.braking, model.terrain, model.limits, model.effect
    motion, rolling = registry.motion(effects), terrain.rolling_while_braking
    geometry = model.steering_geometry
    names = ["", *braking.terrain]
    states = {
        n: table.state_of for n, table in braking.terrain.items() if table.state_of is not None
    }
    return GuardModel(
        surfaces={
            name: _worst_case(braking.on(name), mean.on(name), rolling, motion) for name in names
        },
        governing=tuple(names.index(states.get(name, name)) for name in names),
        named=braking.terrain,
        vehicle=model.vehicle,
        shape=model.vehicle.shape,
        effects=effects,
        motion=motion,
        scale=registry.force_scale(effects),
        resistance=terrain.motion_resistance,
        speed=limits.speed,
        lateral=limits.lateral_accel,
        decel=limits.decel,
        min_load=limits.min_load,
        turn_axis=geometry.centre_offset + geometry.body_offset,
        errors=input_errors(model.tracking, QUANTILE),
    )


def _worst_case(
    b: Braking, mean: Braking, rolling: float, motion: registry.MotionTerms
) -> GuardSurface[float]:
    uphill, grades, rolls, margin = b.uphill or b, b.grade_range, b.trained_roll, 0.0
    if b.extrapolate:
        # Steeper ground than trained is driven with less force, everywhere: on the safe side.
        margin = b.extrapolation_margin
        grades = rolls = (-0.5 * math.pi, 0.5 * math.pi)
    worse, scatter = SPREAD * b.force_std, SPREAD * b.force_scatter
    share = max(1.0 - margin, 1e-9) * max(1.0 - scatter, _MIN_FORCE_SHARE)
    friction = NO_FRICTION_LIMIT if b.sliding_friction is None else b.sliding_friction
    return GuardSurface(
        m_m=share * b.m_m,
        b_m=share * b.b_m,
        m_b=share * b.m_b,
        b_b=share * b.b_b - worse,
        up_m=share * uphill.m_m,
        up_b=share * uphill.b_m,
        # A lag makes stops longer by no more than the same time at held speed.
        dead_time=b.dead_time + motion.lag + SPREAD * b.dead_time_std,
        offset=b.distance_offset,
        speed_error=b.speed_error,
        slowest=b.speed_range[0],
        fastest=b.speed_range[1],
        grade_min=grades[0],
        grade_max=grades[1],
        roll_min=rolls[0],
        roll_max=rolls[1],
        friction=min(friction, motion.friction),
        level=applied_share(b),
        rolling=rolling,
        stronger=(1.0 + margin) * (1.0 + scatter) / share,
        extra=2.0 * worse + 2.0 * given_up(mean, b),
    )


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


def brake_table(model: GuardModel) -> SurfaceTable:
    """Columns (R + 1,) of the R surfaces, in the order of the model's names.

    The last row, index -1, is ground that may be any of them: the narrowest trained ranges and
    the longest dead time. Its force is not used.
    """
    rows = np.array(list(model.surfaces.values()))
    table = GuardSurface(*np.vstack((rows, rows[0])).T)
    for column in (table.grade_min, table.roll_min, table.dead_time):
        column[-1] = column.max()
    for column in (table.grade_max, table.roll_max, table.fastest):
        column[-1] = column.min()
    return table
