"""Stops to drive next: those in which explanations differ most once each is refitted.

A design is built stop by stop. Each adds the difference between two explanations, less the part
that the alternative's own numbers could absorb, to the information of the log (Atkinson and Fedorov
1975, T-optimality, with every number's prior). For an effect that is named, stops are chosen that
sharpen its numbers most, all others unknown (D-optimality for a part of the numbers).

Stops are proposed within the speeds, slopes, turns and headings that the log has seen.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import HELD_BEFORE, StopTable
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Experiment, PlannedStop, Verdict
from slopewise.models.discrepancy.likelihood.refit import Refit, jacobian
from slopewise.models.discrepancy.likelihood.residual_axes import WITHIN, ResidualAxis
from slopewise.models.discrepancy.likelihood.resolvable import NAMED_FROM
from slopewise.models.discrepancy.likelihood.trace import trace_of
from slopewise.models.discrepancy.likelihood.whitener import Whitener
from slopewise.models.discrepancy.model.hypothesis import BASE, is_placed
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.effects.registry import LAWS
from slopewise.models.quantity import GRAVITY

_MAX_REPEATS = 5  # repetitions of a design that are practical
_STOPS = 6  # of a design, and before one after the shortest pause: ten minutes of driving
_PAUSES = (5.0, 60.0, 900.0)  # before a proposed stop, warm to cold [s]
_SHARPER = 0.9  # of its std, to which a number has to shrink for stops to be proposed [1]

_QUIETER = (
    "repeat one stop ten times, everything the same: if they still differ, repair the speed or the "
    "command channel first; if not, drive each kind of stop three times"
)


def next_experiment(table: StopTable, decision: Decision, beyond: float) -> Experiment:
    """Next stops to drive.

    Args:
        table: stops of the log. decision: its conclusion.
        beyond: by which stops end later than that predicts, 0 if no more than by chance [m].
    """
    match decision.verdict:
        case Verdict.AMBIGUOUS | Verdict.MISSING_EFFECT if decision.alternatives:
            return between(table, decision.explanation, decision.alternatives)
        case Verdict.MISSING_EFFECT:
            return sharpening(table, decision.explanation, beyond)
        case Verdict.UNIDENTIFIABLE:
            return Experiment("; ".join(f"for {n}: {t}" for n, t in decision.absorbed.items()))
        case Verdict.UNKNOWN:
            return Experiment(_along(decision.axis))
        case Verdict.TOO_NOISY:
            return Experiment(_QUIETER)
        case _:
            return Experiment("")


def _along(followed: ResidualAxis | None) -> str:
    if followed is None:
        return "repeat some of these stops unchanged: what differs between them is not the stop"
    axis = followed.axis
    if axis.name in WITHIN:
        return (
            "log speed and brake pressure as fast as the sensors can, and stop from several "
            "speeds on level ground: what is missing happens within each stop"
        )
    low, high = np.quantile(axis.values, [0.02, 0.98])
    return (
        f"repeat one stop, everything else the same, at six values of {axis.name} from {low:.3g} "
        f"to {high:.3g} {axis.unit}, three times each"
    )


def between(table: StopTable, best: Refit, alternatives: Sequence[Refit]) -> Experiment:
    """Stops that distinguish the best explanation from its alternatives."""
    plans, sheet, white = _possible(table, best)
    equations = [_difference(sheet, white, best, alternative) for alternative in alternatives]
    starts, rows = zip(*equations, strict=True)

    def separation(*normals: Floats) -> Floats:
        """(stops,) chi square between the best explanation and the nearest, refitted other."""
        return np.asarray(np.min([_not_absorbed(normal) for normal in normals], axis=0))

    chosen, normals = _design(starts, rows, separation)
    reached = float(separation(*(normal[None] for normal in normals))[0])
    repeats = int(np.ceil(NAMED_FROM / reached)) if reached > 0.0 else 0
    leading, *further = (f.names for f in (best, *alternatives))
    names = " or ".join("+".join(each) or "new coefficients" for each in (leading, *further))
    stops = tuple(plans[i] for i in chosen)
    if repeats == 0 or repeats > _MAX_REPEATS:
        different = [n for each in further for n in each if n not in leading]
        test = LAWS[(different or leading)[0]].experiment
        text = f"no few stops like those of the log distinguish {names}: {test}"
        return Experiment(text, stops, repeats if repeats <= 100 else 0)
    text = f"to distinguish {names}, drive {_listed(stops)}"
    text += f"; {repeats} times ({repeats * len(stops)} stops)" if repeats > 1 else ""
    return Experiment(text, stops, repeats)


def sharpening(table: StopTable, best: Refit, beyond: float = 0.0) -> Experiment:
    """Stops that make the numbers of named effects most certain.

    Args:
        table: stops. best: explanation.
        beyond: by which stops still end later than it predicts, 0 if no more than by chance [m].
    """
    plans, sheet, white = _possible(table, best)
    places = np.arange(BASE, len(best.hypothesis.free))

    def sharp(normal: Floats) -> Floats:
        """(stops,) −ln det of the covariance of numbers of effects, all others unknown."""
        inverse = np.linalg.pinv(normal, hermitian=True)
        return -np.asarray(np.linalg.slogdet(inverse[:, places[:, None], places])[1], np.float64)

    start = np.asarray(np.linalg.pinv(best.covariance, hermitian=True), np.float64)
    slopes = white.root @ jacobian(sheet, best.hypothesis)
    chosen, (normal,) = _design([start], [slopes], sharp)
    before = np.sqrt(np.diag(best.covariance)[places])
    after = np.sqrt(np.diag(np.linalg.pinv(normal, hermitian=True))[places])
    stops = tuple(plans[i] for i in chosen)
    shrink = float(np.max(after / np.maximum(before, 1e-300)))
    if shrink > _SHARPER:
        text = f"{_STOPS} more stops would not narrow the numbers"
        if beyond > 0.0:
            text += (
                f", but stops still end up to {beyond:.2f} m beyond the prediction: repeat the "
                "longest and the steepest ones, everything the same"
            )
        else:
            text = f"nothing is needed: {text}"
        return Experiment(text, stops, 1)
    text = f"to sharpen the numbers by a factor of {1.0 / max(shrink, 1e-3):.1f}, drive "
    return Experiment(text + _listed(stops), stops, 1)


def _design(
    starts: Sequence[Floats], rows: Sequence[Floats], gain: Callable[..., Floats]
) -> tuple[list[int], list[Floats]]:
    """Stops that are worth most one after another, and normal equations with all of them.

    Args:
        starts: (P, P) normal equations of the log. rows: (stops, K, P) that each stop would add.
        worth: of normal equations, (stops, P, P) each.
    """
    normals, chosen = list(starts), []
    more = [np.swapaxes(row, 1, 2) @ row for row in rows]
    for _ in range(_STOPS):
        each = [normal + added for normal, added in zip(normals, more, strict=True)]
        chosen.append(int(np.argmax(gain(*each))))
        normals = [normal[chosen[-1]] for normal in each]
    return chosen, normals


def _not_absorbed(normal: Floats) -> Floats:
    """(stops,) chi square of a difference that the numbers before it, refitted, do not absorb."""
    squares, shared = normal[:, -1, -1], normal[:, :-1, -1]
    inverse = np.linalg.pinv(normal[:, :-1, :-1], hermitian=True)
    absorbed = np.einsum("si,sij,sj->s", shared, inverse, shared)
    return np.asarray(np.maximum(squares - absorbed, 0.0))


def _difference(
    sheet: StopTable, white: Whitener, best: Refit, alternative: Refit
) -> tuple[Floats, Floats]:
    """Normal equations of an alternative and of the difference to it, and rows of each stop."""
    difference = predict(sheet, best.hypothesis) - predict(sheet, alternative.hypothesis)
    columns = [jacobian(sheet, alternative.hypothesis), sheet.average @ difference[:, :, None]]
    start = np.zeros((len(alternative.covariance) + 1,) * 2)
    start[:-1, :-1] = np.linalg.pinv(alternative.covariance, hermitian=True)
    return start, white.root @ np.concatenate(columns, axis=2)


def _possible(table: StopTable, best: Refit) -> tuple[list[PlannedStop], StopTable, Whitener]:
    """Stops that could be driven, as a table, and its transform."""
    choices = _choices(table, best)
    plans = []
    for values in itertools.product(*choices.values()):
        given = dict(zip(choices, values, strict=True))
        speed, grade = given.pop("speed"), given.pop("grade")
        plans.append(PlannedStop(float(speed or 0.0), float(grade or 0.0), **given))
    sheet = sheet_of(table, plans, best)
    none = np.zeros((*sheet.time.shape, 1)), np.zeros(1)
    trace = trace_of(sheet, best.hypothesis.model, none)
    return plans, sheet, Whitener.of(trace, best.whitener.onset, best.whitener.noise)


def _choices(table: StopTable, best: Refit) -> dict[str, tuple[float | None, ...]]:
    low, high = np.quantile(table.held, [0.03, 0.97])
    grades = np.quantile(table.grade, [0.03, 0.97])
    choices: dict[str, tuple[float | None, ...]] = {
        "speed": (float(low), float(0.5 * (low + high)), float(high)),
        "grade": (float(grades[0]), float(np.mean(grades)), float(grades[1])),
    }
    if "yaw" in table.logged and float(np.ptp(table.yaw)) > 1.0:
        choices["heading"] = tuple(float(h) for h in np.arange(6) * np.pi / 3.0)
    if "roll" in table.logged and float(np.ptp(table.roll)) > 0.02:
        choices["roll"] = (0.0, float(np.quantile(np.abs(table.roll), 0.95)))
    if "yaw_rate" in table.logged and float(np.quantile(np.abs(table.yaw_rate), 0.95)) > 0.05:
        choices["yaw_rate"] = (0.0, float(np.quantile(np.abs(table.yaw_rate), 0.95)))
    patch = next((e for e in best.hypothesis.added if is_placed(e.name)), None)
    if patch is not None:
        inside = patch.parameters["x"]
        choices["x"] = (inside, inside + 2.0 * patch.parameters["radius"])
        choices["y"] = (patch.parameters["y"],)
    if any(_needs_pauses(name) for name in best.hypothesis.names):
        choices["pause"] = _PAUSES
    return choices


def _needs_pauses(name: str) -> bool:
    how = LAWS[name].search
    return how is not None and how.pauses_distinguish


def sheet_of(table: StopTable, plans: Sequence[PlannedStop], best: Refit) -> StopTable:
    """Stops that were not driven, on ground of constant grade, as a table."""
    speed = np.array([p.speed for p in plans])
    force = float(np.median(table.force))
    grade = np.array([p.grade for p in plans])
    pull = GRAVITY * np.maximum(force + np.sin(grade), 0.1)
    end = best.hypothesis.dead_time + 0.93 * speed / pull
    count, nodes = table.binned.shape[1], table.time.shape[1]
    time = -HELD_BEFORE + np.linspace(0.0, 1.0, nodes) * (end + HELD_BEFORE)[:, None]
    since = np.maximum(time - best.hypothesis.dead_time, 0.0)
    v = np.maximum(speed[:, None] - pull[:, None] * since, 0.02)
    owner = np.arange(nodes) * count // nodes
    average = (owner == np.arange(count)[:, None]) / np.bincount(owner)[:, None]
    spread = float(np.median(table.spread[table.spread > 0.0]))
    spread *= float(np.median(np.diff(table.time)) / np.median(np.diff(time)))
    constant = np.ones_like(time)
    pauses = np.array([p.pause or _PAUSES[-1] for p in plans])

    def column(name: str) -> Floats:
        values: Floats = np.array([getattr(p, name) or 0.0 for p in plans])[:, None] * constant
        return values

    # Brakes are warm only where one stop follows another immediately.
    ago = np.where(pauses <= _PAUSES[0], pauses, np.inf)[:, None] * np.arange(1, _STOPS + 1)
    energy = np.repeat(0.5 * speed[:, None] ** 2, _STOPS, axis=1)
    return replace(
        table,
        time=time,
        speed=v,
        station=np.cumsum(v, axis=1) * (time[:, 1:2] - time[:, :1]),
        grade=grade[:, None] * constant,
        roll=column("roll"),
        yaw=column("heading"),
        yaw_rate=column("yaw_rate"),
        x=column("x"),
        y=column("y"),
        vertical_curvature=0.0 * constant,
        average=np.repeat(average[None], len(plans), axis=0),
        binned=np.zeros((len(plans), count)),
        spread=np.full((len(plans), count), spread),
        held=speed,
        clock=float(table.clock.max()) + pauses,
        run=np.full(len(plans), int(table.run.max()) + 1),
        session=np.zeros(len(plans), np.int64),
        run_names=("",) * len(plans),
        terrain=("",) * len(plans),
        distance=np.zeros(len(plans)),
        standstill_time=end,
        force=pull / GRAVITY - np.sin(grade),
        further={},
        warmed=np.stack((ago, energy), axis=1),
    )


def _listed(stops: Sequence[PlannedStop]) -> str:
    counts: dict[str, int] = {}
    for stop in stops:
        text = f"{stop.speed:.1f} m/s at {np.rad2deg(stop.grade):+.0f}°"
        if stop.heading is not None:
            text += f" heading {np.rad2deg(stop.heading):.0f}°"
        if stop.roll:
            text += f" leaning {np.rad2deg(stop.roll):.0f}°"
        if stop.yaw_rate:
            text += f" turning at {stop.yaw_rate:.2f} rad/s"
        if stop.x is not None and stop.y is not None:
            text += f" at ({stop.x:.0f}, {stop.y:.0f}) m"
        if stop.pause is not None:
            text += f" after {stop.pause:.0f} s"
        counts[text] = counts.get(text, 0) + 1
    return "; ".join(f"{n} × {w}" if n > 1 else w for w, n in counts.items())
