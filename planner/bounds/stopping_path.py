"""The stopping path: from which speed can the vehicle still stop before the clear distance?

An emergency stop is written three times, and no two share a line: here as a *bound*, the highest
speed of a station; in :mod:`slopewise.planner.verify` as the *judge* of a finished plan, in a
different form on purpose; in :mod:`slopewise.models.stops.simulation` as the slow *reference* that
both are tested against.

The bound itself has two ways to the same answer. Where nothing but the grade acts, the energy that
the brakes take out from onset to the target is an integral that is summed once along the path, and
the speed follows from a quadratic (:mod:`slopewise.planner.bounds.closed_form_stop`, some 10 ns a
station). Where an effect acts on the motion itself, or a load may run short on the way, a stop is
integrated along the path, and :mod:`slopewise.planner.bounds.integrated_stop` tries for the speed
(some 10 µs a station). They share what they are asked, :class:`StopProblem`, and nothing of how
they answer: the closed form sums backwards from the target, the other one marches forwards from the
command.

Source: Braking (7), (8), (12), with v dv = −a(θ(s), v_i) ds along the varying slope; the dead time
at held speed comes first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.effects.registry import MotionTerms
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.forces import Forces
from slopewise.planner.ground.terrain_profile import TerrainRows
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.kernels.motion_laws import motion_deceleration

STOPPED, OVERRUN, REAR_LOAD, SIDE_LOAD = range(4)
"""How an integrated stop ends."""

_SUBSTEPS = 2
"""Steps of a stop in a segment [1]: v² is close to linear within, halves keep its error below 1
mm."""

_LOAD_GUARD = 5e-4
"""Share kept free under brakes for what changes within half a step."""


@inlined
def onset_speed(slope_sum: float, intercept_sum: float, slowest: float) -> float:
    """Highest speed at onset that the brakes take out over a stretch.

    Args:
        slope_sum: integral of the slope of F_b/W over v_i, over the stretch [s].
        intercept_sum: integral of its intercept plus sin θ [m].
        slowest: below it the coefficients no longer change [m/s].

    Returns:
        v with v²/2 = g (max(v, slowest) * slope_sum + intercept_sum), 0 where there is none
        [m/s].
    """
    half = GRAVITY * slope_sum
    root = half * half + 2.0 * GRAVITY * intercept_sum
    speed = half + np.sqrt(root) if root > 0.0 else 0.0
    if speed < slowest:
        energy = 2.0 * GRAVITY * (slowest * slope_sum + intercept_sum)
        speed = min(np.sqrt(energy), slowest) if energy > 0.0 else 0.0
    return float(speed)


class StopProblem(NamedTuple):
    """What both ways to a stopping bound are asked.

    Attributes:
        terrain, forces: of M candidates with up to N stations.
        target: (M,) the vehicle must stand here [m].
        height: the stop may fall by this much further than the map says [m].
    """

    terrain: TerrainRows
    forces: Forces
    target: Floats
    height: float


class StopPath(NamedTuple):
    """One path as a stop is integrated along it; arrays are (N,).

    Attributes:
        station, grade, sin_grade: terrain.
        lower_slope, lower_intercept, upper_slope, upper_intercept: both bounds of the force.
        dead_time: from command to onset [s].
        slowest: speed below which the force no longer changes [m/s].
        upright: cos(roll) cos(grade).
        tilt: cos(grade) sin(roll), positive where it falls away from the turn.
        lean: by how much v² adds to that [s²/m²]; falls: share of the load it takes [s²/m²].
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
    dead_time: Floats
    slowest: Floats
    upright: Floats
    tilt: Floats
    lean: Floats
    falls: Floats
    bend: Floats
    yaw: Floats


class StopConditions(NamedTuple):
    """What a stop has to keep, and what acts on it beside the path.

    Attributes:
        target: the vehicle must stand here [m].
        motion: effects.
        rear_lever, front_lever, side_lever: as of the limits.
        min_load: share of its static load that every axle, side and wheel must keep.
        height: the stop may fall by this much further [m].
        watched: behind this station no load can run short, and the target is known to be kept [m].
    """

    target: float
    motion: MotionTerms
    rear_lever: float
    front_lever: float
    side_lever: float
    min_load: float
    height: float
    watched: float


