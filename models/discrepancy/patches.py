"""The place and size of a patch, by trying many nearby: chi square has steps and no slope there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.discrepancy import screening
from models.discrepancy.candidates import Candidate, finer_patches
from models.discrepancy.hypothesis import free_parameters
from models.discrepancy.refine import Fit, fit_with_scatter, prior_precision, residual
from models.discrepancy.stop_table import StopTable

Floats = NDArray[np.float64]

_SEARCH = (
    (30.0, (0.5, 0.4, 0.3)), (10.0, (0.4, 0.3, 0.2)), (3.0, (0.3, 0.2, 0.1)),
    (1.0, (0.3, 0.2, 0.15, 0.1, 0.07, 0.05)),
)  # fmt: skip
"""Blur of what happens within a stop, and radii by which patches are moved, round after round."""


def left_of(table: StopTable, fit: Fit) -> tuple[Floats, Floats]:
    """Whitened residual of a fit: (S,) along the friction of each stop, (N,) the rest."""
    r = fit.white.split(fit.white.bins @ residual(table, fit.hypothesis)[:, :, None])
    return r[0][:, 0], r[1].ravel()


def placed_patch(
    table: StopTable, fit: Fit, start: Candidate, skipped: int = 0, seed: int = 0
) -> tuple[Candidate, float]:
    """The patch that explains most of what a fit leaves, and its strength; 0 if there is none.

    A patch that is a little off errs much where stops cross its edge, so that the right one is a
    needle. What happens within stops is therefore blurred first: differences between stops find
    the place, crossings then its edge.

    Args:
        table: stops. fit: without the patch. start: where to begin.
        skipped: coarse rounds to leave out. seed: of the patches tried.
    """
    left = left_of(table, fit)
    precision = prior_precision(fit.hypothesis)
    nearest, strength = start, 0.0
    draw = 100 * (skipped + 1) + seed
    for blur, radii in _SEARCH[skipped:]:
        gain = 0.0
        for closer in radii:
            draw += 1
            more, shares = finer_patches(table, fit.hypothesis, nearest, closer, draw)
            if not more:
                continue
            sums = screening.reduced(fit.white, fit.jacobian, shares, precision).blurred(blur)
            both = np.zeros(len(more), np.bool_)
            tried = screening.scores(sums, (left[0], left[1] / blur), fit.noise.scatter, both)
            k = int(np.argmax(tried.gain))
            if tried.gain[k] > gain:
                nearest, strength, gain = more[k], float(tried.strength[k]), float(tried.gain[k])
    return nearest, strength


def moved_patch(table: StopTable, found: Fit) -> Fit:
    """The same with its last effect, a patch, where it fits best once its neighbours are tried."""
    h = found.hypothesis
    patch = h.added[-1]
    without = replace(
        found,
        hypothesis=replace(h, added=h.added[:-1]),
        jacobian=found.jacobian[:, :, : -len(free_parameters(patch))],
    )
    inner = {name: float(patch.parameters[name]) for name in ("x", "y", "radius")}
    here = Candidate("surface_patch", "delta", False, inner)
    for seed, skipped in enumerate((0, 2)):
        nearest, strength = placed_patch(table, without, here, skipped, 20 * seed)
        if strength == 0.0:
            continue
        moved = without.hypothesis.plus(nearest.effect(strength))
        better = fit_with_scatter(table, moved, found.noise)
        if better.deviance < found.deviance:
            found, here = better, nearest
    return found
