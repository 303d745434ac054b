"""Result of one investigation of the stored stops, and the model of a proposal."""

from __future__ import annotations

import dataclasses
from typing import Any

from slopewise.models.errors import InputError
from slopewise.models.parameters import Model
from slopewise.services.io.model_file import model_from_dict
from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.plan_messages import Message

_CONCLUSIVE = ("missing_effect", "parameter_drift")


class InvestigationOutcome(Message, frozen=True):
    """Result of one investigation; ``offer`` is None where it failed, with its ``reason``."""

    reason: str
    damaged: list[str]
    offer: ModelProposal | None = None


def is_valid(findings: dict[str, Any]) -> bool:
    """Return True if findings may be used for more than slower plans."""
    interval = findings["gap"]["ci95"]
    return findings["verdict"] in _CONCLUSIVE and interval is not None and interval[0] > 0.0


def model_of(tables: dict[str, Any], file: Model) -> Model:
    """Model of a proposal; vehicle, terrain and limits are those of the model file."""
    try:
        finding = model_from_dict(tables, "offer")
    except InputError as error:
        raise ValueError(str(error)) from None
    return dataclasses.replace(file, braking=finding.braking, effect=finding.effect)
