"""Replay the stops of drive logs through a model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import RunChannels, replay, stop_commands
from slopewise.services.io.drive_log import DriveLog
from slopewise.services.io.log_checks import unseen_channels
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import Summary

_CHANNELS = ("roll", "yaw", "yaw_rate", "x", "y", "brake", "vertical_curvature")
"""Columns that a model may use besides speed, command and pitch."""


class RunSummary(Summary, frozen=True):
    """Measured minus simulated speed of a run [m/s]; its stop commands.

    `longer_by` is the simulated minus the measured distance over all stops [m].
    """

    run: str
    stops: int
    rms: float
    worst: float
    longer_by: float


class SimulateSummary(Summary, frozen=True):
    """Output of `simulate --json`."""

    runs: list[RunSummary]
    notes: list[str]


@dataclass(frozen=True, slots=True)
class SimulateResult:
    """Columns of the output file, and the summary."""

    columns: dict[str, NDArray[Any]]
    summary: SimulateSummary

    def write(self, path: Path) -> None:
        """Write `run,t,v_measured,v_simulated,residual`, all or nothing."""
        write_csv(self.columns, path)


def simulate(logs: LogInput, model_file: str) -> SimulateResult:
    """Read logs and drive the model from each stop command on."""
    model = read_model(find_model(model_file))
    log = logs.read_for(model)
    measured = log.columns["v"]
    simulated = np.empty_like(measured)
    runs = []
    with progress_bar("simulating", len(log.runs)) as advance:
        for number, part in enumerate(log.runs):
            effects = registry.up_to_run(model.effect, number)
            simulated[part] = _replay_run(replace(model, effect=effects), log, part)
            runs.append(_compared(log, part, simulated[part]))
            advance(1)
    table = {
        "run": log.columns["run"],
        "t": log.columns["t"],
        "v_measured": measured,
        "v_simulated": simulated,
        "residual": measured - simulated,
    }
    notes = list(unseen_channels(model.effect, log.columns))
    return SimulateResult(table, SimulateSummary(runs, notes))


def _replay_run(model: Model, log: DriveLog, part: slice) -> NDArray[np.float64]:
    columns = log.columns
    names = [n for n in _CHANNELS if n in columns and np.isfinite(columns[n][part]).all()]
    surfaces = columns["terrain"][part] if "terrain" in columns else np.array([""])
    surface_names, counts = np.unique(surfaces, return_counts=True)
    channels = RunChannels(
        time=columns["t"][part],
        speed=columns["v"][part],
        command=columns["v_cmd"][part],
        pitch=columns["pitch"][part],
        **{name: columns[name][part] for name in names},
    )
    return replay(model, channels, str(surface_names[counts.argmax()]))


def _compared(log: DriveLog, part: slice, simulated: NDArray[np.float64]) -> RunSummary:
    t, v = log.columns["t"][part], log.columns["v"][part]
    residual = v - simulated
    return RunSummary(
        run=str(log.columns["run"][part.start]),
        stops=len(stop_commands(t, v, log.columns["v_cmd"][part])),
        rms=float(np.sqrt(np.mean(residual**2))),
        worst=float(np.max(np.abs(residual))),
        longer_by=float(-np.trapezoid(residual, t)),
    )
