"""Vehicles that follow given polylines at planned speeds, by separate kinematics.

Nothing here is the planner's: the exact follower turns its body as a wheelbase lets it, the other
one pursues a point ahead of it. Both take the plan's speed at the place that they have reached. An
exact follower must touch no wall or post that is as close to a plan as it still passes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan

from ..tracking.passes import Poses, poses_on, strikes
from .given_lines import arc_of

PLACE_STEP = 0.02  # [m] between places on the line
_TOLERANCE = 0.05  # [1] of a share: curvature is sampled, by plan and follower
_REACH = 1.5  # [m] along the plan within which a place is looked for
_PLACE_ERROR = 0.05  # [m] by which a nearest place may be off
_GRAVITY = 9.81  # [m/s²]


class Drive(NamedTuple):
    """Shares of limits that a drive takes at most, 1 is the limit."""

    lateral: float  # of the model's lateral acceleration [1]
    rollover: float  # of the load that may leave a side [1]
    friction: float  # of the ground's friction [1]
    stopping: float  # of the distance to the plan's end [1]

    def beyond(self, *, counts_lateral: bool) -> bool:
        """Return True if a limit is exceeded; a pursuer swings beyond the curvature of any line."""
        shares = (self.rollover, self.friction, self.stopping)
        return max(*shares, self.lateral * counts_lateral) > 1.0 + _TOLERANCE


class Places(NamedTuple):
    """Places on the given line up to where the plan rests, (n,) each."""

    arc: Floats  # [m]
    x: Floats  # x, y: position [m]
    y: Floats
    heading: Floats  # [rad]
    speed: Floats  # of the plan there [m/s]
    stop: Floats  # stopping distance of the plan there [m]


def places(given: Floats, plan: SpeedPlan, measured: Floats) -> Places:
    """Given line in steps of 2 cm with the speed that the plan has at the nearest of its places."""
    x, y = dense(given, measured)
    at: Floats = PLACE_STEP * np.arange(len(x), dtype=np.float64)
    nearest = along_plan(x, y, plan)
    number = np.arange(len(plan.station))
    speed: Floats = np.sqrt(np.interp(nearest, number, plan.speed**2))
    stop: Floats = np.interp(nearest, number, plan.stop_distance)
    rest = plan.station[-1] if plan.speed[-1] > 0.0 else plan.progress
    end = np.interp(rest, plan.station, number)
    n = max(int(np.argmax(nearest >= end - 1e-6)), 1) if nearest[-1] >= end - 1e-6 else len(at)
    heading: Floats = np.arctan2(np.gradient(y), np.gradient(x))
    return Places(at[:n], x[:n], y[:n], heading[:n], speed[:n], stop[:n])


def along_plan(x: Floats, y: Floats, plan: SpeedPlan) -> Floats:
    """Number of the station, with a share, that each of the places in order is nearest to."""
    step = np.stack((np.diff(plan.x), np.diff(plan.y)), axis=1)
    square = np.maximum((step**2).sum(axis=1), 1e-12)
    arc = np.concatenate(([0.0], np.cumsum(np.sqrt(square))))
    number, at = np.empty(len(x)), 0.0
    for i in range(len(x)):
        low = max(int(np.searchsorted(arc, at - 0.3, "right")) - 1, 0)
        high = max(min(int(np.searchsorted(arc, at + _REACH)), len(square)), low + 1)
        off_x, off_y = x[i] - plan.x[low:high], y[i] - plan.y[low:high]
        part, size = step[low:high], square[low:high]
        share = np.clip((off_x * part[:, 0] + off_y * part[:, 1]) / size, 0.0, 1.0)
        away = (off_x - share * part[:, 0]) ** 2 + (off_y - share * part[:, 1]) ** 2
        k = int(np.argmin(away))
        at = float(arc[low + k] + share[k] * np.sqrt(size[k]))
        number[i] = low + k + share[k]
    return number


def follow_exactly(
    given: Floats, plan: SpeedPlan, model: Model, slope: Floats, *, steers_at_noise: bool = True
) -> Drive:
    """A vehicle on the line itself, which turns as the arc that fits the line under it best.

    From its rear axle to its front axle a body rounds any corner; the arc is the parabola of least
    squares, by the filter of Savitzky and Golay. Noise of a shorter length is not steered at: along
    a recorded line the arc is twice as long. ``given`` is (n, 2) [m], ``slope`` the gradient (2,)
    of the plane [1].
    """
    # Noise makes the polyline longer than the way that is driven along it.
    smooth = given if steers_at_noise else averaged(given, model.vehicle.wheelbase)
    line, (x, y) = places(given, plan, smooth), dense(given, smooth)
    n = len(line.arc)
    span = (0.5 if steers_at_noise else 1.0) * model.vehicle.wheelbase
    dx, dy, ddx, ddy = (_derivative(v, span, o)[:n] for o in (1, 2) for v in (x, y))
    curvature = (dx * ddy - dy * ddx) / np.maximum(np.hypot(dx, dy), 0.1) ** 3
    sharpest = model.steering_geometry.max_curvature
    curvature = np.clip(curvature, -sharpest, sharpest)
    along = np.interp(line.arc, arc_of(smooth), arc_of(given))
    heading = np.arctan2(dy, dx)
    if model.vehicle.drive == "ackermann":
        # Its body, which the bank tilts, trails the direction of the line in turns.
        body = poses_on(x, y, model)
        behind = arc_of(np.stack((body.x, body.y), axis=1))
        heading = np.interp(line.arc, behind, np.unwrap(body.heading))
    line = line._replace(heading=heading, arc=along)
    return _felt(line, curvature, plan, model, slope, float(along[-1]))


def dense(given: Floats, measured: Floats) -> tuple[Floats, Floats]:
    """Places of a polyline in steps of 2 cm, by the way along another with as many points."""
    arc = arc_of(measured)
    distinct = np.concatenate(([True], np.diff(arc) > 0.0))
    at = np.arange(0.0, arc[-1], PLACE_STEP)
    x, y = (np.interp(at, arc[distinct], given[distinct, axis]) for axis in range(2))
    return x, y


def _derivative(values: Floats, span: float, order: int) -> Floats:
    """Derivative along a line by parabolas over a length to both sides [m]."""
    window = min(2 * round(span / PLACE_STEP) + 1, (len(values) - 1) // 2 * 2 + 1)
    return np.asarray(savgol_filter(values, window, 2, deriv=order, delta=PLACE_STEP))


def averaged(points: Floats, length: float) -> Floats:
    """Points averaged over a length [m] of their usual distance."""
    step = float(np.median(np.hypot(*np.diff(points, axis=0).T)))
    size = 2 * int(0.5 * length / step) + 1
    return np.asarray(uniform_filter1d(points, size, axis=0, mode="nearest"))


def _felt(
    line: Places, curvature: Floats, plan: SpeedPlan, model: Model, slope: Floats, end: float
) -> Drive:
    """Shares of limits from curvatures at places, (n,) [1/m]; the line may be driven to ``end``."""
    limits, vehicle = model.limits, model.vehicle
    # Left side up is positive: the height rises to the left of the heading.
    roll = np.arctan(-np.sin(line.heading) * slope[0] + np.cos(line.heading) * slope[1])
    turning = line.speed**2 * curvature
    felt = turning + _GRAVITY * np.sin(roll)
    outward = _GRAVITY * np.maximum(np.sign(curvature) * np.sin(roll), 0.0)
    allowed = np.maximum(limits.lateral_accel, outward + 0.1 * limits.lateral_accel)
    lateral = (np.abs(turning) + outward) / allowed
    lever = vehicle.cg_z / (0.5 * vehicle.track_width)
    lost = np.abs(felt) / _GRAVITY * lever
    rollover = lost / (1.0 - limits.min_load)
    friction = np.zeros_like(lateral)
    if model.braking.sliding_friction is not None:
        friction = np.hypot(felt, limits.decel) / (model.braking.sliding_friction * _GRAVITY)
    # The last place of the line that may be reached is as far behind its end as in the plan.
    left = end - line.arc + max(plan.clear_distance - plan.progress, 0.0) + _PLACE_ERROR
    stopping = np.where(line.speed > 0.05, line.stop / np.maximum(left, 1e-6), 0.0)
    return Drive(*(float(share.max()) for share in (lateral, rollover, friction, stopping)))


def pursue(
    given: Floats, plan: SpeedPlan, model: Model, slope: Floats, rng: np.random.Generator
) -> Drive:
    """A kinematic vehicle that steers to a point ahead on the line, and is stopped at a place."""
    line, dt = places(given, plan, given), 0.02
    base = model.vehicle.wheelbase
    lookahead, headway = base * rng.uniform(1.0, 2.0), rng.uniform(0.0, 0.5)
    sharpest = model.steering_geometry.max_curvature
    sharpest = sharpest if np.isfinite(sharpest) else 2.0 / base
    stopped_at = rng.uniform(0.2, 1.0) * line.arc[-1]
    x, y, speed, i = line.x[0], line.y[0], line.speed[0], 0
    far = min(20, len(line.x) - 1)
    pointing = np.arctan2(line.y[far] - y, line.x[far] - x)
    rows: list[tuple[int, float, float, float]] = []
    for _ in range(20_000):
        ahead = slice(i, min(i + 60, len(line.x)))
        i += int(np.argmin((line.x[ahead] - x) ** 2 + (line.y[ahead] - y) ** 2))
        if i >= len(line.x) - 2:
            break
        target = float(line.speed[i])
        if line.arc[i] >= stopped_at:
            target = max(speed - model.limits.decel * dt, 0.0)
            if target == 0.0:
                break
        speed = max(target, 0.05)
        reach = lookahead + headway * speed
        k = min(int(np.searchsorted(line.arc, line.arc[i] + reach)), len(line.x) - 1)
        to_x, to_y = line.x[k] - x, line.y[k] - y
        away = max(np.hypot(to_x, to_y), 0.5 * base)
        angle = np.arctan2(to_y, to_x) - pointing
        curvature = float(np.clip(2.0 * np.sin(angle) / away, -sharpest, sharpest))
        pointing += curvature * speed * dt
        x, y = x + np.cos(pointing) * speed * dt, y + np.sin(pointing) * speed * dt
        rows.append((i, speed, curvature, pointing))
    if not rows:
        return Drive(0.0, 0.0, 0.0, 0.0)
    at, speeds, turns, headings = (np.array(part) for part in zip(*rows, strict=True))
    driven = Places(*(part[at] for part in line))._replace(speed=speeds, heading=headings)
    return _felt(driven, turns, plan, model, slope, float(line.arc[-1]))


_HIGH = 1.0  # [m] of obstacles
_POST, _WALL = 0.2, 2.0  # [m] along the path, of a post and of a wall
_FARTHER, _TRIES = 0.05, 18  # [m] from the planned body, and how often [1]
_TOUCHES = 0.02  # [m] deep: stations sample a path, and maps are not drawn more exactly
_ENDS = 0.15  # share of a path at its ends [1] without obstacles: it has to begin on free ground


class Passed(NamedTuple):
    """A plan past an obstacle: free distance from the planned body [m]; contact of the follower."""

    gap: float
    touched: bool


def pass_obstacle(
    given: Floats,
    planner: CandidatePlanner,
    ground: ElevationMap,
    rng: np.random.Generator,
    *,
    steers_at_noise: bool,
) -> Passed | None:
    """Follow a path exactly past the closest obstacle that its plan passes; None if it passes none.

    ``given`` is (n, 2) [m], ``ground`` flat and without obstacles.
    """
    path, model = CandidatePath("given", given), planner.model
    free = planner.plan(ground, [path])[0]
    k, side = _place(free, rng), float(rng.choice([-1.0, 1.0]))
    long = float(rng.choice([_POST, _WALL]))
    for n in range(_TRIES):
        gap = n * _FARTHER
        blocked = _obstacle(ground, free, k, side * (0.5 * model.vehicle.shape.width + gap), long)
        plan = planner.plan(blocked, [path])[0]
        if plan.progress < free.progress - 0.05:
            continue
        poses = _followed(given, model, steers_at_noise=steers_at_noise)
        return Passed(gap, bool(strikes(poses, model, blocked, inset=_TOUCHES)[0]))
    return None


def _place(plan: SpeedPlan, rng: np.random.Generator) -> int:
    """A station away from the ends, of every other path the one farthest from what was given."""
    n = int(np.searchsorted(plan.station, plan.progress))
    first, last = math.ceil(_ENDS * n), max(math.floor((1.0 - _ENDS) * n), math.ceil(_ENDS * n) + 1)
    assert plan.path_deviation is not None
    if rng.random() < 0.5:
        return first + int(plan.path_deviation.distance[first:last].argmax())
    return int(rng.integers(first, last))


def _obstacle(
    ground: ElevationMap, plan: SpeedPlan, k: int, lateral: float, long: float
) -> ElevationMap:
    """Ground with a box whose side to the path is so far to the left of station k [m]."""
    rows, columns = ground.elevation.shape
    y, x = np.mgrid[:rows, :columns] * ground.resolution
    i, j = max(k - 1, 0), min(k + 1, len(plan.x) - 1)
    heading = math.atan2(plan.y[j] - plan.y[i], plan.x[j] - plan.x[i])
    east, north = x + ground.origin[0] - plan.x[k], y + ground.origin[1] - plan.y[k]
    along = east * math.cos(heading) + north * math.sin(heading)
    left = (north * math.cos(heading) - east * math.sin(heading)) * math.copysign(1.0, lateral)
    box = (np.abs(along) <= 0.5 * long) & (left >= abs(lateral)) & (left <= abs(lateral) + _POST)
    return replace(ground, elevation=np.where(box, _HIGH, 0.0))


def _followed(given: Floats, model: Model, *, steers_at_noise: bool) -> Poses:
    """Poses on the polyline itself, the body as the best arc from axle to axle lies."""
    base = model.vehicle.wheelbase
    smooth = given if steers_at_noise else averaged(given, base)
    x, y = dense(smooth, smooth)
    if model.vehicle.drive == "ackermann":
        return poses_on(x, y, model)
    span = (0.5 if steers_at_noise else 1.0) * base
    dx, dy = (_derivative(v, span, 1) for v in (x, y))
    return Poses(x, y, np.arctan2(dy, dx))
