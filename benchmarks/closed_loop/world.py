"""The vehicle in the physics engine: brakes with their build-up, tyres, contact loads.

The engine (MuJoCo) solves rigid bodies, suspension and Coulomb friction. Added here are a drive,
brakes behind a hydraulic line, an anti-lock, and rolling resistance. None of it uses a law of
`models`. A wheel touches a plane that is tangent to the ground under it, not a height field: at the
edges of its prisms a rolling sphere meets false walls, hops, and stops up to a fifth too late.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.quantity import GRAVITY

from .loop_terrain import PhysicsGround
from .quad import HIDDEN, OVERHANG, QUAD, TrueVehicle

TIME_STEP = 0.0025
"""Step of the physics engine [s]; with 5 ms, stops with the anti-lock are 3 % longer."""

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_WALL = (0.3, 1.5, 1.0)  # [m] half extents


_TILE = """<body name="tile_{0}" mocap="true">
      <geom name="tile_{0}" type="plane" size="1 1 1" contype="0" conaffinity="{1}"/></body>"""
"""Plane under a wheel, which touches that wheel alone and moves with it."""

_STEER = '<position name="steer_{0}" joint="steer_{0}" kp="4000" kv="120"/>'


def scene_xml(hidden: TrueVehicle) -> str:
    """MJCF of the scene."""
    tiles = "".join(_TILE.format(name, 1 << n) for n, name in enumerate(WHEELS))
    motors = "".join(f'<motor name="drive_{name}" joint="axle_{name}"/>' for name in WHEELS)
    touch = "".join(f'<touch name="load_{name}" site="contact_{name}"/>' for name in WHEELS)
    steer = "".join(_STEER.format(name) for name in WHEELS[:2])
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
    {_chassis(hidden)}
  </worldbody>
  <actuator>{motors}{steer}</actuator>
  <sensor>{touch}</sensor>
</mujoco>"""


def _chassis(hidden: TrueVehicle) -> str:
    """The sprung body with its wheels."""
    mass = QUAD.mass - 4.0 * hidden.wheel_mass
    # The wheels hang at the height of the origin; the body balances them.
    ahead = (QUAD.cg_x - 0.5 * QUAD.wheelbase) * QUAD.mass / mass
    above = (QUAD.cg_z - QUAD.wheel_radius) * QUAD.mass / mass
    length, width, height = 1.6, 0.8, 0.5
    sides = ((width, height), (length, height), (length, width))
    inertia = [mass / 12.0 * (a**2 + b**2) for a, b in sides]
    wheels = "".join(_wheel(name, hidden) for name in WHEELS)
    return f"""
    <body name="chassis" pos="0 0 0">
      <freejoint name="free"/>
      <inertial pos="{ahead} 0 {above}" mass="{mass}"
                diaginertia="{inertia[0]} {inertia[1]} {inertia[2]}"/>
      <geom name="body" type="box" size="{OVERHANG} 0.35 0.16" pos="0 0 0.34" mass="0"
            contype="16" conaffinity="32"/>
      {wheels}
    </body>"""


def _wheel(name: str, hidden: TrueVehicle) -> str:
    x = 0.5 * QUAD.wheelbase * (1.0 if name.startswith("front") else -1.0)
    y = 0.5 * QUAD.track_width * (1.0 if name.endswith("left") else -1.0)
    r, m = QUAD.wheel_radius, hidden.wheel_mass
    sag = (QUAD.mass / 4.0 - m) * GRAVITY / hidden.spring
    spin = 0.6 * m * r * r
    joint = f'<joint name="steer_{name}" type="hinge" axis="0 0 1" armature=".2"/>'
    steer = joint if name.startswith("front") else ""
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


TICK = 0.01  # Period of drive, brakes and tyres [s]
_STEPS = round(TICK / TIME_STEP)
_LIFT = 0.05  # [m] above the ground at the reset
_SETTLE = 1.0  # [s] until the suspension rests
_RELEASE, _APPLY = 0.75, 0.08  # anti-lock: factor down, share up, each tick [1]
_MIN_SLIP_SPEED = 0.5  # [m/s] below which the anti-lock is inactive
_MAX_STEER = 0.6  # [rad] of the front wheels
_DEEP = -50.0  # [m] height of the unused wall
_WALL_HALF = 0.3  # [m]


def _eased(share: Floats, slipping: Bools) -> Floats:
    """Share of the torque of each wheel, less while it slips [1]."""
    return np.clip(np.where(slipping, share * _RELEASE, share + _APPLY), 0.05, 1.0)


