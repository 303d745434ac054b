"""Force assumed on a surface without stops, and the surface that a new one replaces."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.calibration.published import PublishSettings
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking

_MAX_INVENTED = 32
"""Learned surfaces that neither file nor map names [1]: an invented name costs others no slot."""

_MAX_SURFACES = 96  # learned surfaces in all [1], so that plans, messages and store stay small

_MIN_STOP_COUNT = PublishSettings().fewest
_TOLERANCE = 1e-9
"""Rounding of F_b/W [1]."""


def prior_for_new_surface(
    prior: Braking, learned: Mapping[str, LearnedForce], share: float
) -> Floats:
    """(4,) a share of the weakest known force, of the file and of surfaces with many stops.

    The force of a surface with few stops is itself assumed and is ignored, and so is the one that
    a surface began with: an estimate that is not valid is used as fitted from its stops.
    """
    known = [prior, *(prior.on(name) for name in prior.terrain)]
    forces = [np.array([getattr(braking, name) for name in NAMES]) for braking in known]
    forces += [
        np.array(force.published if force.valid else force.estimate)
        for force in learned.values()
        if force.valid or force.accepted >= _MIN_STOP_COUNT
    ]
    fast = np.array([0.0, 0.0, prior.speed_range[1], 1.0])
    weakest = min(forces, key=lambda coefficients: float(fast @ coefficients))
    return np.asarray(share * weakest)


def select_surface_to_evict(
    surface: str,
    named: Collection[str],
    learned: Mapping[str, LearnedForce],
    updated: Mapping[str, float],
    new: tuple[Floats, Floats],
) -> str:
    """Surface that a new one replaces; "" while a slot is free.

    Surfaces of file and map have reserved slots; all other names share theirs. Among these the one
    updated the longest ago is evicted, unless it is valid, or weaker than a new surface is assumed
    to be: weak ground is never forgotten.

    Args:
        surface: name of the new one. named: surfaces of file and map.
        learned, updated: force of each surface, and when it was last updated [s].
        new: (4, 4) corners of the trained rectangle, and (4,) coefficients of a new surface.
    """
    invented = [name for name in learned if name and name not in named]
    if surface in named and len(learned) - len(invented) < _MAX_SURFACES:
        return ""
    if len(invented) < _MAX_INVENTED:
        return ""
    corners, coefficients = new
    assumed = corners @ coefficients - _TOLERANCE
    forces = {name: corners @ np.array(learned[name].published) for name in invented}
    spare = [n for n in invented if not learned[n].valid and np.all(forces[n] >= assumed)]
    if not spare:
        expected = (
            f"a surface of the model file or one of the {_MAX_INVENTED} learned surfaces"
            f" (no slot is free), got {surface}"
        )
        raise ParameterError("surface", expected)
    return min(spare, key=lambda name: updated.get(name, -np.inf))
