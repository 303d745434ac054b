"""A car of free bodies in MuJoCo: four sprung wheels on a plane, brakes as dry friction of hinges.

Wheels roll by contact with the plane and lock where it grips less than they brake. All of them
steer, front against rear, by hinges turned for each stop, so that none is dragged sideways. Grade
and cross slope tilt gravity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import world_changes, world_logs
from .effect_plant import GRAVITY, DrivenStops
from .plant_physics import Floats, Stops, draw_ranged, ranged
from .world_changes import Changes

_STEP, _HOLD = 0.002, 2  # step of the engine [s], and steps for which forces hold
_SETTLE = 0.5  # driven before the log begins, so that the body rests on its springs [s]
_AFTER = 1.1  # driven after standstill [s]
_GRIP = 1.2  # of wheels on the plane, beyond any brake [1]
_GAIN = 8.0  # of the speed controller [1/s]
_INTEGRAL = 6.0  # of the speed controller [1/s²]
_MAX_STEER = 0.15  # of each wheel [rad]
_STANDSTILL = 0.01  # [m/s] at the wheels
_SPINS = slice(7, 14, 2)  # degrees of freedom of the four hinges

_SOFTEST = 0.05  # largest angle by which the body rolls or pitches on its springs [rad]
_SIDEWAYS = 0.2  # lateral acceleration that the springs are chosen for, over gravity [1]


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineCar:
    """One vehicle, SI; forces of its brakes as shares of its weight, fixed at the onset."""

    mass: float
    wheelbase: float
    track: float
    height: float  # of the sprung body's centre of gravity
    radius: float
    ahead: float  # that centre ahead of the middle, share of the wheelbase [1]
    wheel_share: float = ranged(0.008, 0.025)  # mass of a wheel over that of the car [1]
    frequency: float = ranged(1.0, 5.0)  # of the body on its springs [Hz]
    damping: float = ranged(0.2, 0.5)  # of it [1]
    m_m: float = ranged(-0.02, 0.02)
    b_m: float = ranged(-0.1, 0.1)
    m_b: float = ranged(-0.008, 0.008)
    b_b: float
    front: float = ranged(-0.04, 0.04)  # share of the brakes; the range is around the ideal one [1]
    rolling: float = ranged(0.01, 0.05)  # resistance [1]
    dead_time: float = ranged(0.1, 0.35)
    build_up: float = ranged(0.005, 0.035)  # time constant [s]
    lag_behind: float = ranged(0.0, 0.015)  # share by which the speed stays below the command [1]
    sensor: float  # height of the speed sensor over the hinges [m]; 0 measures at the wheels
    slow: float  # time constant of its filter [s]
    mount: float  # pitch of the pitch sensor's mount, uphill positive [rad]

    @property
    def spin(self) -> float:
        """Mass that turning wheels add, as a share of the mass: homogeneous discs."""
        return 2.0 * self.wheel_share

    @property
    def force(self) -> float:
        """Braking force over the weight on level ground, at standstill [1]."""
        return (self.b_b + self.rolling) / (1.0 + self.spin)

    @property
    def table(self) -> dict[str, float | str]:
        cg_x = (0.5 + self.ahead) * self.wheelbase
        sizes = (self.wheelbase, self.track, cg_x, self.height, self.radius)
        return world_logs.vehicle_table(self.mass, *sizes)


def draw_car(rng: np.random.Generator) -> EngineCar:
    """Draw a vehicle between a small robot and a utility car."""
    large = float(rng.random())
    wheelbase = 0.6 + 2.0 * large
    track = wheelbase * float(rng.uniform(0.6, 0.85))
    height = min(float(rng.uniform(0.25, 0.45)) + 0.25 * large, 0.45 * wheelbase, 0.7 * track)
    level = float(rng.uniform(0.3, 0.5))
    # Springs that a vehicle of this height stands on without leaning too far.
    pitch = level * GRAVITY * height / (0.5 * wheelbase) ** 2
    roll = _SIDEWAYS * GRAVITY * height / (0.5 * track) ** 2
    softest = math.sqrt(max(pitch, roll) / _SOFTEST) / (2.0 * math.pi)
    ahead = float(rng.uniform(-0.05, 0.05))
    mass = float(np.clip(60.0 * 15.0**large * rng.uniform(0.7, 1.4), 60.0, 900.0))
    numbers = draw_ranged(EngineCar, rng)
    numbers["frequency"] = max(numbers["frequency"], softest)
    numbers["front"] += 0.5 + ahead + level * height / wheelbase
    sensor = float(rng.choice([0.0, 1.0]) * rng.uniform(0.3, 1.2) * height)
    slow, mount = rng.uniform((0.0, -0.01), (0.02, 0.01)).tolist()
    numbers |= {"mass": mass, "wheelbase": wheelbase, "track": track, "height": height}
    numbers |= {"radius": 0.12 + 0.2 * large, "ahead": ahead, "b_b": level}
    return EngineCar(**numbers, sensor=sensor, slow=slow, mount=mount)


_WORLD = """<mujoco>
<option timestep="{step}" integrator="implicitfast" cone="elliptic" impratio="10"/>
<default><geom {stiff}/><joint {stiff_brakes}/></default>
<worldbody><geom type="plane" size="0 0 1" contype="0" conaffinity="1"/><body pos="0 0 {radius}">
<freejoint/><inertial pos="{x} 0 {z}" mass="{mass}" diaginertia="{inertia}"/>{wheels}</body>
</worldbody></mujoco>"""

_STIFF = 'solref{0}="0.005 1" solimp{0}="0.99 0.999 0.001"'
"""Contacts and brakes that creep by millimetres a second."""

_WHEEL = """<body pos="{x} {y} 0"><inertial pos="0 0 0" mass="{mass}" diaginertia="{i} {i} {i}"/>
<joint type="slide" axis="0 0 1" stiffness="{k}" damping="{c}" springref="{preload}"/>
<joint type="hinge" axis="0 1 0" frictionloss="0.001"/>
<geom type="sphere" size="{radius}" contype="1" conaffinity="0"/></body>"""


def build(car: EngineCar, step: float) -> Any:
    """The engine's model of a car."""
    import mujoco

    mass = car.mass * (1.0 - 4.0 * car.wheel_share)
    wheels = ""
    for end, side in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        load = mass * (0.25 + 0.5 * end * car.ahead)
        k = load * (2.0 * math.pi * car.frequency) ** 2
        wheels += _WHEEL.format(
            x=0.5 * end * car.wheelbase,
            y=0.5 * side * car.track,
            mass=car.wheel_share * car.mass,
            i=0.5 * car.wheel_share * car.mass * car.radius**2,
            k=k,
            c=2.0 * car.damping * math.sqrt(k * load),
            preload=-load * GRAVITY / k,
            radius=car.radius,
        )
    around = (0.4 * car.track, 0.38 * car.wheelbase, 0.44 * car.wheelbase)  # radii of gyration
    text = _WORLD.format(
        step=step,
        radius=car.radius,
        x=car.ahead * car.wheelbase,
        z=car.height - car.radius,
        mass=mass,
        inertia=" ".join(str(mass * r**2) for r in around),
        wheels=wheels,
        stiff=_STIFF.format(""),
        stiff_brakes=_STIFF.format("friction"),
    )
    return mujoco.MjModel.from_xml_string(text)


