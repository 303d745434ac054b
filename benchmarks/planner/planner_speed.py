"""How fast the planner is: beside the least that a profile can cost, beside other tools, and how
that grows.

Every figure of one run comes from the same process, the same problems and one thread; what is
compared takes turns. Times of a machine say little, their ratios are the result.
Run it as ``python -m benchmarks.planner.planner_speed [--quick]``.
"""

from __future__ import annotations

import sys
from typing import Any

from rich.console import Console

from ..common.measure import machine
from ..common.scene import SPACING, fan
from .batch import in_batch
from .growth import growth_with_candidates, growth_with_stations, memory
from .one_by_one import chosen_from, emitted, jerk_limited, tasks_of, time_optimal
from .tables import tables

STATIONS, CANDIDATES = 100, 1000

Result = dict[str, Any]


def run(quick: bool = False) -> Result:
    """Measure everything; the result is plain data, ready for JSON.

    Args:
        quick: fewer rounds and smaller sizes, within half a minute.
    """
    scene = fan(STATIONS, CANDIDATES)
    batch = in_batch(scene, 30 if quick else 200)
    chosen = chosen_from(scene.plan(), 6 if quick else 20)
    tasks = tasks_of(scene, chosen)
    rounds = 3 if quick else 10
    single = time_optimal(scene, tasks, rounds)
    smoothing = jerk_limited(scene, tasks, rounds)
    plans = emitted(scene, chosen, rounds)
    growth = {
        "stations": growth_with_stations(quick),
        "candidates": growth_with_candidates(quick),
    }
    result: Result = {
        "quick": quick,
        "machine": machine(),
        "problem": {"stations": STATIONS, "candidates": CANDIDATES, "spacing": SPACING},
        "batch": batch,
        "single": single,
        "smoothing": smoothing,
        "plans": plans,
        "growth": growth,
        "memory": memory(scene),
    }
    result["targets"] = _targets(result)
    return result


def _targets(result: Result) -> list[Result]:
    """What was to be reached, and whether it was."""
    batch = {row["name"]: row for row in result["batch"]}
    single = {row["name"]: row for row in result["single"]}
    smoothing = {row["name"]: row for row in result["smoothing"]}
    pipeline, profile = batch["poses to ranked plans"], batch["profile"]
    smooth, bare = smoothing["planner"], batch["the same without the swept footprint"]
    toppra, ipopt = single["toppra"], smoothing["CasADi + IPOPT"]

    def target(name: str, relation: str, limit: float, unit: str, *values: float) -> Result:
        """Reached by the medians, which decide, and by the least times."""
        passed = None
        if values:
            passed = values[0] <= limit if relation == "<=" else values[0] >= limit
        median, least = values or (None, None)
        return {
            "name": name,
            "relation": relation,
            "limit": limit,
            "unit": unit,
            "value": median,
            "value_least": least,
            "passed": passed,
        }

    def at_most(name: str, limit: float, row: Result, to: str) -> Result:
        return target(name, "<=", limit, "×", row[to], row[f"{to}_least"])

    def at_least(name: str, limit: float, peer: Result, own: Result, share: float = 1.0) -> Result:
        if "note" in peer:
            return target(name, ">=", limit, "×")
        ratios = (peer[kind] / (own[kind] * share) for kind in ("median", "min"))
        return target(name, ">=", limit, "×", *ratios)

    one = 1.0 / result["problem"]["candidates"]
    brakes = batch["profile, brakes decide"]
    milliseconds = (1e3 * smooth["median"], 1e3 * smooth["min"])
    return [
        at_most("poses to ranked plans, to the plain pass", 45.0, pipeline, "to_plain"),
        at_most("the same without the swept footprint", 25.0, bare, "to_plain"),
        at_most("profile, to the pass with braking", 1.5, profile, "to_braking"),
        at_most("the same where brakes decide", 1.5, brakes, "to_braking"),
        at_least("profile in batch, faster than toppra", 3000.0, toppra, profile, one),
        at_least("poses to ranked plans, faster than toppra", 200.0, toppra, pipeline, one),
        target("smoothed plan", "<=", 0.06, "ms", *milliseconds),
        at_least("smoothed plan, faster than IPOPT", 5.0, ipopt, smooth),
    ]


def show(result: Result, console: Console | None = None) -> None:
    """Print tables."""
    screen = console or Console()
    for table in tables(result):
        screen.print(table)


def figures(result: Result) -> list[Any]:
    """Plotly figures of the same data; needs plotly."""
    from .charts import charts

    return charts(result)


if __name__ == "__main__":
    show(run(quick="--quick" in sys.argv[1:]))
