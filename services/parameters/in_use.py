"""The model that plans are made with, and which one it is."""

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
from slopewise.services.io.model_file import model_sha256, vehicle_to_dict
from slopewise.services.wire import plan_messages


@dataclass(frozen=True, slots=True)
class ParametersInUse:
    """A model, and which one it is.

    Attributes:
        model: to plan with. version: grows with every change.
        at: when the oldest of what was learned was learned; monotonic clock [s].
        serial: grows also when the same version is to be planned with otherwise, as it grows older.
        uncertainty: that plans have to survive; None: that of the settings.
        flags: what is not as it should be, in words.
        model_hash: of the model; worked out here, so that no reply has to wait for it.
    """

    model: Model
    version: int = 1
    at: float = field(default_factory=time.monotonic)
    serial: int = 0
    uncertainty: Uncertainty | None = None
    flags: tuple[str, ...] = ()
    model_hash: str = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model_hash", model_sha256(self.model))

    @property
    def identity(self) -> tuple[int, int]:
        """Differs where plans may."""
        return self.version, self.serial

    def flagged(self, flags: tuple[str, ...], version: int) -> ParametersInUse:
        """The same model with other words beside it; nothing is worked out anew."""
        same = copy(self)
        object.__setattr__(same, "flags", flags)
        object.__setattr__(same, "version", version)
        return same

    def message(self) -> plan_messages.Parameters:
        """As replies and status tell it."""
        age = time.monotonic() - self.at
        return plan_messages.Parameters(
            version=self.version,
            name=self.model.name,
            fingerprint=fingerprint(self.model),
            age=age,
            model_hash=self.model_hash,
        )


def slowed(parameters: ParametersInUse, speed: float, reason: str) -> ParametersInUse:
    """The same with a tighter limit of the speed [m/s], for a reason."""
    limits = replace(parameters.model.limits, speed=min(parameters.model.limits.speed, speed))
    return replace(
        parameters,
        model=replace(parameters.model, limits=limits),
        serial=-1 - parameters.serial,
        flags=(f"degraded: {reason}", *parameters.flags),
    )


def fingerprint(model: Model) -> str:
    """What tells one vehicle from another: a digest of its data sheet."""
    return _digest(model.vehicle)


@lru_cache(maxsize=64)
def _digest(vehicle: Vehicle) -> str:
    # Every reply says it, and working it out takes half a millisecond.
    text = json.dumps(vehicle_to_dict(vehicle), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
