"""Judge one plan on a map with a model: all rules, at its rows and between them."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.check.brakes import brakes_along
from slopewise.services.check.columns import judge_columns, judge_told_stops
from slopewise.services.check.driving import judge_driving
from slopewise.services.check.given_plan import GivenPlan
from slopewise.services.check.ground import ground_under
from slopewise.services.check.heights import Heights, in_cells
from slopewise.services.check.line import Line, line_of
from slopewise.services.check.motion import motion_along
from slopewise.services.check.obstacles import judge_obstacles
from slopewise.services.check.report import CheckReport, Ledger
from slopewise.services.check.standing import judge_places, judge_stops
from slopewise.services.check.stop_field import StopField

_ON = 0.3  # [m] behind its last row a plan may still end a stop at least
_STANDS = "the plan stands in one place"
_UNJUDGED = "jerk, and vertical acceleration on rough ground, are comfort and were not judged"


def check(
    plan: GivenPlan,
    model: Model,
    heights: Heights,
    *,
    clear: float = np.inf,
    quantile: float = 0.5,
) -> CheckReport:
    """Does a plan keep every rule of its model on this ground?

    Args:
        plan: N rows of positions and speeds, SI, with any further columns.
        model: vehicle, braking, effects and limits; effects at their means.
        heights: map.
        clear: station up to which the way is known free, and before which the front of the vehicle
            stays [m]. The plan's own clear distance and the end of its path, both for the middle of
            the wheelbase, count as well.
        quantile: of what the model leaves open of its brakes, from its mean at 0.5 on; errors of
            the map and of effects are left to whoever plans with margins.

    Returns:
        Every violation with its row, kind and size; none for a plan that may be driven.

    Raises:
        ParameterError: the plan begins off the map.
    """
    if not clear >= 0.0:
        raise ParameterError("clear", f"a distance >= 0 [m], got {clear:g}")
    if not 0.5 <= quantile < 1.0:
        raise ParameterError("quantile", f"a share in [0.5, 1), got {quantile:g}")
    _check_begin(plan, heights)
    plan = plan.without_repeats()
    if len(plan.x) < 2:
        at_rest = Ledger(plan.name, np.zeros(1, np.int64), np.zeros(1), notes=[_STANDS])
        return _report(plan, at_rest, np.zeros(1), np.array([[0.0], [1.0]]), 0)
    line, ends = _line_and_end(plan, max(clear - model.vehicle.shape.front, 0.0))
    ground = ground_under(heights, line, model.vehicle)
    first = 0.0 if plan.station is None else float(plan.station[0])
    ground = ground._replace(station=ground.station + first)
    brakes = brakes_along(model, ground, line, heights.class_names, float(ndtri(quantile)))
    ledger = Ledger(plan.name, line.row, ground.station)
    ledger.notes.append(_UNJUDGED)
    judge_columns(ledger, plan, line, ground)
    motion = motion_along(line, ground.station, plan.speed, plan.status)
    field = StopField.along(model, line, ground, brakes)
    rows = line.at_row
    clear_at = np.minimum(line.between(ends) + 0.0, ground.station[-1])
    if plan.status == "infeasible":
        ledger.notes.append("the plan says that it cannot be made safe, so its stops do not count")
        return _report(plan, ledger, ground.station[rows], np.zeros((2, len(rows))), 0)
    judge_places(ledger, model, ground, brakes, motion)
    driven = motion._replace(moving=motion.moving & ground.known)
    judge_driving(ledger, model, line, ground, brakes, driven, plan.speed_limit)
    judge_obstacles(ledger, heights, line, ground, model.vehicle, driven.moving)
    judged = judge_stops(ledger, field, ground, motion, clear_at, rows)
    judge_told_stops(ledger, plan, line, judged, driven.moving)
    told = np.stack((judged.distance, judged.rear))
    return _report(plan, ledger, ground.station[rows], told, judged.lanes)


def _check_begin(plan: GivenPlan, heights: Heights) -> None:
    u, v = in_cells(heights, plan.x[:1], plan.y[:1])
    rows, columns = heights.elevation.shape
    if not (0.0 <= u[0] <= columns - 1 and 0.0 <= v[0] <= rows - 1):
        found = f"x {plan.x[0]:.10g}, y {plan.y[0]:.10g}"
        raise ParameterError("x, y", f"a first row on the map, got {found}")


def _line_and_end(plan: GivenPlan, clear: float) -> tuple[Line, Floats]:
    """Samples of a plan, and the station before which stops from its rows have to end, (N,)."""
    steps = np.hypot(np.diff(plan.x), np.diff(plan.y))
    ends = np.full(len(plan.x), clear)
    if plan.clear_distance is not None:
        ends = np.minimum(ends, plan.clear_distance)
    beyond = 0.0
    if np.isfinite(ends).any():
        beyond = max(float(steps[-1]), _ON)
    # A row's own end, or that of the next, whichever is nearer.
    ends[:-1] = np.minimum(ends[:-1], ends[1:])
    finite = np.where(np.isfinite(ends), ends, 1e12)
    return line_of(plan, beyond), finite


def _report(
    plan: GivenPlan, ledger: Ledger, station: Floats, told: Floats, stops: int
) -> CheckReport:
    return CheckReport(
        plan.name,
        plan.status,
        ledger.violations(),
        tuple(ledger.notes),
        station,
        told[0],
        told[1],
        stops,
    )
