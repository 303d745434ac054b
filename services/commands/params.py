"""`slopewise params`: read a running service's parameters, set them, go back to a version."""

from __future__ import annotations

import getpass
import math
import time
from dataclasses import dataclass
from typing import Any

import msgspec
import zenoh
from rich.console import Console
from rich.table import Table

from models.errors import InputError
from services import wire
from services.connect import client_session
from services.parameter_messages import (
    HistoryEntry,
    ParameterGroup,
    ParameterQuestion,
    ParameterReply,
    RollBack,
    SetParameters,
)
from services.wire import Format

_LARGEST_REPLY = 256_000_000
_HOUR = 3600.0
_MOST_NAME = 120


@dataclass(frozen=True, slots=True)
class ParamsJob:
    """What is wanted of whom; at most one of `history`, `rollback`, `changes`.

    Attributes:
        connect, namespace, zenoh_file: where the service is. timeout: for the answer [s].
        group: its name; empty for all.
        history: how many changes. rollback: to which version. changes: NAME=VALUE, to be set.
    """

    connect: str
    namespace: str
    timeout: float = 2.0
    zenoh_file: str = ""
    group: str = ""
    history: int = 0
    rollback: int | None = None
    changes: tuple[str, ...] = ()


def run(job: ParamsJob) -> ParameterReply:
    """Ask, or change.

    Raises:
        InputError: an option cannot be used, nobody answers, or the service refuses.
    """
    if sum((job.history > 0, job.rollback is not None, bool(job.changes))) > 1:
        words = "expected one of --history, --rollback, --set, got several"
        raise InputError("params", "", words)
    name, request = _request(job)
    with client_session(job.connect, job.zenoh_file) as session:
        reply = _ask(session, f"{job.namespace}/v1/{name}", request, job)
    if reply.status != "ok":
        raise InputError(f"{job.namespace}/v1/{name}", "", reply.reason)
    return reply


def _request(job: ParamsJob) -> tuple[str, msgspec.Struct]:
    if job.rollback is not None:
        if job.rollback < 0:
            raise InputError("--rollback", "", f"expected a version, got {job.rollback}")
        request = RollBack(version=job.rollback, group=job.group, who=_who())
        return "params/rollback", request
    if job.changes:
        if not job.group:
            raise InputError("--set", "", "expected the group that is to be changed before it")
        return "params/set", SetParameters(group=job.group, values=_values(job.changes), who=_who())
    return "params", ParameterQuestion(group=job.group, history=job.history)


def _values(changes: tuple[str, ...]) -> dict[str, float]:
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
    session: zenoh.Session, key: str, request: msgspec.Struct, job: ParamsJob
) -> ParameterReply:
    written = Format.MESSAGEPACK
    replies = session.get(
        key, payload=wire.encode(request, written),
        encoding=wire.encoding_of(type(request), written), timeout=job.timeout,
    )  # fmt: skip
    for reply in replies:
        if reply.ok is not None:
            sample = reply.ok
            told = str(sample.encoding)
            return wire.decode(ParameterReply, sample.payload, told, key, _LARGEST_REPLY)
    words = f"expected an answer at {key} within {job.timeout:g} s, got none"
    raise InputError("params", "", words)


def as_json(reply: ParameterReply) -> dict[str, Any]:
    """The reply as it came."""
    return dict(msgspec.to_builtins(reply))


def show(reply: ParameterReply, job: ParamsJob, console: Console) -> None:
    """A row a parameter, or a row a change."""
    kept = "" if reply.durable else ", [red]not kept on disk[/]"
    title = f"{reply.service}: version {reply.version}{kept}"
    if job.history:
        _show_history(reply.history, title, console)
    else:
        _show_groups(reply.groups, title, console)
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


def _show_history(history: list[HistoryEntry], title: str, console: Console) -> None:
    table = Table(title=title)
    for heading in ("version", "when", "group", "cause", "who", "values"):
        table.add_column(heading)
    for entry in history:
        when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(entry.at))
        values = ", ".join(f"{name} {value:.4g}" for name, value in entry.values.items())
        table.add_row(
            str(entry.version), when, entry.group, entry.cause, entry.who,
            values or "as in the model file",
        )  # fmt: skip
    console.print(table)


def _age(seconds: float) -> str:
    if seconds < 60.0:
        return f"{seconds:.0f} s ago"
    return f"{seconds / 60:.0f} min ago" if seconds < _HOUR else f"{seconds / _HOUR:.1f} h ago"
