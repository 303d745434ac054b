"""`slopewise simulate`: replay a drive log's own commands through the model."""

from __future__ import annotations

import dataclasses
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.stops.simulation import RunChannels, replay, stop_commands
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.io.logs.unseen_channels import unseen_channels
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv

_CHANNELS = ("roll", "yaw", "yaw_rate", "x", "y", "brake", "vertical_curvature")


@dataclass(frozen=True, slots=True)
class RunSummary:
    """How one run compares.

    Attributes:
        run: its name.
        stops: stop commands in it.
        rms, worst: root mean square and largest residual of speed [m/s].
        longer_by: how much farther the simulation rolled than the vehicle, over all stops [m].
    """

    run: str
    stops: int
    rms: float
    worst: float
    longer_by: float


@dataclass(frozen=True, slots=True)
class SimulateResult:
    """The columns of the output file, a summary of each run, and doubts in sentences."""

    columns: dict[str, NDArray[Any]]
    runs: list[RunSummary]
    notes: tuple[str, ...] = ()


def run(
    logs: list[Path],
    model_file: str,
    topics: Path | None = None,
    names: str = "",
    *,
    quiet: bool = False,
) -> SimulateResult:
    """Replay logs.

    Args:
        logs: tables or recordings. model_file: the model. topics: mapping of the recordings.
        names: of columns in tables that call them otherwise.

    Raises:
        InputError: names file, row and column.
    """
    model = read_model(find_model(model_file))
    log = read_logs(logs, topics, names)
    simulated = np.empty_like(log.columns["v"])
    summaries = []
    with progress_bar("simulating", len(log.runs), quiet=quiet) as advance:
        for number, part in enumerate(log.runs):
            here = dataclasses.replace(model, effect=registry.up_to_run(model.effect, number))
            simulated[part] = _replay_run(here, log, part)
            summaries.append(_summary(log, part, simulated[part]))
            advance(1)
    measured = log.columns["v"]
    columns = {
        "run": log.columns["run"],
        "t": log.columns["t"],
        "v_measured": measured,
        "v_simulated": simulated,
        "residual": measured - simulated,
    }
    return SimulateResult(columns, summaries, unseen_channels(model.effect, log.columns))


def _replay_run(model: Model, log: DriveLog, part: slice) -> NDArray[np.float64]:
    columns = log.columns
    further = {
        name: columns[name][part]
        for name in _CHANNELS
        if name in columns and np.isfinite(columns[name][part]).all()
    }
    surfaces = columns["terrain"][part] if "terrain" in columns else np.array([""])
    names, counts = np.unique(surfaces, return_counts=True)
    channels = RunChannels(
        time=columns["t"][part],
        speed=columns["v"][part],
        command=columns["v_cmd"][part],
        pitch=columns["pitch"][part],
        **further,
    )
    return replay(model, channels, str(names[counts.argmax()]))


def _summary(log: DriveLog, part: slice, simulated: NDArray[np.float64]) -> RunSummary:
    t, v = log.columns["t"][part], log.columns["v"][part]
    residual = v - simulated
    return RunSummary(
        run=str(log.columns["run"][part.start]),
        stops=len(stop_commands(t, v, log.columns["v_cmd"][part])),
        rms=float(np.sqrt(np.mean(residual**2))),
        worst=float(np.max(np.abs(residual))),
        longer_by=float(-np.trapezoid(residual, t)),
    )


def write(result: SimulateResult, path: Path) -> None:
    """Write `run,t,v_measured,v_simulated,residual`, all or nothing."""
    columns = {
        name: list(values) if name == "run" else values for name, values in result.columns.items()
    }
    write_csv(columns, path)


def as_json(result: SimulateResult) -> dict[str, Any]:
    """Summary for machines."""
    return {"runs": [asdict(r) for r in result.runs], "notes": list(result.notes)}


def show(result: SimulateResult, console: Console, most: int = 30) -> None:
    """A row a run."""
    table = Table(title="measured against simulated speed")
    for title in ("run", "stops", "rms [m/s]", "worst [m/s]", "simulation longer by [m]"):
        table.add_column(title, justify="right")
    for r in result.runs[:most]:
        table.add_row(r.run, str(r.stops), f"{r.rms:.3f}", f"{r.worst:.3f}", f"{r.longer_by:+.3f}")
    console.print(table)
    if len(result.runs) > most:
        console.print(f"… and {len(result.runs) - most} more runs")
    for note in result.notes:
        console.print(f"note: {note}", style="yellow")
