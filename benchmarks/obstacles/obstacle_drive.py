"""One drive over an obstacle in the physics engine, at the speeds of a plan."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from slopewise.models.parameters import Model
from slopewise.planner.plan import SpeedPlan

from .obstacle_scene_xml import TIME_STEP, WHEELS, scene_xml
from .shapes import Block, Slope

_SETTLE = 1.0  # [s] at rest before the drive
_MAX_TIME, _EXTRA_TIME = 2.0, 6.0  # over the planned time [1], added to it [s]
_MIN_SPEED = 0.15  # [m/s] commanded where a plan begins from rest
_TIPPED = 0.5  # cosine of the tilt
MAX_AIR = 0.2
"""Time that a wheel may be in the air without failure [s]."""

_HOLD, _TURN = 1.5, 2.0  # [1/s], [1/(m s)] yaw rate against heading and offset


@dataclass(frozen=True, slots=True)
class Driven:
    """Outcome of a drive.

    Attributes:
        struck: whether the body touched the ground or the obstacle.
        tipped: whether the vehicle tipped over.
        air: longest time that a wheel was in the air [s].
        stuck: whether it did not arrive.
    """

    struck: bool
    tipped: bool
    air: float
    stuck: bool

    @property
    def failed(self) -> bool:
        """Whether the drive is a failure."""
        return self.struck or self.tipped or self.air > MAX_AIR or self.stuck


def drive(block: Block | None, slope: Slope, model: Model, plan: SpeedPlan) -> Driven:
    """Drive the plan's path to its end, or to the first failure.

    Args:
        block: the obstacle, in the frame of the path; its middle is at 0.
        slope: plane under it.
        model: the vehicle.
        plan: speeds along the path.
    """
    engine = mujoco.MjModel.from_xml_string(scene_xml(block, slope, model))
    data = mujoco.MjData(engine)
    length = float(plan.station[-1])
    # Stations run along the slope, as the engine's x does.
    data.qpos[:3] = (-0.5 * length, 0.0, 0.01)
    geoms = [engine.geom(name).id for name in WHEELS]
    body, chassis = engine.geom("body").id, engine.body("chassis").id
    half_track, radius = 0.5 * model.terrain.slip_track, model.vehicle.wheel_radius
    air, longest, struck = np.zeros(4), 0.0, False
    limit = _MAX_TIME * plan.travel_time + _EXTRA_TIME
    time = -_SETTLE
    while time < limit:
        x, y = data.qpos[0] + 0.5 * length, data.qpos[1]
        frame = data.xmat[chassis].reshape(3, 3)
        if frame[2, 2] < _TIPPED and time > 0.0:
            return Driven(struck, True, longest, False)
        if x >= length - 0.02:
            return Driven(struck, False, longest, False)
        speed = 0.0
        if time >= 0.0:
            speed = max(float(np.interp(x, plan.station, plan.speed)), _MIN_SPEED)
        yaw = math.atan2(frame[1, 0], frame[0, 0])
        turn = -_HOLD * yaw - _TURN * y if speed > 0.0 else 0.0
        sides = np.array([speed - turn * half_track, speed + turn * half_track] * 2)
        data.ctrl[:] = sides / radius
        mujoco.mj_step(engine, data)
        time += TIME_STEP
        touching = {int(g) for pair in data.contact.geom[: data.ncon] for g in pair}
        struck = struck or (body in touching and time > 0.0)
        standing = np.array([geom in touching for geom in geoms])
        air = np.where(standing | (time < 0.0), 0.0, air + TIME_STEP)
        longest = max(longest, float(air.max()))
        if struck and longest > MAX_AIR:
            break
    stuck = not struck
    return Driven(struck, False, longest, stuck)
