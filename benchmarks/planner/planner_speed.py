"""Speed of the planner, compared with the lower bound of a profile and with other tools.

Every figure of one run comes from the same process, the same problems and one thread, interleaved.
Times belong to a machine; their ratios are the result.
"""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from ..common.campaign import BenchmarkRequest, Progress, Result
from ..common.scene import SPACING, fan
from ..common.text_tables import RELATIONS, duration, table_of
from ..common.timing import machine
from .batch import in_batch, memory
from .solver_comparison import emitted, jerk_limited, select_free, tasks_of, time_optimal

STATIONS, CANDIDATES = 100, 1000  # of the batch, 25 m long

Values = tuple[float | None, float | None]  # by medians and by minimum times


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Measure everything; the quick run takes half a minute."""
    quick = request.quick
    rounds = 3 if quick else 10
    advance = progress("planner", 4)
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
    result["single"] = time_optimal(tasks, rounds)
    advance(1)
    result["smoothing"] = jerk_limited(scene, tasks, rounds)
    advance(1)
    result["plans"] = emitted(scene, candidates, rounds)
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
    bare, brakes = batch["the same without the swept footprint"], batch["profile, brakes decide"]
    smooth, toppra, ipopt = smoothing["planner"], single["toppra"], smoothing["CasADi + IPOPT"]
    candidates = result["problem"]["candidates"]

    def ratio(row: Result, to: str) -> Values:
        return row[to], row[f"{to}_least"]

    def faster(tool: Result, planner: Result, plans: int = 1) -> Values:
        if "note" in tool:
            return None, None
        return plans * tool["median"] / planner["median"], plans * tool["min"] / planner["min"]

    milliseconds: Values = 1e3 * smooth["median"], 1e3 * smooth["min"]
    by_toppra = [faster(toppra, row, candidates) for row in (profile, pipeline)]
    rows: list[tuple[str, str, float, str, Values]] = [
        ("poses to ranked plans, to the plain pass", "<=", 45.0, "×", ratio(pipeline, "to_plain")),
        ("the same without the swept footprint", "<=", 25.0, "×", ratio(bare, "to_plain")),
        ("profile, to the pass with braking", "<=", 1.5, "×", ratio(profile, "to_braking")),
        ("the same where brakes decide", "<=", 1.5, "×", ratio(brakes, "to_braking")),
        ("profile in batch, faster than toppra", ">=", 3000.0, "×", by_toppra[0]),
        ("poses to ranked plans, faster than toppra", ">=", 200.0, "×", by_toppra[1]),
        ("smoothed plan", "<=", 0.06, "ms", milliseconds),
        ("smoothed plan, faster than IPOPT", ">=", 5.0, "×", faster(ipopt, smooth)),
    ]
    return [
        {"name": name, "relation": relation, "limit": limit, "unit": unit}
        | {"value": value, "value_least": by_min}
        | {"passed": None if value is None else RELATIONS[relation](value, limit)}
        for name, relation, limit, unit, (value, by_min) in rows
    ]


def show(result: Result, console: Console) -> None:
    title = "The time-optimal problem, one candidate (N = {stations})"
    console.print(_batch_table(result))
    console.print(_solver_table(title.format(**result["problem"]), result["single"]))
    smoothing = "The jerk-limited problem, the same candidates"
    console.print(_solver_table(smoothing, result["smoothing"]))
    console.print(_plan_table(result))
    console.print(_target_table(result["targets"]))


def _spread(row: Result) -> tuple[str, str]:
    return duration(row["median"]), f"{duration(row['min'])} … {duration(row['max'])}"


def _batch_table(result: Result) -> Table:
    problem = result["problem"]
    title = f"In batch: {problem['candidates']} candidates of {problem['stations']} stations, "
    title += "one thread; ratios of medians (of least times)"
    table = table_of(title, "median", "min … max", "to plain", "to braking")
    keys = ("to_plain", "to_braking")
    for row in result["batch"]:
        ratios = (f"{row[key]:.3g}× ({row[f'{key}_least']:.3g}×)" for key in keys)
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


def _target_table(rows: list[Result]) -> Table:
    table = table_of("Targets", "target", "reached", "by least times", "")
    for row in rows:
        unit = row["unit"]
        values = (row["value"], row["value_least"])
        reached = ("–" if value is None else f"{value:.3g} {unit}" for value in values)
        verdict = {True: "[green]pass", False: "[red]miss", None: "not measured"}[row["passed"]]
        table.add_row(row["name"], f"{row['relation']} {row['limit']:g} {unit}", *reached, verdict)
    return table
