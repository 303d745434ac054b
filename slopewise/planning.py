"""Speed plans along candidate paths, and the independent check of a plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.errors import ParameterError
from models.parameters import Model
from planner.bounds.speed_bounds import speed_bounds
from planner.ground.braking_ground import ground_along
from planner.ground.elevation_map import ElevationMap
from planner.ground.terrain_profile import terrain_profile
from planner.ground.uncertainty import Uncertainty
from planner.path import CandidatePath
from planner.pipeline.candidates import CandidatePlanner
from planner.pipeline.ranking import rank
from planner.plan import SpeedPlan, Status
from planner.settings import PlannerSettings
from planner.verify.judge import Judgement, check
from planner.verify.track import track_of


def plan(
    model: Model,
    elevation_map: ElevationMap,
    paths: Sequence[CandidatePath],
    *,
    start_speed: float = 0.0,
    clear: float = np.inf,
    quantile: float | None = None,
    settings: PlannerSettings | None = None,
) -> list[SpeedPlan]:
    """A checked speed plan for every candidate path, best first.

    Args:
        model: vehicle, braking, ground and limits.
        elevation_map: ground.
        paths: candidates; a malformed one raises, an undrivable one gets a status.
        start_speed: speed at the first station [m/s].
        clear: station up to which the way is known free, counted from the first point [m].
        quantile: of what the model leaves open that the plans survive, e.g. 0.99; None plans with
            the model's mean.
        settings: spacing of the stations, smoothing, weights of the ranking.

    Raises:
        ParameterError: names the candidate or the argument, and what was expected.
    """
    uncertainty = None if quantile is None else Uncertainty(quantile=quantile)
    planner = CandidatePlanner(model, settings, uncertainty)
    plans = planner.plan(elevation_map, paths, start_speed=start_speed, clear=clear)
    return rank(plans, planner.settings)


def check_plan(
    plan: SpeedPlan,
    model: Model,
    elevation_map: ElevationMap,
    *,
    clear: float = np.inf,
) -> Judgement:
    """Drive a plan through the judge on a map: is every constraint kept, also between stations?

    The ground, the clear distance and every emergency stop are worked out anew from the positions
    of the plan; of the plan itself only its positions and speeds count.

    Args:
        plan: with stations on the map.
        model: that it has to hold for.
        elevation_map: ground as it is known now.
        clear: station up to which the way is known free, counted from the first station [m].

    Returns:
        ``valid``; stopping distance (N,) [m] and least axle and side loads (N,) from each station;
        the worst violation of each constraint, 0 where there is none; the segments they are in. Of
        a plan that is infeasible the emergency braking is not a violation.

    Raises:
        ParameterError: the plan has fewer than two stations.
    """
    n = len(plan.station)
    if n < 2:
        raise ParameterError("plan", f"at least 2 stations, got {n}")
    vehicle = model.vehicle
    x, y = (np.ascontiguousarray(values[:, None]) for values in (plan.x, plan.y))
    profile = terrain_profile(
        elevation_map, x, y, np.array([n]), vehicle.wheelbase, vehicle.track_width
    )
    ground = ground_along(profile, model, elevation_map.class_names)
    bounds = speed_bounds(profile, ground, model, np.array([clear], np.float64))
    emergency = plan.status is Status.INFEASIBLE
    return check(
        track_of(profile, bounds.ground, 0), np.square(plan.speed), float(bounds.clear_distance[0]),
        float(ground.distance_offset[0]), ground.motion, model,
        even=track_of(profile, bounds.even_ground, 0), errors=ground.errors,
        decel=np.inf if emergency else None,
    )  # fmt: skip
