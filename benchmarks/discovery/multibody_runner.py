"""The car's sets one after the other into a file, for whoever improves the workflow."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from ..common.kept import KeptLines
from ..common.tables import table_of
from .catalogue import ALL
from .kept import sources_of
from .metrics import record
from .multibody_outcomes import HALVES, NAMES, multibody_metrics, multibody_orders
from .peers import world_summary
from .tables import tables
from .tasks import FinishedSet, SetTask, do
from .world_outcomes import STRENGTHS, WorldOrder, WorldOutcome, by_what

_WIDE = 150  # columns of the widest table


class KeptOutcome(msgspec.Struct):
    """A line of the file: the promise of a truth, or what became of it, by which sources."""

    sources: str
    promised: str | None = None
    done: FinishedSet | None = None


def run(
    half: str,
    share: float,
    file: Path,
    console: Console,
    only: Collection[str] = (),
    seed: int = 1,
    *,
    with_peers: bool = False,
) -> list[FinishedSet]:
    """All sets of a share of a half, in this process and the one that investigates.

    Args:
        half, share, seed: see :func:`.multibody_outcomes.multibody_orders`.
        file: JSON lines; what is in it by the same sources is not made again.
        console: for the progress. only: these effects, all and clean sets if empty.
        with_peers: the other methods are asked, too.
    """
    kept, sources = KeptLines(file), sources_of(repr(ALL), *(["peers"] if with_peers else []))
    orders = multibody_orders(share, half, seed)
    wanted = [SetTask(multibody=order) for order in orders if not only or order.what in only]
    known = _found(kept, sources)

    def put(line: KeptOutcome) -> None:
        kept.append(b"\n" + msgspec.json.encode(line))

    finished = []
    for task in track(wanted, half, console=console):
        done = known.get(task)
        if done is None:
            done = do(
                task,
                ALL,
                lambda digest: put(KeptOutcome(sources, promised=digest)),
                with_peers=with_peers,
            )
            put(KeptOutcome(sources, done=done))
        finished.append(done)
    return finished


def _found(kept: KeptLines, sources: str) -> dict[SetTask, FinishedSet]:
    own = (one.done for one in kept.decoded(KeptOutcome) if one.sources == sources)
    return {done.task: done for done in own if done is not None}


def strengths(console: Console, count: int = 70) -> None:
    """Measure how strong the effects of each strength are, on one set of ``count`` stops each."""
    from .multibody_sets import MULTIBODY, strength_of

    table = table_of("share of the braking force, where felt most", *STRENGTHS[1:], first="effect")
    for what in track(NAMES, "strengths", console=console):
        cells = []
        for strength in STRENGTHS[1:]:
            rng = np.random.default_rng(7)
            stops = MULTIBODY.scene(count, 0.0, rng)
            stops = stops._replace(delay=np.zeros(count))
            nature = MULTIBODY.nature(WorldOrder(what, 7, strength), stops, rng)
            cells.append(f"{strength_of(nature, stops):.1%}")
        table.add_row(what, *cells)
    console.print(table)


def show(finished: Sequence[FinishedSet], console: Console) -> None:
    """What was reached, effect by strength, the other methods, and every set."""
    outcomes = [done.multibody for done in finished if done.multibody is not None]
    result: dict[str, Any] = {
        "multibody_peer": world_summary([done.peers for done in finished], outcomes, NAMES),
        "multibody": [record(metric) for metric in multibody_metrics(outcomes)],
        "multibody_by_effect": by_what("multibody", outcomes),
    }
    for table in tables(result):
        console.print(table)
    console.print(_sets(outcomes))


def _sets(outcomes: Sequence[WorldOutcome]) -> Table:
    columns = ("strength", "verdict", "named", "", "before", "after", "floor", "closed", "s")
    table = table_of("every set, disagreement on fresh stops in mm/s", *columns, first="effect")
    for o in sorted(outcomes, key=lambda o: (o.what, STRENGTHS.index(o.strength), o.seed)):
        mark = "right" if o.right else "[red]wrong" if o.wrong else ""
        sizes = (f"{1000.0 * size:.1f}" for size in (o.before, o.after, o.floor))
        closed = "–" if o.closed is None else f"{o.closed:.0%}"
        table.add_row(
            o.what,
            o.strength,
            o.verdict,
            ", ".join(o.named),
            mark,
            *sizes,
            closed,
            f"{o.seconds:.1f}",
        )
    return table


def main() -> None:
    """Entry of ``python -m benchmarks.discovery.multibody_sets``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--half", choices=HALVES, default=HALVES[0])
    parser.add_argument("--share", type=float, default=0.2, help="of 180 sets and 60 clean ones")
    parser.add_argument("--seed", type=int, default=1, help="of the choice of sets")
    parser.add_argument("--out", type=Path, metavar="FILE.jsonl")
    parser.add_argument("--only", nargs="+", default=(), choices=NAMES, metavar="EFFECT")
    parser.add_argument("--peers", action="store_true", help="ask the other methods, too")
    parser.add_argument("--strengths", action="store_true", help="measure these instead")
    arguments = parser.parse_args()
    console = Console()
    console = Console(width=max(console.width, _WIDE))
    if arguments.strengths:
        strengths(console)
        return
    if arguments.out is None:
        parser.error("--out FILE.jsonl is missing")
    finished = run(
        arguments.half,
        arguments.share,
        arguments.out,
        console,
        arguments.only,
        arguments.seed,
        with_peers=arguments.peers,
    )
    show(finished, console)
