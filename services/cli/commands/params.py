"""`slopewise params`: read a running service's parameters, set them, go back to a version.

And what the service found on the stops that it keeps: have it look, see the offer, adopt it.
"""

from __future__ import annotations

import getpass
import math
import time
from typing import Any

import msgspec
import zenoh
from rich.console import Console
from rich.table import Table

from slopewise.models.errors import InputError
from slopewise.services.cli.arguments.robot import ParamsOptions
from slopewise.services.report.plan_labels import plural
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import client_session
from slopewise.services.wire.model_proposal import ModelProposal
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

_LARGEST_REPLY = 256_000_000
_HOUR = 3600.0
_MOST_NAME = 120
_LOOK_AGAIN = 0.3  # [s]


def run(job: ParamsOptions) -> ParameterReply:
    """Ask, or change.

    Raises:
        InputError: an option cannot be used, nobody answers, or the service refuses.
    """
    wanted = (
        job.history,
        job.rollback is not None,
        bool(job.changes),
        job.investigate,
        bool(job.adopt),
    )
    if sum(wanted) > 1:
        words = "expected one of --history, --rollback, --set, --investigate, --adopt, got several"
        raise InputError("params", "", words)
    if job.faster and not job.adopt:
        raise InputError("--faster", "", "expected --adopt with it, got none")
    name, request = _request(job)
    with client_session(job.connect, job.zenoh_file) as session:
        reply = _ask(session, f"{job.namespace}/v1/{name}", request, job)
        while job.investigate and reply.status == "ok" and reply.investigating:
            time.sleep(_LOOK_AGAIN)
            key = f"{job.namespace}/v1/{name}"
            reply = _ask(session, key, DiscrepancyQuestion(who=_who()), job)
    if reply.status != "ok":
        raise InputError(f"{job.namespace}/v1/{name}", "", reply.reason)
    return reply


def _request(job: ParamsOptions) -> tuple[str, msgspec.Struct]:
    if job.rollback is not None:
        if job.rollback < 0:
            raise InputError("--rollback", "", f"expected a version, got {job.rollback}")
        request = RollBack(version=job.rollback, group=job.group, who=_who())
        return "params/rollback", request
    if job.changes:
        if not job.group:
            raise InputError("--set", "", "expected the group that is to be changed before it")
        return "params/set", SetParameters(group=job.group, values=_values(job.changes), who=_who())
    if job.investigate:
        return "discrepancy", DiscrepancyQuestion(start=True, who=_who())
    if job.adopt:
        return "params/adopt", AdoptOffer(offer=job.adopt, faster=job.faster, who=_who())
    return "params", ParameterQuestion(group=job.group, history=job.most if job.history else 0)


def _values(changes: list[str]) -> dict[str, float]:
    values = {}
    for change in changes:
        name, _, text = change.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not name or not math.isfinite(value):
            raise InputError("--set", "", f"expected NAME=VALUE with a number, got {change!r}")
        values[name.strip()] = value
    return values


def _who() -> str:
    try:
        return getpass.getuser()[:_MOST_NAME]
    except (OSError, KeyError):
        return "operator"


def _ask(
    session: zenoh.Session, key: str, request: msgspec.Struct, job: ParamsOptions
) -> ParameterReply:
    written = Format.MESSAGEPACK
    replies = session.get(
        key,
        payload=codec.encode(request, written),
        encoding=codec.encoding_of(type(request), written),
        timeout=job.timeout,
    )
    for reply in replies:
        if reply.ok is not None:
            sample = reply.ok
            told = str(sample.encoding)
            return codec.decode(ParameterReply, sample.payload, told, key, _LARGEST_REPLY)
    words = f"expected an answer at {key} within {job.timeout:g} s, got none"
    raise InputError("params", "", words)


def as_json(reply: ParameterReply) -> dict[str, Any]:
    """The reply as it came."""
    return dict(msgspec.to_builtins(reply))


