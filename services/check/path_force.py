"""The braking force along a line: surfaces, brake level, effects, and what friction leaves of it.

F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b) with v_i the speed at onset, below the trained range
that at its lower end. Where a wheel touches several surfaces the lowest force is used, for loads
the highest. Source: Braking (6)–(8); order of the effects as in
:mod:`slopewise.models.effects.registry`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.parameters import Braking, Model
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.physics.force import NO_FRICTION_LIMIT, applied_share, force_line
from slopewise.services.physics.surfaces import possible_surfaces


class PathForce(NamedTuple):
    """Force of the R surfaces that are touched, at M samples, linear in the speed at onset."""

    names: tuple[str, ...]
    on: Bools  # (R, M) samples where a wheel may be on them
    # (6, R, M) F_b/W over the speed at onset v: slope [s/m], intercept without ground terms, share
    # by which it may be off where the model extrapolates, and its variance over v², 2 v and 1
    terms: Floats
    trained_speed_min: Floats  # (R, 1) speeds below which the force no longer changes [m/s]
    trained_speed_max: Floats  # (M,) highest trained speed of them all, by grade [m/s]
    extra: Floats  # (M,) ground terms [1]
    friction: Floats  # (M,) lowest μ of them all, :data:`NO_FRICTION_LIMIT` where unknown
    dead_time: Floats  # (M,) longest of them all, and of those till the brakes take hold [s]
    shortest_dead_time: Floats  # (M,) [s]
    offset: float  # safety offset, the longest along the line [m]
    grade_excess: Floats  # (M,) grade outside the trained range [rad]
    roll_excess: Floats  # (M,) roll outside the trained range [rad]

    def force(self, onset_speed: Floats, *, upper: bool = False) -> Floats:
        """F_b/W (M,) before friction caps it, for speeds (M,) at onset [m/s]."""
        speed = np.maximum(onset_speed, self.trained_speed_min)
        force = surface_force(self.terms, speed, upper=upper)
        ends = np.where(self.on, force, -np.inf if upper else np.inf)
        total: Floats = (ends.max(axis=0) if upper else ends.min(axis=0)) + self.extra
        return total

    def on_rows(self, line: Line) -> PathForce:
        """Without surfaces that are touched between two rows alone: plans see those of rows."""
        rows = self.on[:, line.at_row]
        near = rows[:, line.row] | rows[:, np.minimum(line.row + 1, rows.shape[1] - 1)]
        on = self.on & near
        return self._replace(on=np.where(on.any(axis=0), on, near))


def surface_force(terms: Floats, speed: Floats, *, upper: bool) -> Floats:
    """Lower or upper bound of F_b/W by terms (6, …) of :class:`PathForce`, without ground terms."""
    slope, intercept, surplus, square, double, constant = terms
    force = speed * slope + intercept
    variance = np.maximum((square * speed + 2.0 * double) * speed + constant, 0.0)
    width = surplus * np.abs(force) + np.sqrt(variance)
    bound: Floats = force + width if upper else force - width
    return bound


def path_force_along(
    model: Model,
    ground: LineGround,
    line: Line,
    class_names: tuple[str, ...],
    width: float = 0.0,
    latency: float = 0.0,
) -> PathForce:
    """The braking force of a model on the ground along a line.

    ``width`` standard deviations of the force are subtracted; with 0 it is the mean. Stops are
    commanded late by ``latency`` [s].
    """
    names, on = _touched(model, ground, class_names)
    tables = [model.braking.on(name) if name else model.braking for name in names]
    scale = registry.force_scale(model.effect)
    place = Place(ground.grade, ground.roll, line.x, line.y, line.heading, 0.0)
    outside = np.array([_outside(t.grade_range, ground.grade) for t in tables])
    rolled = np.array([_outside(t.trained_roll, ground.roll) for t in tables])
    rolls = model.terrain.rolling_while_braking
    margin = model.braking.extrapolation_margin if model.braking.extrapolate else 0.0
    dead_times = [t.dead_time + width * t.dead_time_std for t in tables]
    caps = [registry.motion(model.effect, table.sliding_friction).friction for table in tables]

    def lowest(values: list[float] | Floats) -> Floats:
        """(M,) of numbers (R,) or rows (R, M) the lowest of the surfaces that are touched."""
        rows = np.reshape(values, (len(on), -1))
        column: Floats = np.where(on, rows, np.inf).min(axis=0)
        return column

    def terms(table: Braking, beyond: Floats) -> list[Floats]:
        force = _force_of(table, rolls, ground.grade, scale)
        variance = width**2 * scale**2 * _variance_terms(table, ground.grade)
        return [*force, np.where(beyond > 0.0, margin, 0.0), *variance]

    return PathForce(
        names=names,
        on=on,
        terms=np.stack([terms(*of) for of in zip(tables, outside, strict=True)], axis=1),
        trained_speed_min=np.array([[t.speed_range[0]] for t in tables]),
        trained_speed_max=lowest(np.array([_trained_speed_max(t, ground.grade) for t in tables])),
        extra=np.broadcast_to(registry.ground_term(model.effect, place), ground.grade.shape),
        friction=lowest(np.minimum(caps, NO_FRICTION_LIMIT)),
        dead_time=_until_onset(ground.station, on, dead_times, model.limits.speed, latency),
        shortest_dead_time=lowest(dead_times),
        offset=-float(lowest([-t.distance_offset for t in tables])[: line.driven].min()),
        grade_excess=-lowest(-outside),
        roll_excess=-lowest(-rolled),
    )


def _until_onset(
    station: Floats, on: Bools, dead_times: list[float], speed: float, latency: float
) -> Floats:
    """(M,) longest dead times of the surfaces (R, M) that a vehicle meets until they are over [s].

    It is as fast as ``speed`` at most, and has the ``latency`` before them.
    """
    longest: Floats = np.where(on, np.array(dead_times)[:, None], 0.0).max(axis=0)
    counts = np.pad(np.cumsum(on, axis=1), ((0, 0), (1, 0)))
    for _ in dead_times:  # each may lead on to ground with a longer one
        end = np.searchsorted(station, station + speed * (longest + latency), "right")
        for count, dead in zip(counts, dead_times, strict=True):
            is_met = count[end] > count[:-1]
            longest = np.where(is_met, np.maximum(longest, dead), longest)
    return longest


def _touched(
    model: Model, ground: LineGround, class_names: tuple[str, ...]
) -> tuple[tuple[str, ...], Bools]:
    """Names of the R surfaces that wheels touch, and (R, M) where; "" is the base."""
    tables = model.braking.terrain
    may_be = possible_surfaces(tables, (*class_names, ""))
    classes = np.vstack((ground.classes, ~ground.classes.any(axis=0)))
    on: Bools = np.any(classes[:, None] & may_be[:, :, None], axis=0)
    names = ["", *tables]
    touched = np.flatnonzero(on.any(axis=1)).tolist()
    return tuple(names[i] for i in touched), on[touched]


def _trained_speed_max(table: Braking, grade: Floats) -> Floats:
    """(M,) highest speed that a surface was driven at, by grade where the model has it."""
    if table.speed_by_grade is None or table.extrapolate:
        return np.full(len(grade), table.speed_range[1])
    grades, speeds = np.array(table.speed_by_grade).T
    highest: Floats = np.minimum(table.speed_range[1], np.interp(grade, grades, speeds))
    return highest


def _force_of(table: Braking, rolls: float, grade: Floats, scale: float) -> tuple[Floats, Floats]:
    """Slope and intercept of F_b/W over the speed at onset, (M,) each; without brakes it rolls."""
    up, level = table.uphill or table, applied_share(table)
    downhill, uphill = (table.m_m, table.b_m), (up.m_m, up.b_m)
    slope, intercept = force_line(downhill, uphill, (table.m_b, table.b_b), grade)
    return scale * level * slope, scale * (level * intercept + (1.0 - level) * rolls)


def _variance_terms(table: Braking, grade: Floats) -> Floats:
    """(3, M) variance of F_b/W over the speed at onset: coefficients of v², 2 v and 1.

    Var of (m_m θ + m_b) v + (b_m θ + b_b), scatter from stop to stop added; scatter in proportion
    to the force has that form as well.
    """
    c = np.zeros((4, 4)) if table.covariance is None else np.array(table.covariance)
    sides = [(table.m_m, table.b_m)]
    sides += [] if table.uphill is None else [(table.uphill.m_m, table.uphill.b_m)]
    for m_m, b_m in sides:
        scatter = table.force_scatter * np.array([m_m, b_m, table.m_b, table.b_b])
        c = c + np.outer(scatter, scatter)
    c = c * applied_share(table) ** 2
    c[3, 3] += table.force_std**2
    square = (c[0, 0] * grade + 2.0 * c[0, 2]) * grade + c[2, 2]
    double = (c[0, 1] * grade + c[0, 3] + c[1, 2]) * grade + c[2, 3]
    constant = (c[1, 1] * grade + 2.0 * c[1, 3]) * grade + c[3, 3]
    return np.stack((square, double, constant))


def _outside(bounds: tuple[float, float], values: Floats) -> Floats:
    return np.maximum(np.maximum(bounds[0] - values, values - bounds[1]), 0.0)
