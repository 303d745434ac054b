"""A vehicle of the vertical plane, between a small robot and a utility car."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .effect_plant import GRAVITY

_SOFTEST = 0.04  # largest angle by which the body pitches on its springs under brakes [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class RockingCar:
    """One vehicle, SI; forces of its brakes as shares of its weight, fixed at the onset."""

    mass: float
    wheelbase: float
    height: float  # of the centre of gravity
    radius: float
    rear: float  # distance from that centre to the rear axle over the wheelbase [1]
    axle_share: float  # mass of each axle over that of the car [1]
    frequency: float  # of the body in heave [Hz]
    damping: float  # of it [1]
    stiffness: float  # of a tyre's force by slip, over its load [1]
    relaxation: float  # of the tyres [m]
    m_m: float
    b_m: float
    m_b: float
    b_b: float
    front: float  # share of the brakes [1]
    rolling: float  # resistance over the load [1]
    dead_time: float
    build_up: float  # of the pressure: mean delay [s]
    play: float  # hysteresis of the pads over the full force [1]
    lag_behind: float  # share by which the speed stays below the commanded one [1]
    counts: int  # per turn of each encoder; 0 has a receiver on the roof
    window: int  # samples that counts are averaged over [1]
    roof: float  # height of the receiver [m]
    late: float  # delay of the receiver [s]
    mount: float  # pitch of the pitch sensor's mount, uphill positive [rad]

    @property
    def force(self) -> float:
        """Braking force over the weight on level ground, at standstill [1]."""
        return (self.b_b * (1.0 - self.play) + self.rolling) / (1.0 + self.axle_share)


def draw_car(rng: np.random.Generator) -> RockingCar:
    """Draw a vehicle between a small robot and a utility car."""
    wheelbase = float(rng.uniform(0.6, 2.6))
    height = min(float(rng.uniform(0.25, 0.7)), 0.45 * wheelbase)
    level, rear = float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.44, 0.56))
    softest = math.sqrt(level * GRAVITY * height / _SOFTEST) / (math.pi * wheelbase)
    radius = float(rng.uniform(0.1, 0.14)) + 0.08 * wheelbase
    return RockingCar(
        mass=float(np.clip(150.0 * wheelbase**1.6 * rng.uniform(0.6, 1.4), 60.0, 900.0)),
        wheelbase=wheelbase,
        height=height,
        radius=radius,
        rear=rear,
        axle_share=float(rng.uniform(0.02, 0.06)),
        frequency=max(float(rng.uniform(1.0, 5.0)), softest),
        damping=float(rng.uniform(0.2, 0.5)),
        stiffness=float(rng.uniform(9.0, 20.0)),
        relaxation=radius * float(rng.uniform(0.3, 0.8)),
        m_m=float(rng.uniform(-0.02, 0.02)),
        b_m=float(rng.uniform(-0.1, 0.1)),
        m_b=float(rng.uniform(-0.008, 0.008)),
        b_b=level,
        front=rear + level * height / wheelbase + float(rng.uniform(-0.04, 0.04)),
        rolling=float(rng.uniform(0.01, 0.05)),
        dead_time=float(rng.uniform(0.1, 0.35)),
        build_up=float(rng.uniform(0.005, 0.035)),
        play=float(rng.uniform(0.0, 0.04)),
        lag_behind=float(rng.uniform(0.0, 0.02)),
        counts=int(rng.integers(100, 401) * (rng.random() < 0.5)),
        window=int(rng.integers(2, 5)),
        roof=height + float(rng.uniform(0.1, 0.5)),
        late=float(rng.uniform(0.03, 0.06)),
        mount=float(rng.uniform(-0.01, 0.01)),
    )
