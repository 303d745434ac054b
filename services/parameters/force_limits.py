"""Bounds of learned braking: how far above the model file, on new surfaces, on how many of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.calibration.published import PublishSettings
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import corner_design
from slopewise.models.parameters import Braking

_REPORTED_EXCESS = 1e-3
"""Smallest F_b/W above the file that is reported [1]: a tenth of the step that one stop may add."""

_TYPICAL_EXCESS = 0.10
"""Share of the file's force by which stops may show more on a vehicle that is as calibrated [1]."""

_MAX_INVENTED = 32
"""Learned surfaces that neither file nor map names [1]: an invented name costs others no slot."""

_MAX_SURFACES = 96  # learned surfaces in all [1], so that plans, messages and store stay small
_MIN_STOP_COUNT = PublishSettings().min_stops
_BOUND_TOLERANCE = 1e-6  # rounding of stored F_b/W at the bounds [1]
FORCE_ROUNDING = 1e-9  # of F_b/W [1]


def validate_force(force: LearnedForce, prior: Braking, corners: Floats) -> None:
    """Raise unless the brakes slow the vehicle at all corners (4, 4) of the trained rectangle."""
    bounds = PublishSettings()
    forces = corners @ np.array(force.published)
    low, high = bounds.min_force - _BOUND_TOLERANCE, bounds.max_force + _BOUND_TOLERANCE
    if not np.all((forces >= low) & (forces <= high)):
        expected = f"F_b/W of {bounds.min_force} … {bounds.max_force} at trained speeds and grades"
        got = f"{forces.min():.3f} … {forces.max():.3f}"
        raise ParameterError(", ".join(NAMES), f"{expected}, got {got}")
    m_m, b_m, m_b, b_b = force.published
    dataclasses.replace(prior, m_m=m_m, b_m=b_m, m_b=m_b, b_b=b_b)


def limit_increase(prior: Braking, used: Braking, share: float) -> tuple[Braking, list[str]]:
    """Learned braking with no F_b/W above the file's by more than a share [1] of it.

    F_b/W is bilinear in speed and grade: a limit at the four corners of the trained rectangle is
    one everywhere in it. Also returns surfaces on which it still exceeds the file; "" is the base.
    """
    base, above = _limit_surface(prior, used, share)
    stronger = [""] if above else []
    tables = {}
    for name, table in used.terrain.items():
        changes, above = _limit_surface(prior.on(name), used.on(name), share)
        tables[name] = dataclasses.replace(table, **changes) if changes else table
        stronger += [name] if above else []
    if not base and tables == used.terrain:
        return used, stronger
    return dataclasses.replace(used, terrain=tables, **base), stronger


def _limit_surface(prior: Braking, used: Braking, share: float) -> tuple[dict[str, Any], bool]:
    """Coefficients to replace, empty within the limit; True if the force exceeds the file."""
    corners = corner_design(used.speed_range, used.grade_range)
    file, force = corners @ prior.coefficients, corners @ used.coefficients
    limit = file + share * np.abs(file)
    excess = np.minimum(force, limit) - file
    above = bool(np.any(excess > _REPORTED_EXCESS))
    if prior.distance is not None:
        # Sessions differ, and corners more than the middle: neither is reported.
        typical = (_TYPICAL_EXCESS + 3.0 * prior.distance.session_std) * file.mean()
        above = bool(excess.mean() > typical)
    if np.all(force <= limit + FORCE_ROUNDING):
        return {}, above
    lower = np.linalg.solve(corners, np.minimum(force, limit))
    return dict(zip(NAMES, lower.tolist(), strict=True)), above


def prior_for_new_surface(
    prior: Braking, learned: Mapping[str, LearnedForce], share: float
) -> Floats:
    """(4,) a share of the weakest known force, of the file and of surfaces with many stops.

    The force of a surface with few stops is itself assumed and is ignored, and so is the one that
    a surface began with: an estimate that is not valid is used as fitted from its stops.
    """
    forces = [np.array(known.coefficients) for known in (prior, *map(prior.on, prior.terrain))]
    forces += [
        np.array(force.published if force.valid else force.estimate)
        for force in learned.values()
        if force.valid or force.accepted >= _MIN_STOP_COUNT
    ]
    fast = np.array([0.0, 0.0, prior.speed_range[1], 1.0])
    return np.asarray(share * min(forces, key=lambda coefficients: float(fast @ coefficients)))


def select_surface_to_evict(
    surface: str,
    named: Collection[str],
    learned: Mapping[str, LearnedForce],
    updated: Mapping[str, float],
    new: tuple[Floats, Floats],
) -> str:
    """Surface that a new one replaces; "" while a slot is free.

    Surfaces that file or map name have reserved slots; all other names share theirs. Among these
    the one ``updated`` the longest ago is evicted, unless it is valid, or weaker than a new surface
    is assumed to be: weak ground is never forgotten. ``new``: (4, 4) corners of the trained
    rectangle, and (4,) coefficients of a new surface.
    """
    invented = [name for name in learned if name and name not in named]
    if surface in named and len(learned) - len(invented) < _MAX_SURFACES:
        return ""
    if len(invented) < _MAX_INVENTED:
        return ""
    corners, coefficients = new
    assumed = corners @ coefficients - FORCE_ROUNDING
    forces = {name: corners @ np.array(learned[name].published) for name in invented}
    spare = [n for n in invented if not learned[n].valid and np.all(forces[n] >= assumed)]
    if not spare:
        expected = (
            f"a surface of the model file or one of the {_MAX_INVENTED} learned surfaces"
            f" (no slot is free), got {surface}"
        )
        raise ParameterError("surface", expected)
    return min(spare, key=lambda name: updated.get(name, -np.inf))
