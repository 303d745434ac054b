"""The stopping path: from which speed can the vehicle still stop before the clear distance?

Two ways to the same answer. Where nothing but the grade acts, the energy that the brakes take out
from onset to the target is an integral that is summed once along the path, and the speed follows
from a quadratic. Where an effect acts on the motion itself, or a load may run short on the way, a
stop is integrated along the path, and :mod:`planner.bounds.integrated_stop` tries for the speed.

Source: Braking (7), (8), (12), with v dv = −a(θ(s), v_i) ds along the varying slope; the dead time
at held speed comes first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.effects import registry
from models.effects.registry import Motion
from models.quantity import GRAVITY
from planner.kernels.compiled import Floats, inlined

STOPPED, OVERRUN, REAR_LOAD, SIDE_LOAD = range(4)
"""How a integrated stop ends."""

_SUBSTEPS = 2
_motion_deceleration = inlined(registry.motion_deceleration)


@inlined
def onset_speed(speed_part: float, intercept_part: float, slowest: float) -> float:
    """Highest speed at onset that the brakes take out over a stretch.

    Args:
        speed_part: integral of the part of F_b/W that grows with v_i, over the stretch [s].
        intercept_part: integral of the other part plus sin θ [m].
        slowest: below it the coefficients no longer change [m/s].

    Returns:
        v with v²/2 = g (max(v, slowest) * speed_part + intercept_part), 0 where there is none
        [m/s].
    """
    half = GRAVITY * speed_part
    root = half * half + 2.0 * GRAVITY * intercept_part
    speed = half + np.sqrt(root) if root > 0.0 else 0.0
    if speed < slowest:
        energy = 2.0 * GRAVITY * (slowest * speed_part + intercept_part)
        speed = min(np.sqrt(energy), slowest) if energy > 0.0 else 0.0
    return float(speed)


class StopPath(NamedTuple):
    """One path as a stop is integrated along it; arrays are (N,).

    Attributes:
        station, grade, sin_grade: terrain.
        lower_slope, lower_intercept, upper_slope, upper_intercept: parts of both forces.
        upright: cos(roll) cos(grade).
        side_speed_sq: highest v² that keeps both sides loaded.
        bend: |curvature| [1/m].
        yaw: heading, without jumps [rad].
    """

    station: Floats
    grade: Floats
    sin_grade: Floats
    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    upright: Floats
    side_speed_sq: Floats
    bend: Floats
    yaw: Floats


@inlined
def integrate_stop(
    k: int, speed: float, target: float, count: int, path: StopPath, slowest: float,
    dead_time: float, motion: Motion, rear_lever: float, min_load: float,
) -> tuple[int, float, float]:  # fmt: skip
    """March one emergency stop from station k along a path.

    Within a step the deceleration is that of its middle, so v² is linear: exact for forces that are
    linear in station, second order for the motion terms.

    Args:
        k: station of the stop command.
        speed: speed there [m/s].
        target: the vehicle must stand here [m].
        count: stations of the path.
        path: terrain and forces along it.
        slowest: speed below which the coefficients no longer change [m/s].
        dead_time: from command to onset [s].
        motion: effects.
        rear_lever: cg_z / (L − cg_x).
        min_load: share of its static load that the rear axle must keep.

    Returns:
        How it ends, where [m], and the least rear load share on the way. Where an overrun ends is
        extrapolated from the first station behind the target.
    """
    station, grade, sin_grade, upright = path.station, path.grade, path.sin_grade, path.upright
    lower_slope, lower_intercept = path.lower_slope, path.lower_intercept
    upper_slope, upper_intercept = path.upper_slope, path.upper_intercept
    side_speed_sq = path.side_speed_sq
    onset = station[k] + speed * dead_time
    v_i = max(speed, slowest)
    energy = speed * speed
    least = np.inf
    i = k
    while i + 1 < count and station[i + 1] <= onset:
        if energy > side_speed_sq[i] or energy > side_speed_sq[i + 1]:
            return SIDE_LOAD, station[i], least
        least = min(least, upright[i] + rear_lever * sin_grade[i])
        i += 1
    if energy > side_speed_sq[i]:
        return SIDE_LOAD, station[i], least
    s = onset
    lagged = motion.lag > 0.0
    moved = motion.viscous + motion.turning + motion.drag + motion.wind_drag > 0.0
    force = 0.0
    heat = motion.heat
    previous = 0.0
    while i + 1 < count:
        length = station[i + 1] - station[i]
        turn = grade[i + 1] - grade[i]
        while s < station[i + 1]:
            piece = min(station[i + 1] - s, max(length / _SUBSTEPS, 1e-3))
            if lagged:
                piece = min(piece, max(0.2 * motion.lag * np.sqrt(energy), 1e-3))
            u = (s + 0.5 * piece - station[i]) / length
            w = 1.0 - u
            wanted = v_i * (w * lower_slope[i] + u * lower_slope[i + 1])
            wanted += w * lower_intercept[i] + u * lower_intercept[i + 1]
            sine = (w * sin_grade[i] + u * sin_grade[i + 1]) * (1.0 + 0.5 * u * w * turn * turn)
            up = w * upright[i] + u * upright[i + 1]
            middle_sq = max(energy - previous * piece, 0.0)
            middle = np.sqrt(middle_sq)
            applied = wanted
            seconds = piece / max(middle, 1e-3)
            if lagged:
                decay = np.exp(-0.5 * seconds / motion.lag)
                applied = wanted + (force - wanted) * decay
                force = wanted + (force - wanted) * decay * decay
            if motion.fade > 0.0:
                applied /= 1.0 + motion.fade * heat
            applied = min(applied, motion.friction * up)
            if motion.fade > 0.0:
                heat += GRAVITY * max(applied, 0.0) * piece - heat * min(
                    seconds / motion.fade_tau, 1.0
                )
            a = GRAVITY * (applied + sine)
            strong = v_i * (w * upper_slope[i] + u * upper_slope[i + 1])
            strong += w * upper_intercept[i] + u * upper_intercept[i + 1]
            strong = min(strong, motion.friction * up)
            if moved:
                bend = w * path.bend[i] + u * path.bend[i + 1]
                yaw = w * path.yaw[i] + u * path.yaw[i + 1]
                a += _motion_deceleration(middle, bend, yaw, motion)
                drag = _motion_deceleration(np.sqrt(energy), bend, yaw, motion)
                strong += max(drag, 0.0) / GRAVITY
            least = min(least, up - rear_lever * strong)
            if least < min_load:
                return REAR_LOAD, s, least
            after = energy - 2.0 * a * piece
            if after <= 0.0 and a > 0.0:
                s += energy / (2.0 * a)
                return (STOPPED if s <= target else OVERRUN), s, least
            energy = after
            previous = a
            s = s + piece if piece < station[i + 1] - s else station[i + 1]
        if s > target:
            way = energy / (2.0 * previous) if previous > 0.0 else np.inf
            return OVERRUN, s + way, least
        if energy > side_speed_sq[i + 1]:
            return SIDE_LOAD, s, least
        i += 1
    return OVERRUN, s, least
