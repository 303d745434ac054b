"""A skid-steered vehicle that shares no code with the estimator: four contact points in the plane.

Every wheel has its own normal load from a moment balance, rolls with f_r and is dragged sideways
with μ_t; motor currents follow from the forces that balance these, the slope and the inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

G = 9.80665


@dataclass(frozen=True)
class Body:
    mass: float = 30.0
    wheelbase: float = 0.55
    track_width: float = 0.60
    cg_z: float = 0.20
    wheel_radius: float = 0.13
    torque_constant: float = 0.044
    gear_ratio: float = 78.71
    idle_current: float = 0.5
    yaw_lag: float = 0.12  # [s] from rim speeds to yaw rate


@dataclass(frozen=True)
class Ground:
    f_r: float
    mu_t: float
    slip_track: float


ASPHALT = Ground(0.03, 0.26, 1.00)
DIRT = Ground(0.13, 0.20, 1.15)
PLOWED = Ground(0.21, 0.16, 1.26)
SAND = Ground(0.30, 0.11, 1.62)


def square(sides=4, straight=8.0, turn=2.0, speed=0.5, rate=np.pi / 4, on_the_spot=True):
    """(duration, v, yaw rate) of each leg: straights and quarter turns, rest at both ends."""
    legs = [(2.0, 0.0, 0.0)]
    for _ in range(sides):
        legs += (
            [(straight, speed, 0.0), (0.3, 0.0, 0.0)] if on_the_spot else [(straight, speed, 0.0)]
        )
        legs += [(turn, 0.0 if on_the_spot else speed, rate)]
        if on_the_spot:
            legs += [(0.3, 0.0, 0.0)]
    return [*legs, (2.0, 0.0, 0.0)]


def drive(
    legs,
    ground,
    body=Body(),
    *,
    dt=0.01,
    pitch=0.0,
    roll=0.0,
    gyro_std=0.02,
    gyro_bias=0.0,
    current_std=0.2,
    encoder_std=0.005,
    seed=0,
):
    """Columns of a drive log. ``ground`` may be a function of time, as may the wheels' grip.

    A leg with NaN yaw rate is driven stuck: rim speeds ±0.3 m/s that do not turn the body.
    """
    random = np.random.default_rng(seed)
    ends = np.cumsum([leg[0] for leg in legs])
    t = np.arange(0.0, ends[-1], dt)
    leg = np.searchsorted(ends, t, side="right").clip(max=len(legs) - 1)
    v = np.array([x[1] for x in legs])[leg]
    rates = np.array([x[2] for x in legs])[leg]
    stuck = np.isnan(rates)
    grounds = [ground(s) if callable(ground) else ground for s in t]
    b_s = np.array([g.slip_track for g in grounds])
    difference = np.where(stuck, 0.6, np.nan_to_num(rates) * b_s)
    target = np.where(stuck, 0.0, difference / b_s)

    # A first-order lag, with rim speeds linear between samples: its exact solution.
    decay = np.exp(-dt / body.yaw_lag)
    lag = body.yaw_lag / dt * (1.0 - decay)
    start = [(lag - 1.0) * target[0]]  # no rotation yet
    w = lfilter([1.0 - lag, lag - decay], [1.0, -decay], target, zi=start)[0]
    v_left, v_right = v - 0.5 * difference, v + 0.5 * difference
    left, right = _thrusts(body, grounds, v_left, v_right, w, v, pitch, roll)
    per_ampere = body.gear_ratio * body.torque_constant / body.wheel_radius
    currents = [
        force / per_ampere
        + body.idle_current * np.sign(rim)
        + random.normal(0, current_std, t.size)
        for force, rim in ((left, v_left), (right, v_right))
    ]
    return {
        "t": t,
        "v": v,
        "v_cmd": v,
        "pitch": np.full(t.size, pitch),
        "roll": np.full(t.size, roll),
        "yaw_rate": w + gyro_bias + random.normal(0.0, gyro_std, t.size),
        "v_left": v_left + encoder_std * random.normal(size=t.size) * (v_left != 0.0),
        "v_right": v_right + encoder_std * random.normal(size=t.size) * (v_right != 0.0),
        "current_left": currents[0],
        "current_right": currents[1],
    }


def _thrusts(body, grounds, v_left, v_right, w, v, pitch, roll):
    """Forward forces of the sides: along the vehicle and about its vertical axis they balance."""
    f_r = np.array([g.f_r for g in grounds])
    mu = np.array([g.mu_t for g in grounds])
    W, B, L = body.mass * G, body.track_width, body.wheelbase
    down = W * np.cos(pitch) * np.cos(roll)
    # left side up, or a left turn, presses on the right wheels: moments about the ground line
    tilt = (W * np.cos(pitch) * np.sin(roll) + body.mass * v * w) * body.cg_z / B
    load_left, load_right = 0.5 * down - tilt, 0.5 * down + tilt
    rolling_left = f_r * load_left * np.sign(v_left)
    rolling_right = f_r * load_right * np.sign(v_right)
    along_slope = W * np.sin(-pitch)
    # each wheel is L/2 ahead of or behind the pole and dragged sideways
    moment = mu * W * (L / 2) * np.tanh(w / 0.01)
    pull = moment / B
    driving = (np.abs(v_left) + np.abs(v_right)) > 0.0
    left = rolling_left + 0.5 * along_slope - pull
    right = rolling_right + 0.5 * along_slope + pull
    return left * driving, right * driving
