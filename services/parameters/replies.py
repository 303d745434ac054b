"""Parameters, history and operators' changes as messages."""

from __future__ import annotations

import json
import math

import msgspec

from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.errors import ParameterError, SlopewiseError
from slopewise.services.parameters.change import StoredChange
from slopewise.services.parameters.group import ParameterGroups
from slopewise.services.parameters.in_use import fingerprint
from slopewise.services.parameters.log import Last
from slopewise.services.parameters.service import ParameterService
from slopewise.services.parameters.store import StoreError
from slopewise.services.wire.parameter_messages import (
    AdoptOffer,
    DiscrepancyQuestion,
    HistoryEntry,
    ParameterGroup,
    ParameterQuestion,
    ParameterReply,
    RollBack,
    SetParameters,
)

_FROM_FILE = Last(1, "model file", "")


def group_message(service: ParameterService, group: str) -> ParameterGroup:
    """A group as it is now; ParameterError if there is none of that name."""
    known = _named(service, group).describe(group)
    last = service.log.last.get(group, _FROM_FILE)
    return ParameterGroup(
        group=group,
        version=last.version,
        valid=known.valid,
        age=known.age,
        fingerprint=fingerprint(service.in_use.model),
        cause=last.cause,
        who=last.who,
        values={name: float(value) for name, value in known.values.items()},
        stds=known.stds,
        covariance=known.covariance,
        unit=known.unit,
        notes=known.notes,
    )


def _named(service: ParameterService, group: str) -> ParameterGroups:
    names = service.learner.names()
    if group not in names:
        raise ParameterError("group", f"one of {', '.join(names)}, got {group[:80]}")
    return service.learner.group(group)


def read(service: ParameterService, question: ParameterQuestion, name: str) -> ParameterReply:
    """The answer to a question; ``name`` is that of the service."""
    try:
        names = [question.group] if question.group else service.learner.names()
        groups = [group_message(service, group) for group in names]
        history: list[HistoryEntry] = []
        if question.history:
            changes = service.log.history(question.group, question.history)
            history = [entry for entry in map(_entry, changes) if entry is not None]
    except (ParameterError, StoreError) as error:
        return reply_of(service, name, "error", str(error))
    return reply_of(service, name, "ok", "", groups, history)


def change(
    service: ParameterService, request: SetParameters | RollBack | AdoptOffer, name: str
) -> ParameterReply:
    """The answer to an operator's change, which is made if it can be."""
    try:
        if isinstance(request, SetParameters):
            service.set_values(request.group, request.values, request.who)
        elif isinstance(request, AdoptOffer):
            service.adopt(request.offer, request.who, faster=request.faster)
        else:
            service.roll_back(request.version, request.group, request.who)
    except (SlopewiseError, StoreError) as error:
        service.counters["changes_refused"] += 1
        return reply_of(service, name, "refused", str(error))
    service.counters["changes_by_operators"] += 1
    groups = [group_message(service, g) for g in service.learner.names()]
    return reply_of(service, name, "ok", "", groups)


def findings(service: ParameterService, question: DiscrepancyQuestion, name: str) -> ParameterReply:
    """The answer about findings: the last one whole, after a new look was begun if wanted."""
    status, reason = "ok", ""
    if question.start:
        try:
            service.investigate(question.who)
        except ParameterError as error:
            status, reason = "refused", str(error)
    reply = reply_of(service, name, status, reason)
    return msgspec.structs.replace(reply, offer=service.learner.effects.offer)


def reply_of(
    service: ParameterService,
    name: str,
    status: str,
    reason: str,
    groups: list[ParameterGroup] | None = None,
    history: list[HistoryEntry] | None = None,
) -> ParameterReply:
    """An answer of any kind."""
    offer = service.learner.effects.offer
    return ParameterReply(
        status=status,  # type: ignore[arg-type]
        reason=reason,
        service=name,
        version=service.log.version,
        durable=service.log.durable,
        groups=groups or [],
        history=history or [],
        flags=service.flags(),
        offer=None if offer is None else msgspec.structs.replace(offer, model={}),
        investigation=service.investigator.last,
        investigating=service.investigator.running,
    )


def _entry(change: StoredChange) -> HistoryEntry | None:
    """A change with the values that its state holds; None if nobody can read it any more."""
    values: dict[str, float] = {}
    stds: dict[str, float] = {}
    valid = False
    try:
        state = json.loads(change.state) or {}
        learned = state.get("learned")
        if learned is not None:
            values = dict(zip(NAMES, learned["published"], strict=True))
            matrix = learned["covariance"]
            stds = {name: math.sqrt(max(matrix[i][i], 0.0)) for i, name in enumerate(NAMES)}
            valid = bool(learned["valid"])
        values |= state.get("values", {})
        stds |= state.get("stds", {})
    except (ValueError, KeyError, TypeError, IndexError):
        return None
    return HistoryEntry(
        version=change.version,
        group=change.group,
        at=change.moment.at,
        cause=change.cause,
        who=change.who,
        values=values,
        stds=stds,
        valid=valid,
    )
