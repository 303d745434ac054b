"""`slopewise params`: parameters of a running service, and a comparison of two model files."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.models.errors import InputError
from slopewise.services.cli import options
from slopewise.services.cli.command import print_result, schema_of
from slopewise.services.cli.options import argument, option
from slopewise.services.cli.tables import line, notes, number, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    import msgspec

    from slopewise.services.jobs.compare_models import ModelComparison
    from slopewise.services.wire.model_proposal import ModelProposal
    from slopewise.services.wire.parameter_messages import (
        HistoryEntry,
        ParameterGroup,
        ParameterReply,
    )

_HOUR = 3600.0  # [s]
_MAX_NAME = 120
"""Longest name of an operator that the service stores."""

_PERIOD = 0.3
"""Pause between requests while the service investigates [s]; that takes seconds to minutes."""

_SHORTER = -1e-9
"""Change of a stopping distance below which it is shorter [m], beyond rounding."""


def params(
    group: Annotated[
        str,
        argument(
            "braking, braking.SURFACE, terrain, limits, effects; all by default. diff: "
            "compare two model files, without a service."
        ),
    ] = "",
    files: Annotated[list[Path] | None, argument("Files of diff.", "[A.toml B.toml]")] = None,
    history: Annotated[
        bool, option("The last changes: when, by what cause, to which values.", None, "--history")
    ] = False,
    limit: Annotated[
        int, typer.Option("--most", min=1, max=10_000, help="Changes that are listed.")
    ] = 20,
    rollback: Annotated[
        int | None, option("Restore GROUP, or all, as of a version.", "VERSION")
    ] = None,
    changes: Annotated[
        list[str] | None, option("Set a parameter of GROUP; repeat it.", "NAME=VALUE", "--set")
    ] = None,
    investigate: Annotated[
        bool, option("Compare the stored stops with the model.", None, "--investigate")
    ] = False,
    adopt: Annotated[str, option("Plan with the model change that it proposes.", "OFFER")] = "",
    faster: Annotated[
        bool, option("Even if stops get shorter than by the model file.", None, "--faster")
    ] = False,
    connect: options.Connect = "tcp/127.0.0.1:7447",
    namespace: options.Namespace = "slopewise/robot",
    timeout: options.Timeout = 2.0,
    zenoh_file: options.ZenohFile = "",
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("wire.parameter_messages.ParameterReply")] = False,
) -> None:
    """Read the parameters of a running service, set them, or restore an earlier version.

    Limits may be set tighter than in the model file, not wider; braking above it is used in plans
    once stops confirm it. A model change found by the service is proposed, and an operator
    adopts it.

    [bold]Examples[/]  slopewise params braking --history
              slopewise params limits --set speed=1.5
              slopewise params --investigate
              slopewise params diff configs/vehicles/atv.toml learned.toml
    """
    if group == "diff" or files:
        from slopewise.services.jobs.compare_models import compare_models

        comparison = compare_models(files or [])
        print_result(as_json, comparison, _comparison_tables(comparison))
        return
    name, message = _message(
        group, limit if history else 0, rollback, changes, investigate, adopt, faster
    )
    from slopewise.services.cli.ask import ask
    from slopewise.services.wire.connect import client_session
    from slopewise.services.wire.parameter_messages import DiscrepancyQuestion, ParameterReply

    key = f"{namespace}/v1/{name}"
    with client_session(connect, zenoh_file) as session:
        reply = ask(session, key, ParameterReply, message, timeout, "params")
        while investigate and reply.status == "ok" and reply.investigating:
            time.sleep(_PERIOD)
            poll = DiscrepancyQuestion(who=_operator())
            reply = ask(session, key, ParameterReply, poll, timeout, "params")
    if reply.status != "ok":
        raise InputError(key, "", reply.reason)
    print_result(as_json, reply, _tables(reply, group, history, investigate))


def _message(
    group: str,
    history: int,
    rollback: int | None,
    changes: list[str] | None,
    investigate: bool,
    adopt: str,
    faster: bool,
) -> tuple[str, msgspec.Struct]:
    """Name of the key, and message; InputError if the options do not fit together."""
    from slopewise.services.wire import parameter_messages as messages

    if sum(map(bool, (history, rollback is not None, changes, investigate, adopt))) > 1:
        expected = "expected one of --history, --rollback, --set, --investigate, --adopt"
        raise InputError("params", "", f"{expected}, got several")
    if faster and not adopt:
        raise InputError("--faster", "", "expected --adopt with it, got none")
    who = _operator()
    if rollback is not None:
        if rollback < 0:
            raise InputError("--rollback", "", f"expected a version, got {rollback}")
        return "params/rollback", messages.RollBack(version=rollback, group=group, who=who)
    if changes:
        if not group:
            raise InputError("--set", "", "expected the group that is to be changed before it")
        values = _values(changes)
        return "params/set", messages.SetParameters(group=group, values=values, who=who)
    if investigate:
        return "discrepancy", messages.DiscrepancyQuestion(start=True, who=who)
    if adopt:
        return "params/adopt", messages.AdoptOffer(offer=adopt, faster=faster, who=who)
    return "params", messages.ParameterQuestion(group=group, history=history)


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


def _operator() -> str:
    import getpass

    try:
        return getpass.getuser()[:_MAX_NAME]
    except (OSError, KeyError):
        return "operator"


def _tables(
    reply: ParameterReply, group: str, is_history: bool, is_investigation: bool
) -> Iterator[Any]:
    """One row per parameter, or one row per change; then the proposal and the flags."""
    stored = "" if reply.durable else ", not stored on disk"
    title = f"{reply.service}: version {reply.version}{stored}"
    if is_history:
        yield from _history(reply.history, title)
    elif not is_investigation:
        yield from _groups(reply.groups, title)
    if reply.investigation and (is_investigation or not group):
        yield line(f"stored stops: {reply.investigation}")
    if reply.offer is not None and group in ("", "effects"):
        yield from _offer(reply.offer)
    for flag in reply.flags:
        yield line(flag, "yellow")


def _groups(groups: list[ParameterGroup], title: str) -> Iterator[Any]:
    rows = []
    for group in groups:
        operator = f" ({group.who})" if group.who else ""
        state = "" if group.valid else " (not valid yet)"
        facts = [group.group + state, f"version {group.version}"]
        facts.append(f"{group.cause}{operator}, {_age(group.age)}")
        for name, value in group.values.items():
            std = number(group.stds.get(name), ".2g")
            rows.append((facts[0], name, f"{value:.4g}", std, group.unit.get(name, ""), *facts[1:]))
            facts = ["", "", ""]
    columns = ("group", "parameter", "value", "std", "unit", "since", "last change")
    yield from table(columns, rows, title=title, left=columns)


def _history(history: list[HistoryEntry], title: str) -> Iterator[Any]:
    rows = []
    for entry in history:
        moment = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(entry.at))
        values = ", ".join(f"{name} {value:.4g}" for name, value in entry.values.items())
        last = values or "as in the model file"
        rows.append((entry.version, moment, entry.group, entry.cause, entry.who, last))
    columns = ("version", "when", "group", "cause", "who", "values")
    yield from table(columns, rows, title=title, left=columns)


def _offer(offer: ModelProposal) -> Iterator[Any]:
    """The proposed change, its effect in metres, and the command that adopts it."""
    yield line(f"offer {offer.id}: {offer.verdict} – {offer.summary}", "bold")
    for effect in offer.findings["effects"]:
        values = ", ".join(
            f"{n} = {p['value']:.4g} ± {p['std']:.2g} {p['unit']}"
            for n, p in effect["parameters"].items()
        )
        yield line(f"  {effect['name']}: {values}, confidence {effect['confidence']:.0%}")
    gap = offer.findings["stop_distance"]
    yield line(
        f"  {plural(offer.stops, 'stop')}, data {offer.data}: "
        f"{gap['before']:.3f} m off as configured, "
        f"{gap['after']:.3f} m with it, floor {gap['noise_floor']:.3f}"
    )
    for change, reference in ((offer.beside_file, "file"), (offer.beside_use, "in use")):
        span = f"{change.least:+.2f} m ({change.where}) … {change.most:+.2f} m"
        yield line(f"  plans stop {span} compared with the model {reference}")
    yield from notes(offer.notes, "  note")
    yield line(f"  {offer.command() or offer.obstacle}")


def _age(seconds: float) -> str:
    if seconds < 60.0:
        return f"{seconds:.0f} s ago"
    return f"{seconds / 60:.0f} min ago" if seconds < _HOUR else f"{seconds / _HOUR:.1f} h ago"


def _comparison_tables(comparison: ModelComparison) -> Iterator[Any]:
    """One line per key, then the change of stops."""
    for key, change in comparison.keys.items():
        before, after = ("none" if v is None else v for v in (change.before, change.after))
        yield line(f"{key}: {before} → {after}")
    if not comparison.keys:
        yield "no difference"
    for stop in comparison.stops:
        if stop.smallest or stop.largest:
            is_shorter = stop.smallest < _SHORTER
            note = ", shorter somewhere: plans get faster" if is_shorter else ""
            span = f"{stop.smallest:+.2f} … {stop.largest:+.2f} m"
            yield line(f"stops on {stop.surface}: {span}{note}", "yellow" if is_shorter else "")
