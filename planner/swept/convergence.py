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

from slopewise.models.arrays import Floats, Ints
from slopewise.models.parameters import Model
from slopewise.planner.ground.body_pose import BodyRows
from slopewise.planner.ground.terrain_profile import TerrainProfile

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


class Departure(NamedTuple):
    """Pose of the vehicle relative to M lines.

    Attributes:
        segment: (M,) index of the station behind it.
        along: (M,) distance from the first station to its foot on the line in the plan view [m].
        offset: (M,) signed distance from the line, to the left positive [m].
        heading: body heading [rad]. speed: vehicle speed [m/s].
        age: time since the pose was measured [s].
    """

    segment: Ints
    along: Floats
    offset: Floats
    heading: float
    speed: float
    age: float


class Convergence(NamedTuple):
    """Poses of the body on the way to M lines, at their first K stations, (K, M) each.

    Attributes:
        body: middle of all courses. across: what they differ by, to either side [m].
        longer: what the body is longer by, ahead and behind, where headings differ [m].
        offset, turned: (M,) offset [m] and heading error [rad] of the vehicle, 0 on the line.
    """

    body: BodyRows
    across: Floats
    longer: float
    offset: Floats
    turned: Floats


def convergence(
    profile: TerrainProfile, departure: Departure, model: Model, latency: float
) -> Convergence | None:
    """The way of the vehicle to its lines; None where it is on all of them.

    Args:
        profile: M candidates. departure: vehicle pose relative to them.
        model: vehicle and limits. latency: from the measured state to its use, at most [s].
    """
    shape = model.vehicle.shape
    arm = max(shape.front, shape.rear) + model.steering_geometry.body_offset
    offset, turned = departure.offset, _heading_error(profile, departure)
    is_off_line = np.abs(offset) + arm * np.abs(np.sin(turned)) > _ON_LINE
    if not is_off_line.any():
        return None
    offset, turned = np.where(is_off_line, offset, 0.0), np.where(is_off_line, turned, 0.0)
    late = max(departure.speed, 0.0) * latency
    shortest, longest = _lookaheads(model, departure.speed, offset, turned)
    amplitude = 4.0 * np.abs(offset) + 2.0 * (late + longest + arm) * np.abs(turned)
    ends = late + longest * np.log(np.maximum(amplitude / _ON_LINE, 1.0))
    arc = np.hypot(np.diff(profile.x, axis=0), np.diff(profile.y, axis=0)).cumsum(axis=0)
    distance = np.concatenate((np.zeros((1, arc.shape[1])), arc)) - departure.along
    rows = min(max(int((distance < ends).sum(axis=0).max()) + 1, 2), len(distance))
    distance = np.ascontiguousarray(distance[:rows])
    lateral, error = _hull(distance, offset, turned, shortest, longest, late)
    return Convergence(
        _moved(profile, lateral[0], error[0], model.steering_geometry.body_offset),
        lateral[1] + arm * np.sin(error[1]),
        0.5 * shape.width * math.sin(float(error[1].max())),
        offset,
        turned,
    )


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
    body, lanes = profile.body_rows, np.arange(len(departure.segment))
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


def _hull(
    distance: Floats,
    offset: Floats,
    turned: Floats,
    shortest: float,
    longest: Floats,
    late: float,
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Middle and half the range of the offsets [m] and of the headings [rad] of all courses."""
    courses = [
        offset_and_heading(distance - begin, offset + begin * turned, turned, lookahead)
        for lookahead in (shortest, np.sqrt(shortest * longest), longest)
        for begin in ((0.0, late) if late > 0.0 else (0.0,))
    ]
    bounds = []
    for values in zip(*courses, strict=True):
        low, high = np.minimum.reduce(values), np.maximum.reduce(values)
        # Behind the vehicle nothing is swept but the line.
        bounds.append(
            (
                np.where(distance > 0.0, 0.5 * (low + high), 0.0),
                np.where(distance > 0.0, 0.5 * (high - low), 0.0),
            )
        )
    return bounds[0], bounds[1]


def _moved(
    profile: TerrainProfile, lateral: Floats, turned: Floats, body_offset: float
) -> BodyRows:
    """Poses of the body off the line and turned from it."""
    rows = len(lateral)
    line_x, line_y = profile.heading_x[:rows], profile.heading_y[:rows]
    planned_x, planned_y = (values[:rows] for values in profile.body_rows[2:])
    cosine, sine = np.cos(turned), np.sin(turned)
    heading_x = planned_x * cosine - planned_y * sine
    heading_y = planned_y * cosine + planned_x * sine
    x = profile.x[:rows] - lateral * line_y + body_offset * heading_x
    y = profile.y[:rows] + lateral * line_x + body_offset * heading_y
    return BodyRows(x, y, heading_x, heading_y)
