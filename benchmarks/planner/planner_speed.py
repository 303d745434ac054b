"""Speed of the planner, compared with the lower bound of a profile and with other tools.

Every figure of one run comes from the same process, the same problems and one thread, interleaved.
Times belong to a machine; their ratios are the result.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.table import Table

from ..common.campaign import BenchmarkRequest, Progress
from ..common.scene import SPACING, fan
from ..common.text_tables import duration, table_of
from ..common.timing import machine
from .batch import in_batch
from .scaling import growth_with_candidates, growth_with_stations, memory
from .solver_comparison import emitted, jerk_limited, select_free, tasks_of, time_optimal

STATIONS, CANDIDATES = 100, 1000  # of the batch, 25 m long

Result = dict[str, Any]


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Measure everything; the quick run takes half a minute."""
    quick = request.quick
    rounds = 3 if quick else 10
    advance = progress("planner", 5)
    scene = fan(STATIONS, CANDIDATES)
    result: Result = {
        "quick": quick,
        "machine": machine(),
        "problem": {"stations": STATIONS, "candidates": CANDIDATES, "spacing": SPACING},
        "batch": in_batch(scene, 30 if quick else 200),
    }
    advance(1)
    candidates = select_free(scene.plan(), 6 if quick else 20)
    tasks = tasks_of(scene, candidates)
    result["single"] = time_optimal(scene, tasks, rounds)
    advance(1)
    result["smoothing"] = jerk_limited(scene, tasks, rounds)
    advance(1)
    result["plans"] = emitted(scene, candidates, rounds)
    advance(1)
    result["growth"] = {
        "stations": growth_with_stations(quick),
        "candidates": growth_with_candidates(quick),
    }
    advance(1)
    result["memory"] = memory(scene)
    result["targets"] = _targets(result)
    return result


def _targets(result: Result) -> list[Result]:
    """Rows of the target table: limits, values by medians, which decide, and by minimum times."""
    batch, single, smoothing = (
        {row["name"]: row for row in result[key]} for key in ("batch", "single", "smoothing")
    )
    pipeline, profile = batch["poses to ranked plans"], batch["profile"]
    smooth, toppra, ipopt = smoothing["planner"], single["toppra"], smoothing["CasADi + IPOPT"]

    def target(name: str, relation: str, limit: float, unit: str, *values: float) -> Result:
        passed = None
        if values:
            passed = values[0] <= limit if relation == "<=" else values[0] >= limit
        median, by_min = values or (None, None)
        return {
            "name": name,
            "relation": relation,
            "limit": limit,
            "unit": unit,
            "value": median,
            "value_least": by_min,
            "passed": passed,
        }

    def at_most(name: str, limit: float, row: Result, to: str) -> Result:
        return target(name, "<=", limit, "×", row[to], row[f"{to}_least"])

    def at_least(
        name: str, limit: float, tool: Result, planner: Result, share: float = 1.0
    ) -> Result:
        if "note" in tool:
            return target(name, ">=", limit, "×")
        ratios = (tool[kind] / (planner[kind] * share) for kind in ("median", "min"))
        return target(name, ">=", limit, "×", *ratios)

    per_candidate = 1.0 / result["problem"]["candidates"]
    bare, brakes = batch["the same without the swept footprint"], batch["profile, brakes decide"]
    milliseconds = (1e3 * smooth["median"], 1e3 * smooth["min"])
    return [
        at_most("poses to ranked plans, to the plain pass", 45.0, pipeline, "to_plain"),
        at_most("the same without the swept footprint", 25.0, bare, "to_plain"),
        at_most("profile, to the pass with braking", 1.5, profile, "to_braking"),
        at_most("the same where brakes decide", 1.5, brakes, "to_braking"),
        at_least("profile in batch, faster than toppra", 3000.0, toppra, profile, per_candidate),
        at_least(
            "poses to ranked plans, faster than toppra", 200.0, toppra, pipeline, per_candidate
        ),
        target("smoothed plan", "<=", 0.06, "ms", *milliseconds),
        at_least("smoothed plan, faster than IPOPT", 5.0, ipopt, smooth),
    ]


def show(result: Result, console: Console) -> None:
    """Print all tables, the targets last."""
    for table in _tables(result):
        console.print(table)


def _tables(result: Result) -> Iterator[Table]:
    yield _batch_table(result)
    title = "The time-optimal problem, one candidate (N = {stations})"
    yield _solver_table(title.format(**result["problem"]), result["single"])
    yield _solver_table("The jerk-limited problem, the same candidates", result["smoothing"])
    yield _plan_table(result)
    for title, by in (
        ("Growth with stations, 16 candidates", "stations"),
        ("Growth with candidates, 100 stations", "candidates"),
    ):
        yield _growth_table(title, by, result["growth"][by])
    yield _target_table(result["targets"])


def _spread(row: Result) -> tuple[str, str]:
    return duration(row["median"]), f"{duration(row['min'])} … {duration(row['max'])}"


def _batch_table(result: Result) -> Table:
    problem = result["problem"]
    table = table_of(
        f"In batch: {problem['candidates']} candidates of {problem['stations']} stations, "
        "one thread; ratios of medians (of least times)",
        "median",
        "min … max",
        "to plain",
        "to braking",
    )
    for row in result["batch"]:
        ratios = (
            f"{row[key]:.3g}× ({row[f'{key}_least']:.3g}×)" for key in ("to_plain", "to_braking")
        )
        table.add_row(row["name"], *_spread(row), *ratios)
    return table


def _solver_table(title: str, rows: list[Result]) -> Table:
    table = table_of(title, "median", "min … max", "solved", "drive", "excess")
    for row in rows:
        if "note" in row:
            table.add_row(row["name"], row["note"])
            continue
        drive = f"{row['travel_time']:.3f} s" if "travel_time" in row else "–"
        over = f"{row['excess']:.2%}" if "excess" in row else "–"
        table.add_row(row["name"], *_spread(row), f"{row['solved']}/{row['of']}", drive, over)
    return table


def _plan_table(result: Result) -> Table:
    table = table_of("One plan that is emitted, and memory", "median", "min … max")
    for row in result["plans"]:
        table.add_row(row["name"], *_spread(row))
    memory = result["memory"]
    table.add_row("arrays of a batch", f"{memory['batch_arrays'] / 1e6:.1f} MB")
    table.add_row("peak of this process", f"{memory['process_peak'] / 1e6:.0f} MB")
    return table


def _growth_table(title: str, by: str, rows: list[Result]) -> Table:
    table = table_of(title, *(str(row[by]) for row in rows))
    for name in dict.fromkeys(name for row in rows for name in row):
        if name not in ("stations", "candidates"):
            cells = (duration(row[name]["median"]) if name in row else "–" for row in rows)
            table.add_row(name, *cells)
    return table


def _target_table(rows: list[Result]) -> Table:
    table = table_of("Targets", "target", "reached", "by least times", "")
    for row in rows:
        unit = row["unit"]
        reached = (
            "–" if value is None else f"{value:.3g} {unit}"
            for value in (row["value"], row["value_least"])
        )
        verdict = {True: "[green]pass", False: "[red]miss", None: "not measured"}[row["passed"]]
        table.add_row(row["name"], f"{row['relation']} {row['limit']:g} {unit}", *reached, verdict)
    return table
