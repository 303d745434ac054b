"""Quantities that could be measured better, and the plan if they were."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slopewise.models.parameters import Model
from slopewise.planner.explain.relaxed import trained_for
from slopewise.planner.explain.what_if import Assumptions


@dataclass(frozen=True, slots=True)
class Measurable:
    """One thing that could be known better than it is.

    Attributes:
        name: in files.
        text: what to do, the beginning of a sentence.
        known: the assumptions if that were known exactly.
    """

    name: str
    text: str
    known: Callable[[Assumptions], Assumptions]


def _braking_known(assumptions: Assumptions) -> Assumptions:
    effects = tuple(replace(e, covariance=None) for e in assumptions.model.effect)
    exact = _everywhere(assumptions.model, covariance=None, force_std=0.0, force_scatter=0.0)
    model = replace(exact, effect=effects)
    uncertainty = assumptions.uncertainty
    fresh = None if uncertainty is None else replace(uncertainty, age=0.0)
    return replace(assumptions, model=model, uncertainty=fresh)


def _slopes_known(assumptions: Assumptions) -> Assumptions:
    uncertainty = assumptions.uncertainty
    exact = None if uncertainty is None else replace(uncertainty, slope_std=0.0)
    return replace(assumptions, uncertainty=exact)


def _everywhere(model: Model, **changes: Any) -> Model:
    """The model with keys of [braking] changed on the base and on all surfaces."""
    base = model.braking
    surfaces = {name: replace(table, **changes) for name, table in base.terrain.items()}
    return replace(model, braking=replace(base, terrain=surfaces, **changes))


MEASURABLE = (
    Measurable(
        "braking",
        "more and fresher stops, until the braking coefficients are exact",
        _braking_known,
    ),
    Measurable(
        "dead_time",
        "a dead time that is the same in every stop and known exactly",
        lambda q: replace(q, model=_everywhere(q.model, dead_time_std=0.0)),
    ),
    Measurable(
        "stop_offset",
        "predicted stops that need no safety offset on their distance",
        lambda q: replace(q, model=_everywhere(q.model, distance_offset=0.0)),
    ),
    Measurable(
        "clear_distance",
        "a way known to be free as far as the path goes",
        lambda q: replace(q, clear=np.inf),
    ),
    Measurable("map_slopes", "exact grades and rolls in the map", _slopes_known),
    Measurable(
        "map_coverage",
        "a scan of the unknown ground, if it is level",
        lambda q: replace(q, ground_known=True),
    ),
    Measurable(
        "speed_range",
        "stops from higher speeds, up to the speed limit",
        lambda q: replace(q, model=trained_for(q.model, speeds=True)),
    ),
    Measurable(
        "grade_range",
        "stops on steeper ground",
        lambda q: replace(q, model=trained_for(q.model, grades=True)),
    ),
    Measurable(
        "surface",
        "stops on the surfaces never braked on, if they brake as the known ground does",
        lambda q: replace(q, surfaces_known=True),
    ),
)
"""All of them; where nothing depends on one, knowing it changes nothing."""