def drive(
    car: EngineCar,
    changes: Changes,
    stops: Stops,
    before: float = world_logs.BEFORE,
    step: float = _STEP,
) -> DrivenStops:
    """Drive all stops in their order, sampled from ``before`` [s] each command, as sensed."""
    model = build(car, step)
    model.geom_friction[:, 0] = changes.grip or _GRIP
    model.dof_damping[_SPINS] = changes.viscous * car.mass * GRAVITY * car.radius**2 / 4.0
    time = world_logs.sample_times(before)
    stopped, ends, heat = [], [], 0.0
    for i in range(len(stops.speed)):
        gone = float(stops.clock[i] - stops.clock[i - 1]) if i else 0.0
        heat *= math.exp(-gone / changes.cooling)
        rows, rest, heat = _Stop(car, changes, stops, i, model).run(time, heat)
        stopped.append(rows)
        ends.append((rest, rows[min(int(np.searchsorted(time, rest)), len(time) - 1), 1]))
    speed, station, x, y, yaw, rate, grade, roll = np.moveaxis(np.stack(stopped), 2, 0)
    rest, distance = np.array(ends).T
    still = np.zeros(len(rest))
    poses = (x, y, yaw, rate, grade + car.mount, roll)
    sensed = world_logs.filtered(speed, car.slow)
    return DrivenStops(time, sensed, station, *poses, rest, distance, deceleration=still)


