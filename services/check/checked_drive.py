"""A plan on its ground, as all checks take it."""

from __future__ import annotations

from typing import NamedTuple

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.path_force import PathForce
from slopewise.services.check.path_ground import LineGround
from slopewise.services.check.plan_line import Line
from slopewise.services.check.steering_checks import Turning
from slopewise.services.check.stop_dynamics import StopDynamics
from slopewise.services.physics.loads import BodyAttitude


class CheckedDrive(NamedTuple):
    """A plan of N rows, and its ground at M samples."""

    plan: ExternalPlan
    line: Line
    ground: LineGround
    field: StopDynamics
    turning: Turning
    clear: Floats  # (M,) station before which stops end [m]

    @property
    def model(self) -> Model:
        """Vehicle, braking and limits."""
        return self.field.model

    @property
    def brakes(self) -> PathForce:
        """Force of the brakes along the line."""
        return self.field.brakes

    @property
    def pose(self) -> BodyAttitude:
        """How the vehicle stands at the samples."""
        return self.field.pose
