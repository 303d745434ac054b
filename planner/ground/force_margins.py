"""What widens, shifts or caps the force of the surfaces: effects, uncertainty, friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Place
from slopewise.models.parameters import Model
from slopewise.planner.ground.forces import Forces
from slopewise.planner.ground.surface_table import FRICTION, MOST_FRICTION, braking_on
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.kernels.compiled import kernel
from slopewise.planner.kernels.workspace import empty

_SLOWEST, _STOP = 0.25, 15.0
"""Mean speed of the slowest plan [m/s] and its longest stop [s]: how late it is at a station."""


def ground_terms(
    model: Model, profile: TerrainProfile, yaw: Floats, session_time: float
) -> tuple[Floats, Floats]:
    """Least and most that the ground terms can be around each station, (N, M).

    Terms that bend where grade or roll change sign are zero in between. What has a sharp edge may
    lie between two stations: it counts as larger by a step where that is the safe side, and for
    the neighbours as well. What changes with time counts from now until the vehicle has surely come
    by and stopped.
    """
    place = Place(profile.grade, profile.roll, profile.x, profile.y, yaw, session_time)
    lowest, highest = np.zeros_like(profile.grade), np.zeros_like(profile.grade)
    step = float(np.max(np.diff(profile.station, axis=0)))
    for effect in model.effect:
        law = registry.LAWS[effect.name]
        own = registry.ground_term([effect], place)
        least, most = own, own
        if "session_time" in law.depends_on:
            late = session_time + profile.station / _SLOWEST + _STOP
            later = registry.ground_term([effect], place._replace(session_time=late))
            least, most = np.minimum(own, later), np.maximum(own, later)
        if law.kinks_at_level:
            grade, roll = (level_between(slope) for slope in (profile.grade, profile.roll))
            level = registry.ground_term([effect], place._replace(grade=grade, roll=roll))
            least, most = np.minimum(own, level), np.maximum(own, level)
        elif law.grown is not None:
            grown = [replace(effect, parameters=law.grown(effect.parameters, step))]
            near = registry.ground_term(grown, place)
            least, _ = spread_to_neighbours(np.minimum(own, near))
            _, most = spread_to_neighbours(np.maximum(own, near))
        lowest, highest = lowest + least, highest + most
    return lowest, highest


def level_between(slope: Floats) -> Floats:
    """The slope, but level where it changes sign on the way to a neighbour, (N, M) [rad]."""
    lowest, highest = spread_to_neighbours(slope)
    return np.where((lowest < 0.0) & (highest > 0.0), 0.0, slope)


def spread_to_neighbours(term: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest value among each station and its neighbours."""
    padded = np.pad(term, ((1, 1), (0, 0)), mode="edge")
    stack = np.stack((padded[:-2], term, padded[2:]))
    return stack.min(axis=0), stack.max(axis=0)


def margins(surfaces: int, model: Model, uncertainty: Uncertainty) -> Floats:
    """Matrices of the margin of F_b/W on each surface, (S, 4, 4), of Uncertainty.force_matrix."""
    names = ["", *model.braking.terrain]
    scale = registry.force_scale(model.effect)
    matrices = np.empty((surfaces, 4, 4))
    for i in range(surfaces):
        # Ground that was never braked on is as uncertain as the ground that is known best of it.
        name = names[i] if i < len(names) else ""
        matrices[i] = scale**2 * uncertainty.force_matrix(braking_on(model, name))
    return matrices


def widened(forces: Forces, grade: Floats, bits: Ints, matrices: Floats) -> Forces:
    """Both bounds with the margin of the least certain surface.

    Args:
        forces: of the surfaces, (N, M).
        grade: (N, M) [rad].
        bits: (N, M) surfaces that each station may be on.
        matrices: (S, 4, 4) of :func:`margins`.
    """
    out = forces._replace(**dict(zip(Forces._fields[:4], empty(4, *grade.shape), strict=True)))
    _widen(grade, np.ascontiguousarray(bits), matrices, forces, out)
    return out


