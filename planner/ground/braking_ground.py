"""Braking force that the ground of each station offers: the model, the surface and its effects.

Two bounds of the force are kept. Where surfaces meet, or where the model extrapolates, the *lower*
one decides where the vehicle stops and the *upper* one whether it tips; elsewhere they are the
same. Either is linear in the speed at brake onset: F_b/W = slope * v_i + intercept. Where friction
caps the force at some trained speed, both slopes are 0: the intercepts are the least and the most
that it can then be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.ground_terms import ground_terms
from slopewise.planner.ground.surfaces import DEAD, surface_cache_of
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.ground.uncertainty import Uncertainty, survived_errors


@dataclass(frozen=True, slots=True)
class GroundConditions:
    """Conditions of the moment, besides map and model.

    Attributes:
        session_time: since the session began [s], for effects that change with it.
        brake_heat: heat per mass in the brakes now [J/kg], for brakes that fade.
        pose_age: time since pose and speed were measured [s]: the vehicle is farther along.
    """

    session_time: float = 0.0
    brake_heat: float = 0.0
    pose_age: float = 0.0


class StopErrors(NamedTuple):
    """Lengthening of stops besides force and dead time of the model.

    Attributes:
        speed: the vehicle may be faster than planned by this [m/s].
        drive_cut: the drive may be cut during the dead time, so that a slope speeds the vehicle up.
        height: the stop may fall by this much further than the map says [m].
        along_track: distance by which it may begin farther along than planned [m].
        latency: time by which it may be commanded later, at the speed held till then [s].
    """

    speed: float = 0.0
    drive_cut: bool = False
    height: float = 0.0
    along_track: float = 0.0
    latency: float = 0.0


@dataclass(frozen=True, slots=True)
class BrakingGround:
    """Braking along M candidates of up to N stations; arrays are (N, M) unless stated otherwise.

    Attributes:
        lower_slope, lower_intercept: lower bound of F_b/W [s/m], [1].
        upper_slope, upper_intercept: upper bound of F_b/W [s/m], [1].
        dead_time: from stop command to onset, the longest of the surfaces until then [s].
        shortest_dead_time: the shortest of the surfaces there [s].
        slowest: speed below which the coefficients no longer change [m/s].
        fastest: highest trained speed, on that grade where the model has a hull [m/s].
        trained: the grade lies in the trained range, or extrapolation is allowed.
        distance_offset: (M,) safety offset added to every stop [m].
        push: what motion terms take away from planned braking, <= 0, as a share of the weight;
            None without any.
        motion: terms that act on the motion itself; friction is in the forces already.
        closed_form: the stopping path has one: nothing acts on the motion.
        friction: least friction of the ground [1]; None where it is not known.
        errors: of speed and map.
    """

    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    dead_time: Floats
    shortest_dead_time: Floats
    slowest: Floats
    fastest: Floats
    trained: Bools
    distance_offset: Floats
    push: Floats | None
    motion: registry.MotionTerms
    closed_form: bool
    friction: Floats | None
    errors: StopErrors

    @property
    def braking_intercept(self) -> Floats:
        """Intercept of the force that planned braking may count on, (N, M) [1]."""
        return self.lower_intercept if self.push is None else self.lower_intercept + self.push


def ground_along(
    profile: TerrainProfile,
    model: Model,
    class_names: tuple[str, ...] = ("",),
    conditions: GroundConditions | None = None,
    uncertainty: Uncertainty | None = None,
) -> BrakingGround:
    """Braking force along candidates.

    Args:
        conditions: session time and brake heat; both zero if omitted.
        uncertainty: what to survive; the model's mean alone if omitted.
    """
    now = conditions or GroundConditions()
    braking = model.braking
    known = surface_cache_of(model, class_names, uncertainty)
    motion = known.motion._replace(heat=now.brake_heat)
    lowest = highest = push = drag = None
    if model.effect:
        yaw = np.arctan2(profile.heading_y, profile.heading_x)
        lowest, highest = _survived_terms(profile, model, uncertainty, yaw, now.session_time)
        if motion.moves:
            push = _push(profile, model, yaw, motion)
            if uncertainty is not None:
                drag = uncertainty.drag_spread(model.effect, profile.curvature, model.limits.speed)
    margin = braking.extrapolation_margin if braking.extrapolate else -1.0
    rows, trained, distance_offset = core.braking_forces(
        profile, known, margin, lowest, highest, drag
    )
    errors = stop_errors(model, uncertainty, profile.height_std, now.pose_age)
    low_slope, low, up_slope, up, dead_time, shortest, slowest, fastest = rows[:8]
    times = [t for t in np.unique(known.table[:, DEAD]) if (dead_time == t).any()]
    if len(times) > 1:
        speed, latency = model.limits.speed, errors.latency
        dead_time = _until_onset(dead_time, times, profile.station, speed, latency)
    return BrakingGround(
        low_slope,
        low,
        up_slope,
        up,
        dead_time,
        shortest,
        slowest,
        fastest,
        trained,
        distance_offset,
        push,
        motion,
        known.closed_form,
        rows[8] if known.slides else None,
        errors,
    )


def _until_onset(
    dead_time: Floats, times: list[float], station: Floats, speed: float, latency: float
) -> Floats:
    """Dead times (N, M) of stops that lead onto ground with a longer one before brakes hold [s].

    ``times`` are all that there are, the shortest first.
    """
    longest, before = dead_time, np.zeros(0)
    while not np.array_equal(longest, before):  # each may lead on to ground with a longer one
        before = longest
        for time in times[1:]:
            ahead = np.where(dead_time >= time, station, np.inf)
            nearest = np.minimum.accumulate(ahead[::-1])[::-1]
            is_reached = nearest <= station + speed * (longest + latency)
            longest = np.where(is_reached, np.maximum(longest, time), longest)
    return longest


def stop_errors(
    model: Model, uncertainty: Uncertainty | None, height_std: float, pose_age: float = 0.0
) -> StopErrors:
    """Errors that stops survive, with those of a map's heights [m] and the age of the pose [s]."""
    width = 0.0 if uncertainty is None else uncertainty.width
    tracking = survived_errors(model, uncertainty)
    return StopErrors(
        width * model.braking.speed_error,
        model.braking.drive_in_dead_time != "held",
        # The height of one place against that of another: two errors.
        width * math.sqrt(2.0) * height_std,
        tracking.along_track,
        tracking.latency + pose_age,
    )


def _push(
    profile: TerrainProfile, model: Model, yaw: Floats, motion: registry.MotionTerms
) -> Floats:
    """Force that motion terms may take away from planned braking, <= 0, (N, M) [1]."""
    pushes = (
        registry.motion_deceleration(speed, profile.curvature, yaw, motion) / GRAVITY
        for speed in (0.0, model.limits.speed)
    )
    push: Floats = np.minimum(0.0, np.minimum(*pushes))
    return push


def _survived_terms(
    profile: TerrainProfile,
    model: Model,
    uncertainty: Uncertainty | None,
    yaw: Floats,
    session_time: float,
) -> tuple[Floats, Floats]:
    """Lowest and highest that effects of the ground add to the force, (N, M) [1]."""
    lowest, highest = ground_terms(model, profile, yaw, session_time)
    if uncertainty is None:
        return lowest, highest
    margin = sum(uncertainty.ground_margin(e) for e in model.effect)
    return lowest - margin, highest + margin
