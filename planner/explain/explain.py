"""Limits of a plan's speed: what limits it where, what each bound costs, what to measure next.

Costs come from planning again with one bound lifted, not from shadow prices. A shadow price is the
slope of the cost at the present bound; most bounds here are steps (unknown ground, a clear
distance, the trained range), and where two bounds lie close together the second takes over, which a
slope does not see. Planning again is exact, and one candidate takes milliseconds.

Costs do not add up: where two bounds hold the plan at the same speed, lifting either one alone
gains nothing, and each of them costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.explain.measurements import MEASURABLE
from slopewise.planner.explain.relaxed import without
from slopewise.planner.explain.what_if import Assumptions, WhatIf
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import EvenPath
from slopewise.planner.pipeline.ranking import travel_cost
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings

_SMOOTHING = 5e-4
"""Share of the travel time by which smoothing may differ from one plan to the next."""

_MIN_REACH = 0.05
"""A plan that gets farther by more than that gets farther [m]."""


@dataclass(frozen=True, slots=True)
class LimitedStretch:
    """Neighbouring stations that the same bound limits.

    Attributes:
        begin, end: stations [m]. seconds: spent between them.
        limiting: the bound.
    """

    begin: float
    end: float
    limiting: Limiting
    seconds: float


@dataclass(frozen=True, slots=True)
class BoundCost:
    """Gain of the plan without a bound.

    Attributes:
        limiting: the bound.
        seconds: travel time, and for each metre not reached the charge of the ranking [s]; >= 0.
        reach: how much farther the plan would get [m]; >= 0.
    """

    limiting: Limiting
    seconds: float
    reach: float


@dataclass(frozen=True, slots=True)
class Measurement:
    """Gain of knowing a quantity exactly.

    Attributes:
        name: of what is measured.
        seconds, reach: as in :class:`BoundCost`, at most: a measurement may also find it worse.
        sentence: the same as text.
    """

    name: str
    seconds: float
    reach: float
    sentence: str


@dataclass(frozen=True, slots=True)
class Explanation:
    """Explanation of a plan.

    Attributes:
        plan: what is explained.
        stretches: where what limits it, up to where it rests; none if it never moves.
        costs: of every bound, the dearest first.
        measurements: the one that buys most first.
    """

    plan: SpeedPlan
    stretches: tuple[LimitedStretch, ...]
    costs: tuple[BoundCost, ...]
    measurements: tuple[Measurement, ...]


def explain(
    model: Model,
    elevation_map: ElevationMap,
    path: CandidatePath | EvenPath,
    *,
    settings: PlannerSettings | None = None,
    uncertainty: Uncertainty | None = None,
    start_speed: float = 0.0,
    clear: float = np.inf,
) -> Explanation:
    """Plan one candidate, and again with each bound lifted and with each thing known better.

    Args:
        model: its mean, as :class:`slopewise.planner.pipeline.candidates.CandidatePlanner` takes
        it.
        elevation_map: ground.
        path: the candidate.
        settings: of planning.
        uncertainty: what plans have to survive, None for the mean alone.
        start_speed: at the first station [m/s].
        clear: station up to which the ground is known to be free [m].

    Raises:
        ParameterError: the path is malformed.
    """
    settings = settings or PlannerSettings()
    model = within_sight(model, elevation_map, settings.unseen_steps)
    what_if = WhatIf(elevation_map, path, model, settings=settings, start_speed=start_speed)
    assumptions = Assumptions(
        model=model, uncertainty=uncertainty, clear=clear, smooth=settings.smooth
    )
    plan = what_if.plan(assumptions)

    def gain(relaxed: Assumptions) -> tuple[float, float]:
        return _gain(plan, what_if.plan(relaxed), settings)

    costs = [BoundCost(bound, *gain(without(bound, assumptions))) for bound in Limiting]
    measurements = []
    for measurable in MEASURABLE:
        seconds, reach = gain(measurable.known(assumptions))
        sentence = f"{measurable.text}: {_bought(seconds, reach)}"
        measurements.append(Measurement(measurable.name, seconds, reach, sentence))
    return Explanation(
        plan,
        stretches(plan),
        tuple(sorted(costs, key=lambda cost: -cost.seconds)),
        tuple(sorted(measurements, key=lambda measurement: -measurement.seconds)),
    )


def stretches(plan: SpeedPlan) -> tuple[LimitedStretch, ...]:
    """Where what limits a plan. What holds at a station holds up to the next."""
    moving = np.flatnonzero(plan.speed > 0.0)
    if len(moving) == 0:
        return ()
    rest = min(int(moving[-1]) + 1, len(plan.station) - 1)
    codes = plan.limiting[:rest]
    edges = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), rest]
    return tuple(
        LimitedStretch(
            float(plan.station[i]),
            float(plan.station[k]),
            Limiting(int(codes[i])),
            float(plan.time[k] - plan.time[i]),
        )
        for i, k in pairwise(edges)
    )


def _gain(plan: SpeedPlan, relaxed: SpeedPlan, settings: PlannerSettings) -> tuple[float, float]:
    """Seconds and metres that another plan is better by.

    The plan itself stays possible when a bound is lifted, so nothing can be lost; differences
    within the tolerance of smoothing are not listed.
    """
    seconds = travel_cost(plan, settings) - travel_cost(relaxed, settings)
    if seconds <= _SMOOTHING * plan.travel_time:
        return 0.0, 0.0
    reach = relaxed.progress - plan.progress
    return seconds, reach if reach > _MIN_REACH else 0.0


def _bought(seconds: float, reach: float) -> str:
    if seconds <= 0.0:
        return "nothing here"
    if reach > 0.0:
        return f"up to {reach:.1f} m farther, worth {seconds:.2f} s"
    return f"up to {seconds:.2f} s"
