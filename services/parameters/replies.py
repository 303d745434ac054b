"""Parameters, history and operators' changes as messages."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict

import msgspec

from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.errors import ParameterError, SlopewiseError
from slopewise.services.parameters.active_parameters import fingerprint
from slopewise.services.parameters.parameter_history import LastChange
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.parameters.store import StoredChange, StoreError
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

_FROM_FILE = LastChange(1, "model file", "")
"""Change of a group that is still that of the model file: version 1."""


def group_message(service: ParameterService, group: str) -> ParameterGroup:
    """Message of a group; ParameterError names the groups that there are."""
    state = service.learner.state
    names = state.names()
    if group not in names:
        raise ParameterError("group", f"one of {', '.join(names)}, got {group[:80]}")
    known = asdict(state.group(group).describe(group))
    known["values"] = {name: float(value) for name, value in known["values"].items()}
    last = asdict(service.history.last.get(group, _FROM_FILE))
    vehicle = fingerprint(service.active.model.vehicle)
    return ParameterGroup(group=group, fingerprint=vehicle, **last, **known)


def read(service: ParameterService, request: ParameterQuestion, group: str = "") -> ParameterReply:
    """Groups and their history; ``group``: the one of the key, before that of the request."""
    group = group or request.group
    try:
        names = [group] if group else service.learner.state.names()
        groups = [group_message(service, name) for name in names]
        history: list[HistoryEntry] = []
        if request.history:
            changes = service.history.opened().history(group, request.history)
            history = [entry for entry in map(_entry, changes) if entry is not None]
    except (ParameterError, StoreError) as error:
        return reply_of(service, "error", str(error))
    return reply_of(service, "ok", "", groups, history)


def change(
    service: ParameterService, request: SetParameters | RollBack | AdoptOffer
) -> ParameterReply:
    """Apply an operator's change, and report the result."""
    try:
        if isinstance(request, SetParameters):
            service.set_values(request.group, request.values, request.who)
        elif isinstance(request, AdoptOffer):
            service.adopt(request.offer, request.who, faster=request.faster)
        else:
            service.roll_back(request.version, request.group, request.who)
    except (SlopewiseError, StoreError) as error:
        service.counters["changes_refused"] += 1
        return reply_of(service, "refused", str(error))
    service.counters["changes_by_operators"] += 1
    return read(service, ParameterQuestion())


def findings(service: ParameterService, request: DiscrepancyQuestion) -> ParameterReply:
    """Reply about findings: the last one whole, after a new investigation was requested."""
    status, reason = "ok", ""
    if request.start:
        try:
            service.investigate(request.who)
        except ParameterError as error:
            status, reason = "refused", str(error)
    reply = reply_of(service, status, reason)
    return msgspec.structs.replace(reply, offer=service.learner.state.effects.proposal)


def reply_of(
    service: ParameterService,
    status: str,
    reason: str,
    groups: Sequence[ParameterGroup] = (),
    history: Sequence[HistoryEntry] = (),
) -> ParameterReply:
    """Reply of any kind."""
    proposal = service.learner.state.effects.proposal
    return ParameterReply(
        status=status,  # type: ignore[arg-type]
        reason=reason,
        service=service.id,
        version=service.history.version,
        durable=service.history.durable,
        groups=[*groups],
        history=[*history],
        flags=service.flags(),
        offer=None if proposal is None else msgspec.structs.replace(proposal, model={}),
        investigation=service.investigator.last,
        investigating=service.investigator.running,
    )


def _entry(change: StoredChange) -> HistoryEntry | None:
    """Entry of a change with the values in its state; None if the state cannot be read."""
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
