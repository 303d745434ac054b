"""Smallest effect found, by stops and noise: `python -m benchmarks.discrepancy.power`

Sets of the plant as drawn, whether or not their effect is identifiable. Findings are compared with
the change of a stop that the log states as resolvable: beyond the reach of new coefficients, large
enough for the hidden effect to be detected. The true change is that of the plant's noise-free stops
against the base refitted to them.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .blind_run import SealedLog, investigate_log, tables_of
from .catalogue import SetConditions, SetSpec, make
from .identifiability import change_beyond_base

COUNTS = (30, 60, 120, 240)  # stops of a log
FACTORS = (1, 3, 10)  # on noise and scatter [1]
EFFECTS = ("aerodynamic_drag", "step_change", "surface_patch", "turning_resistance")
SIZES = ("small", "medium")
RATIOS = (0.5, 1.0, 2.0, np.inf)
"""Upper ends of the bins of true over resolvable change."""

_NOISE, _SCATTER = 0.01, 0.005  # [m/s], [1]: times the factor


@dataclass(frozen=True, slots=True)
class PowerCase:
    """One log: the hidden effect ("" for none), its size, stops, and the factor of the noise."""

    name: str
    size: str
    stops: int
    factor: int
    seed: int


@dataclass(frozen=True, slots=True)
class PowerOutcome:
    """Outcome of one log.

    Attributes:
        known: whether the effect is identifiable, by the plant alone.
        right: whether exactly its name was given with confidence.
        seen: whether it is among the names.
        wrong: whether another name was given with confidence.
        verdict: verdict of the finding.
        change: largest change of stops beyond new coefficients [m].
        resolvable: change from which the log states that it would be detected [m]; of a clean log
            the median over all effects.
    """

    case: PowerCase
    known: bool
    right: bool
    seen: bool
    wrong: bool
    verdict: str
    change: float
    resolvable: float

    @property
    def ratio(self) -> float:
        """True over resolvable change."""
        return self.change / self.resolvable if self.resolvable > 0.0 else 0.0


def cases(seeds: int) -> list[PowerCase]:
    """All combinations of stops, noise, effect and size, and clean logs of each."""
    hidden = [("", ""), *itertools.product(EFFECTS, SIZES)]
    return [
        PowerCase(name, size, stops, factor, 1000 * seed + number)
        for number, (stops, factor, (name, size), seed) in enumerate(
            itertools.product(COUNTS, FACTORS, hidden, range(seeds))
        )
    ]


def outcome(case: PowerCase) -> PowerOutcome:
    """Drive, measure and investigate one log."""
    conditions = SetConditions(
        designs=("mixed",),
        counts=(case.stops,),
        noises=(_NOISE * case.factor,),
        scatters=(_SCATTER * case.factor,),
    )
    kind, names = ("faint", (case.name,)) if case.name else ("clean", ())
    hidden = make(SetSpec(kind, names, case.size, case.seed), conditions)
    finding = investigate_log(SealedLog(hidden.columns, tables_of(hidden.configured)))
    confident, named = finding.is_confident, set(finding.names)
    sizes = finding.resolvable
    if not case.name:
        typical = float(np.median(list(sizes.values()))) if sizes else np.inf
        return PowerOutcome(
            case, True, finding.verdict == "none", False, confident, finding.verdict, 0.0, typical
        )
    change = change_beyond_base(
        hidden.truth, hidden.base, hidden.stops, hidden.noise, hidden.scatter
    )
    return PowerOutcome(
        case,
        hidden.identifiability.has_name,
        confident and named == {case.name},
        case.name in named,
        confident and named != {case.name},
        finding.verdict,
        change,
        sizes.get(case.name, np.inf),
    )


def by_stops(done: Sequence[PowerOutcome]) -> list[str]:
    """Rows of the first table: one for each number of stops and noise."""
    lines = [
        f"{'stops':>6}{'noise':>7}{'known':>7}{'right':>7}{'of them':>9}{'wrong':>7}"
        f"{'clean none':>12}{'resolvable, median cm':>23}"
    ]
    for stops, factor in itertools.product(COUNTS, FACTORS):
        here = [o for o in done if (o.case.stops, o.case.factor) == (stops, factor)]
        hidden, clean = (
            [o for o in here if bool(o.case.name) is is_one] for is_one in (True, False)
        )
        if not hidden:
            continue
        known = [o for o in hidden if o.known]
        quiet = sum(o.verdict in ("none", "too_noisy") for o in clean)
        size = 100.0 * float(np.median([o.resolvable for o in hidden]))
        lines.append(
            f"{stops:>6}{f'× {factor}':>7}{len(known):>4}/{len(hidden):<2}"
            f"{sum(o.right for o in hidden):>7}{sum(o.right for o in known):>6}/{len(known):<2}"
            f"{sum(o.wrong for o in here):>7}{quiet:>9}/{len(clean):<2}{size:>23.1f}"
        )
    return lines


def by_ratio(done: Sequence[PowerOutcome]) -> list[str]:
    """Rows of the second table: one for each bin of true over resolvable change."""
    lines = [f"{'true / resolvable':>18}{'logs':>6}{'right':>7}{'seen':>6}{'wrong':>7}"]
    low = 0.0
    for high in RATIOS:
        here = [o for o in done if o.case.name and low <= o.ratio < high]
        label = f"{low:g} … {high:g}" if np.isfinite(high) else f"from {low:g}"
        lines.append(
            f"{label:>18}{len(here):>6}{sum(o.right for o in here):>7}"
            f"{sum(o.seen for o in here):>6}{sum(o.wrong for o in here):>7}"
        )
        low = high
    return lines


def main() -> None:
    """Measure, print two tables, write JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1, help="logs of each kind")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    done: list[PowerOutcome] = []
    todo = cases(given.seeds)
    with multiprocessing.get_context("spawn").Pool(given.jobs) as pool:
        for result in pool.imap(outcome, todo):
            done.append(result)
            print(f"\r{len(done)} of {len(todo)}", end="", flush=True)
            if given.json:
                given.json.write_text(json.dumps([asdict(o) for o in done], indent=1))
    print()
    print("\n".join([*by_stops(done), "", *by_ratio(done)]))


if __name__ == "__main__":
    main()
