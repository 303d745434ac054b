"""A vehicle of free bodies for MuJoCo: a body on four sprung wheels over a plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .effect_plant import GRAVITY

_SOFTEST = (
    0.05  # largest angle by which the body leans on its springs under brakes or in curves [rad]
)
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
    wheel_share: float  # mass of a wheel over that of the car [1]
    frequency: float  # of the body on its springs [Hz]
    damping: float  # of it [1]
    m_m: float
    b_m: float
    m_b: float
    b_b: float
    front: float  # share of the brakes [1]
    rolling: float = 0.02  # resistance [1]
    dead_time: float = 0.2
    build_up: float = 0.015  # time constant [s]
    lag_behind: float = 0.0  # share by which the speed stays below the commanded one [1]
    sensor: float = 0.0  # height of the speed sensor over the hinges [m]; 0 measures at the wheels
    slow: float = 0.0  # time constant of its filter [s]
    mount: float = 0.0  # pitch of the pitch sensor's mount, uphill positive [rad]

    @property
    def spin(self) -> float:
        """Mass that turning wheels add, as a share of the mass: homogeneous discs."""
        return 2.0 * self.wheel_share

    @property
    def force(self) -> float:
        """Braking force over the weight on level ground, at standstill [1]."""
        return (self.b_b + self.rolling) / (1.0 + self.spin)


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
    return EngineCar(
        mass=float(np.clip(60.0 * 15.0**large * rng.uniform(0.7, 1.4), 60.0, 900.0)),
        wheelbase=wheelbase,
        track=track,
        height=height,
        radius=0.12 + 0.2 * large,
        ahead=ahead,
        wheel_share=float(rng.uniform(0.008, 0.025)),
        frequency=max(float(rng.uniform(1.0, 5.0)), softest),
        damping=float(rng.uniform(0.2, 0.5)),
        m_m=float(rng.uniform(-0.02, 0.02)),
        b_m=float(rng.uniform(-0.1, 0.1)),
        m_b=float(rng.uniform(-0.008, 0.008)),
        b_b=level,
        front=0.5 + ahead + level * height / wheelbase + float(rng.uniform(-0.04, 0.04)),
        rolling=float(rng.uniform(0.01, 0.05)),
        dead_time=float(rng.uniform(0.1, 0.35)),
        build_up=float(rng.uniform(0.005, 0.035)),
        lag_behind=float(rng.uniform(0.0, 0.015)),
        sensor=float(rng.choice([0.0, 1.0]) * rng.uniform(0.3, 1.2) * height),
        slow=float(rng.uniform(0.0, 0.02)),
        mount=float(rng.uniform(-0.01, 0.01)),
    )


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
