"""Check one plan on a map with a model: all rules, at its rows and between them."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_promise import promised
from slopewise.services.check.averaged_heights import averaged
from slopewise.services.check.check_report import CheckReport, ViolationLog
from slopewise.services.check.driving_checks import check_driving
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.heights import Heights, in_cells
from slopewise.services.check.obstacle_checks import check_obstacles
from slopewise.services.check.path_force import path_force_along
from slopewise.services.check.path_ground import ground_under
from slopewise.services.check.plan_line import Line, line_of, motion_along
from slopewise.services.check.reported_columns import check_columns, check_reported_stops
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_ends import CheckedStops, check_places, check_stops

_MIN_TAIL = 0.3  # [m] of path behind the last row where stops may still end, at least
_STANDSTILL_NOTE = "the plan stands in one place"
_UNCHECKED = "jerk, and vertical acceleration on rough ground, are comfort and were not checked"


def check_plan_on_map(
    plan: ExternalPlan,
    model: Model,
    heights: Heights,
    *,
    clear: float = np.inf,
    quantile: float = 0.5,
) -> CheckReport:
    """Check that a plan keeps every rule of its model on this ground.

    Args:
        plan: N rows of positions and speeds, SI, with any further columns.
        model: vehicle, braking, effects and limits; effects at their means.
        clear: station up to which the path is known to be free, and before which the front of the
            vehicle stays [m]. The plan's own clear distance and the end of its path are used as
            well, for the middle of the wheelbase.
        quantile: one-sided probability that the checked stops cover the uncertainty of the brakes;
            0.5 is the mean. Errors of the map and of effects are not included.

    Returns:
        Every violation with its row, kind and size; none for a plan that may be driven.
    """
    if not clear >= 0.0:
        raise ParameterError("clear", f"a distance >= 0 [m], got {clear:g}")
    if not 0.5 <= quantile < 1.0:
        raise ParameterError("quantile", f"a share in [0.5, 1), got {quantile:g}")
    _check_begin(plan, heights)
    plan = plan.without_repeats()
    if len(plan.x) < 2:
        at_rest = ViolationLog(
            plan.name, np.zeros(1, np.int64), np.zeros(1), notes=[_STANDSTILL_NOTE]
        )
        return _report(plan, at_rest, np.zeros(1), CheckedStops(np.zeros(1), np.ones(1), 0))
    heights = averaged(heights, model.vehicle.wheel_radius)
    line, ends = _line_and_end(plan, max(clear - model.vehicle.shape.front, 0.0))
    ground = ground_under(heights, line, model.vehicle)
    first = 0.0 if plan.station is None else float(plan.station[0])
    ground = ground._replace(station=ground.station + first)
    if quantile > 0.5:
        model = promised(model, quantile)
    brakes = path_force_along(model, ground, line, heights.class_names, float(ndtri(quantile)))
    log = ViolationLog(plan.name, line.row, ground.station)
    log.notes.append(_UNCHECKED)
    check_columns(log, plan, line, ground)
    motion = motion_along(line, ground.station, plan.speed, plan.status)
    field = StopDynamics.along(model, line, ground, brakes)
    rows = line.at_row
    clear_at = np.minimum(line.between(ends) + 0.0, ground.station[-1])
    if plan.status == "infeasible":
        log.notes.append("the plan says that it cannot be made safe, so its stops were not checked")
        unchecked = CheckedStops(np.zeros(len(rows)), np.zeros(len(rows)), 0)
        return _report(plan, log, ground.station[rows], unchecked)
    check_places(log, model, ground, brakes, motion)
    driven = motion._replace(moving=motion.moving & ground.known)
    check_driving(log, model, line, ground, brakes, driven, plan.speed_limit)
    check_obstacles(log, heights, line, ground, model.vehicle, driven.moving)
    nominal = check_stops(log, field, ground, motion, clear_at, rows)
    check_reported_stops(log, plan, line, nominal, driven.moving)
    return _report(plan, log, ground.station[rows], nominal)


def _check_begin(plan: ExternalPlan, heights: Heights) -> None:
    u, v = in_cells(heights, plan.x[:1], plan.y[:1])
    rows, columns = heights.elevation.shape
    if not (0.0 <= u[0] <= columns - 1 and 0.0 <= v[0] <= rows - 1):
        got = f"x {plan.x[0]:.10g}, y {plan.y[0]:.10g}"
        raise ParameterError("x, y", f"a first row on the map, got {got}")


def _line_and_end(plan: ExternalPlan, clear: float) -> tuple[Line, Floats]:
    """Samples of a plan, and the station before which stops from its rows have to end, (N,)."""
    steps = np.hypot(np.diff(plan.x), np.diff(plan.y))
    ends = np.full(len(plan.x), clear)
    if plan.clear_distance is not None:
        ends = np.minimum(ends, plan.clear_distance)
    beyond = 0.0
    if np.isfinite(ends).any():
        beyond = max(float(steps[-1]), _MIN_TAIL)
    # The end of a row, or that of the next: the nearer one.
    ends[:-1] = np.minimum(ends[:-1], ends[1:])
    finite = np.where(np.isfinite(ends), ends, 1e12)
    return line_of(plan, beyond), finite


def _report(
    plan: ExternalPlan, log: ViolationLog, station: Floats, stops: CheckedStops
) -> CheckReport:
    name, status = plan.name, plan.status
    return CheckReport(name, status, log.violations(), tuple(log.notes), station, *stops)
