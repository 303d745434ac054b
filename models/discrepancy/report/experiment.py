"""Which stops to drive next: those in which rival explanations differ most once each is refitted.

A design is built stop by stop. Each adds what it tells between two explanations, less what the
rival's own numbers could take up, on top of what the log has told of them already (Atkinson and
Fedorov 1975, T-optimality, with every number's prior). For an effect that is named, stops are
chosen that sharpen its numbers most, all others unknown (D-optimality for a part of the numbers).

Stops are proposed within the speeds, slopes, turns and headings that the log has seen.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.findings import Experiment, PlannedStop
from slopewise.models.discrepancy.model.hypothesis import BASE, is_placed
from slopewise.models.discrepancy.model.noise import Whitener, whitener
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.search.candidates import search_of
from slopewise.models.discrepancy.search.refine import Fit, jacobian
from slopewise.models.discrepancy.thresholds import (
    MOST_REPEATS,
    PROPOSED_PAUSES,
    PROPOSED_STOPS,
    SHEET_BINS,
    SHEET_NODES,
    TELLS_APART,
    WARMING_STOPS,
    WORTH_DRIVING,
)
from slopewise.models.effects.registry import LAWS
from slopewise.models.quantity import GRAVITY


def between(table: StopTable, best: Fit, rivals: Sequence[Fit]) -> Experiment:
    """Stops that tell the best explanation from its rivals.

    Args:
        table: stops of the log. best: explanation. rivals: at least one.
    """
    plans, sheet, white = _possible(table, best)
    gains = [_Gain(sheet, white, best, rival) for rival in rivals]
    chosen: list[int] = []
    while len(chosen) < PROPOSED_STOPS:
        # The nearest of the rivals decides, so that none is left untested.
        worth = np.min([gain.of_each() for gain in gains], axis=0)
        pick = int(np.argmax(worth))
        chosen.append(pick)
        for gain in gains:
            gain.add(pick)
    reached = min(gain.total for gain in gains)
    repeats = int(np.ceil(TELLS_APART / reached)) if reached > 0.0 else 0
    own, *others = (_named(f) for f in (best, *rivals))
    names = " or ".join("+".join(each) or "new coefficients" for each in (own, *others))
    stops = tuple(plans[i] for i in chosen)
    if repeats == 0 or repeats > MOST_REPEATS:
        different = [n for each in others for n in each if n not in own]
        test = LAWS[(different or own)[0]].experiment
        text = f"no few stops like those of the log tell {names}: {test}"
        return Experiment(text, stops, repeats if repeats <= 100 else 0)
    text = f"to tell {names}, drive {_words(stops)}"
    text += f"; {repeats} times ({repeats * len(stops)} stops)" if repeats > 1 else ""
    return Experiment(text, stops, repeats)


def _named(fit: Fit) -> tuple[str, ...]:
    """Names of an explanation; the build-up of the brakes where it has no other."""
    return fit.hypothesis.names or tuple(e.name for e in fit.hypothesis.added)


def sharpening(table: StopTable, best: Fit, beyond: float = 0.0) -> Experiment:
    """Stops that make the numbers of named effects most certain.

    Args:
        table: stops. best: explanation.
        beyond: by which stops still end later than it predicts, 0 if no more than by chance [m].
    """
    plans, sheet, white = _possible(table, best)
    slopes = white.by_stop(white.grid @ jacobian(sheet, best.hypothesis))
    information = np.linalg.pinv(best.covariance, hermitian=True)
    own = np.arange(BASE, len(best.hypothesis.free))
    chosen: list[int] = []
    while len(chosen) < PROPOSED_STOPS:
        more = information + np.einsum("skp,skq->spq", slopes, slopes)
        spread = np.linalg.pinv(more, hermitian=True)[:, own[:, None], own]
        chosen.append(int(np.argmin(np.linalg.slogdet(spread)[1])))
        information = more[chosen[-1]]
    before = np.sqrt(np.diag(best.covariance)[own])
    after = np.sqrt(np.diag(np.linalg.pinv(information, hermitian=True))[own])
    stops = tuple(plans[i] for i in chosen)
    shrink = float(np.max(after / np.maximum(before, 1e-300)))
    if shrink > WORTH_DRIVING:
        words = f"{PROPOSED_STOPS} more stops would not make the numbers surer"
        if beyond > 0.0:
            words += (
                f", but stops still end up to {beyond:.2f} m beyond the prediction: repeat the "
                "longest and the steepest ones, everything the same"
            )
        else:
            words = f"nothing is needed: {words}"
        return Experiment(words, stops, 1)
    text = f"to sharpen the numbers by a factor of {1.0 / max(shrink, 1e-3):.1f}, drive "
    return Experiment(text + _words(stops), stops, 1)


class _Gain:
    """Chi square between two explanations as a design grows, the rival refitted throughout."""

    def __init__(self, sheet: StopTable, white: Whitener, best: Fit, rival: Fit) -> None:
        apart = predict(sheet, best.hypothesis) - predict(sheet, rival.hypothesis)
        self.apart = white.by_stop(white.grid @ apart[:, :, None])[:, :, 0]
        self.slopes = white.by_stop(white.grid @ jacobian(sheet, rival.hypothesis))
        self.information = np.linalg.pinv(rival.covariance, hermitian=True)
        self.taken = np.zeros(len(self.information))
        self.raw = 0.0
        self.total = 0.0

    def of_each(self) -> Floats:
        """(stops,) chi square with one more stop."""
        info = self.information + np.einsum("skp,skq->spq", self.slopes, self.slopes)
        taken = self.taken + np.einsum("skp,sk->sp", self.slopes, self.apart)
        inverse = np.linalg.pinv(info, hermitian=True)
        solved = np.einsum("spq,sq->sp", inverse, taken)
        raw = self.raw + np.einsum("sk,sk->s", self.apart, self.apart)
        result: Floats = raw - np.einsum("sp,sp->s", taken, solved)
        return result

    def add(self, pick: int) -> None:
        """Take a stop into the design."""
        self.total = float(self.of_each()[pick])
        slope, apart = self.slopes[pick], self.apart[pick]
        self.information = self.information + slope.T @ slope
        self.taken = self.taken + slope.T @ apart
        self.raw += float(apart @ apart)


def _possible(table: StopTable, best: Fit) -> tuple[list[PlannedStop], StopTable, Whitener]:
    """Stops that could be driven, as a table, and its transform."""
    choices = _choices(table, best)
    plans = []
    for values in itertools.product(*choices.values()):
        given = dict(zip(choices, values, strict=True))
        speed, grade = given.pop("speed"), given.pop("grade")
        plans.append(PlannedStop(float(speed or 0.0), float(grade or 0.0), **given))
    sheet = sheet_of(table, plans, best)
    noise = replace(best.noise, correlation=0.0)
    return plans, sheet, whitener(sheet, noise, best.hypothesis)


def _choices(table: StopTable, best: Fit) -> dict[str, tuple[float | None, ...]]:
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
    patch = next((e for e in best.hypothesis.added if is_placed(e)), None)
    if patch is not None:
        inside = patch.parameters["x"]
        choices["x"] = (inside, inside + 2.0 * patch.parameters["radius"])
        choices["y"] = (patch.parameters["y"],)
    if any(search_of(name).pauses_distinguish for name in best.hypothesis.names):
        choices["pause"] = PROPOSED_PAUSES
    return choices


def sheet_of(table: StopTable, plans: Sequence[PlannedStop], best: Fit) -> StopTable:
    """Stops that were not driven, on ground of constant grade, as a table."""
    count = len(plans)
    speed = np.array([p.speed for p in plans])
    force = float(np.median(table.force))
    grade = np.array([p.grade for p in plans])
    pull = GRAVITY * np.maximum(force + np.sin(grade), 0.1)
    end = best.hypothesis.dead_time + 0.93 * speed / pull
    time = -0.3 + np.linspace(0.0, 1.0, SHEET_NODES) * (end + 0.3)[:, None]
    since = np.maximum(time - best.hypothesis.dead_time, 0.0)
    v = np.maximum(speed[:, None] - pull[:, None] * since, 0.02)
    owner = np.arange(SHEET_NODES) * SHEET_BINS // SHEET_NODES
    average = (owner == np.arange(SHEET_BINS)[:, None]) / np.bincount(owner)[:, None]
    rate = float(np.median(table.spread[table.spread > 0.0])) * np.median(np.diff(table.time))
    spread = rate * table.binned.shape[1] / SHEET_BINS / np.median(np.diff(time))
    one = np.ones_like(time)
    pauses = np.array([p.pause or PROPOSED_PAUSES[-1] for p in plans])

    def column(name: str) -> Floats:
        own: Floats = np.array([getattr(p, name) or 0.0 for p in plans])[:, None] * one
        return own

    clock = float(table.clock.max()) + pauses
    cooled = []
    for i, pause in enumerate(pauses):
        if pause <= PROPOSED_PAUSES[0]:
            cooled += [
                (i, float(pause) * (k + 1), 0.5 * float(speed[i]) ** 2)
                for k in range(WARMING_STOPS)
            ]
    return replace(
        table,
        time=time,
        speed=v,
        station=np.cumsum(v, axis=1) * (time[:, 1:2] - time[:, :1]),
        grade=grade[:, None] * one,
        roll=column("roll"),
        yaw=column("heading"),
        yaw_rate=column("yaw_rate"),
        x=column("x"),
        y=column("y"),
        vertical_curvature=0.0 * one,
        average=np.repeat(average[None], count, axis=0),
        binned=np.zeros((count, SHEET_BINS)),
        spread=np.full((count, SHEET_BINS), float(spread)),
        held=speed,
        clock=clock,
        run=np.full(count, int(table.run.max()) + 1),
        run_names=("",) * count,
        terrain=("",) * count,
        distance=np.zeros(count),
        standstill_time=end,
        force=pull / GRAVITY - np.sin(grade),
        further={},
        cooled=(),
        warmed=_warmth(cooled, count),
    )


def _warmth(
    cooled: Sequence[tuple[int, float, float]], count: int
) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Per stop: (seconds before it, energy) of the stops that warmed its brakes."""
    return tuple(
        tuple((ago, energy) for owner, ago, energy in cooled if owner == i) for i in range(count)
    )


def _words(stops: Sequence[PlannedStop]) -> str:
    said: dict[str, int] = {}
    for stop in stops:
        words = f"{stop.speed:.1f} m/s at {np.rad2deg(stop.grade):+.0f}°"
        if stop.heading is not None:
            words += f" heading {np.rad2deg(stop.heading):.0f}°"
        if stop.roll:
            words += f" leaning {np.rad2deg(stop.roll):.0f}°"
        if stop.yaw_rate:
            words += f" turning at {stop.yaw_rate:.2f} rad/s"
        if stop.x is not None and stop.y is not None:
            words += f" at ({stop.x:.0f}, {stop.y:.0f}) m"
        if stop.pause is not None:
            words += f" after {stop.pause:.0f} s"
        said[words] = said.get(words, 0) + 1
    return "; ".join(f"{n} × {w}" if n > 1 else w for w, n in said.items())
