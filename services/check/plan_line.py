"""The line that a plan drives, and its motion: samples between its rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.input_errors import InputErrors
from slopewise.models.steering import SteeringGeometry
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.body_on_line import Body, body_along
from slopewise.services.check.external_plan import ExternalPlan

_MIN_SAMPLES, _MAX_SAMPLES = 4, 40  # of each segment: a fifth of a wheel, or bounded memory
_SPACING = 0.08  # [m] between samples within those bounds: a fifth of a wheel on the ground
_MAX_NOISE = 0.02  # [1/m] noise that remains in the curvature: half its tolerance of columns
_ROUNDED = 0.02  # [m] noise of rows that were rounded or measured; what is more, is driven
_CHORD = 0.15  # of the body's width: as much as a clear gap beside the vehicle is judged by
_MIN_ROWS = 12  # fifth differences of fewer do not separate noise from turns
_EVEN = 0.02  # share of the step between rows: rounding in files
CURVATURE, CURVATURE_SHARE = 0.02, 0.1  # [1/m], [1] by which a reported curvature may be off

_NEVER_OFF, _NO_ERRORS = SteeringGeometry(), InputErrors()


class Line(NamedTuple):
    """M samples along a plan of N rows, and beyond its last row; arrays are (M,) unless stated."""

    row: Ints  # row that each sample belongs to, N − 1 beyond the last one
    share: Floats  # share of the distance to the next row
    at_row: Ints  # (N,) sample of each row
    x: Floats
    y: Floats
    flat: Floats  # metres in the plan view
    heading: Floats  # heading without jumps [rad]
    curvature: Floats  # plan-view curvature, left positive [1/m]
    body: Body
    driven: int  # samples up to the last row; those behind it continue it straight

    def between(self, values: Floats) -> Floats:
        """(M,) values that are linear between rows (N,); as at the last row beyond it."""
        ahead = np.minimum(self.row + 1, len(values) - 1)
        linear: Floats = values[self.row] + self.share * (values[ahead] - values[self.row])
        return linear


def line_of(
    plan: ExternalPlan,
    beyond: float,
    steering: SteeringGeometry = _NEVER_OFF,
    errors: InputErrors = _NO_ERRORS,
) -> Line:
    """Samples of a plan without repeated places, and for ``beyond`` metres straight behind it.

    ``steering`` and ``errors``, at the quantile of the check, place the body.
    """
    x, y = plan.x, plan.y
    steps = np.hypot(np.diff(x), np.diff(y))
    along = np.concatenate(([0.0], np.cumsum(steps)))
    parts = int(np.clip(np.ceil(np.median(steps) / _SPACING), _MIN_SAMPLES, _MAX_SAMPLES))
    heading, curvature = _turning(plan, along, steps)
    count = len(x)
    row = np.repeat(np.arange(count - 1), parts)
    share = np.tile(np.arange(parts) / parts, count - 1)
    extra = int(np.ceil(beyond / _SPACING)) if beyond > 0.0 else 0
    row = np.concatenate((row, np.full(1 + extra, count - 1)))
    share = np.concatenate((share, np.zeros(1 + extra)))
    ahead = np.minimum(row + 1, count - 1)
    x, y, flat, heading, curvature = (
        v[row] + share * (v[ahead] - v[row]) for v in (x, y, along, heading, curvature)
    )
    if extra:
        further = beyond * np.arange(1, extra + 1) / extra
        flat[-extra:] += further
        x[-extra:] += further * np.cos(heading[-1])
        y[-extra:] += further * np.sin(heading[-1])
        curvature[-extra:] = 0.0
    body = body_along((x, y, heading), flat, curvature, steering, errors)
    place = x, y, flat, heading, curvature, body
    return Line(row, share, np.arange(count) * parts, *place, len(row) - extra)


def _turning(plan: ExternalPlan, along: Floats, steps: Floats) -> tuple[Floats, Floats]:
    """Heading [rad] and curvature [1/m] at the rows, from chords long enough to see past noise.

    Rows whose reported curvature is that of their neighbours are exact: a zigzag is driven.
    """
    x, y = plan.x, plan.y
    if len(x) == 2:
        return np.full(2, np.arctan2(y[1] - y[0], x[1] - x[0])), np.zeros(2)
    length, reach = float(along[-1]), _reach(x, y)
    # The neighbours of each row; at both ends those of the row before.
    inner = np.clip(np.arange(len(x)), 1, len(x) - 2)
    heading, curvature = _chords(plan, along, *(along[inner + k] for k in (-1, 0, 1)))
    if reach <= float(np.median(steps)):
        return heading, curvature
    if plan.curvature is not None:
        differs = np.abs(plan.curvature - curvature) > CURVATURE + CURVATURE_SHARE * np.abs(
            curvature
        )
        if not differs[evenly_between(steps)].any():
            return heading, curvature
    reach = min(reach, 0.5 * length)
    centre = np.clip(along, reach, length - reach)
    return _chords(plan, along, centre - reach, centre, centre + reach)


def _chords(
    plan: ExternalPlan, along: Floats, behind: Floats, centre: Floats, ahead: Floats
) -> tuple[Floats, Floats]:
    """Heading [rad] and curvature [1/m] by the chords between three places near each row [m]."""

    def at(s: Floats) -> tuple[Floats, Floats]:
        return np.interp(s, along, plan.x), np.interp(s, along, plan.y)

    (x0, y0), (x1, y1), (x2, y2) = at(behind), at(centre), at(ahead)
    first, second = np.hypot(x1 - x0, y1 - y0), np.hypot(x2 - x1, y2 - y1)
    before, after = np.arctan2(y1 - y0, x1 - x0), np.arctan2(y2 - y1, x2 - x1)
    turn = np.angle(np.exp(1j * (after - before)))
    curvature = turn / np.maximum(0.5 * (first + second), 1e-9)
    # The chord of both has the heading of the arc at its middle.
    heading = np.unwrap(before + turn * first / np.maximum(first + second, 1e-9))
    return heading + curvature * (along - centre), curvature


def even_steps(steps: Floats) -> Bools:
    """(N − 1,) steps between rows that are as long as the others."""
    even: Bools = np.abs(steps / np.median(steps) - 1.0) < _EVEN
    return even


def evenly_between(steps: Floats) -> Bools:
    """(N,) rows with even steps around: neither an end, nor put between two others to rest there.

    Such a row lies on the chord of its neighbours, with the mean of their slopes.
    """
    around = np.concatenate(([True, False], even_steps(steps), [False, True]))
    is_even: Bools = around[:-3] & around[1:-2] & around[2:-1] & around[3:]
    return is_even


def _reach(x: Floats, y: Floats) -> float:
    """Length of a chord that shows curvature to within :data:`_MAX_NOISE` [m].

    Rows that are rounded, or were measured, are noisy; fifth differences of a smooth path vanish.
    """
    if len(x) < _MIN_ROWS:
        return 0.0
    fifth = np.abs(np.diff(np.stack((x, y)), n=5, axis=1))
    noise = 1.4826 * float(np.median(fifth)) / np.sqrt(252.0)
    return float(np.sqrt(2.5 * noise / _MAX_NOISE)) if noise <= _ROUNDED else 0.0


class Motion(NamedTuple):
    """Motion at M samples; arrays are (M,)."""

    speed: Floats
    accel: Floats  # from its sample on [m/s²]
    accel_before: Floats  # up to its sample [m/s²]
    moving: Bools  # the plan moves there


def motion_along(line: Line, station: Floats, speed: Floats) -> Motion:
    """The motion of a plan with speeds (N,) at its rows, v² linear between them."""
    at_rows = station[line.at_row]
    energy = line.between(speed * speed)
    accel = 0.5 * np.diff(speed * speed) / np.diff(at_rows)
    after = np.append(accel, 0.0)[line.row]
    before = after.copy()
    before[line.at_row[1:]] = accel
    energy[line.driven :] = 0.0
    return Motion(np.sqrt(energy), after, before, energy > 0.0)


def widest_spacing(plan: ExternalPlan, vehicle: Vehicle, resolution: float) -> Floats:
    """(N − 1,) distance of rows up to which what lies between them follows from them [m].

    Farther apart than the body is long, and than a cell, rows do not say where the vehicle drives.
    In a turn by δ an arc of length s leaves its chord by s δ/8: up to a share of the body's width.
    """
    x, y, shape = plan.x, plan.y, vehicle.shape
    heading = np.arctan2(np.diff(y), np.diff(x))
    turn = np.concatenate(([0.0], np.abs(np.angle(np.exp(1j * np.diff(heading)))), [0.0]))
    turn = np.maximum(turn[:-1], turn[1:])
    straight = max(shape.front + shape.rear, resolution)
    return np.minimum(straight, 8.0 * _CHORD * shape.width / np.maximum(turn, 1e-9))
