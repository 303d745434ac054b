"""The other methods alone on sets of one world, for a comparison where ours was asked before.

``python -m benchmarks.discovery.peer_runner multibody --share 0.1 --seed 2 --out FILE.jsonl``
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
from rich.console import Console

from ..common.kept import KeptLines
from ..common.tables import table_of
from . import catalogue, engine_outcomes, multibody_outcomes, peers
from .peers import PeerAnswer
from .sensing import Columns

WORLDS = ("plant", "engine", "multibody")


class AskedSet(msgspec.Struct):
    """One set: what was hidden, sets of names that are right, and the answers."""

    world: str
    what: str
    kind: str
    seed: int
    allowed: list[list[str]]
    answers: dict[str, PeerAnswer]


class MadeLog(NamedTuple):
    """A log before anybody is asked; the answers of its :class:`AskedSet` are still missing."""

    truth: AskedSet
    columns: Columns
    configured: dict[str, float]


def logs(world: str, share: float, half: str, seed: int) -> Iterator[MadeLog]:
    """Sets of a world as the benchmark makes them; of the plant, those that can be named.

    Args:
        world: one of :data:`WORLDS`. share, seed: of its sets. half: of the car's alone.
    """
    if world == "plant":
        for order in catalogue.orders(share, seed):
            if order.kind not in ("clean", "single", "pair"):
                continue
            hidden = catalogue.make(order)
            if hidden.identifiable or order.kind == "clean":
                allowed = [list(order.names)] if order.names else []
                asked = AskedSet(
                    world, " + ".join(order.names), order.kind, order.seed, allowed, {}
                )
                yield MadeLog(asked, hidden.columns, hidden.configured)
        return
    from . import engine_sets, multibody_sets, worlds

    if world == "engine":
        names, orders = engine_outcomes.NAMES, engine_outcomes.engine_orders(share, seed)
    else:
        names = multibody_outcomes.NAMES
        orders = multibody_outcomes.multibody_orders(share, half, seed)
    for one in orders:
        if world == "engine":
            made = worlds.make(engine_sets.ENGINE, one, engine_sets.calibrated)
            columns, configured = made.columns, made.configured
        else:
            car = worlds.make(multibody_sets.MULTIBODY, one, multibody_sets.calibrated)
            columns, configured = car.columns, car.configured
        allowed = [list(right) for right in names.get(one.what, ())]
        kind = "single" if one.what else "clean"
        what = f"{one.what} {one.strength}".strip()
        yield MadeLog(AskedSet(world, what, kind, one.seed, allowed, {}), columns, configured)


def show(asked: list[AskedSet], console: Console) -> None:
    """Every set, then how many each method has right, wrong and clean, and its time a log."""
    table = table_of("every set", *(peers.TITLES[key] for key in peers.PEERS), first="hidden")
    for one in asked:
        table.add_row(one.what or "clean", *(_cell(one, key) for key in peers.PEERS))
    console.print(table)
    columns = ("right", "wrong", "clean sets without a name", "median s a log", "most")
    counts = table_of("the same sets", *columns, first="method")
    for key in peers.PEERS:
        of = [one for one in asked if key in one.answers]
        hidden = [one for one in of if one.allowed]
        clean = [one for one in of if not one.allowed]
        seconds = sorted(one.answers[key].seconds for one in of)
        if not of:
            continue
        counts.add_row(
            peers.TITLES[key],
            f"{sum(right(one, key) for one in hidden)}/{len(hidden)}",
            f"{sum(wrong(one, key) for one in hidden)}/{len(hidden)}",
            f"{sum(not one.answers[key].named for one in clean)}/{len(clean)}",
            f"{seconds[len(seconds) // 2]:.1f}",
            f"{seconds[-1]:.1f}",
        )
    console.print(counts)


def _cell(one: AskedSet, key: str) -> str:
    answer = one.answers.get(key)
    if answer is None:
        return "–"
    mark = "" if not one.allowed else "+ " if right(one, key) else "− " if wrong(one, key) else ""
    return mark + (answer.fault or ", ".join(answer.named))


def right(one: AskedSet, key: str) -> bool:
    """All that is hidden was named, and nothing else."""
    return set(one.answers[key].named) in map(set, one.allowed)


def wrong(one: AskedSet, key: str) -> bool:
    """Something was named that is not hidden."""
    named = set(one.answers[key].named)
    return bool(named) and not any(named <= set(allowed) for allowed in one.allowed)


def main() -> None:
    """Entry of the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", choices=WORLDS)
    parser.add_argument("--share", type=float, default=0.1, help="of all sets of the world")
    parser.add_argument("--half", choices=multibody_outcomes.HALVES, default="tuning")
    parser.add_argument("--seed", type=int, default=1, help="of the choice of sets")
    parser.add_argument("--most", type=int, default=10**6, help="sets")
    parser.add_argument("--out", type=Path, metavar="FILE.jsonl", required=True)
    arguments = parser.parse_args()
    kept, asked = KeptLines(arguments.out), list[AskedSet]()
    made = logs(arguments.world, arguments.share, arguments.half, arguments.seed)
    for log in made:
        log.truth.answers = peers.ask(log.columns, log.configured)
        kept.append(b"\n" + msgspec.json.encode(log.truth))
        asked.append(log.truth)
        if len(asked) == arguments.most:
            break
    show(asked, Console(width=160))


if __name__ == "__main__":
    main()
