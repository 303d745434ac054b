"""Paths as users give them, ten kinds, each drivable by the criterion of its generator.

Curves keep to the least radius, searches over grids turn by 90° at most and trees by 75°, noise
and coarse points are laid on curves that keep to the radius. Gear changes are cusps: the path up to
the first is what can be planned.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from slopewise.models.arrays import Floats

Random = np.random.Generator

_SAMPLE = 0.004  # [m] between samples that distances are measured by
_FINE = 0.02  # [m] between points of a curve before it is sampled
_WIDE = 2.0  # [m] radius from which on a vehicle cannot round a corner within its width
_STEPS = (0.05, 0.1, 0.25, 0.5)  # [m] between the points that are given


def arc_of(points: Floats) -> Floats:
    """Distance along a polyline (n, 2) at each of its points [m]."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))


def largest_distance(first: Floats, second: Floats) -> float:
    """Largest distance from either line to the nearest place of the other, by samples [m]."""
    here, there = _samples(first), _samples(second)
    away, back = cKDTree(there).query(here)[0], cKDTree(here).query(there)[0]
    return float(max(away.max(), back.max()))


def _samples(line: Floats) -> Floats:
    """Places on a line (n, 2), no two in a row farther apart than 4 mm."""
    along = arc_of(line)
    distinct = np.concatenate(([True], np.diff(along) > 0.0))
    at = np.unique(np.concatenate((along, np.arange(0.0, along[-1], _SAMPLE))))
    axes = (np.interp(at, along[distinct], line[distinct, axis]) for axis in range(2))
    return np.stack(tuple(axes), axis=1)


class GivenLine(NamedTuple):
    """A polyline (n, 2) [m]; (x, y) where it first turns round, None where it never does."""

    points: Floats
    cusp: tuple[float, float] | None = None


def walked(curvature: Floats, step: float = _FINE) -> Floats:
    """Places along a curve that begins at the origin, from its curvature [1/m]."""
    heading = np.concatenate(([0.0], np.cumsum(curvature * step)))
    middle = 0.5 * (heading[1:] + heading[:-1])
    ahead = np.stack((np.cos(middle), np.sin(middle)), axis=1)
    return np.concatenate((np.zeros((1, 2)), np.cumsum(step * ahead, axis=0)))


def sampled(curve: Floats, step: float) -> Floats:
    """Points a step apart on a curve, and its end."""
    every = max(round(step / _FINE), 1)
    return np.concatenate((curve[:-1:every], curve[-1:]))


def turn(curvature: float, length: float) -> Floats:
    """Curvature along a piece of constant curvature [1/m]."""
    return np.full(max(round(length / _FINE), 1), curvature)


def slalom(rng: Random, radius: float) -> GivenLine:
    """A sine, or the posts of one: points to one side and the other in turn."""
    length = rng.uniform(3.0, 8.0) * radius
    wave = 2.0 * np.pi / length
    high = rng.uniform(0.2, 1.0) / (wave**2 * radius)
    per_wave = rng.choice([4, 8, 16, 32])
    x = np.arange(0.0, rng.integers(3, 7) * per_wave) * length / per_wave
    return GivenLine(np.stack((x, high * np.sin(wave * x)), axis=1))


