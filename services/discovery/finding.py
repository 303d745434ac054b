"""What one look at the stored stops comes to, and the model that an offer stands for."""

from __future__ import annotations

import dataclasses
from typing import Any

from slopewise.models.errors import InputError
from slopewise.models.parameters import Model
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.plan_messages import Message

_SURE = ("missing_effect", "parameter_drift")


class InvestigationOutcome(Message, frozen=True):
    """What one look came to; ``offer`` is None where it failed, and ``reason`` says why."""

    reason: str
    damaged: list[str]
    offer: ModelProposal | None = None


def is_valid(findings: dict[str, Any]) -> bool:
    """Whether findings may be trusted with more than making plans slower."""
    interval = findings["gap"]["ci95"]
    return findings["verdict"] in _SURE and interval is not None and interval[0] > 0.0


def model_of(tables: dict[str, Any], file: Model) -> Model:
    """The model of an offer; vehicle, terrain and limits are those of the model file.

    Raises:
        ValueError: it is none.
    """
    try:
        found = model_from_dict(tables, "offer")
    except InputError as error:
        raise ValueError(str(error)) from None
    return dataclasses.replace(file, braking=found.braking, effect=found.effect)
