"""Forces on an emergency stop along a line: attitude, brakes, friction, effects on the motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.effects.brake_fade import remaining_share
from slopewise.models.input_errors import InputErrors
from slopewise.models.laws.crest import remaining_force
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.path_force import PathForce, surface_force
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.physics.loads import BodyAttitude, attitude_of, braking_cap

_NO_ERRORS = InputErrors()


class PathState(NamedTuple):
    """Conditions of L vehicles at their places; arrays are (L,)."""

    sample: Ints  # the one behind
    share: Floats  # share of the distance from it to the next
    pose: BodyAttitude
    curvature: Floats  # curvature of the path [1/m]
    yaw: Floats  # heading [rad]
    friction: Floats
    first: Floats  # (7, L) terms of the force, where the line has one surface; else ignored


@dataclass(frozen=True)
class StopDynamics:
    """Everything that decides a stop along one line of M samples.

    ``nominal`` ignores losses of braking that the model file does not name: friction in turns, on
    banks and of locked axles, and crests. Plans report such stopping distances.
    """

    model: Model
    brakes: PathForce
    station: Floats
    table: Floats  # (15, M) pose and curvature, heading, friction, terms of the force
    motion: registry.MotionTerms
    crest_share: float | None
    errors: InputErrors
    nominal: bool = False

    @classmethod
    def along(
        cls,
        model: Model,
        line: Line,
        ground: LineGround,
        brakes: PathForce,
        errors: InputErrors = _NO_ERRORS,
    ) -> StopDynamics:
        """Collect it; ``errors`` make stops begin late."""
        pose = attitude_of(ground.grade, ground.roll, ground.vertical_curvature, line.curvature)
        first = *brakes.terms[:, 0], brakes.extra
        table = np.stack((*pose, line.curvature, line.heading, brakes.friction, *first))
        effects = registry.motion(model.effect), registry.crest_share(model.effect)
        return cls(model, brakes, ground.station, table, *effects, errors)

    @property
    def pose(self) -> BodyAttitude:
        """How the vehicle stands at the samples."""
        return BodyAttitude(*self.table[:5])

    @cached_property
    def two_sided(self) -> bool:
        """The force is known by bounds only: of several surfaces, or with a margin."""
        return len(self.brakes.on) > 1 or bool(self.brakes.terms[2:].any())

    @cached_property
    def brakes_early(self) -> bool:
        """Surfaces have different dead times."""
        return bool(self.brakes.shortest_dead_time.min() < self.brakes.dead_time.max())

    def at(self, s: Floats) -> PathState:
        """Linear between samples; as at the first and the last beyond them."""
        k = np.searchsorted(self.station, s, "right") - 1
        k = np.minimum(np.maximum(k, 0), len(self.station) - 2)
        share = (s - self.station[k]) / (self.station[k + 1] - self.station[k])
        share = np.minimum(np.maximum(share, 0.0), 1.0)
        rows = self.table.take(k, axis=1)
        rows += share * (self.table.take(k + 1, axis=1) - rows)
        curvature, yaw, friction = rows[5:8]
        return PathState(k, share, BodyAttitude(*rows[:5]), curvature, yaw, friction, rows[8:])

    def force(self, here: PathState, onset_speed: Floats, *, upper: bool = False) -> Floats:
        """Demanded F_b/W, before build-up, heat, friction and crests; or its upper bound."""
        b = self.brakes
        if len(b.on) == 1:
            speed = np.maximum(onset_speed, b.trained_speed_min[0, 0])
            force: Floats = surface_force(here.first[:6], speed, upper=upper) + here.first[6]
            return force
        ends = [self._force_at(here.sample + i, onset_speed, upper) for i in (0, 1)]
        force = ends[0] + here.share * (ends[1] - ends[0])
        return force

    def _force_at(self, sample: Ints, onset_speed: Floats, upper: bool) -> Floats:
        b = self.brakes
        part = b._replace(on=b.on[:, sample], terms=b.terms[..., sample], extra=b.extra[sample])
        return part.force(onset_speed, upper=upper)

    def deceleration(
        self, here: PathState, speed: Floats, force: Floats, heat: Floats, *, upper: bool = False
    ) -> tuple[Floats, Floats]:
        """Deceleration [m/s²], and the force that is left of a force that has built up.

        ``upper`` ignores the loss over crests: for loads.
        """
        if self.motion.fade > 0.0:
            heat = np.maximum(heat, 0.0)
            force = force * remaining_share(heat, self.motion.fade, self.motion.fade_tau)
        cap = here.friction * here.pose.normal_ratio
        if not self.nominal:
            cap = braking_cap(self.model.vehicle, here.pose, here.friction, speed * speed)
        force = np.minimum(force, cap)
        if not upper:
            force = force * self._crest_force_share(here.pose, speed)
        extra = 0.0
        if self.motion.moves:
            extra = registry.motion_deceleration(speed, here.curvature, here.yaw, self.motion)
        return GRAVITY * (force + here.pose.sine) + extra, force

    def _crest_force_share(self, pose: BodyAttitude, speed: Floats) -> Floats:
        """As the effect of the model says; else the force falls as the normal force does."""
        if self.crest_share is not None:
            share: Floats = remaining_force(speed, pose.vertical_curvature, self.crest_share)
            return share
        if self.nominal:
            return np.ones_like(speed)
        lost = (
            np.maximum(-pose.vertical_curvature, 0.0)
            * speed
            * speed
            / (GRAVITY * pose.normal_ratio)
        )
        return np.maximum(1.0 - lost, 0.0)
