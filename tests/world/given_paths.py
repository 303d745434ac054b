"""Paths as planners and people give them, of many kinds."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

Path = np.ndarray
Random = np.random.Generator


def alternating(rng: Random) -> Path:
    """Points to one side and to the other in turn, as noise would lie."""
    step, i = rng.choice([0.25, 0.5, 1.0, 2.0]), np.arange(rng.integers(18, 60))
    sides = ([1, -1], [0, 1, 0, -1], [1, 1, -1, -1], [0, 1, 1, 0, -1, -1])[rng.integers(4)]
    return np.stack([step * i, rng.uniform(0.05, 1.2) * np.resize(sides, len(i))], axis=1)


def walked(steps: np.ndarray | float, headings: np.ndarray) -> Path:
    return np.cumsum(np.stack([steps * np.cos(headings), steps * np.sin(headings)], 1), axis=0)


def noisy(rng: Random) -> Path:
    """An arc with noise of 1 to 10 cm."""
    step = rng.choice([0.02, 0.05, 0.1, 0.25, 0.5, 1.0])
    points = walked(step, rng.uniform(-0.12, 0.12) * np.arange(0.0, rng.uniform(10, 40), step))
    return points + rng.uniform(0.01, 0.1) * rng.normal(size=points.shape)


def stairs(rng: Random) -> Path:
    """A search over a grid of 0.1 to 1 m cells, with four or eight neighbours."""
    cell, slope, diagonal = rng.uniform(0.1, 1.0), rng.uniform(0.0, 1.0), rng.random() < 0.3
    places = [(0, 0)]
    for _ in range(int(rng.uniform(12.0, 30.0) / cell)):
        x, y = places[-1]
        up = y < slope * (x + 1) and (rng.random() > 0.1)
        places.append((x + (not up or diagonal), y + up))
    return cell * np.array(places, float)


def sparse(rng: Random) -> Path:
    """A few vertices, metres apart."""
    count = rng.integers(2, 9)
    return walked(rng.uniform(2.0, 10.0, count), np.cumsum(rng.uniform(-1.8, 1.8, count)))


def zigzag(rng: Random) -> Path:
    """Straight arms with points on them."""
    turns, width, high = rng.integers(5, 30), rng.uniform(0.3, 3.0), rng.uniform(0.05, 2.0)
    at = np.linspace(0.0, turns - 1.0, (turns - 1) * rng.integers(1, 12) + 1)
    y = np.interp(at, np.arange(turns), high * (np.arange(turns) % 2))
    return np.stack([width * at, y], axis=1)


def cusps(rng: Random) -> Path:
    """There, back, and on, in steps of 5 cm to 1 m."""
    step = rng.choice([0.05, 0.1, 0.2, 0.5, 1.0])
    back = np.pi + rng.uniform(-0.3, 0.3)
    ways = ((rng.uniform(0.5, 6.0), 0.0), (rng.uniform(0.1, 3.0), back), (6.0, 0.2))
    return walked(step, np.concatenate([np.full(max(int(s / step), 1), h) for s, h in ways]))


def crossing(rng: Random) -> Path:
    """Figures of eight, full turns, and lanes that go there and back."""
    step, kind = rng.choice([0.1, 0.25, 0.5]), rng.integers(3)
    if kind == 0:
        t = np.arange(0.0, 2.0 * np.pi, step / rng.uniform(3.0, 7.0))
        return np.stack([6.0 * np.sin(t), rng.uniform(1.0, 4.0) * np.sin(2.0 * t)], axis=1)
    if kind == 1:
        radius, lead = rng.uniform(0.8, 4.0), np.zeros(int(6.0 / step))
        turns = np.arange(0.0, 2.0 * np.pi * rng.integers(1, 3), step / radius)
        return walked(step, np.concatenate([lead, turns, lead]))
    x, width = np.arange(0.0, rng.uniform(4.0, 10.0), step), rng.uniform(0.6, 3.0)
    lanes = [(x if i % 2 == 0 else x[::-1], np.full(len(x), width * i)) for i in range(4)]
    return np.concatenate([np.stack(lane, axis=1) for lane in lanes])


KINDS: tuple[Callable[[Random], Path], ...] = (
    alternating,
    noisy,
    stairs,
    sparse,
    zigzag,
    cusps,
    crossing,
)


def given_paths(count: int, seed: int = 1) -> Iterator[tuple[str, Path]]:
    """Kind and points; most of them turned, so that neither axis is special."""
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        kind = KINDS[i % len(KINDS)]
        points = kind(rng)
        if rng.random() < 0.8:
            turn = rng.uniform(-np.pi, np.pi)
            cosine, sine = np.cos(turn), np.sin(turn)
            points = points @ np.array([[cosine, sine], [-sine, cosine]]) + rng.uniform(-5, 5, 2)
        yield kind.__name__, points
