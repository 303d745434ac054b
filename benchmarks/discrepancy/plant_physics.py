"""Parameters of a stopping vehicle's world, and of the stops that it drives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Physics(NamedTuple):
    """Base model and all effects that may act in addition; defaults are absent effects.

    Attributes:
        m_m, b_m, m_b, b_b, dead_time: F_b/W = (m_m v_i + b_m) θ + m_b v_i + b_b after dead_time.
        drag: a += drag v² [1/m]; viscous: a += g viscous v [s/m].
        wind_drag, wind, wind_direction: a += c (|u| u − v²), u = v + wind cos(yaw − direction).
        lag: time constant of the force after the onset [s].
        fade, fade_tau: F/(1 + fade q), dq/dt = braking power per mass − q/fade_tau.
        friction: F_b/W ≤ friction cos θ cos φ, a share of the load on the ground.
        asymmetry, nonlinearity, cross_slope: F_b/W += k max(θ, 0), k θ|θ|, k |φ|.
        turning: a += g k |yaw rate|.
        patch, patch_x, patch_y, patch_radius: F_b/W += patch inside a circle; patch_2 … patch_4
            likewise.
        furrow, furrow_direction: F_b/W += k cos 2(yaw − direction).
        step_scale, step_delta, step_run: from that run on F_b/W × scale + delta.
        drift: F_b/W += k t.
        ambient: F_b/W += k column, another column of the log.
        ripple, ripple_length: F_b/W += A sin(2π x/length), x on the map.
        bump, bump_grade, bump_width: F_b/W += A exp(−((θ − θ₀)/w)²).
        grab, grab_speed: F_b/W += A exp(−v/v₀).
        overshoot, overshoot_time: F_b/W += A exp(−((t − T)/(T/2))²), t since the onset.
    """

    m_m: float
    b_m: float
    m_b: float
    b_b: float
    dead_time: float
    drag: float = 0.0
    viscous: float = 0.0
    wind_drag: float = 0.0
    wind: float = 0.0
    wind_direction: float = 0.0
    lag: float = 0.0
    fade: float = 0.0
    fade_tau: float = 100.0
    friction: float = 100.0
    asymmetry: float = 0.0
    nonlinearity: float = 0.0
    cross_slope: float = 0.0
    turning: float = 0.0
    patch: float = 0.0
    patch_x: float = 0.0
    patch_y: float = 0.0
    patch_radius: float = 1.0
    patch_2: float = 0.0
    patch_2_x: float = 0.0
    patch_2_y: float = 0.0
    patch_2_radius: float = 1.0
    patch_3: float = 0.0
    patch_3_x: float = 0.0
    patch_3_y: float = 0.0
    patch_3_radius: float = 1.0
    patch_4: float = 0.0
    patch_4_x: float = 0.0
    patch_4_y: float = 0.0
    patch_4_radius: float = 1.0
    furrow: float = 0.0
    furrow_direction: float = 0.0
    step_scale: float = 1.0
    step_delta: float = 0.0
    step_run: float = 1e9
    drift: float = 0.0
    ambient: float = 0.0
    ripple: float = 0.0
    ripple_length: float = 1.0
    bump: float = 0.0
    bump_grade: float = 0.0
    bump_width: float = 1.0
    grab: float = 0.0
    grab_speed: float = 1.0
    overshoot: float = 0.0
    overshoot_time: float = 1.0


class Stops(NamedTuple):
    """Driven stops, one run per stop; every field has shape (n,).

    Attributes:
        speed: speed until the onset [m/s].
        grade, wave, wave_length, wave_phase: θ(s) = grade + wave sin(2π s/length + phase).
        roll, curvature: roll and path curvature [rad], [1/m].
        heading, x, y: pose at the stop command [rad], [m].
        clock: time of the command in the log [s].
        ambient: value of the further column [1].
        friction: factor on the force of this stop [1].
        delay: addition to the dead time [s].
    """

    speed: Floats
    grade: Floats
    wave: Floats
    wave_length: Floats
    wave_phase: Floats
    roll: Floats
    curvature: Floats
    heading: Floats
    x: Floats
    y: Floats
    clock: Floats
    ambient: Floats
    friction: Floats
    delay: Floats
