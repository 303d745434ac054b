"""Scenes from hypothesis: ground, path, vehicle and what else a plan depends on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import ground_map
from tests.world.plans import min_loads, plan_one, stop_on, violations
from tests.world.vehicles import SMALL, Tables, tables_with


def by_day_and_night(day: int, night: int) -> Callable[[Any], Any]:
    """Count of examples by day, and of others by night, with `pytest -m nightly`."""
    if settings.get_current_profile_name() != "nightly":
        return settings(max_examples=day)

    def at_night(test: Any) -> Any:
        return pytest.mark.nightly(
            pytest.mark.timeout(6 * 3600)(settings(max_examples=night)(test))
        )

    return at_night


EFFECT_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "aerodynamic_drag": {"c": (0.0, 0.05)},
    "headwind": {"c": (0.0, 0.02), "wind": (-8.0, 8.0), "direction": (-3.2, 3.2)},
    "viscous_resistance": {"c": (0.0, 0.03)},
    "brake_lag": {"tau": (0.02, 0.4)},
    "brake_fade": {"k": (0.0, 0.03), "tau": (0.5, 50.0)},
    "wheel_lockup": {"mu": (0.25, 0.8)},
    "grade_asymmetry": {"k": (-0.3, 0.3)},
    "grade_nonlinearity": {"k": (-0.5, 0.5)},
    "cross_slope": {"k": (-0.2, 0.2)},
    "crest_unloading": {"k": (0.0, 1.5)},
    "turning_resistance": {"k": (0.0, 0.1)},
    "surface_patch": {
        "delta": (-0.15, 0.15),
        "x": (0.0, 8.0),
        "y": (-1.0, 1.0),
        "radius": (0.3, 3.0),
    },
    "directional_surface": {"k": (-0.1, 0.1), "direction": (-3.2, 3.2)},
    "step_change": {"scale": (0.7, 1.2), "delta": (-0.05, 0.05)},
}


@dataclass(frozen=True)
class Scene:
    """One request to the planner, and whether its ground has an icy strip."""

    tables: Tables
    ground: ElevationMap
    path: CandidatePath
    settings: PlannerSettings
    options: dict[str, float]
    icy: bool

    def plan(self) -> SpeedPlan:
        return plan_one(self.tables, self.ground, self.path, self.settings, **self.options)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: round(value, 6))


def maybe(share: int, strategy: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """None, except for one in `share`."""
    return st.one_of(*[st.none()] * (share - 1), strategy)


@st.composite
def tables(draw: st.DrawFn) -> Tables:
    """A vehicle and its model: every coefficient and limit over a wide range."""
    out = tables_with()
    if draw(maybe(3, st.just(1))):
        for table, values in SMALL.items():
            out[table].update(values)
    vehicle, braking = out["vehicle"], out["braking"]
    length = vehicle["wheelbase"]
    vehicle |= {
        "cg_x": length * draw(between(0.35, 0.65)),
        "cg_z": length * draw(between(0.17, 0.75)),
        "drive": draw(st.sampled_from(["skid_steer", "ackermann"])),
        "max_drive_force": vehicle["max_drive_force"] * draw(between(0.6, 2.0)),
        "max_drive_power": vehicle["max_drive_power"] * draw(between(0.3, 2.0)),
    }
    slowest = draw(between(0.0, 1.5))
    braking |= {
        "m_m": draw(between(-0.08, 0.08)),
        "b_m": draw(between(-0.6, 0.6)),
        "m_b": draw(between(-0.03, 0.03)),
        "b_b": draw(between(0.3, 0.8)),
        "dead_time": draw(st.one_of(st.just(0.0), between(0.0, 0.6))),
        "distance_offset": draw(st.one_of(st.just(0.0), between(0.0, 0.5))),
        "speed_range": [slowest, slowest + draw(between(0.5, 4.0))],
        "grade_range": [-draw(between(0.1, 0.4)), draw(between(0.1, 0.4))],
    }
    if margin := draw(maybe(4, between(0.0, 0.5))):
        braking |= {"extrapolate": True, "extrapolation_margin": margin}
    if (slope := draw(maybe(4, between(-0.6, 0.6)))) is not None:
        braking["uphill"] = {"m_m": draw(between(-0.08, 0.08)), "b_m": slope}
    if level := draw(maybe(5, between(0.6, 1.0))):
        braking["level"] = level
    if friction := draw(maybe(5, between(0.3, 0.8))):
        braking["sliding_friction"] = friction
    out["terrain"]["lateral_resistance"] = draw(between(0.05, 0.6))
    out["limits"] = {
        "speed": draw(between(0.5, 5.0)),
        "accel": draw(between(0.3, 3.0)),
        "decel": draw(between(0.3, 4.0)),
        "jerk": draw(between(0.5, 6.0)),
        "lateral_accel": draw(between(0.5, 5.0)),
        "min_load": draw(between(0.02, 0.4)),
    }
    return out


@st.composite
def effects(draw: st.DrawFn) -> list[dict[str, Any]]:
    """None to three of the effects, each at most once."""
    names = draw(st.lists(st.sampled_from(list(EFFECT_RANGES)), max_size=3, unique=True))
    return [
        {"name": name, "parameters": {k: draw(between(*r)) for k, r in EFFECT_RANGES[name].items()}}
        for name in names
    ]


@st.composite
def heights(draw: st.DrawFn) -> Any:
    """A function of x and y: a plane, waves, a step and a ramp."""
    rise, cross = draw(between(-0.2, 0.2)), draw(between(-0.2, 0.2))
    waves = draw(
        st.lists(
            st.tuples(between(0.0, 0.4), between(1.0, 20.0), between(0.0, 6.3), between(0.0, 6.3)),
            max_size=4,
        )
    )
    step = draw(maybe(4, st.tuples(between(1.0, 10.0), between(-0.15, 0.15))))
    ramp = draw(maybe(4, st.tuples(between(1.0, 10.0), between(-0.4, 0.4))))

    def z(x: Any, y: Any) -> Any:
        total = rise * x + cross * y
        for height, length, heading, phase in waves:
            along = x * np.cos(heading) + y * np.sin(heading)
            total += height * min(1.0, length / 8.0) * np.sin(2 * np.pi * along / length + phase)
        if step:
            total += step[1] * (x > step[0])
        if ramp:
            total += ramp[1] * np.clip(x - ramp[0], 0.0, 3.0)
        return total

    return z


@st.composite
def paths(draw: st.DrawFn, longest: float = 12.0, limits: bool = True) -> CandidatePath:
    """A clothoid from the origin, to the east at first."""
    length = draw(between(1.5, longest))
    along = np.linspace(0.0, length, max(int(length / 0.2), 3))
    sharpness = draw(st.sampled_from([0.0, 0.2, 1.0]))
    first, last = sharpness * draw(between(-0.5, 0.5)), sharpness * draw(between(-0.5, 0.5))
    yaw = first * along + (last - first) * along**2 / (2.0 * length)
    steps = np.diff(along)[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)[1:]
    points = np.concatenate([[(0.0, 0.0)], np.cumsum(steps, axis=0)])
    limit = None
    if limits and draw(maybe(5, st.just(1))):
        few = draw(st.lists(between(0.3, 5.0), min_size=2, max_size=4))
        limit = np.array([few[i * len(few) // len(along)] for i in range(len(along))])
    return CandidatePath("generated", points, speed_limit=limit)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """All of them together."""
    table = draw(tables())
    table["effect"] = draw(effects())
    strip = draw(maybe(5, st.tuples(between(1.0, 8.0), between(0.3, 4.0))))
    if strip:
        weaker = draw(between(0.3, 0.9))
        braking = table["braking"]
        ice: dict[str, Any] = {"b_b": weaker * braking["b_b"]}
        if draw(st.booleans()):
            ice |= {"dead_time": braking["dead_time"] + 0.1, "distance_offset": 0.6}
        braking["terrain"] = {"ice": ice}
    hole = draw(maybe(4, st.tuples(between(2.0, 12.0), between(-1.0, 1.0), between(0.1, 1.0))))
    ground = ground_map(
        draw(heights()),
        x=(-8.0, 18.0),
        y=(-11.0, 11.0),
        resolution=draw(st.sampled_from([0.1, 0.2, 0.25, 0.5, 1.0])),
        unknown=(lambda x, y: np.hypot(x - hole[0], y - hole[1]) < hole[2]) if hole else None,
        classes=(lambda x, y: (x >= strip[0]) & (x <= sum(strip))) if strip else None,
        class_names=("", "ice"),
    )
    return Scene(
        table,
        ground,
        draw(paths()),
        PlannerSettings(
            spacing=draw(st.sampled_from([0.1, 0.25, 0.25, 0.5])),
            smooth=draw(st.sampled_from([True, True, True, False])),
        ),
        {
            "start_speed": draw(st.one_of(st.just(0.0), between(0.0, 4.0))),
            "clear": draw(st.one_of(st.just(np.inf), between(0.0, 12.0))),
        },
        bool(strip),
    )


def complaints(scene: Scene, plan: SpeedPlan) -> list[str]:
    """Complaints about a plan, by its status."""
    if plan.status is Status.INFEASIBLE:
        return _could_have_stopped(scene, plan)
    rough = plan.status is Status.DEGRADED or not scene.settings.smooth
    clear = scene.options["clear"]
    by_kind = violations(plan, scene.tables, scene.ground, clear=clear, jerk=not rough, slack=2.0)
    if plan.status is Status.DEGRADED and plan.reason.startswith("starts at"):
        # What a turn takes of friction is counted up to the highest planned speed, not beyond it.
        by_kind = {k: v for k, v in by_kind.items() if k not in ("decel", "friction")}
    return [text for kind in by_kind.values() for text in kind] + _stops_short(scene, plan)


def _stops_short(scene: Scene, plan: SpeedPlan) -> list[str]:
    """A plan that is ok gets to the end of its path, less offset and the last few stations."""
    offset = scene.tables["braking"]["distance_offset"]
    if scene.icy:
        offset = max(offset, 0.6)
    limit = scene.path.speed_limit
    if limit is not None and limit.min() == 0.0:
        return []
    missing = plan.station[-1] - plan.progress - offset - 4.0 * float(np.diff(plan.station).max())
    if plan.status is Status.OK and missing > 0.0:
        return [f"stands at {plan.progress:.2f} m of {plan.station[-1]:.2f} m"]
    return []


def _could_have_stopped(scene: Scene, plan: SpeedPlan) -> list[str]:
    """A start that full braking brings to rest in time, with its wheels down, is not infeasible."""
    tables = scene.tables
    if scene.icy or tables["effect"] or tables["braking"].get("extrapolate"):
        return []  # margins of the planner apply there
    stop = stop_on(plan, tables, plan.station[0], plan.speed[0])
    end = plan.station[0] + stop.distance + tables["braking"]["distance_offset"]
    spare = plan.clear_distance - end
    if np.isfinite(stop.distance):
        spare = min(
            spare, *(x - tables["limits"]["min_load"] for x in min_loads(plan, tables, stop))
        )
    # A stop begun a little later, at less speed, may be longer where braking grows with speed.
    tight = 0.5 if "only immediate full braking" in plan.reason else 0.05  # words: ok
    return [f"could have stopped with {spare:.3f} to spare"] if spare > tight else []