@inlined
def integrate_stop(
    k: int, speed: float, path: StopPath, conditions: StopConditions
) -> tuple[int, float, float]:
    """March one emergency stop from station k along a path.

    Within a step the deceleration is that of its middle, so v² is linear: exact for forces that are
    linear in station, second order for the motion terms.

    Args:
        k: station of the stop command.
        speed: speed there [m/s].
        path: terrain and forces along it, (N,) each.
        conditions: target, effects and loads to keep.

    Returns:
        How it ends, where [m], and the least rear load share on the way. Where an overrun ends is
        extrapolated from the first station behind the target.
    """
    station, motion, target = path.station, conditions.motion, conditions.target
    count = station.shape[0]
    v_i = max(speed, path.slowest[k])
    energy = speed * speed
    s = station[k] + speed * path.dead_time[k]
    i, least, side = _hold_speed(k, s, energy, path, conditions)
    if side < conditions.min_load:
        return SIDE_LOAD, station[i], least
    force, heat, previous = 0.0, motion.heat, 0.0
    while i + 1 < count:
        length = station[i + 1] - station[i]
        while s < station[i + 1]:
            piece = min(station[i + 1] - s, max(length / _SUBSTEPS, 1e-3))
            if motion.lag > 0.0:
                piece = min(piece, max(0.2 * motion.lag * np.sqrt(energy), 1e-3))
            u = (s + 0.5 * piece - station[i]) / length
            a, share, wheel, force, heat = _brake(
                i, u, piece, v_i, (energy, previous, force, heat), path, conditions
            )
            least = min(least, share)
            if least < conditions.min_load + _LOAD_GUARD:
                return REAR_LOAD, s, least
            if wheel < conditions.min_load + _LOAD_GUARD:
                return SIDE_LOAD, s, least
            after = energy - 2.0 * a * piece
            if after <= 0.0 and a > 0.0:
                s += (0.5 * energy + GRAVITY * conditions.height) / a
                return (STOPPED if s <= target else OVERRUN), s, least
            energy = after
            previous = a
            s = s + piece if piece < station[i + 1] - s else station[i + 1]
        if s > conditions.watched:
            return STOPPED, s, least
        if s > target:
            left = energy / (2.0 * previous) if previous > 0.0 else np.inf
            return OVERRUN, s + left, least
        i += 1
    return OVERRUN, s, least


@inlined
def _hold_speed(
    k: int, onset: float, energy: float, path: StopPath, conditions: StopConditions
) -> tuple[int, float, float]:
    """Drive at held speed up to the onset, or to where a side or wheel lifts.

    Returns:
        The segment that this is in, and the least shares of the rear and of any side or wheel.
    """
    least, side = np.inf, np.inf
    i = k
    while True:
        rear, wheel = _held_shares(i, energy, path, conditions)
        least, side = min(least, rear), min(side, wheel)
        beyond = i + 1 >= path.station.shape[0] or path.station[i + 1] > onset
        if beyond or side < conditions.min_load:
            return i, least, side
        i += 1


@inlined
def _held_shares(
    i: int, energy: float, path: StopPath, conditions: StopConditions
) -> tuple[float, float]:
    """Rear share, and the least of sides and wheels, at station i at a held speed."""
    up = path.upright[i] - path.falls[i] * energy
    rear = up + conditions.rear_lever * path.sin_grade[i]
    axle = min(rear, up - conditions.front_lever * path.sin_grade[i])
    side = up - conditions.side_lever * abs(path.tilt[i] + path.lean[i] * energy)
    return rear, min(side, axle + side - up)


@inlined
def _brake(
    i: int,
    u: float,
    piece: float,
    v_i: float,
    state: tuple[float, float, float, float],
    path: StopPath,
    conditions: StopConditions,
) -> tuple[float, float, float, float, float]:
    """One piece of a stop, by what acts in its middle, at share u of segment i.

    Args:
        state: v² before the piece, deceleration before it, force built up, heat of the brakes.

    Returns:
        Deceleration [m/s²], share of the rear axle, least share of sides and rear wheels, force
        built up, heat of the brakes.
    """
    motion = conditions.motion
    energy, previous, force, heat = state
    w = 1.0 - u
    wanted = v_i * (w * path.lower_slope[i] + u * path.lower_slope[i + 1])
    wanted += w * path.lower_intercept[i] + u * path.lower_intercept[i + 1]
    turn = path.grade[i + 1] - path.grade[i]
    sine = w * path.sin_grade[i] + u * path.sin_grade[i + 1]
    sine *= 1.0 + 0.5 * u * w * turn * turn
    up = w * path.upright[i] + u * path.upright[i + 1]
    middle = np.sqrt(max(energy - previous * piece, 0.0))
    applied = wanted
    seconds = piece / max(middle, 1e-3)
    if motion.lag > 0.0:
        decay = np.exp(-0.5 * seconds / motion.lag)
        applied = wanted + (force - wanted) * decay
        force = wanted + (force - wanted) * decay * decay
    if motion.fade > 0.0:
        applied /= 1.0 + motion.fade * heat
    applied = min(applied, motion.friction * up)
    if motion.fade > 0.0:
        heat += GRAVITY * max(applied, 0.0) * piece - heat * min(seconds / motion.fade_tau, 1.0)
    a = GRAVITY * (applied + sine)
    upper = v_i * (w * path.upper_slope[i] + u * path.upper_slope[i + 1])
    upper += w * path.upper_intercept[i] + u * path.upper_intercept[i + 1]
    upper = min(upper, motion.friction * up)
    if motion.moves:
        bend = w * path.bend[i] + u * path.bend[i + 1]
        yaw = w * path.yaw[i] + u * path.yaw[i + 1]
        a += motion_deceleration(middle, bend, yaw, motion)
        upper += max(motion_deceleration(np.sqrt(energy), bend, yaw, motion), 0.0) / GRAVITY
    # The load lost over a crest is that at the fastest end of the piece.
    up -= (w * path.falls[i] + u * path.falls[i + 1]) * energy
    rear = up - conditions.rear_lever * upper
    tilt = w * path.tilt[i] + u * path.tilt[i + 1]
    lean = w * path.lean[i] + u * path.lean[i + 1]
    side = up - conditions.side_lever * abs(tilt + lean * energy)
    return a, rear, min(side, rear + side - up), force, heat
