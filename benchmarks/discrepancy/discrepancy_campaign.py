"""The benchmark of missing effects: hide, investigate blindly, score; with a baseline."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from importlib.util import find_spec
from multiprocessing import util
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from ..common.campaign import BenchmarkRequest, Progress, ResultCache, digest_of_sources, run_jobs
from ..common.text_tables import table_of
from . import baselines, catalogue
from .baselines import TITLES, BaselineAnswer
from .blind_run import BlindRun, SealedLog, tables_of
from .car_outcomes import CAR_NAMES, CLEAN, CarOutcome, CarSpec, car_specs
from .catalogue import ALL, SetConditions, SetSpec
from .discrepancy_metrics import car_metrics, car_rows, effect_rows, metrics
from .score import SetOutcome, score

Result = dict[str, Any]
SetTask = SetSpec | CarSpec  # a set of the plant or of the car

_SOURCES = (
    "benchmarks/discrepancy",
    "models/discrepancy",
    "models/calibration",
    "models/effects",
    "models/laws",
    "models/stop_logs",
    "models/stops",
)
_IGNORED_SOURCES = ("discrepancy_campaign.py", "discrepancy_metrics.py", "discrepancy_tables.py")
_CAR_PACKAGE = ("commonroad-vehicle-models", "vehiclemodels")  # its name and its module


@dataclass(frozen=True, slots=True)
class FinishedSet:
    """Outcome of a task, and the answer of the baseline."""

    task: SetTask
    outcome: SetOutcome | CarOutcome
    answer: BaselineAnswer


@dataclass(frozen=True, slots=True, kw_only=True)
class SetCounts:
    """Size of a run."""

    share: float  # of the plant's catalogue, one set of each kind at least [1]
    max_sets: int = 10**6
    conditions: SetConditions = ALL  # of the plant's sets
    seed: int = 1  # determines all sets
    minutes: float = float("inf")  # time after which no further set is started [min]
    multibody: float = 0.0  # share of the sealed sets of the multi-body car [1]
    tuning: float = 0.0  # share of the car's tuning half; if positive, no other set is run [1]


FULL = SetCounts(share=1.0, multibody=0.25)
QUICK = SetCounts(
    share=0.01, max_sets=68, conditions=SetConditions(counts=(40, 70)), multibody=0.01
)


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Run all sets, as far as time allows, on two processes."""
    size = replace(
        QUICK if request.quick else FULL, minutes=request.minutes, tuning=request.tuning_share
    )
    if request.sets is not None:
        size = replace(size, max_sets=request.sets)
    return run_sets(planned(size), size, progress, request.out)


def show(result: Result, console: Console) -> None:
    """Print all tables, and the package without which a world could not be run."""
    for table in tables(result):
        console.print(table)
    for package in result.get("missing", ()):
        console.print(f"{package} is not installed: pip install '.\\[sim]' in a clone")


def planned(size: SetCounts) -> list[SetTask]:
    """Tasks of a run; every first part of the list holds a fair share of each family."""
    if size.tuning > 0.0:
        return list[SetTask](car_specs(size.tuning, "tuning", size.seed))[: size.max_sets]
    todo = list[SetTask](catalogue.specs(size.share, size.seed))
    if size.multibody > 0.0 and find_spec(_CAR_PACKAGE[1]) is not None:
        todo += car_specs(size.multibody, "sealed", size.seed)
    rng = np.random.default_rng((5, size.seed))
    return catalogue.spread(todo, type, rng)[: size.max_sets]


def run_sets(
    todo: Sequence[SetTask], size: SetCounts, progress: Progress, folder: Path | None = None
) -> Result:
    """Run tasks; outcomes stored in the folder are not computed again."""
    work = partial(run_task, conditions=size.conditions)
    until = time.monotonic() + 60.0 * size.minutes
    with tempfile.TemporaryDirectory(prefix="slopewise-bench-") as temporary:
        digest = digest_of_sources(_SOURCES, _IGNORED_SOURCES, repr(size.conditions))
        stored = ResultCache((folder or Path(temporary)) / f"sets-{digest}")
        finished = run_jobs(work, todo, progress, "discrepancy", stored, until)
    missing = [_CAR_PACKAGE[0]] if find_spec(_CAR_PACKAGE[1]) is None else []
    return result_of(finished) | {"planned": len(todo), "missing": missing}


def run_task(task: SetTask, conditions: SetConditions = ALL) -> FinishedSet:
    """Make a set, investigate it blindly, score the finding."""
    if isinstance(task, SetSpec):
        hidden = catalogue.make(task, conditions)
        log = SealedLog(hidden.columns, tables_of(hidden.configured))
        outcome = score(hidden, _blind_run().investigate(log))
        return FinishedSet(task, outcome, baselines.ask(hidden.columns, hidden.configured))
    # Only the worker process needs the package of the car.
    from . import car_sets

    car = car_sets.make(task)
    log = SealedLog(car.columns, tables_of(car.configured, car_sets.car_table()))
    scored = car_sets.score_set(car, _blind_run().investigate(log))
    return FinishedSet(task, scored, baselines.ask(car.columns, car.configured))


@cache
def _blind_run() -> BlindRun:
    """The one investigating process for all tasks of this process."""
    process = BlindRun()
    # A worker process joins its children before it runs what is registered with atexit, and
    # before that it closes queues, at priority 10: the end has to be sent earlier.
    util.Finalize(None, process.close, exitpriority=100)
    return process


