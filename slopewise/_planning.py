"""Speed plans along candidate paths, and the independent check of a plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.typed_arguments import typed_arguments
from slopewise.planner.ground.uncertainty import QUANTILE, Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.services.check.check_report import CheckReport
from slopewise.services.check.external_plan import ExternalPlan, plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.jobs.plan import RefusedPath, plan_paths, without_refused


class Plans(list[SpeedPlan]):
    """Plans, best first.

    Attributes:
        refused: paths that cannot be planned, each with its ``candidate`` and a ``reason``.
    """

    def __init__(self, plans: Sequence[SpeedPlan], refused: tuple[RefusedPath, ...]) -> None:
        super().__init__(plans)
        self.refused = refused


@typed_arguments
def plan(
    model: Model,
    elevation_map: ElevationMap,
    paths: Sequence[CandidatePath],
    *,
    start_speed: float = 0.0,
    clear: float = np.inf,
    quantile: float | None = QUANTILE,
    settings: PlannerSettings | None = None,
) -> Plans:
    """A checked speed plan for every candidate path, best first; ``refused`` names the others.

    Args:
        model: vehicle, braking, ground and limits.
        elevation_map: ground.
        paths: candidates; a malformed one is refused, an undrivable one gets a status.
        start_speed: speed at the first station [m/s].
        clear: station up to which the path is known to be free, from the first point [m].
        quantile: one-sided probability that margins cover the model's uncertainty; None plans with
            the model's mean, half of whose stops are longer.
        settings: spacing of the stations, smoothing, weights of the ranking.

    Raises:
        ParameterError: names the argument and what was expected; or the first candidate, where all
            are refused.
    """
    uncertainty = None if quantile is None else Uncertainty(quantile=quantile)
    planner = CandidatePlanner(model, settings, uncertainty)
    usable, refused = without_refused(planner, elevation_map, paths)
    plans, *_ = plan_paths(planner, elevation_map, usable, start_speed=start_speed, clear=clear)
    return Plans(plans, refused)


@typed_arguments
def check_plan(
    plan: SpeedPlan | ExternalPlan,
    model: Model,
    elevation_map: ElevationMap,
    *,
    clear: float = np.inf,
    quantile: float = QUANTILE,
) -> CheckReport:
    """Check a plan independently of the planner: every rule, on this ground.

    Ground, forces and every emergency stop are derived from the positions and speeds of the plan,
    at its rows and between them; its further columns have to agree. Shared with the planner are
    the model, the map, the formulas of named effects and gravity.

    Args:
        plan: plan of any planner: ``GivenPlan(name="mine", x=x, y=y, speed=speed)``.
        model: model that it has to hold for.
        elevation_map: ground as known now.
        clear: station up to which the path is known to be free, from the first station [m]; the
            plan's clear distance and the end of its path limit it, too.
        quantile: one-sided probability that margins cover the brakes' uncertainty; 0.5: the mean.

    Returns:
        ``valid``; the violations by station, kind and size; stopping distances (N,) [m] and
        smallest rear loads (N,) from each station, of the checker. A plan with status infeasible
        is never valid.

    Raises:
        ParameterError: fewer than two stations, columns of other lengths, or a start off the map.
    """
    if isinstance(plan, SpeedPlan) and len(plan.station) < 2:
        raise ParameterError("plan", f"at least 2 stations, got {len(plan.station)}")
    given = plan_of_columns(plan.columns()) if isinstance(plan, SpeedPlan) else plan
    return check_plan_on_map(given, model, elevation_map, clear=clear, quantile=quantile)