class DrivenWorld:
    """One vehicle on one terrain, stepped by ticks; `collided` once it touched the wall."""

    # Of the middle of the wheelbase, at the height of the axles.
    pose: tuple[float, float, float]  # x, y [m] and yaw [rad]
    speed: float  # along the body [m/s]
    pitch: float  # of the body with dive, nose down positive [rad]

    def __init__(
        self, terrain: PhysicsGround, rng: np.random.Generator, hidden: TrueVehicle = HIDDEN
    ) -> None:
        self.terrain = terrain
        self.model = mujoco.MjModel.from_xml_string(scene_xml(hidden))
        self.data = mujoco.MjData(self.model)
        self._hidden, self._rng = hidden, rng

        def ids(kind: mujoco.mjtObj, prefix: str) -> list[int]:
            return [mujoco.mj_name2id(self.model, kind, f"{prefix}{name}") for name in WHEELS]

        joints = ids(mujoco.mjtObj.mjOBJ_JOINT, "axle_")
        self._spin = self.model.jnt_dofadr[joints]
        self._tyres = np.array(ids(mujoco.mjtObj.mjOBJ_GEOM, ""))
        tiles = [self.model.body(f"tile_{name}").mocapid[0] for name in WHEELS]
        self._tiles = np.array(tiles, np.int64)
        self._wall = int(self.model.body("wall").mocapid[0])
        self._slopes = np.gradient(terrain.height, terrain.size / (len(terrain.height) - 1))
        self._wall_geom = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, "wall")
        share = np.array([hidden.front_share] * 2 + [1.0 - hidden.front_share] * 2) / 2.0
        weight = QUAD.mass * GRAVITY
        self._full = share * hidden.brake_ratio * weight * QUAD.wheel_radius
        self._friction = np.array(hidden.friction)
        self._resistance = np.array(hidden.resistance)
        self._lag = np.exp(-TICK / hidden.build_up)
        self._line: list[float] = []
        self.reset(0.5 * terrain.size, 0.5 * terrain.size, 0.0)

    def reset(self, x: float, y: float, yaw: float) -> None:
        """Put the vehicle parallel to the ground and let it settle with brakes on."""
        mujoco.mj_resetData(self.model, self.data)
        self.wall(None)
        self._pressure = np.zeros(4)
        self._release, self._driven = np.ones(4), np.ones(4)
        self._strength = 1.0
        self._line = [0.0] * max(round(self._hidden.dead_time / TICK), 1)
        self.time = 0.0
        self.collided = self.braking = False
        height, normal = self._plane(x, y)
        ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        ahead -= normal * (ahead @ normal)
        ahead /= np.linalg.norm(ahead)
        frame = np.column_stack((ahead, np.cross(normal, ahead), normal))
        position = np.array([x, y, height]) + normal * (QUAD.wheel_radius + _LIFT)
        self.data.qpos[:3] = position
        mujoco.mju_mat2Quat(self.data.qpos[3:7], frame.ravel())
        # The planes under the wheels follow from their places.
        mujoco.mj_kinematics(self.model, self.data)
        self.update_motion()
        for _ in range(round(_SETTLE / TICK)):
            self.tick(0.0, 1.0, 0.0)
        self.time = 0.0

    def _plane(self, x: float, y: float) -> tuple[float, Floats]:
        """Height and normal of the ground over the size of the vehicle."""
        half = 0.5 * QUAD.wheelbase
        offsets = ((0.0, 0.0), (half, 0.0), (-half, 0.0), (0.0, half), (0.0, -half))
        h = [self.height(x + dx, y + dy) for dx, dy in offsets]
        normal = np.array([-(h[1] - h[2]) / (2 * half), -(h[3] - h[4]) / (2 * half), 1.0])
        return max(h), normal / np.linalg.norm(normal)

    def height(self, x: float, y: float) -> float:
        """Height of the ground [m]."""
        return float(self._ground(np.array([x]), np.array([y]))[0][0])

    def wall(self, pose: tuple[float, float, float] | None) -> None:
        """Put the wall with its near face at x, y, square to a heading; None removes it."""
        if pose is None:
            self.data.mocap_pos[self._wall] = (0.0, 0.0, _DEEP)
            return
        x, y, heading = pose
        x, y = x + _WALL_HALF * np.cos(heading), y + _WALL_HALF * np.sin(heading)
        self.data.mocap_pos[self._wall] = (x, y, self.height(x, y) + 0.6)
        self.data.mocap_quat[self._wall] = (np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading))

    def tick(self, thrust: float, brake: float, steer: float) -> None:
        """Advance by :data:`TICK` with thrust of all wheels [N], brakes 0 … 1, curvature [1/m].

        Brakes of 1 are the emergency stop.
        """
        data, hidden, radius = self.data, self._hidden, QUAD.wheel_radius
        surface = self._surfaces()
        self._lay_tiles()
        self.model.geom_friction[self._tyres, 0] = self._friction[surface]
        emergency = brake >= 1.0
        if emergency and not self.braking:
            self._strength = 1.0 + hidden.brake_scatter * float(self._rng.standard_normal())
        self.braking = emergency
        self._line.append(min(max(brake, 0.0), 1.0))
        command = self._line.pop(0) * self._full * self._strength
        self._pressure = command + (self._pressure - command) * self._lag
        spin = data.qvel[self._spin]
        self._anti_lock(spin)
        loads = np.maximum(self.loads, 0.0)
        torque = self._pressure * self._release + self._resistance[surface] * loads * radius
        self.model.dof_frictionloss[self._spin] = np.maximum(torque, 0.1)
        data.ctrl[:4] = self._traction(thrust * radius / 4.0, spin)
        data.ctrl[4:6] = self._steering(steer)
        mujoco.mj_step(self.model, data, nstep=_STEPS)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            raise RuntimeError(f"the physics engine diverged at {self.time:.2f} s")
        self.update_motion()
        self.time += TICK
        if data.mocap_pos[self._wall, 2] > _DEEP and data.ncon:
            self.collided = self.collided or bool(np.any(data.contact.geom == self._wall_geom))

    def _lay_tiles(self) -> None:
        """Put the plane of each wheel under its place in the middle of the tick."""
        _, _, yaw = self.pose
        ahead = 0.5 * TICK * self.speed
        where = self.data.geom_xpos[self._tyres]
        x, y = where[:, 0] + ahead * math.cos(yaw), where[:, 1] + ahead * math.sin(yaw)
        height, rise_y, rise_x = self._ground(x, y)
        self.data.mocap_pos[self._tiles] = np.column_stack((x, y, height))
        # The shortest turn from straight up to the normal.
        length = np.sqrt(1.0 + rise_x**2 + rise_y**2)
        turn = np.column_stack((length + 1.0, rise_y, -rise_x, np.zeros(4)))
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        self.data.mocap_quat[self._tiles] = turn

    def _ground(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Height and slopes towards y and x, bilinear, shape (k,) each."""
        last = len(self.terrain.height) - 2
        per_cell = (last + 1) / self.terrain.size
        u, v = x * per_cell, y * per_cell
        j = np.minimum(np.maximum(u, 0.0), last).astype(np.int64)
        i = np.minimum(np.maximum(v, 0.0), last).astype(np.int64)
        u, v = u - j, v - i
        shares = ((1.0 - v) * (1.0 - u), (1.0 - v) * u, v * (1.0 - u), v * u)
        corners = ((i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1))

        def between(values: Floats) -> Floats:
            parts = (s * values[c] for s, c in zip(shares, corners, strict=True))
            return np.asarray(sum(parts), np.float64)

        return between(self.terrain.height), between(self._slopes[0]), between(self._slopes[1])

    def _anti_lock(self, spin: Floats) -> None:
        speed = self.speed
        if speed < _MIN_SLIP_SPEED:
            self._release[:] = 1.0
            return
        slip = 1.0 - spin * QUAD.wheel_radius / speed
        locking = (slip > self._hidden.slip) & (self._pressure > 0.05 * self._full)
        self._release = _eased(self._release, locking)

    def _traction(self, torque: float, spin: Floats) -> Floats:
        """Torque of each wheel, less for a spinning one [N m]."""
        spinning = spin * QUAD.wheel_radius > max(1.15 * self.speed, self.speed + 0.25)
        self._driven = _eased(self._driven, spinning)
        return torque * self._driven

    def _steering(self, curvature: float) -> tuple[float, float]:
        """Steering angles of the front wheels (Ackermann) [rad]."""
        length, half = QUAD.wheelbase, 0.5 * QUAD.track_width
        left, right = (math.atan2(length * curvature, 1.0 - s * half * curvature) for s in (1, -1))
        return min(max(left, -_MAX_STEER), _MAX_STEER), min(max(right, -_MAX_STEER), _MAX_STEER)

    def _surfaces(self) -> Ints:
        where = self.data.geom_xpos[self._tyres]
        return self.terrain.surface_at(where[:, 0], where[:, 1])

    @property
    def surface(self) -> int:
        """Index of the surface under the middle of the wheelbase."""
        x, y, _ = self.pose
        return int(self.terrain.surface_at(np.array([x]), np.array([y]))[0])

    @property
    def loads(self) -> Floats:
        """Normal loads, front left, front right, rear left, rear right, shape (4,) [N]."""
        return np.asarray(self.data.sensordata)

    def update_motion(self) -> None:
        """Compute speed, pose and pitch, once per step."""
        w, i, j, k = (float(q) for q in self.data.qpos[3:7])
        ahead = (1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j + w * k), 2.0 * (i * k - w * j))
        east, north, up = (float(v) for v in self.data.qvel[:3])
        self.speed = ahead[0] * east + ahead[1] * north + ahead[2] * up
        x, y = (float(q) for q in self.data.qpos[:2])
        self.pose = (x, y, math.atan2(ahead[1], ahead[0]))
        self.pitch = -math.asin(min(max(ahead[2], -1.0), 1.0))
