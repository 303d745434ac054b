"""Effects of the library on a grid of their inner numbers, as changes of the fall of speed.

Each candidate is one column: what one unit of its strength adds to v_i − v(t), at the forces of the
fit so far. Numbers inside an effect (a time constant, a direction, a place) are tried on a grid;
the refit makes them exact afterwards. Nothing is differentiated.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_ground import ground_of, session_time
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.brakes import brought_force, heat
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import integral, wanted_force
from slopewise.models.discrepancy.thresholds import PATCH_TRIES
from slopewise.models.effects.effect_law import Enters, Search
from slopewise.models.effects.registry import LAWS
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.effects.surface_patch import holds_stops, share_inside
from slopewise.models.parameters import Effect


@dataclass(frozen=True, slots=True)
class EffectColumn:
    """One effect at one point of the grid of its inner numbers.

    Attributes:
        name: of the effect. inner: parameters beside its strength.
    """

    name: str
    inner: dict[str, float] = field(default_factory=dict)

    @property
    def search(self) -> Search:
        """How logs are searched for the effect."""
        return search_of(self.name)

    def effect(self, strength: float) -> Effect:
        """The effect with a strength, or the nearest that there can be."""
        how = self.search
        own: dict[str, float] = {}
        if not how.is_complete:
            low, high = LAWS[self.name].parameters[how.strength].bounds
            own[how.strength] = min(max(how.offset + strength, low), high)
        return Effect(name=self.name, parameters={**own, **self.inner})


def search_of(name: str) -> Search:
    """How logs are searched for an effect that is named here only because they are."""
    found = LAWS[name].search
    assert found is not None
    return found


def is_cap(name: str) -> bool:
    """Whether an effect caps the force: it shows less in what it takes than in stops that no longer
    differ.
    """
    return LAWS[name].enters is Enters.CAP


def candidates(table: StopTable, hypothesis: Hypothesis) -> tuple[list[EffectColumn], Floats]:
    """Every candidate that the log has channels for, and (S, M, Q) its column.

    Args:
        table: stops. hypothesis: fitted so far; its forces are what lag, fade and friction act on.
    """
    taken = {e.name for e in (*hypothesis.model.effect, *hypothesis.added)}
    seen = stops_seen(table, hypothesis)
    found: list[EffectColumn] = []
    columns: list[Floats] = []
    for name, law in LAWS.items():
        alone = name in taken and (law.once or is_cap(name))
        if law.search is None or alone or not law.channels <= table.logged:
            continue
        for inner, share in law.search.columns(seen):
            found.append(EffectColumn(name, inner))
            columns.append(share)
    forces = np.array([LAWS[c.name].enters in (Enters.GROUND, Enters.LASTING) for c in found])
    return found, integral(table, hypothesis, np.stack(columns, axis=2), forces)


def stops_seen(table: StopTable, hypothesis: Hypothesis) -> StopsSeen:
    """Stops as effects see them, at the forces of a hypothesis."""
    place = ground_of(table)
    wanted = wanted_force(table, hypothesis, place)
    brought = brought_force(table, hypothesis, wanted, table.speed, place, table.time)

    def heat_of(tau: float) -> Floats:
        return heat(table, tau, table.speed, table.time, hypothesis.dead_time)

    return StopsSeen(
        speed=table.speed,
        grade=table.grade,
        roll=table.roll,
        yaw=table.yaw,
        yaw_rate=table.yaw_rate,
        x=table.x,
        y=table.y,
        vertical_curvature=table.vertical_curvature,
        clock=session_time(table),
        run=table.run,
        demanded=wanted,
        built=brought.force,
        given=brought.given,
        passes=brought.passes,
        heat=heat_of,
    )


def finer_patches(
    table: StopTable, around: EffectColumn, closer: float, draw: int = 0
) -> tuple[list[EffectColumn], Floats]:
    """Patches near one of them, moved by a share of its radius; none that hold too few stops.

    Returns:
        Q of them, and (S, M, Q) the share of them around each time.
    """
    inner = around.inner
    rng = np.random.default_rng((PATCH_TRIES, draw))
    found, shares = [], []
    for dx, dy, grown in closer * rng.standard_normal((PATCH_TRIES, 3)):
        at = {
            "x": inner["x"] + dx * inner["radius"],
            "y": inner["y"] + dy * inner["radius"],
            "radius": inner["radius"] * float(np.exp(grown)),
        }
        inside = share_inside(table.x, table.y, at["x"], at["y"], at["radius"])
        if holds_stops(inside):
            found.append(replace(around, inner=at))
            shares.append(inside)
    return found, np.stack(shares, axis=2) if found else np.empty((*table.time.shape, 0))


def share_of(table: StopTable, patch: EffectColumn) -> Floats:
    """(S, M, 1) share of a patch around each time."""
    p = patch.inner
    return share_inside(table.x, table.y, p["x"], p["y"], p["radius"])[:, :, None]
