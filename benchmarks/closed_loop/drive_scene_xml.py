"""The physics engine's scene: planes under the wheels, a sprung four-wheeler, a movable wall.

A wheel touches a plane that is tangent to the ground under it, not a height field: at the edges of
its prisms a rolling sphere meets false walls, hops, and stops up to a fifth too late.
"""

from __future__ import annotations

from slopewise.models.quantity import GRAVITY
from slopewise.models.vehicle import Vehicle

from .quad import OVERHANG, TrueVehicle

TIME_STEP = 0.0025
"""Step of the physics engine [s]; with 5 ms, stops with the anti-lock are 3 % longer."""

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_WALL = (0.3, 1.5, 1.0)  # [m] half extents


def scene_xml(vehicle: Vehicle, hidden: TrueVehicle) -> str:
    """MJCF of the scene."""
    tiles = "".join(_tile(name) for name in WHEELS)
    motors = "".join(f'<motor name="drive_{name}" joint="axle_{name}"/>' for name in WHEELS)
    touch = "".join(f'<touch name="load_{name}" site="contact_{name}"/>' for name in WHEELS)
    steer = "".join(
        f'<position name="steer_{name}" joint="steer_{name}" kp="4000" kv="120"/>'
        for name in WHEELS[:2]
    )
    return f"""
<mujoco model="closed loop">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{TIME_STEP}" integrator="implicitfast" cone="elliptic" impratio="100"
          iterations="12" gravity="0 0 -{GRAVITY}"/>
  <size memory="64M"/>
  <worldbody>
    {tiles}
    <body name="wall" mocap="true" pos="0 0 -50">
      <geom name="wall" type="box" size="{_WALL[0]} {_WALL[1]} {_WALL[2]}"
            contype="32" conaffinity="16"/>
    </body>
    {_chassis(vehicle, hidden)}
  </worldbody>
  <actuator>{motors}{steer}</actuator>
  <sensor>{touch}</sensor>
</mujoco>"""


def _chassis(vehicle: Vehicle, hidden: TrueVehicle) -> str:
    """The sprung body with its wheels."""
    mass = vehicle.mass - 4.0 * hidden.wheel_mass
    # The wheels hang at the height of the origin; the body balances them.
    ahead = (vehicle.cg_x - 0.5 * vehicle.wheelbase) * vehicle.mass / mass
    above = (vehicle.cg_z - vehicle.wheel_radius) * vehicle.mass / mass
    length, width, height = 1.6, 0.8, 0.5
    inertia = [
        mass / 12.0 * (a**2 + b**2) for a, b in ((width, height), (length, height), (length, width))
    ]
    wheels = "".join(_wheel(name, vehicle, hidden) for name in WHEELS)
    return f"""
    <body name="chassis" pos="0 0 0">
      <freejoint name="free"/>
      <inertial pos="{ahead} 0 {above}" mass="{mass}"
                diaginertia="{inertia[0]} {inertia[1]} {inertia[2]}"/>
      <geom name="body" type="box" size="{OVERHANG} 0.35 0.16" pos="0 0 0.34" mass="0"
            contype="16" conaffinity="32"/>
      {wheels}
    </body>"""


def _tile(name: str) -> str:
    """Plane under one wheel, which touches that wheel alone and moves with it."""
    return f"""
    <body name="tile_{name}" mocap="true">
      <geom name="tile_{name}" type="plane" size="1 1 1" contype="0"
            conaffinity="{1 << WHEELS.index(name)}"/>
    </body>"""


def _wheel(name: str, vehicle: Vehicle, hidden: TrueVehicle) -> str:
    x = 0.5 * vehicle.wheelbase * (1.0 if name.startswith("front") else -1.0)
    y = 0.5 * vehicle.track_width * (1.0 if name.endswith("left") else -1.0)
    r, m = vehicle.wheel_radius, hidden.wheel_mass
    sag = (vehicle.mass / 4.0 - m) * GRAVITY / hidden.spring
    spin = 0.6 * m * r * r
    steer = ""
    if name.startswith("front"):
        steer = f'<joint name="steer_{name}" type="hinge" axis="0 0 1" armature=".2"/>'
    return f"""
      <body name="{name}" pos="{x} {y} 0">
        <joint name="spring_{name}" type="slide" axis="0 0 1" stiffness="{hidden.spring}"
               damping="{hidden.damper}" springref="-{sag}" range="-.15 .15"/>
        {steer}
        <joint name="axle_{name}" type="hinge" axis="0 1 0" frictionloss="1"
               solreffriction=".005 1" solimpfriction=".98 .999 .01"/>
        <inertial pos="0 0 0" mass="{m}" diaginertia="{0.6 * spin} {spin} {0.6 * spin}"/>
        <geom name="{name}" type="sphere" size="{r}" priority="1" friction="1 0 0" condim="3"
              solref=".02 1" solimp=".95 .99 .002" contype="{1 << WHEELS.index(name)}"
              conaffinity="0"/>
        <site name="contact_{name}" type="sphere" size="{r + 0.05}"/>
      </body>"""