def _searched(rng: Random, neighbours: int) -> Floats:
    """A* over a grid with discs as obstacles."""
    cell = rng.choice([0.1, 0.2, 0.5, 1.0])
    size = int(rng.uniform(10.0, 14.0) / cell)
    y, x = np.mgrid[:size, :size] * cell
    blocked = np.zeros((size, size), bool)
    for _ in range(8):
        at, wide = rng.uniform(0.0, size * cell, 2), rng.uniform(0.5, 1.5)
        blocked |= np.hypot(x - at[0], y - at[1]) < wide
    goal = (size - 1, int(rng.integers(size // 3, size)))
    blocked[0, 0] = blocked[goal[1], goal[0]] = False
    cells = _a_star(blocked, (0, 0), goal, neighbours)
    if cells is None or len(cells) * cell < 6.0:
        return _searched(rng, neighbours)
    points: Floats = cell * np.array(cells, float)
    return points


def _a_star(
    blocked: np.ndarray, start: tuple[int, int], goal: tuple[int, int], neighbours: int
) -> list[tuple[int, int]] | None:
    around = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)][:neighbours]
    cost, before = {start: 0.0}, {start: start}
    queue = [(0.0, start)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            back = [goal]
            while back[-1] != start:
                back.append(before[back[-1]])
            return back[::-1]
        for dx, dy in around:
            to = (here[0] + dx, here[1] + dy)
            if min(to) < 0 or max(to) >= len(blocked) or blocked[to[1], to[0]]:
                continue
            new = cost[here] + math.hypot(dx, dy)
            if new < cost.get(to, math.inf):
                cost[to], before[to] = new, here
                heapq.heappush(queue, (new + math.dist(to, goal), to))
    return None


def grid_4(rng: Random, radius: float) -> GivenLine:
    """A* with four neighbours, cells of 0.1 to 1 m."""
    return GivenLine(_searched(rng, 4))


def grid_8(rng: Random, radius: float) -> GivenLine:
    """A* with eight neighbours."""
    return GivenLine(_searched(rng, 8))


def tree(rng: Random, radius: float) -> GivenLine:
    """A branch of a rapidly exploring random tree, vertices 0.5 to 2 m apart."""
    step = rng.uniform(0.5, 2.0)
    nodes, heading, before = [np.zeros(2)], [0.0], [0]
    for _ in range(3000):
        aim = rng.uniform((0.0, -7.0), (16.0, 7.0))
        i = int(np.argmin(np.hypot(*(np.array(nodes) - aim).T)))
        to = math.atan2(*(aim - nodes[i])[::-1])
        if abs(math.remainder(to - heading[i], 2.0 * math.pi)) > math.radians(75.0):
            continue
        nodes.append(nodes[i] + step * np.array([math.cos(to), math.sin(to)]))
        heading.append(to)
        before.append(i)
        if nodes[-1][0] > 10.0:
            break
    way = [int(np.argmax(np.array(nodes)[:, 0]))]
    while way[-1] != 0:
        way.append(before[way[-1]])
    return GivenLine(np.array([nodes[i] for i in way[::-1]]))


def dubins(rng: Random, radius: float) -> GivenLine:
    """Words of Dubins: turn, straight or turn, turn."""
    tight = radius * rng.uniform(1.0, 2.0)
    first, last = rng.choice([-1.0, 1.0], 2)
    arcs = rng.uniform(0.4, 3.0, 3) * tight
    is_straight = rng.random() < 0.7
    between = turn(0.0, rng.uniform(2.0, 8.0)) if is_straight else turn(-first / tight, arcs[1])
    pieces = (turn(first / tight, arcs[0]), between, turn(last / tight, arcs[2]))
    return GivenLine(sampled(walked(np.concatenate(pieces)), rng.choice(_STEPS)))


def reeds_shepp(rng: Random, radius: float) -> GivenLine:
    """Words of Reeds and Shepp with one to three changes of gear."""
    step, gear, parts, cusp = rng.choice([0.05, 0.1, 0.2, 0.5, 1.0]), 1.0, [np.zeros((1, 2))], None
    heading = 0.0
    for _ in range(rng.integers(2, 5)):
        curvature = rng.choice([-1.0, 0.0, 1.0]) / (radius * rng.uniform(1.0, 2.0))
        length = max(rng.uniform(1.5, 6.0) * radius, 3.0 * step)
        c, s = math.cos(heading), math.sin(heading)
        curve = walked(turn(gear * curvature, length)) @ np.array([[c, s], [-s, c]])
        parts.append(parts[-1][-1] + gear * sampled(curve, step)[1:])
        cusp = cusp or (float(parts[-1][-1, 0]), float(parts[-1][-1, 1]))
        heading, gear = heading + gear * curvature * length, -gear
    return GivenLine(np.concatenate(parts), cusp)


def noisy(rng: Random, radius: float) -> GivenLine:
    """A recorded line: gentle bends with noise of 1 to 5 cm, less for a small vehicle."""
    curvatures = rng.uniform(-0.5, 0.5, 5) / radius
    curve = walked(np.repeat(curvatures, round(rng.uniform(2.0, 5.0) / _FINE)))
    points = sampled(curve, rng.choice(_STEPS[:3]))
    std = min(radius, 1.0) * rng.uniform(0.01, 0.05)
    return GivenLine(points + std * rng.standard_normal(points.shape))


def coarse(rng: Random, radius: float) -> GivenLine:
    """Vertices from an operator: 1.5 to 5 m apart, turns up to 60°; 30° for a wide radius."""
    sharpest = 60.0 if radius < _WIDE else 30.0
    heading = np.cumsum(np.radians(rng.uniform(-sharpest, sharpest, rng.integers(4, 9))))
    steps = rng.uniform(1.5, 5.0, len(heading))[:, None]
    ahead = steps * np.stack((np.cos(heading), np.sin(heading)), axis=1)
    return GivenLine(np.concatenate((np.zeros((1, 2)), np.cumsum(ahead, axis=0))))


def u_turn(rng: Random, radius: float) -> GivenLine:
    """Straight, half a circle, and back."""
    tight = radius * rng.uniform(1.0, 2.0)
    lead = turn(0.0, rng.uniform(2.0, 8.0))
    half = turn(rng.choice([-1.0, 1.0]) / tight, math.pi * tight)
    curve = walked(np.concatenate((lead, half, lead)))
    return GivenLine(sampled(curve, rng.choice(_STEPS)))


def spiral(rng: Random, radius: float) -> GivenLine:
    """A clothoid, wound up or down."""
    ends = [0.0, rng.choice([-1.0, 1.0]) / (radius * rng.uniform(1.0, 1.5))]
    if rng.random() < 0.5:
        ends.reverse()
    count = round(rng.uniform(8.0, 20.0) * radius / _FINE)
    curve = walked(np.linspace(ends[0], ends[1], count))
    return GivenLine(sampled(curve, rng.choice(_STEPS)))


KINDS: dict[str, Callable[[Random, float], GivenLine]] = {
    "slalom": slalom,
    "grid, 4": grid_4,
    "grid, 8": grid_8,
    "tree": tree,
    "dubins": dubins,
    "cusps": reeds_shepp,
    "noisy": noisy,
    "coarse": coarse,
    "u-turn": u_turn,
    "spiral": spiral,
}


def given_line(kind: str, seed: int, radius: float) -> GivenLine:
    """A path of a kind, turned at random, around the origin; least radius of its curves [m]."""
    rng = np.random.default_rng([list(KINDS).index(kind), seed])
    line = KINDS[kind](rng, radius)
    angle, middle = rng.uniform(-np.pi, np.pi), line.points.mean(axis=0)
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    points = (line.points - middle) @ turned
    if line.cusp is None:
        return GivenLine(points)
    return GivenLine(points, tuple(((np.array(line.cusp) - middle) @ turned).tolist()))