@kernel
def _widen(grade: Floats, bits: Ints, matrices: Floats, forces: Forces, out: Forces) -> None:
    """Give up √(φᵀ S φ), which is convex in v_i: its chord over the trained speeds is above it."""
    stations, candidates = grade.shape
    for k in range(stations):
        for j in range(candidates):
            theta, slow, fast = grade[k, j], forces.slowest[k, j], forces.fastest[k, j]
            at_slow, at_fast = 0.0, 0.0
            for i in range(matrices.shape[0]):
                if (bits[k, j] >> i) & 1 == 0:
                    continue
                s = matrices[i]
                vv = (s[0, 0] * theta + 2.0 * s[0, 2]) * theta + s[2, 2]
                v1 = (s[0, 1] * theta + s[0, 3] + s[1, 2]) * theta + s[2, 3]
                one = (s[1, 1] * theta + 2.0 * s[1, 3]) * theta + s[3, 3]
                at_slow = max(at_slow, (vv * slow + 2.0 * v1) * slow + one)
                at_fast = max(at_fast, (vv * fast + 2.0 * v1) * fast + one)
            at_slow, at_fast = np.sqrt(at_slow), np.sqrt(at_fast)
            rise = (at_fast - at_slow) / max(fast - slow, 1e-6)
            intercept = at_slow - rise * slow
            out.lower_slope[k, j] = forces.lower_slope[k, j] - rise
            out.lower_intercept[k, j] = forces.lower_intercept[k, j] - intercept
            out.upper_slope[k, j] = forces.upper_slope[k, j] + rise
            out.upper_intercept[k, j] = forces.upper_intercept[k, j] + intercept


def frictions_on(bits: Ints, table: Floats) -> tuple[Floats, Floats]:
    """Least and most friction of the surfaces that each station may be on, (N, M) [1].

    Args:
        bits: (N, M) surfaces.
        table: (S, COLUMNS) of :mod:`slopewise.planner.ground.surface_table`.
    """
    on = [((bits >> i) & 1).astype(np.bool_) for i in range(len(table))]
    lower, upper = table[:, FRICTION], table[:, MOST_FRICTION]
    least = np.min([np.where(m, f, np.inf) for m, f in zip(on, lower, strict=True)], axis=0)
    most = np.max([np.where(m, f, 0.0) for m, f in zip(on, upper, strict=True)], axis=0)
    return least, most


def capped(forces: Forces, profile: TerrainProfile, least: Floats, most: Floats) -> Forces:
    """Cap both bounds by friction times the share of the weight that presses on the ground.

    What turns and banks take of it: :mod:`slopewise.planner.bounds.contact`.

    Args:
        forces: (N, M). profile: terrain under the wheels.
        least, most: friction, (N, M) [1].
    """
    upright = np.sqrt((1.0 - profile.sin_grade**2) * (1.0 - profile.sin_roll**2))
    slow, fast = forces.slowest, forces.fastest

    def extremes(speed_part: Floats, intercept_part: Floats) -> tuple[Floats, Floats]:
        ends = slow * speed_part + intercept_part, fast * speed_part + intercept_part
        return np.minimum(*ends), np.maximum(*ends)

    low, high = extremes(forces.lower_slope, forces.lower_intercept)
    slides = high > least * upright
    _, highest = extremes(forces.upper_slope, forces.upper_intercept)
    may_slide = highest > most * upright
    # Over a crest the ground is more upright between two stations than at either.
    uppermost = np.cos(level_between(profile.grade)) * np.cos(level_between(profile.roll))
    return forces._replace(
        lower_slope=np.where(slides, 0.0, forces.lower_slope),
        lower_intercept=np.where(slides, np.minimum(low, least * upright), forces.lower_intercept),
        upper_slope=np.where(may_slide, 0.0, forces.upper_slope),
        upper_intercept=np.where(
            may_slide, np.minimum(highest, most * uppermost), forces.upper_intercept
        ),
    )
