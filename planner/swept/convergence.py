"""From the actual pose to the planned line: what a vehicle sweeps until it is back on it.

A pure-pursuit tracker aims at a point of the line one lookahead ahead. Close to the line that is
e″ + (2/λ) e′ + (2/λ²) e = 0 for the offset e along the line, whose solution is used here. How long
the lookahead really is, and when the tracker begins to steer, is known within limits only: the body
is swept over all of these courses. Definitions: docs/vehicle_motion.md.

Source: Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.terrain_profile import BodyRows, TerrainProfile

_ON_LINE = 0.01
"""A vehicle whose corners are all within that of where they are planned is on its line [m]: maps
are not drawn more exactly, and odometry is not read so."""

_WHEELBASES = 2.0
_SECONDS = 1.0
"""Lookahead of a tracker whose model file has none, in wheelbases [1], or the distance driven in a
time [s] where that is more: regulated pure pursuit of Nav2 has 1.5 s and at least 0.3 m."""

_LONGEST = 2.0
"""A tracker looks ahead up to that many times its lookahead [1]: it is scaled with speed, and cut
short of bends."""

_SHARE = 0.25
"""Share of the lateral acceleration that a vehicle uses to return to its line [1]; most of it is
for bends of the line itself."""

_BRAKING = 0.5
"""Share of planned braking by which a vehicle slows for its turn back [1]: jerk takes time."""

_ON_A_BANK = 0.1
"""Share of the lateral limit that any bank leaves to turns [1], as in the bounds of the line."""


class Departure(NamedTuple):
    """Pose of the vehicle relative to M lines.

    Attributes:
        segment: (M,) index of the station behind it.
        along: (M,) distance from the first station to its foot on the line in the plan view [m].
        offset: (M,) signed distance from the line, to the left positive [m].
        heading: body heading [rad].
        speed: highest one of the vehicle until a new command takes effect [m/s].
        age: time since the pose was measured [s].
        later: (2, M) lowest and highest offset to which earlier commands may lead it until
            a new one takes effect [m]; None: till then it holds its heading.
    """

    segment: Ints
    along: Floats
    offset: Floats
    heading: float
    speed: float
    age: float
    later: Floats | None = None

    def only(self, lanes: Ints) -> Departure:
        """The vehicle relative to some of the lines, by their indices."""
        return self._replace(
            segment=self.segment[lanes],
            along=self.along[lanes],
            offset=self.offset[lanes],
            later=None if self.later is None else self.later[:, lanes],
        )


class Convergence(NamedTuple):
    """Poses of the body on the way to M lines, at their first K stations, (K, M) each.

    Attributes:
        body: middle of all courses. across: what they differ by, to either side [m].
        longer: what the body is longer by, ahead and behind, where headings differ [m].
        turned: (M,) heading error of the vehicle [rad].
        speed: highest one at which the sharpest course keeps to the lateral limits, inf up to the
            station ahead of the vehicle [m/s].
    """

    body: BodyRows
    across: Floats
    longer: float
    turned: Floats
    speed: Floats


def is_off_line(profile: TerrainProfile, departure: Departure, model: Model) -> Bools:
    """Return True for each of M lines that the vehicle is not on, so that it has a way to it."""
    turned = _heading_error(profile, departure)
    away: Bools = np.abs(departure.offset) + _arm(model) * np.abs(np.sin(turned)) > _ON_LINE
    if departure.later is not None:
        away |= np.abs(departure.later).max(axis=0) > _ON_LINE
    return away


def _arm(model: Model) -> float:
    """Distance from the reference point to the farther end of the body [m]."""
    shape = model.vehicle.shape
    return max(shape.front, shape.rear) + model.steering_geometry.body_offset


def convergence(
    profile: TerrainProfile, departure: Departure, model: Model, latency: float
) -> Convergence:
    """The way of the vehicle to lines that it is off.

    Args:
        profile: M candidates. departure: vehicle pose relative to them.
        model: vehicle and limits. latency: from the measured state to its use, at most [s].
    """
    arm, offset, turned = _arm(model), departure.offset, _heading_error(profile, departure)
    late = max(departure.speed, 0.0) * latency
    held, far, away = _late_courses(departure, turned, late)
    shortest, longest = _lookaheads(model, departure.speed, far, away)
    amplitude = 4.0 * far + 2.0 * (late + longest + arm) * away
    ends = late + longest * np.log(np.maximum(amplitude / _ON_LINE, 1.0))
    arc = np.hypot(np.diff(profile.x, axis=0), np.diff(profile.y, axis=0)).cumsum(axis=0)
    distance = np.concatenate((np.zeros((1, arc.shape[1])), arc)) - departure.along
    rows = min(max(int((distance < ends).sum(axis=0).max()) + 1, 2), len(distance))
    distance = np.ascontiguousarray(distance[:rows])
    lateral, error, curvature = _hull(distance, offset, turned, held, shortest, longest, late)
    return Convergence(
        _moved(profile, lateral[0], error[0], model.steering_geometry.body_offset),
        lateral[1] + arm * np.sin(error[1]),
        0.5 * model.vehicle.shape.width * math.sin(float(error[1].max())),
        turned,
        _highest_speed(profile, departure, model, distance, curvature),
    )


def _highest_speed(
    profile: TerrainProfile, departure: Departure, model: Model, distance: Floats, curvature: Floats
) -> Floats:
    """Speed at which the turn back to the line holds on the bank that is there, (K, M) [m/s].

    The vehicle already drives, and brakes to it by half of what planned braking may.

    Args:
        distance: along the lines from the vehicle on, (K, M) [m].
        curvature: largest one of any course, beyond that of the line, (K, M) [1/m].
    """
    vehicle, limits, rows = model.vehicle, model.limits, len(distance)
    lever = 0.5 * vehicle.track_width / vehicle.cg_z
    lateral = min(limits.lateral_accel, (1.0 - limits.min_load) * GRAVITY * lever)
    if model.braking.sliding_friction is not None:
        lateral = min(lateral, model.braking.sliding_friction * GRAVITY)
    bank = GRAVITY * np.abs(profile.sin_roll[:rows])
    total = np.abs(profile.curvature[:rows]) + curvature
    held = np.maximum(lateral - bank, _ON_A_BANK * lateral) / np.maximum(total, 1e-9)
    slowing = departure.speed**2 - _BRAKING * 2.0 * limits.decel * np.maximum(distance, 0.0)
    speed = np.sqrt(np.maximum(held, slowing))
    behind = np.arange(rows)[:, None] <= departure.segment + 1
    free: Floats = np.where(behind | (curvature <= 0.0), np.inf, speed)
    return free


def offset_and_heading(
    distance: Floats, offset: Floats | float, turned: Floats | float, lookahead: Floats | float
) -> tuple[Floats, Floats]:
    """Offset [m] and heading error [rad] of a pure-pursuit tracker at distance along the line.

    Args:
        distance: distance from where it begins to steer; before that the heading is held [m].
        offset, turned: [m], [rad], there. lookahead: λ [m].
    """
    u = np.maximum(distance, 0.0) / lookahead
    decay, cosine, sine = np.exp(-u), np.cos(u), np.sin(u)
    lateral = decay * (offset * cosine + (offset + lookahead * turned) * sine)
    slope = decay * (turned * cosine - (2.0 * offset / lookahead + turned) * sine)
    return lateral + np.minimum(distance, 0.0) * turned, slope


def _heading_error(profile: TerrainProfile, departure: Departure) -> Floats:
    """Heading of the body less that of the line, (M,) [rad].

    Along a segment the line has any heading between those at its ends: stations are not drawn more
    exactly.
    """
    body, lanes = profile.body, np.arange(len(departure.segment))
    ends = np.stack([departure.segment, departure.segment + 1])
    planned = np.arctan2(body.heading_y[ends, lanes], body.heading_x[ends, lanes])
    errors = np.remainder(departure.heading - planned + np.pi, 2.0 * np.pi) - np.pi
    nearest = np.where(np.abs(errors[0]) < np.abs(errors[1]), errors[0], errors[1])
    return np.where(errors[0] * errors[1] <= 0.0, 0.0, nearest)


def _lookaheads(model: Model, speed: float, offset: Floats, turned: Floats) -> tuple[float, Floats]:
    """The shortest lookahead, and the longest of M lines [m].

    The turn back to the line, |κ| ≤ 2 (|e| + λ |e_ψ|) / λ², keeps within what the steering can do
    and within a share of the lateral acceleration: where it would not, the tracker looks farther.
    """
    given = None if model.tracking is None else model.tracking.lookahead
    shortest = given or max(_WHEELBASES * model.vehicle.wheelbase, _SECONDS * speed)
    sideways = _SHARE * model.limits.lateral_accel / max(speed, _ON_LINE) ** 2
    free = min(model.steering_geometry.max_curvature, sideways)
    turn, lateral = np.abs(turned), np.abs(offset)
    gentle = (turn + np.sqrt(turn * turn + 2.0 * free * lateral)) / free
    return shortest, _LONGEST * np.maximum(shortest, gentle)


def _late_courses(
    departure: Departure, turned: Floats, late: float
) -> tuple[Floats, Floats, Floats]:
    """Curvatures of courses until steering begins; largest offset and heading error by then.

    Args:
        departure: vehicle pose relative to M lines; turned: (M,) heading errors [rad].
        late: distance to where steering begins, if it does not immediately [m].

    Returns:
        (B, M) beyond that of the line [1/m], for courses that steer immediately and later; (M,)
        [m]; (M,) [rad].
    """
    offset, straight = departure.offset, np.zeros_like(turned)
    if late <= 0.0 or departure.later is None:
        courses = 1 if late <= 0.0 else 2
        return np.stack([straight] * courses), np.abs(offset), np.abs(turned)
    # e(s) = e₀ + ψ₀ s + ½ κ s² is at the known offset where steering begins.
    held = 2.0 * (departure.later - offset - turned * late) / late**2
    far = np.abs(np.stack([offset, *departure.later])).max(axis=0)
    away = np.abs(np.stack([turned, *(turned + held * late)])).max(axis=0)
    return np.stack([straight, straight, *held]), far, away


def _hull(
    distance: Floats,
    offset: Floats,
    turned: Floats,
    held: Floats,
    shortest: float,
    longest: Floats,
    late: float,
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats], Floats]:
    """Offsets [m] and headings [rad] of all courses: middle and half the range; curvature [1/m]."""
    begin = np.array([0.0, *[late] * (len(held) - 1)])[:, None, None, None]
    held = held[:, None, None]
    lookahead = np.stack([np.full_like(longest, shortest), np.sqrt(shortest * longest), longest])
    ahead = distance - begin
    before = np.minimum(ahead, 0.0)
    # All courses together: (begins, lookaheads, K, M).
    lateral, error = offset_and_heading(
        ahead,
        offset + begin * turned + 0.5 * held * begin**2,
        turned + held * begin,
        lookahead[:, None],
    )
    lateral += 0.5 * held * before**2
    error += held * before
    turn_back = np.abs(lateral / lookahead[:, None] + error) * (2.0 / lookahead[:, None])
    curvature = np.where(ahead > 0.0, turn_back, np.abs(held)).max(axis=(0, 1))
    bounds = []
    for values in (lateral, error):
        # Behind the vehicle nothing is swept but the line.
        low, high = (
            np.where(distance > 0.0, f(values, axis=(0, 1)), 0.0) for f in (np.min, np.max)
        )
        bounds.append((0.5 * (low + high), 0.5 * (high - low)))
    return bounds[0], bounds[1], curvature


def _moved(
    profile: TerrainProfile, lateral: Floats, turned: Floats, body_offset: float
) -> BodyRows:
    """Poses of the body off the line and turned from it."""
    rows = len(lateral)
    line_x, line_y = profile.heading_x[:rows], profile.heading_y[:rows]
    planned_x, planned_y = (values[:rows] for values in profile.body[2:])
    cosine, sine = np.cos(turned), np.sin(turned)
    heading_x = planned_x * cosine - planned_y * sine
    heading_y = planned_y * cosine + planned_x * sine
    x = profile.x[:rows] - lateral * line_y + body_offset * heading_x
    y = profile.y[:rows] + lateral * line_x + body_offset * heading_y
    return BodyRows(x, y, heading_x, heading_y)
