"""What an emergency stop meets along a line: pose, force, friction, effects on the motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.effects import registry
from slopewise.models.effects.brake_fade import remaining_share
from slopewise.models.laws.crest import remaining_force
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.check.brakes import Brakes
from slopewise.services.check.friction import braking_cap
from slopewise.services.check.ground import LineGround
from slopewise.services.check.line import Line
from slopewise.services.check.loads import Stance, pose_of


class Here(NamedTuple):
    """What L vehicles meet where they are; arrays are (L,).

    Attributes:
        sample, share: the sample behind, and the share of the way to the next.
        pose, curvature, yaw, friction: there.
        slope, intercept: of the force on the one surface there is; of no account with more.
    """

    sample: Ints
    share: Floats
    pose: Stance
    curvature: Floats
    yaw: Floats
    friction: Floats
    slope: Floats
    intercept: Floats


@dataclass(frozen=True)
class StopField:
    """Everything that decides a stop along one line of M samples.

    ``as_learned`` leaves out what the ground takes beyond the model file: turns, banks and locked
    axles of friction, crests that no effect names. Plans tell such stopping distances.
    """

    model: Model
    brakes: Brakes
    station: Floats
    table: Floats
    motion: registry.MotionTerms
    crest_share: float | None
    as_learned: bool = False

    @classmethod
    def along(cls, model: Model, line: Line, ground: LineGround, brakes: Brakes) -> StopField:
        """Collect it."""
        pose = pose_of(ground.grade, ground.roll, ground.bend, line.curvature)
        first = brakes.slope[0], brakes.intercept[0] + brakes.extra
        table = np.stack((*pose, line.curvature, line.heading, brakes.friction, *first), axis=1)
        return cls(
            model,
            brakes,
            ground.station,
            table,
            registry.motion(model.effect),
            registry.crest_share(model.effect),
        )

    @cached_property
    def two_sided(self) -> bool:
        """The force is known by bounds only: of several surfaces, or with a margin."""
        b = self.brakes
        return len(b.on) > 1 or bool(b.spare.any()) or bool(b.doubt.any())

    def at(self, s: Floats) -> Here:
        """Linear between samples; as at the first and the last beyond them."""
        k = np.searchsorted(self.station, s, "right") - 1
        k = np.minimum(np.maximum(k, 0), len(self.station) - 2)
        share = (s - self.station[k]) / (self.station[k + 1] - self.station[k])
        share = np.minimum(np.maximum(share, 0.0), 1.0)
        row = self.table[k]
        row += share[:, None] * (self.table[k + 1] - row)
        columns = row.T
        return Here(k, share, Stance(*columns[:5]), *columns[5:])

    def force(self, here: Here, onset_speed: Floats, *, most: bool = False) -> Floats:
        """F_b/W that is wanted, before build-up, heat, friction and crests."""
        b = self.brakes
        if not self.two_sided:
            one: Floats = here.slope * np.maximum(onset_speed, b.slowest[0, 0]) + here.intercept
            return one
        ends = [self._force_at(here.sample + i, onset_speed, most) for i in (0, 1)]
        force: Floats = ends[0] + here.share * (ends[1] - ends[0])
        return force

    def _force_at(self, sample: Ints, onset_speed: Floats, most: bool) -> Floats:
        b = self.brakes
        part = b._replace(
            on=b.on[:, sample],
            slope=b.slope[:, sample],
            intercept=b.intercept[:, sample],
            spare=b.spare[:, sample],
            extra=b.extra[sample],
            doubt=b.doubt[:, :, sample],
        )
        return part.force(onset_speed, most=most)

    def deceleration(
        self, here: Here, speed: Floats, force: Floats, heat: Floats, *, most: bool = False
    ) -> tuple[Floats, Floats]:
        """Deceleration [m/s²], and the force that is left of a force that has built up.

        ``most`` leaves out what crests take: for loads.
        """
        if self.motion.fade > 0.0:
            heat = np.maximum(heat, 0.0)
            force = force * remaining_share(heat, self.motion.fade, self.motion.fade_tau)
        cap = here.friction * here.pose.upright
        if not self.as_learned:
            cap = braking_cap(self.model.vehicle, here.pose, here.friction, speed * speed)
        force = np.minimum(force, cap)
        if not most:
            force = force * self._kept_over_crests(here.pose, speed)
        extra = 0.0
        if self.motion.moves:
            extra = registry.motion_deceleration(speed, here.curvature, here.yaw, self.motion)
        return GRAVITY * (force + here.pose.sine) + extra, force

    def _kept_over_crests(self, pose: Stance, speed: Floats) -> Floats:
        """As the effect of the model says; else the force falls as the normal force does."""
        if self.crest_share is not None:
            kept: Floats = remaining_force(speed, pose.bend, self.crest_share)
            return kept
        if self.as_learned:
            return np.ones_like(speed)
        lost = np.maximum(-pose.bend, 0.0) * speed * speed / (GRAVITY * pose.upright)
        return np.maximum(1.0 - lost, 0.0)
