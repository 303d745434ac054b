"""The physics engine's scene: ground, a sprung four-wheeler, a wall that may appear.

A wheel touches a plane that is tangent to the ground under it. The height field itself is there to
be seen only: at the edges of its prisms a rolling sphere meets walls that are not there, hops, and
stops up to a fifth too late.
"""

from __future__ import annotations

from slopewise.models.vehicle import Vehicle

from .quad import OVERHANG, TrueVehicle
from .terrain import PhysicsGround

TIME_STEP = 0.0025
"""Of the physics engine [s]; with twice as much, stops with the anti-lock are 3 % longer."""

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_BASE = 5.0  # [m] ground below the lowest point
_WALL = (0.3, 1.5, 1.0)  # [m] half extents


def scene_xml(terrain: PhysicsGround, vehicle: Vehicle, hidden: TrueVehicle) -> str:
    """MJCF of the scene; heights are filled in afterwards, normed to 0 … 1."""
    rows = len(terrain.height)
    half = 0.5 * terrain.size
    relief = max(float(terrain.height.max()), 1e-3)
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
          iterations="12" gravity="0 0 -9.80665"/>
  <size memory="64M"/>
  <visual>
    <headlight ambient=".45 .45 .45" diffuse=".5 .5 .5"/>
    <global offwidth="960" offheight="640"/>
  </visual>
  <asset>
    <hfield name="ground" nrow="{rows}" ncol="{rows}" size="{half} {half} {relief} {_BASE}"/>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".75 .85 .95" rgb2="1 1 1"
             width="64" height="384"/>
    <texture name="surfaces" type="2d" builtin="flat" rgb1="1 1 1" width="512" height="512"/>
    <material name="ground" texture="surfaces" texrepeat="1 1" specular="0" reflectance="0"/>
  </asset>
  <worldbody>
    <light pos="30 30 60" dir="-.3 -.2 -1" directional="true" diffuse=".6 .6 .6"/>
    <geom name="ground" type="hfield" hfield="ground" pos="{half} {half} 0" material="ground"
          contype="0" conaffinity="0"/>
    {tiles}
    <body name="wall" mocap="true" pos="0 0 -50">
      <geom name="wall" type="box" size="{_WALL[0]} {_WALL[1]} {_WALL[2]}" rgba=".85 .3 .2 1"
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
    # The wheels hang at the height of the origin; the rest carries what they lack.
    ahead = (vehicle.cg_x - 0.5 * vehicle.wheelbase) * vehicle.mass / mass
    above = (vehicle.cg_z - vehicle.wheel_radius) * vehicle.mass / mass
    length, width, height = 1.6, 0.8, 0.5
    inertia = [
        mass / 12.0 * (width**2 + height**2),
        mass / 12.0 * (length**2 + height**2),
        mass / 12.0 * (length**2 + width**2),
    ]
    wheels = "".join(_wheel(name, vehicle, hidden) for name in WHEELS)
    return f"""
    <body name="chassis" pos="0 0 0">
      <freejoint name="free"/>
      <camera name="chase" pos="-5 -2.2 2.6" xyaxes=".4 -.92 0 .36 .16 .92" mode="trackcom"/>
      <inertial pos="{ahead} 0 {above}" mass="{mass}"
                diaginertia="{inertia[0]} {inertia[1]} {inertia[2]}"/>
      <geom name="body" type="box" size="{OVERHANG} 0.35 0.16" pos="0 0 0.34" mass="0"
            rgba=".25 .35 .5 1" contype="16" conaffinity="32"/>
      <site name="imu" pos="{ahead} 0 {above}"/>
      {wheels}
    </body>"""


def _tile(name: str) -> str:
    """The ground under one wheel, for that wheel alone: a plane that goes along with it."""
    return f"""
    <body name="tile_{name}" mocap="true">
      <geom name="tile_{name}" type="plane" size="1 1 1" contype="0"
            conaffinity="{1 << WHEELS.index(name)}" rgba="0 0 0 0"/>
    </body>"""


def _wheel(name: str, vehicle: Vehicle, hidden: TrueVehicle) -> str:
    x = 0.5 * vehicle.wheelbase * (1.0 if name.startswith("front") else -1.0)
    y = 0.5 * vehicle.track_width * (1.0 if name.endswith("left") else -1.0)
    r, m = vehicle.wheel_radius, hidden.wheel_mass
    sag = (vehicle.mass / 4.0 - m) * 9.80665
    spring = f"{sag / hidden.spring}"
    spin = 0.6 * m * r * r
    steer = ""
    if name.startswith("front"):
        steer = f'<joint name="steer_{name}" type="hinge" axis="0 0 1" armature=".2"/>'
    return f"""
      <body name="{name}" pos="{x} {y} 0">
        <joint name="spring_{name}" type="slide" axis="0 0 1" stiffness="{hidden.spring}"
               damping="{hidden.damper}" springref="-{spring}" range="-.15 .15"/>
        {steer}
        <joint name="axle_{name}" type="hinge" axis="0 1 0" frictionloss="1"
               solreffriction=".005 1" solimpfriction=".98 .999 .01"/>
        <inertial pos="0 0 0" mass="{m}" diaginertia="{0.6 * spin} {spin} {0.6 * spin}"/>
        <geom name="{name}" type="sphere" size="{r}" priority="1" friction="1 0 0" condim="3"
              solref=".02 1" solimp=".95 .99 .002" contype="{1 << WHEELS.index(name)}"
              conaffinity="0" rgba="0 0 0 0"/>
        <geom type="cylinder" size="{r} .09" euler="1.5708 0 0" contype="0" conaffinity="0"
              mass="0" rgba=".12 .12 .12 1"/>
        <site name="contact_{name}" type="sphere" size="{r + 0.05}" rgba="0 0 0 0"/>
      </body>"""
