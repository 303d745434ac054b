"""Logs of the hidden plant that several tests share, driven and investigated once."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from slopewise.models.discrepancy.data.prepare import prepare
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.findings import Findings
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.onset import Onset
from slopewise.models.discrepancy.likelihood.refit import Known, Refit, improved
from slopewise.models.discrepancy.likelihood.trace import trace_of
from slopewise.models.discrepancy.likelihood.whitener import Whitener
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from slopewise.models.parameters import Effect
from tests.world.plant import World, drive
from tests.world.shared import once
from tests.world.vehicles import BASE

WORLDS = {
    "clean": World(),
    "drift": World(coefficients=(-0.02, -0.30, 0.02, 0.36), dead_time=0.27),
    "bias": World(pitch_bias=float(np.deg2rad(2.3))),
    "drag": World(effects={"aerodynamic_drag": {"c": 0.06}}),
    "lag": World(effects={"brake_lag": {"tau": 0.2}}),
    "fade": World(effects={"brake_fade": {"k": 0.012, "tau": 60.0}}),
    "lockup": World(effects={"wheel_lockup": {"mu": 0.42}}),
    "cross": World(effects={"cross_slope": {"k": 0.5}}),
    "patch": World(
        effects={"surface_patch": {"delta": -0.1, "x": 20.0, "y": 20.0, "radius": 11.0}}
    ),
    "places": World(
        effects={"surface_patch": {"delta": -0.1, "x": 8.0, "y": 8.0, "radius": 7.0}},
        further_places=((30.0, 28.0, 9.0),),
    ),
    "step": World(effects={"step_change": {"scale": 0.85, "run": 25}}),
    "pair": World(
        effects={"brake_lag": {"tau": 0.2}, "directional_surface": {"k": 0.04, "direction": 0.6}}
    ),
    "lag_and_drag": World(
        effects={"brake_lag": {"tau": 0.2}, "aerodynamic_drag": {"c": 0.06}}, speeds=(2.0, 6.0)
    ),
    "build_up": World(effects={"brake_lag": {"tau": 0.03}}, dead_time=0.27, noise=0.01),
    "noisy": World(noise=0.2, scatter=0.3, grades=(-0.05, 0.05)),
    "waves": World(waves=0.12, grades=(-0.1, 0.1), speeds=(2.0, 4.0), has_curvature=True),
    "crests": World(
        effects={"crest_unloading": {"k": 1.5}},
        waves=0.12,
        grades=(-0.1, 0.1),
        speeds=(2.0, 4.0),
        has_curvature=True,
    ),
    "ambient": World(ambient=0.04),
    "slow_drag": World(effects={"aerodynamic_drag": {"c": 0.06}}, speeds=(1.0, 2.8)),
}


@cache
def log(name: str, stops: int = 48, seed: int = 3) -> tuple[dict[str, np.ndarray], list[slice]]:
    """Columns and runs."""
    return drive(WORLDS[name], stops, seed)


@cache
def table(name: str, stops: int = 48, seed: int = 3) -> StopTable:
    """Stops of a log, as the workflow sees them."""
    columns, runs = log(name, stops, seed)
    return prepare(columns, runs, BASE, None, DiscrepancySettings())[0]


STOPS = {"places": 90, "lag_and_drag": 90, "noisy": 24}
STOPS |= dict.fromkeys(("clean", "drift", "bias", "cross", "ambient"), 36)
"""Stops of logs that need more than the others, or fewer."""
AT_NIGHT = (
    *("places", "lag_and_drag", "pair", "build_up", "waves", "crests", "lockup"),
    *("drag", "fade", "slow_drag", "step"),
)


def by_day_or_night(*names: str) -> list[Any]:
    """Names of logs as parameters; those whose search takes long are left to the night."""
    return [pytest.param(n, marks=pytest.mark.nightly if n in AT_NIGHT else ()) for n in names]


@cache
def investigated(name: str) -> tuple[Findings, list[int]]:
    """Findings of a log, with the progress reported."""

    def search() -> tuple[Findings, list[int]]:
        reported: list[int] = []
        columns, runs = log(name, STOPS.get(name, 48))
        return investigate(columns, runs, BASE, advance=reported.append), reported

    return once(f"findings-{name}", search)


def findings_of(name: str) -> Findings:
    return investigated(name)[0]


def whitener_of(stops: StopTable, *, build_up: float = 0.01, lagging: bool = False) -> Whitener:
    """At the usual noise, with the brakes of the vehicle."""
    none = np.zeros((*stops.time.shape, 1)), np.zeros(1)
    trace = trace_of(stops, BASE, none)
    onset = Onset(BASE.braking.dead_time, build_up)
    return Whitener.of(trace, onset, prior.NOISE, lagging=lagging)


def known_little(hypothesis: Hypothesis) -> Known:
    """Shifts of coefficients and the dead time are as good as unknown, all else is unknown."""
    count = len(hypothesis.free)
    root, expected = np.eye(5, count) * [[5.0], [1.0], [10.0], [1.0], [1.0]], np.zeros(count)
    expected[4] = hypothesis.model.braking.dead_time
    return Known(root, expected)


def refit_of(stops: StopTable, *effects: Effect) -> Refit:
    """Stops explained by effects that are known to be there."""
    hypothesis = replace(Hypothesis.configured(BASE), added=effects)
    fit = improved(stops, hypothesis, whitener_of(stops), known_little(hypothesis))
    names = tuple(sorted(effect.name for effect in effects))
    return replace(fit, extents=({},) * len(effects), names=names)
