"""PySINDy on the same logs: sparse regression of the smoothed deceleration on the right library.

It gets more help than it would have in the field: stops already cut out, a library that holds every
named effect that is linear in its parameters, and no hidden state to look for. Its sparsity
threshold stands for 2 % of the braking force.
"""

from __future__ import annotations

import warnings
from importlib.util import find_spec

import numpy as np

from .physics import Floats
from .plant import GRAVITY
from .sensing import Columns

EFFECTS = (
    "viscous_resistance",
    "aerodynamic_drag",
    "grade_asymmetry",
    "grade_nonlinearity",
    "cross_slope",
    "turning_resistance",
    "directional_surface",
    "directional_surface",
    "session_drift",
    "headwind",
    "headwind",
    "ambient",
)
_BASE = 4
_KEPT = 100.0  # by which coefficients of the base are larger than the sparsity threshold sees
_LEAST = 0.08  # [m/s²] a term that adds less than that (one standard deviation) is none
_WINDOW = 11  # samples of the smoothed derivative
_CLEAR = 0.1  # [s] after the onset


def available() -> bool:
    """It is installed."""
    return find_spec("pysindy") is not None


def name_effects(columns: Columns, configured: dict[str, float]) -> tuple[str, ...] | None:
    """Names of the effects whose terms survive, the strongest first; None if not installed."""
    if not available():
        return None
    import pysindy

    speeds, features, times = _stops(columns, configured["dead_time"])
    if not features:
        return ()  # no stop is long enough to be smoothed
    everything = np.concatenate(features)
    # Inputs of unit spread, so that one threshold fits all; those of the base are to stay.
    shift, scale = np.mean(everything, axis=0), np.std(everything, axis=0) + 1e-12
    shift[:_BASE], scale[:_BASE] = 0.0, 1.0 / _KEPT
    spread = float(np.std(np.concatenate(speeds)))
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=_LEAST / spread, alpha=1e-9, max_iter=30),
        feature_library=pysindy.IdentityLibrary(),
        differentiation_method=pysindy.SmoothedFiniteDifference(
            smoother_kws={"window_length": _WINDOW, "polyorder": 2}
        ),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(
            [v[:, None] / spread for v in speeds],
            t=times,
            u=[(f - shift) / scale for f in features],
        )
    found = model.coefficients()[0]
    weights = np.abs(np.concatenate((found[:1], found[1 + _BASE :])))
    strongest = np.argsort(-weights)
    return tuple(dict.fromkeys(EFFECTS[i] for i in strongest if weights[i] > 0.0))


def _stops(columns: Columns, dead_time: float) -> tuple[list[Floats], list[Floats], list[Floats]]:
    """Speed, features and time of each stop while it brakes."""
    run = columns["run"]
    edges = np.flatnonzero(run[1:] != run[:-1]) + 1
    speeds, features, times = [], [], []
    for a, b in zip([0, *edges], [*edges, len(run)], strict=True):
        part = {name: values[a:b] for name, values in columns.items() if name != "run"}
        told = int(np.flatnonzero(part["v_cmd"] <= 0.0)[0])
        since = part["t"] - part["t"][told]
        rest = np.flatnonzero((part["v"] <= 0.05) & (since > 0.0))
        end = int(rest[0]) if len(rest) else len(since)
        keep = np.flatnonzero((since > dead_time + _CLEAR) & (np.arange(len(since)) < end - 2))
        if len(keep) <= _WINDOW + 2:
            continue
        onset = float(np.mean(part["v"][max(told - 10, 0) : told]))
        speeds.append(part["v"][keep].astype(float))
        times.append(since[keep])
        features.append(_features({k: v[keep].astype(float) for k, v in part.items()}, onset))
    return speeds, features, times


def _features(part: dict[str, Floats], onset: float) -> Floats:
    v, theta, one = part["v"], -part["pitch"], np.ones_like(part["v"])
    theta = one * float(np.mean(theta))
    yaw = part["yaw"]
    terms = [
        onset * theta,
        theta,
        onset * one,
        one,
        v * v,
        np.maximum(theta, 0.0),
        theta * np.abs(theta),
        np.abs(part["roll"]),
        np.abs(part["yaw_rate"]),
        np.cos(2.0 * yaw),
        np.sin(2.0 * yaw),
        part["t"],
        v * np.cos(yaw),
        v * np.sin(yaw),
        part["ambient"],
    ]
    return -GRAVITY * np.column_stack(terms)