def result_of(finished: Sequence[FinishedSet]) -> Result:
    """Targets and values reached, as plain data."""
    plant = [(o, f.answer) for f in finished if isinstance(o := f.outcome, SetOutcome)]
    car = [(o, f.answer) for f in finished if isinstance(o := f.outcome, CarOutcome)]
    outcomes, cars = [o for o, _ in plant], [o for o, _ in car]
    single = [pair for pair in plant if pair[0].kind == "single" and pair[0].identifiable]
    pairs = [pair for pair in plant if pair[0].kind == "pair" and pair[0].identifiable]
    hidden = [pair for pair in plant if pair[0].kind in ("single", "pair", "off")]
    result: Result = {
        "sets": len(finished),
        "metrics": [m.record() for m in metrics(outcomes)],
        "by_effect": effect_rows(outcomes),
        "peer": baselines.summary(
            {
                "right name first, all effects": (single, "first"),
                "the right name and no other, all effects": (single, "exact"),
                "both names of a pair and no other": (pairs, "exact"),
                "a wrong name given": (hidden, "wrong"),
                "an effect named on clean sets": (
                    [pair for pair in plant if pair[0].kind == "clean"],
                    "named",
                ),
            },
            lambda o: (o.truth,),
        ),
        "outcomes": [o.record() for o in outcomes],
    }
    if not cars:
        return result
    hidden_cars = [pair for pair in car if pair[0].what != CLEAN]
    return result | {
        "multibody": [m.record() for m in car_metrics(cars)],
        "multibody_by_effect": car_rows(cars),
        "multibody_outcomes": [asdict(o) for o in cars],
        "multibody_peer": baselines.summary(
            {
                "the right names and no other": (hidden_cars, "exact"),
                "a wrong name given": (hidden_cars, "wrong"),
                "an effect named on clean sets": (
                    [pair for pair in car if pair[0].what == CLEAN],
                    "named",
                ),
            },
            lambda o: CAR_NAMES.get(o.what, ()),
        ),
    }


def tables(result: Result) -> Iterator[Table]:
    """Targets and values reached, counts by effect, then the other methods."""
    for key, title, table in (
        ("metrics", "hidden effects", _metric_table),
        ("multibody", "with the multi-body car", _metric_table),
        ("by_effect", "by effect", _effect_table),
        ("multibody_by_effect", "with the car", _effect_table),
        ("peer", "the same sets", _baseline_table),
        ("multibody_peer", "the same sets of the car", _baseline_table),
    ):
        if key in result:
            yield table(title, result[key])


def _metric_table(title: str, rows: list[Result]) -> Table:
    columns = ("target", "reached", "95 % interval or quartiles", "of", "")
    table = table_of(title, *columns, first="what")
    for row in rows:
        verdict = {True: "[green]pass", False: "[red]miss", None: ""}[row["passed"]]
        table.add_row(row["what"], _target(row), *_reached(row), verdict)
    return table


def _target(row: Result) -> str:
    if not row["relation"]:
        return "–"
    if row["relation"] == "in":
        low, high = row["wanted"]
        return f"{low:.0%} … {high:.0%}"
    sign = {">=": "≥", "<=": "≤"}[row["relation"]]
    return f"{sign} {_value(row, row['wanted'])}"


def _reached(row: Result) -> tuple[str, str, str]:
    if row["reached"] is None:
        return "–", "", "0"
    of = f"{row['hits']}/{row['of']}" if row["unit"] == "%" else str(row["of"])
    interval = f"{_value(row, row['low'])} … {_value(row, row['high'])}"
    return _value(row, row["reached"]), interval, of


def _value(row: Result, value: float) -> str:
    if row["unit"] in ("%", "share"):
        return f"{value:.1%}"
    return f"{value:.3g} {row['unit']}".strip()


def _effect_table(title: str, rows: list[Result]) -> Table:
    table = Table(title=title, title_justify="left")
    for column in ("kind", "effect"):
        table.add_column(column, overflow="fold")
    for column in ("sets", "identifiable", "right", "wrong", "axis", "closed"):
        table.add_column(column, justify="right")
    table.add_column("verdicts", overflow="fold")
    for row in rows:
        verdicts = ", ".join(f"{name} {count}" for name, count in sorted(row["verdicts"].items()))
        closed = "–" if row["closed"] is None else f"{row['closed']:.0%}"
        axis = "–" if row["axis"] is None else str(row["axis"])
        counts = (str(row[key]) for key in ("sets", "identifiable", "right", "wrong"))
        table.add_row(row["kind"], row["effect"], *counts, axis, closed, verdicts)
    return table


def _baseline_table(title: str, rows: list[Result]) -> Table:
    """Shares of the methods, with intervals if there are only two."""
    keys = [key for key in TITLES if key in rows[0]]
    several = len(keys) > 2
    columns = [text for key in keys for text in ([TITLES[key]] if several else [TITLES[key], ""])]
    table = table_of(title, *columns, first="what")
    for row in rows:
        cells = []
        for key in keys:
            reached, interval, of = _reached(row[key]) if key in row else ("–", "", "0")
            cells += [of] if several else [f"{reached} ({of})", interval]
        table.add_row(row["what"], *cells)
    return table