class _Stop:
    """One stop in the engine."""

    def __init__(self, car: EngineCar, changes: Changes, stops: Stops, i: int, model: Any) -> None:
        import mujoco

        self.car, self.changes, self.model = car, changes, model
        self.data, self.step = mujoco.MjData(model), mujoco.mj_step
        self.grade, self.roll = float(stops.grade[i]), float(stops.roll[i])
        self.wave, self.phase = float(stops.wave[i]), float(stops.wave_phase[i])
        self.wave_length = float(stops.wave_length[i])
        self.heading, self.x, self.y = (float(stops[k][i]) for k in (7, 8, 9))
        self.onset = car.dead_time + float(stops.delay[i])
        self.strength = float(stops.friction[i]) * (changes.factor[i] if changes.factor else 1.0)
        self.speed = float(stops.speed[i]) * (1.0 - car.lag_behind)
        self.lag = changes.lag or car.build_up
        turn = float(np.clip(0.5 * car.wheelbase * stops.curvature[i], -_MAX_STEER, _MAX_STEER))
        steer = math.atan(turn)
        for joint, end in ((2, 1), (4, 1), (6, -1), (8, -1)):
            model.jnt_axis[joint] = (-math.sin(end * steer), math.cos(steer), 0.0)
        self.data.qvel[0] = self.speed
        self.data.qvel[5] = self.speed * 2.0 * turn / car.wheelbase
        self.data.qvel[_SPINS] = self.speed / car.radius
        # Views, for they are written in every step.
        self.gravity, self.loss = model.opt.gravity, model.dof_frictionloss[_SPINS]
        self.drive, self.air = self.data.qfrc_applied[_SPINS], self.data.xfrc_applied[1]
        self.front = 0.5 * car.front * car.mass * GRAVITY * car.radius
        self.rear = 0.5 * (1.0 - car.front) * car.mass * GRAVITY * car.radius
        self.integral, self.v_i, self.station, self.before = math.nan, self.speed, 0.0, self.speed

    def run(self, time: Floats, heat: float) -> tuple[Floats, float, float]:
        """Rows of speed, station, x, y, yaw, yaw rate, grade, roll; time of rest [s]; heat."""
        rows = np.zeros((len(time), 8))
        hold = _HOLD * float(self.model.opt.timestep)
        t, k, rest = -(_SETTLE - float(time[0])), 0, math.inf
        while k < len(time) and t < rest + _AFTER:
            v, row = self._sense()
            if t >= time[k] - 1e-9:
                rows[k], k = row, k + 1
            if t >= self.onset and v <= _STANDSTILL and math.isinf(rest):
                rest = t
            braked = self._push(t + 0.5 * hold, row, v, heat)
            self.step(self.model, self.data, _HOLD)
            self.station += hold * max(v, 0.0)
            heat += hold * (GRAVITY * braked * max(v, 0.0) - heat / self.changes.cooling)
            t += hold
        rows[k:] = rows[k - 1]
        rows[k:, [0, 5]] = 0.0
        rows[:, 1] -= rows[int(np.searchsorted(time, 0.0)), 1]
        return rows, rest, heat

    def _sense(self) -> tuple[float, tuple[float, ...]]:
        """Speed of the body, and what sensors show."""
        q, u = self.data.qpos.tolist(), self.data.qvel.tolist()
        a, b, c, d = q[3:7]
        yaw = math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (a * c - b * d))))
        tilt = math.atan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c))
        v = u[0] * math.cos(yaw) + u[1] * math.sin(yaw)
        wheels = 0.25 * self.car.radius * (u[7] + u[9] + u[11] + u[13])
        sensed = v + self.car.sensor * u[4] if self.car.sensor else wheels
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        x, y = self.x + cos * q[0] - sin * q[1], self.y + sin * q[0] + cos * q[1]
        grade = self._slope() - pitch
        roll = self.roll + tilt
        return v, (sensed, self.station, x, y, self.heading + yaw, u[5], grade, roll)

    def _slope(self) -> float:
        turn = 2.0 * math.pi * self.station / self.wave_length + self.phase
        return self.grade + self.wave * math.sin(turn)

    def _push(self, t: float, row: tuple[float, ...], v: float, heat: float) -> float:
        """Set gravity, forces and brakes for a time; returns the force of the brakes [1]."""
        car, changes, yaw, slope = self.car, self.changes, row[4] - self.heading, self._slope()
        cos, sin = math.cos(yaw), math.sin(yaw)
        back = GRAVITY * math.sin(slope)
        side = -GRAVITY * math.cos(slope) * math.sin(self.roll)
        down = -GRAVITY * math.cos(slope) * math.cos(self.roll)
        gravity = (-back * cos - side * sin, -back * sin + side * cos, down)
        self.gravity[:] = gravity
        drag = 0.0
        if changes.air:
            ahead = v + changes.wind * math.cos(row[4] - changes.wind_from)
            drag = changes.air * abs(ahead) * ahead
            self.air[:2] = (-car.mass * drag * cos, -car.mass * drag * sin)
        ground = self._ground(row)
        if t < self.onset:
            self.v_i = v
            if math.isnan(self.integral):
                self.integral = back + drag + GRAVITY * (ground + changes.viscous * v)
            behind = self.speed - v
            self.integral += _INTEGRAL * behind * _HOLD * float(self.model.opt.timestep)
            force = _GAIN * behind + self.integral
            # Resistance that helps is a smaller drive.
            push = 0.25 * car.mass * (force - GRAVITY * min(ground, 0.0)) * car.radius
            self.drive[:] = push
            self._hold(max(ground, 0.0), 0.0)
            return 0.0
        self.drive[:] = 0.0
        level = self._demand(slope) / (1.0 + changes.fade * heat)
        level *= -math.expm1(-(t - self.onset) / self.lag)
        self._hold(ground, level)
        return level

    def _hold(self, ground: float, level: float) -> None:
        """Set the torques that ground and brakes take from each wheel [N m]."""
        resistance = 0.25 * ground * self.car.mass * GRAVITY * self.car.radius
        front = max(self.front * level + resistance, 1e-3)
        rear = max(self.rear * level + resistance, 1e-3)
        self.loss[:] = (front, front, rear, rear)

    def _demand(self, slope: float) -> float:
        """Force of the brakes over the weight when built up [1]."""
        car, changes, v = self.car, self.changes, self.v_i
        level = (car.m_m * v + car.b_m + changes.eager) * slope + car.m_b * v + car.b_b
        level += changes.asymmetry * max(slope, 0.0) + changes.nonlinearity * slope * abs(slope)
        return max(level, 0.0) * self.strength

    def _ground(self, row: tuple[float, ...]) -> float:
        """Resistance of the ground over the weight [1]."""
        changes, (_, station, x, y, yaw, rate) = self.changes, row[:6]
        force = self.car.rolling + changes.cross * abs(self.roll) + changes.turning * abs(rate)
        at_x, at_y, radius, delta = changes.patch
        if radius and math.hypot(x - at_x, y - at_y) < radius:
            force += delta
        if changes.furrows:
            force += changes.furrows * math.cos(2.0 * (yaw - changes.furrows_along))
        if changes.ripple:
            force += changes.ripple * math.sin(2.0 * math.pi * station / changes.ripple_length)
        return force


def make(kind: str, label: str, seed: int) -> world_logs.WorldLog:
    rng = np.random.default_rng((53, seed))
    car = draw_car(rng)
    if "wheel_lockup" in label and not car.sensor:
        car = replace(car, sensor=0.5 * car.height)  # wheels that slide show no speed
    earlier = np.random.default_rng((54, seed))
    return world_logs.car_log(kind, label, car, drive, 0.04, rng, earlier)


def requests(seed: int = 1) -> list[tuple[str, str, int]]:
    return world_changes.requests_of(59 + 1000 * seed, 10, 3, tuple(world_changes.OUTSIDE))
