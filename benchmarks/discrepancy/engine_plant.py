"""A sprung four-wheeler in a physics engine (MuJoCo), in which effects arise from physics.

Heavier bodies, wind on the body, brakes that fade with their heat, slippery ground, viscous
bearings, slow hydraulics: none is a term of the braking model. The ground is a plane; gravity is
tilted instead, along the path as the grade does. The body dives, rocks and slips, and its pitch is
that of an attitude sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from .effect_plant import GRAVITY, DrivenStops
from .plant_physics import Floats, Stops

TICK = 0.01
"""Period of brakes, drive and gravity [s]."""

BEFORE = 1.2
"""Logged time before each command [s]."""

MASS, RADIUS = 500.0, 0.28  # [kg], [m] of a wheel

_STEP = 0.0025  # [s] of the engine
_SETTLE = 0.5  # [s] at speed before the log begins
_MAX_STOP = 8.0  # [s]
_AFTER_STANDSTILL = 1.2  # [s] simulated while the body rocks back
_WHEELS = (("fl", 0.6, 0.5), ("fr", 0.6, -0.5), ("rl", -0.6, 0.5), ("rr", -0.6, -0.5))  # x, y [m]
_WHEEL_MASS = 12.0  # [kg]
_SPRING, _DAMPER = 45000.0, 2200.0  # [N/m], [N s/m] of one wheel
_FRONT_SHARE = 0.6  # of the brake torque [1]
_MIN_BRAKES = 0.25  # share left by heat at least [1]
_GAIN = 8.0  # [1/s] of the speed controller


@dataclass(frozen=True, slots=True, kw_only=True)
class Nature:
    """True parameters of the engine; the defaults are a vehicle without effects.

    Attributes:
        brake: torque of all wheels at the rims over the dry weight [1].
        resistance: rolling resistance over the load [1].
        friction: friction of the tyres [1].
        delay: dead time of the command [s].
        build_up: time constant of the hydraulics [s].
        payload: [kg] from run ``payload_run`` on. repair: factor on the brakes from that run on.
        air: force on the body per relative air speed squared [N s²/m²]; wind [m/s] blows against
            a vehicle that heads towards ``wind_from`` [rad].
        bearing: viscous torque of each axle [N m s].
        fading: share of the brakes lost per heat, linear, down to a quarter [kg/J].
        cooling: time constant of that heat [s].
        glazing: share of the brakes lost per second of the session [1/s].
        slippery: x, y, radius [m] and friction [1] of an area.
    """

    brake: float = 0.42
    resistance: float = 0.03
    friction: float = 0.9
    delay: float = 0.22
    build_up: float = 0.012
    payload: float = 0.0
    repair: float = 1.0
    payload_run: int = 10**9
    air: float = 0.0
    wind: float = 0.0
    wind_from: float = 0.0
    bearing: float = 0.0
    fading: float = 0.0
    cooling: float = 150.0
    glazing: float = 0.0
    slippery: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.9)


def drive(nature: Nature, stops: Stops) -> DrivenStops:
    """Drive all stops in their order, sampled every two ticks from :data:`BEFORE` each command."""
    vehicle = _Vehicle(nature)
    traces = [vehicle.stop(stops, i) for i in range(len(stops.speed))]
    time = np.arange(-round(BEFORE / TICK), round(_MAX_STOP / TICK)) * TICK
    table = np.stack([trace[::2] for trace in traces])
    speed, station, x, y, yaw, rate, grade, roll = np.moveaxis(table, 2, 0)
    rest, distance = np.full(len(traces), np.inf), np.full(len(traces), np.inf)
    for i, trace in enumerate(traces):
        crossed = np.flatnonzero((trace[:, 0] <= 0.0) & (time > 0.0))
        if len(crossed):
            rest[i], distance[i] = time[crossed[0]], trace[crossed[0], 1]
    none = np.zeros(len(traces))
    sampled: Floats = np.asarray(time[::2], np.float64)
    return DrivenStops(sampled, speed, station, x, y, yaw, rate, grade, roll, rest, distance, none)


class _Vehicle:
    """Vehicle of a session; its brakes stay warm from stop to stop."""

    def __init__(self, nature: Nature) -> None:
        self.nature = nature
        self.model = mujoco.MjModel.from_xml_string(_scene(nature))
        self.data = mujoco.MjData(self.model)
        self.body = self.model.body("chassis").id
        self.axles = np.array([self.model.joint(f"axle_{w}").dofadr[0] for w, _, _ in _WHEELS])
        self.tyres = np.array([self.model.geom(w).id for w, _, _ in _WHEELS])
        share = np.array([_FRONT_SHARE] * 2 + [1.0 - _FRONT_SHARE] * 2) / 2.0
        self.full = share * nature.brake * MASS * GRAVITY * RADIUS
        self.dry = (self.model.body_mass.copy(), self.model.body_inertia.copy())
        self.heat, self.since = 0.0, 0.0

    def stop(self, stops: Stops, i: int) -> Floats:
        """Rows of speed, station, x, y, yaw, yaw rate, −pitch, roll at each tick of one stop."""
        nature, data = self.nature, self.data
        self._load(i)
        v, heading = float(stops.speed[i]), float(stops.heading[i])
        lead = v * (BEFORE + _SETTLE)
        mujoco.mj_resetData(self.model, data)
        data.qpos[:3] = (
            stops.x[i] - lead * math.cos(heading),
            stops.y[i] - lead * math.sin(heading),
            RADIUS,
        )
        data.qpos[3:7] = (math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading))
        data.qvel[:2] = (v * math.cos(heading), v * math.sin(heading))
        data.qvel[self.axles] = v / RADIUS
        strength = float(stops.friction[i])
        strength *= 1.0 - nature.glazing * float(stops.clock[i])
        if i >= nature.payload_run:
            strength *= nature.repair
        self.heat *= math.exp(-(float(stops.clock[i]) - self.since) / nature.cooling)
        onset = nature.delay + float(stops.delay[i])
        pressure = 0.0
        keep = math.exp(-TICK / nature.build_up)
        rows = np.empty((round((BEFORE + _MAX_STOP) / TICK), 8))
        start = -round((BEFORE + _SETTLE) / TICK)
        station, stood = -lead, 0
        for tick in range(start, round(_MAX_STOP / TICK)):
            grade = float(
                stops.grade[i]
                + stops.wave[i]
                * math.sin(2.0 * math.pi * station / stops.wave_length[i] + stops.wave_phase[i])
            )
            self._tilt_gravity(grade, float(stops.roll[i]), heading)
            speed, row = self._row(station, grade, float(stops.roll[i]))
            if tick - start >= round(_SETTLE / TICK):
                rows[tick + round(BEFORE / TICK) :] = row
            stood += tick > 0 and (speed <= 0.0 or stood > 0)
            if stood > _AFTER_STANDSTILL / TICK:
                break
            # Share of this tick after the dead time.
            braking = min(max((tick + 1) - onset / TICK, 0.0), 1.0)
            pressure = braking + (pressure - braking) * keep
            self._brake(pressure * strength)
            force = MASS * (_GAIN * (v - speed) + GRAVITY * (math.sin(grade) + nature.resistance))
            data.ctrl[:] = (1.0 - braking) * force * RADIUS / 4.0
            self._wind()
            self._slip()
            mujoco.mj_step(self.model, data, nstep=round(TICK / _STEP))
            station += TICK * max(0.5 * (speed + self._speed()), 0.0)
        self.since = float(stops.clock[i])
        return rows

    def _load(self, run: int) -> None:
        extra = self.nature.payload if run >= self.nature.payload_run else 0.0
        mass, inertia = self.dry
        self.model.body_mass[:], self.model.body_inertia[:] = mass, inertia
        self.model.body_mass[self.body] += extra
        self.model.body_inertia[self.body] *= 1.0 + extra / mass[self.body]
        mujoco.mj_setConst(self.model, self.data)

    def _tilt_gravity(self, grade: float, roll: float, heading: float) -> None:
        ahead, left = -math.sin(grade), -math.cos(grade) * math.sin(roll)
        c, s = math.cos(heading), math.sin(heading)
        self.model.opt.gravity[:] = (
            GRAVITY * (ahead * c - left * s),
            GRAVITY * (ahead * s + left * c),
            -GRAVITY * math.cos(grade) * math.cos(roll),
        )

    def _frame(self) -> Floats:
        frame: Floats = self.data.xmat[self.body].reshape(3, 3)
        return frame

    def _speed(self) -> float:
        w, i, j, k = self.data.qpos[3:7]
        ahead = (1.0 - 2.0 * (j * j + k * k), 2.0 * (i * j + w * k), 2.0 * (i * k - w * j))
        return float(np.dot(ahead, self.data.qvel[:3]))

    def _row(self, station: float, grade: float, roll: float) -> tuple[float, tuple[float, ...]]:
        w, i, j, k = (float(q) for q in self.data.qpos[3:7])
        up = 2.0 * (i * k - w * j)
        yaw = math.atan2(2.0 * (i * j + w * k), 1.0 - 2.0 * (j * j + k * k))
        roll_angle = math.asin(min(max(2.0 * (j * k + w * i), -1.0), 1.0))
        speed = self._speed()
        x, y = (float(q) for q in self.data.qpos[:2])
        rate = float(self.data.qvel[5])
        return speed, (speed, station, x, y, yaw, rate, grade + math.asin(up), roll + roll_angle)

    def _brake(self, pressure: float) -> None:
        nature, spin = self.nature, self.data.qvel[self.axles]
        hot = max(1.0 - nature.fading * self.heat, _MIN_BRAKES)
        rolling = nature.resistance * MASS * GRAVITY * RADIUS / 4.0
        torque = self.full * pressure * hot
        self.heat += TICK * (float(np.abs(spin) @ torque) / MASS - self.heat / nature.cooling)
        self.model.dof_frictionloss[self.axles] = torque + rolling

    def _wind(self) -> None:
        nature = self.nature
        if nature.air == 0.0:
            return
        ahead = self._frame()[:, 0]
        yaw = math.atan2(ahead[1], ahead[0])
        u = self._speed() + nature.wind * math.cos(yaw - nature.wind_from)
        self.data.xfrc_applied[self.body, :3] = -nature.air * abs(u) * u * ahead

    def _slip(self) -> None:
        x, y, radius, friction = self.nature.slippery
        where = self.data.geom_xpos[self.tyres]
        inside = (where[:, 0] - x) ** 2 + (where[:, 1] - y) ** 2 <= radius**2
        self.model.geom_friction[self.tyres, 0] = np.where(inside, friction, self.nature.friction)


def _scene(nature: Nature) -> str:
    chassis = MASS - 4.0 * _WHEEL_MASS
    sag = chassis / 4.0 * GRAVITY / _SPRING
    spin = 0.6 * _WHEEL_MASS * RADIUS**2
    wheels = "".join(
        f"""<body name="{name}" pos="{x} {y} 0">
          <joint type="slide" axis="0 0 1" stiffness="{_SPRING}" damping="{_DAMPER}"
                 springref="-{sag}" range="-.15 .15" limited="true"/>
          <joint name="axle_{name}" type="hinge" axis="0 1 0" frictionloss="1"
                 damping="{nature.bearing}" solreffriction=".005 1" solimpfriction=".98 .999 .01"/>
          <inertial pos="0 0 0" mass="{_WHEEL_MASS}"
                    diaginertia="{0.6 * spin} {spin} {0.6 * spin}"/>
          <geom name="{name}" type="sphere" size="{RADIUS}" priority="1" condim="3"
                friction="{nature.friction} 0 0" solref=".02 1" solimp=".95 .99 .002"/>
        </body>"""
        for name, x, y in _WHEELS
    )
    motors = "".join(f'<motor joint="axle_{name}"/>' for name, _, _ in _WHEELS)
    return f"""<mujoco>
      <compiler angle="radian"/>
      <option timestep="{_STEP}" integrator="implicitfast" cone="elliptic" impratio="100"
              iterations="12"/>
      <worldbody>
        <geom type="plane" size="1 1 1"/>
        <body name="chassis" pos="0 0 {RADIUS}">
          <freejoint/>
          <inertial pos="0 0 0.3" mass="{chassis}" diaginertia="35 110 120"/>
          {wheels}
        </body>
      </worldbody>
      <actuator>{motors}</actuator>
    </mujoco>"""