class ReplyView:
    """A reply, shown as it was asked for."""

    def __init__(self, job: ParamsOptions) -> None:
        """What was asked."""
        self._job = job

    def as_json(self, reply: ParameterReply) -> dict[str, Any]:
        """For machines."""
        return as_json(reply)

    def show(self, reply: ParameterReply, console: Console) -> None:
        """For people."""
        show(reply, self._job, console)


def show(reply: ParameterReply, job: ParamsOptions, console: Console) -> None:
    """A row a parameter, or a row a change."""
    kept = "" if reply.durable else ", [red]not kept on disk[/]"
    title = f"{reply.service}: version {reply.version}{kept}"
    if job.history:
        _show_history(reply.history, title, console)
    elif not job.investigate:
        _show_groups(reply.groups, title, console)
    if reply.investigation and (job.investigate or not job.group):
        console.print(f"stored stops: {reply.investigation}")
    if reply.offer is not None and job.group in ("", "effects"):
        _show_offer(reply.offer, console)
    for flag in reply.flags:
        console.print(f"[yellow]{flag}[/]")


def _show_groups(groups: list[ParameterGroup], title: str, console: Console) -> None:
    table = Table(title=title)
    for heading in ("group", "parameter", "value", "std", "unit", "since", "last change"):
        table.add_column(heading)
    for group in groups:
        last = f"{group.cause}{f' ({group.who})' if group.who else ''}, {_age(group.age)}"
        state = "" if group.valid else " (not valid yet)"
        facts = [group.group + state, f"version {group.version}", last]
        for name, value in group.values.items():
            std = f"{group.stds[name]:.2g}" if name in group.stds else "–"
            table.add_row(facts[0], name, f"{value:.4g}", std, group.unit.get(name, ""), *facts[1:])
            facts = ["", "", ""]
        table.add_section()
    console.print(table)


def _show_offer(offer: ModelProposal, console: Console) -> None:
    """What is offered, what it changes in metres, and how to adopt it."""
    console.print(f"[bold]offer {offer.id}[/]: {offer.verdict} – {offer.summary}")
    for effect in offer.findings["effects"]:
        values = ", ".join(
            f"{n} = {p['value']:.4g} ± {p['std']:.2g} {p['unit']}"
            for n, p in effect["parameters"].items()
        )
        console.print(f"  {effect['name']}: {values}, {effect['confidence']:.0%} sure")
    gap = offer.findings["stop_distance"]
    console.print(
        f"  {plural(offer.stops, 'stop')}, data {offer.data}: "
        f"{gap['before']:.3f} m off as configured, "
        f"{gap['after']:.3f} m with it, floor {gap['noise_floor']:.3f}"
    )
    for shift, beside in ((offer.beside_file, "model file"), (offer.beside_use, "parameters then")):
        by = f"{shift.least:+.2f} m ({shift.where}) … {shift.most:+.2f} m"
        console.print(f"  plans stop {by} beside the {beside}")
    for note in offer.notes:
        console.print(f"  note: {note}", style="yellow")
    console.print(f"  {offer.command() or offer.obstacle}")


def _show_history(history: list[HistoryEntry], title: str, console: Console) -> None:
    table = Table(title=title)
    for heading in ("version", "when", "group", "cause", "who", "values"):
        table.add_column(heading)
    for entry in history:
        when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(entry.at))
        values = ", ".join(f"{name} {value:.4g}" for name, value in entry.values.items())
        table.add_row(
            str(entry.version),
            when,
            entry.group,
            entry.cause,
            entry.who,
            values or "as in the model file",
        )
    console.print(table)


def _age(seconds: float) -> str:
    if seconds < 60.0:
        return f"{seconds:.0f} s ago"
    return f"{seconds / 60:.0f} min ago" if seconds < _HOUR else f"{seconds / _HOUR:.1f} h ago"
