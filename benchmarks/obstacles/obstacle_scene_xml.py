"""The physics engine's scene: a plane with one block or hole, and a sprung four-wheeler.

The slope is in gravity, not in the ground: the path runs along x.
"""

from __future__ import annotations

import math

from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY

from .shapes import FAR, Block, Slope

TIME_STEP = 0.002  # [s] of the engine
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_DEEP = 1.0  # [m] thickness of the ground
_WHEEL_SHARE = 0.04  # of the mass, each wheel [1]
_FRICTION = 0.6  # [1]
_GAIN = 0.3  # of the weight per m/s that a wheel is too slow [s/m]


def scene_xml(block: Block | None, slope: Slope, model: Model) -> str:
    """MJCF of the scene; no block is a plane."""
    length = math.sqrt(1.0 + slope.along**2 + slope.across**2)
    gravity = [-GRAVITY * part / length for part in (slope.along, slope.across, 1.0)]
    torque = 0.25 * model.vehicle.max_drive_force * model.vehicle.wheel_radius
    gain = _GAIN * model.vehicle.mass * GRAVITY * model.vehicle.wheel_radius**2
    motors = "".join(
        f'<velocity name="{name}" joint="axle_{name}" kv="{gain}" forcerange="-{torque} {torque}"/>'
        for name in WHEELS
    )
    return f"""<mujoco>
      <compiler angle="radian" autolimits="true"/>
      <option timestep="{TIME_STEP}" integrator="implicitfast" cone="elliptic" impratio="10"
              iterations="20" gravity="{gravity[0]} {gravity[1]} {gravity[2]}"/>
      <default><geom friction="{_FRICTION} .005 .0001" solref=".01 1" contype="1" conaffinity="2"/>
      </default>
      <worldbody>{_ground(block)}{_vehicle(model)}</worldbody>
      <actuator>{motors}</actuator>
    </mujoco>"""


def _box(x: tuple[float, float], y: tuple[float, float], top: float) -> str:
    size = (0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0]), 0.5 * _DEEP)
    at = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), top - 0.5 * _DEEP)
    return f'<geom type="box" size="{size[0]} {size[1]} {size[2]}" pos="{at[0]} {at[1]} {at[2]}"/>'


def _ground(block: Block | None) -> str:
    """A plane with the block on it, or around the hole."""
    plane = '<geom type="plane" size="1 1 1" pos="0 0 {}"/>'
    if block is None or block.height == 0.0:
        return plane.format(0.0)
    length, width = block.half_length, block.half_width
    if block.height > 0.0:
        parts = _box((-length, length), (-width, width), block.height)
        level = 0.0
    else:
        wide = width + FAR
        parts = _box((-length - FAR, -length), (-wide, wide), 0.0)
        parts += _box((length, length + FAR), (-wide, wide), 0.0)
        parts += _box((-length, length), (-wide, -width), 0.0)
        parts += _box((-length, length), (width, wide), 0.0)
        level = block.height
    half = 0.5 * block.yaw
    turned = f"{math.cos(half)} 0 0 {math.sin(half)}"
    body = f'<body pos="{block.x} {block.y} 0" quat="{turned}">{parts}</body>'
    return plane.format(level) + body


def _vehicle(model: Model) -> str:
    """Body and wheels at their places on level ground, the springs under their loads."""
    vehicle, shape = model.vehicle, model.vehicle.shape
    wheel = _WHEEL_SHARE * vehicle.mass
    mass = vehicle.mass - 4.0 * wheel
    ahead = (vehicle.cg_x - 0.5 * vehicle.wheelbase) * vehicle.mass / mass
    above = (vehicle.cg_z * vehicle.mass - 4.0 * wheel * vehicle.wheel_radius) / mass
    length, width = shape.front + shape.rear, vehicle.track_width - shape.wheel_width
    height = 1.2 * vehicle.wheel_radius
    inertia = [
        mass / 12.0 * (a**2 + b**2) for a, b in ((width, height), (length, height), (length, width))
    ]
    half = (0.5 * length, 0.5 * width - 0.01, 0.5 * height)
    at = (0.5 * (shape.front - shape.rear), 0.0, shape.clearance + half[2])
    wheels = "".join(_wheel(name, model, mass, wheel) for name in WHEELS)
    return f"""
      <body name="chassis" pos="0 0 0">
        <freejoint name="free"/>
        <inertial pos="{ahead} 0 {above}" mass="{mass}"
                  diaginertia="{inertia[0]} {inertia[1]} {inertia[2]}"/>
        <geom name="body" type="box" size="{half[0]} {half[1]} {half[2]}"
              pos="{at[0]} {at[1]} {at[2]}" contype="2" conaffinity="1"/>
        {wheels}
      </body>"""


def _wheel(name: str, model: Model, sprung: float, mass: float) -> str:
    vehicle, shape = model.vehicle, model.vehicle.shape
    x = 0.5 * vehicle.wheelbase * (1.0 if name.startswith("front") else -1.0)
    y = 0.5 * vehicle.track_width * (1.0 if name.endswith("left") else -1.0)
    omega = 2.0 * math.pi * vehicle.ride_frequency
    stiffness = 0.25 * sprung * omega**2
    damping = 2.0 * vehicle.ride_damping * 0.25 * sprung * omega
    sag, travel = GRAVITY / omega**2, shape.wheel_travel
    radius = vehicle.wheel_radius
    spin = 0.5 * mass * radius**2
    return f"""
        <body name="{name}" pos="{x} {y} {radius}">
          <joint name="spring_{name}" type="slide" axis="0 0 1" stiffness="{stiffness}"
                 damping="{damping}" springref="-{sag}" range="-{travel} {travel}"/>
          <joint name="axle_{name}" type="hinge" axis="0 1 0" armature="{spin}"/>
          <inertial pos="0 0 0" mass="{mass}" diaginertia="{0.6 * spin} {spin} {0.6 * spin}"/>
          <geom name="{name}" type="cylinder" size="{radius} {0.5 * shape.wheel_width}"
                euler="1.5707963 0 0" contype="2" conaffinity="1"/>
        </body>"""
