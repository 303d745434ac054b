"""Check one plan on a map with a model: all rules, at its rows and between them."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.input_errors import InputErrors, input_errors
from slopewise.models.parameters import Model
from slopewise.models.stop_promise import promised
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.averaged_heights import averaged
from slopewise.services.check.body_on_line import Body
from slopewise.services.check.check_report import CheckReport, ViolationLog
from slopewise.services.check.checked_drive import CheckedDrive, too_tight, turning_along
from slopewise.services.check.driving_checks import check_driving, check_speeds_at_side
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.obstacle_checks import obstacles_along, shows_steps, step_length
from slopewise.services.check.path_force import path_force_along
from slopewise.services.check.path_ground import LineGround, ground_under
from slopewise.services.check.plan_line import Line, line_of, motion_along, widest_spacing
from slopewise.services.check.reported_columns import (
    check_clear_distance,
    check_columns,
    check_reported_stops,
    check_status,
    verified_columns,
)
from slopewise.services.check.speed_claims import (
    breaches,
    check_limiting,
    check_speed_bound,
    held_at_rows,
    tried_speeds,
)
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.check.stop_ends import (
    CheckedStops,
    blocking_ground,
    check_places,
    check_stops,
    stops_at_rows,
    worst_stops,
)
from slopewise.services.check.tolerances import TOLERANCES

_MIN_TAIL = 0.3  # [m] of path behind the last row where stops may still end, at least
_STANDSTILL_NOTE = "the plan stands in one place"
_UNCHECKED = "jerk, and vertical acceleration on rough ground, are comfort and were not checked"


def check_plan_on_map(
    plan: ExternalPlan,
    model: Model,
    heights: ElevationMap,
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
    plan = plan.without_repeats()
    if len(plan.x) < 2:
        return _at_rest(plan)
    heights = averaged(heights, model.vehicle.wheel_radius)
    errors = input_errors(model.tracking, quantile if quantile > 0.5 else None)
    beyond, ends = _tail_and_ends(plan, max(clear - model.front, 0.0))
    line, sides = _line_and_sides(plan, beyond, model, errors)
    if quantile > 0.5:
        model = promised(model, quantile)
    first = 0.0 if plan.station is None else float(plan.station[0])

    def below(body: Body) -> tuple[LineGround, StopDynamics]:
        """Ground under a body on the line, and stops there."""
        ground = ground_under(heights, line._replace(body=body), model.vehicle)
        ground = ground._replace(station=ground.station + first)
        brakes = path_force_along(
            model, ground, line, heights.class_names, float(ndtri(quantile)), errors.latency
        )
        return ground, StopDynamics.along(model, line, ground, brakes, errors)

    ground, field = below(line.body)
    clear_at = np.minimum(line.between(ends) + 0.0, ground.station[-1])
    log = ViolationLog(plan.name, line.row, ground.station)
    log.notes.append(_UNCHECKED)
    _check_spacing(log, plan, line, model.vehicle, heights.resolution)
    turning = turning_along(line, model.steering_geometry)
    drive = CheckedDrive(plan, line, ground, field, turning, clear_at)
    stops = _check_rules(log, heights, drive)
    for ground, field in map(below, sides):
        _check_side(log, drive._replace(ground=ground, field=field))
    columns = drive.ground.station[line.at_row], stops.nominal[0], stops.nominal[1]
    texts = log.violations(), tuple(log.notes)
    return CheckReport(
        plan.name, plan.status, *texts, *columns, stops.lanes, *verified_columns(plan)
    )


def _line_and_sides(
    plan: ExternalPlan, beyond: float, model: Model, errors: InputErrors
) -> tuple[Line, list[Body]]:
    """The line with its band, and the body at both ends of what tracking errors make of it."""
    line = line_of(plan, beyond, model.steering_geometry, errors)
    body = line.body
    sides = [body.at_side(side) for side in (-1.0, 1.0) if body.across.any()]
    if plan.path_deviation is not None:
        deviation = line.between(plan.path_deviation)
        body = body.following(deviation, line.flat, model.vehicle.wheelbase)
    return line._replace(body=body), sides


def _check_rules(log: ViolationLog, heights: ElevationMap, drive: CheckedDrive) -> CheckedStops:
    """Note what motion, ground, stops and reported columns break; the stops from the rows."""
    plan, model, ground = drive.plan, drive.field.model, drive.ground
    motion = motion_along(drive.line, ground.station, plan.speed)
    check_columns(log, drive)
    check_places(log, drive, motion)
    driven = motion._replace(moving=motion.moving & ground.known)
    check_driving(log, drive, driven)
    blocked = np.any([there for _, there, _ in blocking_ground(drive)], axis=0)
    steps = np.zeros_like(blocked)
    obstacles = obstacles_along(heights, drive.line.body, ground, model.vehicle)
    for kind, excess, sentence, value in (*obstacles, too_tight(drive.turning, model)):
        if excess[0] > TOLERANCES[kind].value:  # It is in that already.
            excess[drive.line.row == 0] = -np.inf
        log.add(kind, excess, sentence, value, where=driven.moving)
        of_kind = steps if kind == "step" else blocked
        of_kind |= excess > TOLERANCES[kind].value
    if not shows_steps(heights, model.vehicle):
        log.notes.append(
            f"steps were not checked: cells of {heights.resolution:g} m do not show any to "
            f"wheels of radius {model.vehicle.wheel_radius:g} m"
        )
    tried = [held_at_rows(drive, speed) for speed in tried_speeds(plan)]
    worst, *ends = worst_stops(drive, (motion, *tried))
    check_stops(log, drive, motion, worst)
    stops = stops_at_rows(drive, motion, worst)
    below, near, far = (breaches(drive, *of) for of in zip(tried, ends, strict=True))
    check_reported_stops(log, drive, stops, driven.moving)
    length = step_length(heights, model.vehicle)
    check_clear_distance(log, drive, blocked, steps, heights.resolution, length)
    check_status(log, drive)
    check_speed_bound(log, drive, below)
    check_limiting(log, drive, motion, near, far)
    return stops


def _check_side(log: ViolationLog, edge: CheckedDrive) -> None:
    """Note what speeds and stops break on ground at an end of the band."""
    motion = motion_along(edge.line, edge.ground.station, edge.plan.speed)
    check_places(log, edge, motion)
    check_speeds_at_side(log, edge, motion._replace(moving=motion.moving & edge.ground.known))
    check_stops(log, edge, motion, *worst_stops(edge, (motion,)))


def _at_rest(plan: ExternalPlan) -> CheckReport:
    """Report of a plan that stands in one place."""
    log = ViolationLog(plan.name, np.zeros(1, np.int64), np.zeros(1), notes=[_STANDSTILL_NOTE])
    if plan.status == "infeasible":
        log.add("status", np.ones(1), "status is infeasible")
    level, nothing = np.ones(1), np.zeros(1)
    return CheckReport(
        plan.name, plan.status, log.violations(), tuple(log.notes), nothing, nothing, level, 0
    )


def _check_spacing(
    log: ViolationLog, plan: ExternalPlan, line: Line, vehicle: Vehicle, resolution: float
) -> None:
    """Note rows too far from the next one; nothing else is judged there."""
    steps, widest = (
        np.hypot(np.diff(plan.x), np.diff(plan.y)),
        widest_spacing(plan, vehicle, resolution),
    )
    sentence = "rows are {0:.2f} m apart: too sparse to judge, {1:.2f} m are the most here"
    log.add("spacing", steps / widest - 1.0, sentence, steps, widest, at=line.at_row[:-1])
    log.sparse.update(np.flatnonzero(steps > (1.0 + TOLERANCES["spacing"].value) * widest).tolist())


def _tail_and_ends(plan: ExternalPlan, clear: float) -> tuple[float, Floats]:
    """Length behind the last row, and stations before which stops from rows have to end (N,)."""
    steps = np.hypot(np.diff(plan.x), np.diff(plan.y))
    ends = np.full(len(plan.x), clear)
    if plan.clear_distance is not None:
        ends = np.minimum(ends, plan.clear_distance)
    beyond = 0.0
    if np.isfinite(ends).any():
        beyond = max(float(steps[-1]), _MIN_TAIL)
    # The end of a row, or that of the next: the nearer one.
    ends[:-1] = np.minimum(ends[:-1], ends[1:])
    return beyond, np.where(np.isfinite(ends), ends, 1e12)
