"""The place and size of a patch, by trying many: chi square has steps and no slope there.

Which stops lie inside is found first, from what tells stops apart, thousands of circles at once.
Where exactly the edge lies then shows within the stops that cross it: a circle that is a little off
errs much there, so that the right one is a needle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import BASE, free_parameters
from slopewise.models.discrepancy.model.prediction import integral
from slopewise.models.discrepancy.search import screening
from slopewise.models.discrepancy.search.candidates import EffectColumn, finer_patches
from slopewise.models.discrepancy.search.refine import (
    Fit,
    fit_with_scatter,
    prior_precision,
    residual,
)
from slopewise.models.discrepancy.thresholds import (
    CIRCLE_MOVES,
    CIRCLE_TRIES,
    CIRCLES,
    CIRCLES_KEPT,
    EDGE_ROUNDS,
    FEWEST_TOUCHED,
    LARGEST_PATCH,
    PLACE_NODES,
    SMALLEST_PATCH,
)


def left_of(table: StopTable, fit: Fit) -> tuple[Floats, Floats]:
    """Whitened residual of a fit: (S,) along the friction of each stop, (N,) the rest."""
    r = fit.white.split(fit.white.bins @ residual(table, fit.hypothesis)[:, :, None])
    return r[0][:, 0], r[1].ravel()


def placed_patch(
    table: StopTable, fit: Fit, name: str, seed: int = 0
) -> tuple[EffectColumn, float] | None:
    """The patch that explains most of what a fit leaves, and its strength; None if there is none.

    Args:
        table: stops. fit: without the patch. name: of the effect. seed: of the patches tried.
    """
    circle = _Between(table, fit).best_circle(np.random.default_rng(seed))
    if circle is None:
        return None
    x, y, radius = circle.tolist()
    nearest = EffectColumn(name, {"x": x, "y": y, "radius": radius})
    weighed = WeighedPatches(table, fit)
    strength, draw = 0.0, 100 * seed
    for blur, radii in EDGE_ROUNDS:
        gain = 0.0
        for closer in radii:
            draw += 1
            more, shares = finer_patches(table, nearest, closer, draw)
            if not more:
                continue
            tried = weighed.scores(shares, blur)
            k = int(np.argmax(tried.gain))
            if tried.gain[k] > gain:
                nearest, strength, gain = more[k], float(tried.strength[k]), float(tried.gain[k])
    return (nearest, strength) if strength != 0.0 else None


class WeighedPatches:
    """What patches explain of what a fit leaves; all that they share is worked out once."""

    def __init__(self, table: StopTable, fit: Fit) -> None:
        self.fit = fit
        white, nodes = fit.white, table.time.shape[1]
        each = np.broadcast_to(np.eye(nodes), (len(table), nodes, nodes))
        # (S, K, M) whitened bins by a force around each time.
        self.told = white.grid @ integral(table, fit.hypothesis, each, np.ones(nodes, np.bool_))
        self.base = white.split(white.grid @ fit.jacobian)
        self.left = left_of(table, fit)
        self.precision = prior_precision(fit.hypothesis)

    def scores(self, shares: Floats, blur: float = 1.0) -> screening.Scores:
        """Of patches with (S, M, Q) shares, with noise within stops that many times as large."""
        white = self.fit.white
        columns = white.split(self.told @ shares)
        sums = screening.summed(self.base, columns, white.power, self.precision).blurred(blur)
        left = self.left[0], self.left[1] / blur
        both = np.zeros(shares.shape[2], np.bool_)
        return screening.scores(sums, left, white.noise.scatter, both)


class _Between:
    """What circles explain of the differences between stops, by few places along each."""

    def __init__(self, table: StopTable, fit: Fit) -> None:
        self.fit = fit
        white = fit.white
        nodes = table.time.shape[1]
        groups = np.arange(nodes) // PLACE_NODES
        forces = np.ones(groups[-1] + 1, np.bool_)
        each = (groups[:, None] == np.arange(len(forces))).astype(np.float64)
        share = np.broadcast_to(each, (*table.time.shape, len(forces)))
        along = np.einsum("sk,skm->sm", white.friction, white.grid)
        # (S, G) share of each place in what a stop's friction explains.
        self.told = np.einsum("sm,smg->sg", along, integral(table, fit.hypothesis, share, forces))
        counts = each.sum(axis=0)
        self.x, self.y = table.x @ each / counts, table.y @ each / counts
        base, _ = white.split(white.grid @ fit.jacobian)
        self.left = left_of(table, fit)[0]
        p = base.shape[1]
        nothing = np.zeros((0, p))
        self.sums = screening.Reduced(
            np.zeros((p, p)),
            np.zeros((p, 0)),
            np.zeros(0),
            base,
            np.zeros((len(base), 0)),
            white.power,
            nothing,
            nothing,
            prior_precision(fit.hypothesis),
        )

    def best_circle(self, rng: np.random.Generator) -> Floats | None:
        """(3,) x, y, radius [m] of the circle that explains most; None where none holds stops."""
        size = float(max(np.ptp(self.x), np.ptp(self.y)))
        if size <= 0.0:
            return None
        stops = rng.integers(0, len(self.x), CIRCLES)
        radius = size * np.exp(rng.uniform(np.log(SMALLEST_PATCH), np.log(LARGEST_PATCH), CIRCLES))
        off = rng.normal(0.0, 0.5, (2, CIRCLES)) * radius
        circles = np.stack((self.x[stops, 0] + off[0], self.y[stops, 0] + off[1], radius), axis=1)
        gains = self._gains(circles)
        best = circles[np.argsort(-gains)[:CIRCLES_KEPT]]
        highest = np.sort(gains)[::-1][:CIRCLES_KEPT]
        for closer in CIRCLE_MOVES:
            steps = closer * rng.standard_normal((CIRCLES_KEPT, CIRCLE_TRIES, 3))
            tried = best[:, None, :].repeat(CIRCLE_TRIES, axis=1)
            tried[:, :, :2] += steps[:, :, :2] * best[:, None, 2:]
            tried[:, :, 2] *= np.exp(steps[:, :, 2])
            gains = self._gains(tried.reshape(-1, 3)).reshape(CIRCLES_KEPT, CIRCLE_TRIES)
            k = np.argmax(gains, axis=1)
            rows = np.arange(CIRCLES_KEPT)
            better = gains[rows, k] > highest
            best = np.where(better[:, None], tried[rows, k], best)
            highest = np.where(better, gains[rows, k], highest)
        winner: Floats = best[int(np.argmax(highest))]
        return winner if highest.max() > 0.0 else None

    def _gains(self, circles: Floats) -> Floats:
        """(Q,) drop of −2 log likelihood by circles (Q, 3)."""
        x, y, radius = circles.T
        away = (self.x[:, :, None] - x) ** 2 + (self.y[:, :, None] - y) ** 2
        inside = away <= radius**2
        touched = inside.any(axis=1).sum(axis=0)
        fair = (touched >= FEWEST_TOUCHED) & ~inside.all(axis=(0, 1))
        columns = np.einsum("sg,sgq->sq", self.told, inside)
        count, p = len(circles), self.sums.base_between.shape[1]
        sums = replace(
            self.sums,
            cross_within=np.zeros((p, count)),
            own_within=np.zeros(count),
            between=columns,
            rows=np.zeros((0, count)),
        )
        nothing = np.zeros(0)
        both = np.zeros(count, np.bool_)
        found = screening.scores(sums, (self.left, nothing), self.fit.noise.scatter, both)
        result: Floats = np.where(fair, found.gain, 0.0)
        return result


def moved_patch(table: StopTable, found: Fit, index: int) -> Fit:
    """The same with one of its effects, a patch, where it fits best once the others are there.

    Args:
        table: stops. found: with the patch. index: of the patch among its effects.
    """
    patch = found.hypothesis.added[index]
    without = without_effect(found, index)
    placed = placed_patch(table, without, patch.name, seed=1 + index)
    if placed is None:
        return found
    nearest, strength = placed
    better = fit_with_scatter(table, without.hypothesis.plus(nearest.effect(strength)), found.noise)
    return better if better.deviance < found.deviance else found


def without_effect(found: Fit, index: int) -> Fit:
    """The same fit as seen by a search for one of its effects: without it."""
    added = found.hypothesis.added
    begin = BASE + sum(len(free_parameters(e)) for e in added[:index])
    own = np.arange(begin, begin + len(free_parameters(added[index])))
    rest = replace(found.hypothesis, added=(*added[:index], *added[index + 1 :]))
    return replace(found, hypothesis=rest, jacobian=np.delete(found.jacobian, own, axis=2))
