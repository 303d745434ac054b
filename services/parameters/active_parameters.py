"""The model that plans are made with, and its version."""

from __future__ import annotations

import hashlib
import json
import time
from copy import copy
from dataclasses import dataclass, field, replace
from functools import lru_cache

from slopewise.models.parameters import Model
from slopewise.models.vehicle import Vehicle
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.services.io.decode import encode_table
from slopewise.services.io.model_file import model_sha256
from slopewise.services.wire import plan_messages


@dataclass(frozen=True, slots=True)
class ActiveParameters:
    """A model and its version."""

    model: Model
    version: int = 1  # grows with every change
    at: float = field(default_factory=time.monotonic)  # last update of the oldest ones [s]
    revision: int = 0  # grows also when plans of the same version change, as parameters age
    uncertainty: Uncertainty | None = None  # that margins cover; None: that of the settings
    flags: tuple[str, ...] = ()  # active warnings
    # Computed here, so that no reply has to wait for it.
    model_hash: str = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model_hash", model_sha256(self.model))

    @property
    def identity(self) -> tuple[int, int]:
        """Version and revision; equal where plans are."""
        return self.version, self.revision

    def with_flags(self, flags: tuple[str, ...], version: int) -> ActiveParameters:
        """The same model with other warnings; nothing is recomputed."""
        same = copy(self)
        object.__setattr__(same, "flags", flags)
        object.__setattr__(same, "version", version)
        return same

    def message(self) -> plan_messages.Parameters:
        """Message for replies and status."""
        return plan_messages.Parameters(
            version=self.version,
            name=self.model.name,
            fingerprint=fingerprint(self.model.vehicle),
            age=time.monotonic() - self.at,
            model_hash=self.model_hash,
        )


def slowed(model: Model, speed: float) -> Model:
    """A model with a tighter limit of the speed [m/s]."""
    return replace(model, limits=replace(model.limits, speed=min(model.limits.speed, speed)))


def with_max_speed(parameters: ActiveParameters, speed: float, reason: str) -> ActiveParameters:
    """The same with a tighter limit of the speed [m/s], and the reason as a warning."""
    return replace(
        parameters,
        model=slowed(parameters.model, speed),
        revision=-1 - parameters.revision,
        flags=(f"degraded: {reason}", *parameters.flags),
    )


@lru_cache(maxsize=64)
def fingerprint(vehicle: Vehicle) -> str:
    """Digest of a vehicle's data sheet, which distinguishes vehicles."""
    # Part of every reply, and computing it takes half a millisecond.
    text = json.dumps(encode_table(vehicle), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
