"""What a surface begins with that nobody braked on, and which ones make room for it."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.calibration.published import PublishSettings
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking

_MOST_GUESSES = 32
_MOST_NAMED = 96
_MANY = PublishSettings().fewest


def unheard_of(prior: Braking, learned: Mapping[str, LearnedForce], share: float) -> Floats:
    """(4,) a share of the weakest force known: of the file, and of what many stops have shown.

    What is itself a guess says nothing of further ground; what it was held for in the beginning
    does not either, so an estimate that is not valid counts as the stops tell it.
    """
    sure = [prior, *(prior.on(name) for name in prior.terrain)]
    known = [np.array([getattr(one, name) for name in NAMES]) for one in sure]
    known += [
        np.array(one.published if one.valid else one.estimate)
        for one in learned.values()
        if one.valid or one.accepted >= _MANY
    ]
    fast = np.array([0.0, 0.0, prior.speed_range[1], 1.0])
    weakest = min(known, key=lambda coefficients: float(fast @ coefficients))
    return np.asarray(share * weakest)


def makes_room(
    surface: str,
    named: Collection[str],
    learned: Mapping[str, LearnedForce],
    taught: Mapping[str, float],
    least: tuple[Floats, Floats],
) -> str:
    """Which surface a new one takes the place of; "" where there is room.

    Surfaces of file and map have places of their own; names that nobody knows share theirs. Among
    these the one that was taught the longest ago makes room, unless it is sure or told that its
    ground is weaker than new ground is taken to be: that is not forgotten.

    Args:
        surface: the new one. named: surfaces of file and map. learned, taught: what each surface
            taught, and when [s].
        least: (4, 4) corners of the trained rectangle, and (4,) what a new surface begins with.

    Raises:
        ParameterError: there is no room.
    """
    guesses = [name for name in learned if name and name not in named]
    if surface in named and len(learned) - len(guesses) < _MOST_NAMED:
        return ""
    if len(guesses) < _MOST_GUESSES:
        return ""
    corners, begins = least
    new = corners @ begins - 1e-9
    forces = {name: corners @ np.array(learned[name].published) for name in guesses}
    spare = [n for n in guesses if not learned[n].valid and np.all(forces[n] >= new)]
    if not spare:
        raise ParameterError("surface", f"one of at most {_MOST_GUESSES}, got {surface}")
    return min(spare, key=lambda name: taught.get(name, -np.inf))
