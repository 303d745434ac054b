"""`slopewise fleet plan`, `calibrate` and `discrepancy`: many paths, logs and vehicles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli import options
from slopewise.services.cli.command import ExitStatus, print_result, schema_of
from slopewise.services.cli.options import argument, option
from slopewise.services.cli.tables import LISTED, line, notes, rejections, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    from slopewise.services.fleet.calibrate_fleet import FleetCalibrateResult
    from slopewise.services.fleet.fleet_summary import FleetSummary
    from slopewise.services.fleet.plan_fleet import FleetPlanSummary
    from slopewise.services.fleet.vehicle_finding import Row

Workers = Annotated[
    int | None,
    typer.Option(min=0, help="Processes here; 0 works in this one. One for each processor."),
]
Scheduler = Annotated[str, option("A running Dask scheduler, e.g. tcp://10.0.0.1:8786.", "ADDRESS")]
_CALIBRATION = "fleet.calibrate_fleet.FleetCalibrationSummary"
ByFolder = Annotated[
    bool, option("A folder is a vehicle; else each file is one.", None, "--by-folder")
]


def fleet_plan(
    map_file: Annotated[Path, argument("Elevation map: tiled GeoTIFF in metres.", "MAP")],
    path_files: Annotated[
        list[Path], argument("Candidates: CSV or Parquet with x,y[,candidate].", "PATHS…")
    ],
    model: options.ModelFile,
    out: Annotated[Path, option("Where the results go, as Parquet in parts.", "DIR")],
    speed: options.StartSpeed = 0.0,
    clear: options.ClearDistance = math.inf,
    spacing: options.Spacing = None,
    quantile: options.Quantile = 0.999,
    nodata: options.NoDataValue = None,
    smooth: options.Smooth = True,
    workers: Workers = None,
    scheduler: Scheduler = "",
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of("fleet.plan_fleet.FleetPlanSummary")] = False,
) -> ExitStatus | None:
    r"""Plan the candidates of many files over a map that need not fit into memory.

    DIR/plans has one row per station, DIR/candidates one per candidate, in parts. A run that was
    interrupted is resumed; any number of workers gives the same bytes. Status 3: no candidate may
    be driven. Needs the extra: pip install '.\[fleet]' in a clone.

    [bold]Example[/]  slopewise fleet plan county.tif paths-*.csv --model atv --out out/county
    """
    from slopewise.planner.ground.uncertainty import Uncertainty
    from slopewise.planner.settings import PlannerSettings
    from slopewise.services.fleet.plan_fleet import plan_fleet
    from slopewise.services.fleet.plan_part import FleetPlanRequest
    from slopewise.services.jobs.summary import from_options

    request = FleetPlanRequest(
        map_file,
        path_files,
        model,
        out,
        speed,
        clear,
        from_options(PlannerSettings, smooth=smooth, spacing=spacing),
        from_options(Uncertainty, quantile=quantile),
        workers,
        scheduler,
        nodata,
    )
    summary = plan_fleet(request)
    print_result(as_json, summary, _plan_tables(summary), out)
    return None if summary.admissible else ExitStatus.NOT_ADMISSIBLE


def _plan_tables(summary: FleetPlanSummary) -> Iterator[Any]:
    """Number of candidates by status."""
    kinds = ", ".join(f"{count} {name}" for name, count in summary.statuses.items())
    yield line(f"{summary.model}: {plural(summary.candidates, 'candidate')}: {kinds}")
    yield f"{summary.driven} may be driven"
    if summary.resumed:
        yield f"{summary.resumed} of them were planned by an earlier run"
    if summary.unexpected:
        parts = plural(summary.unexpected, "part")
        yield from notes([f"of other paths: {parts} in the folder"])
    yield from notes(summary.notes)
    rate = f"{summary.planned / summary.seconds:.3g} per second"
    yield f"{plural(summary.planned, 'candidate')} planned in {summary.seconds:.1f} s, {rate}"


def fleet_calibrate(
    logs: options.LogFiles,
    model: options.ModelFile,
    out: Annotated[Path, option("Folder, with one model per vehicle.", "DIR")],
    by_folder: ByFolder = False,
    map_file: options.GroundMap = None,
    nodata: options.NoDataValue = None,
    coverage: options.Coverage = 0.995,
    workers: Workers = None,
    scheduler: Scheduler = "",
    as_json: options.AsJson = False,
    json_schema: Annotated[bool, schema_of(_CALIBRATION)] = False,
) -> ExitStatus | None:
    """Fit a braking model to each vehicle of a fleet, pooled where its stops carry little.

    Surface by surface: how the vehicles differ, and each as far as its stops support. A vehicle
    without stops, or far stronger than the others, gets the fleet's mean and a longer offset; one
    far weaker is planned by its stops. Status 3: the other results are written, but those of a
    vehicle are physically implausible, or its log cannot be read, with the reason.

    [bold]Example[/]  slopewise fleet calibrate logs/*.csv --model atv --out out/fleet
    """
    from slopewise.services.fleet.calibrate_fleet import calibrate_fleet
    from slopewise.services.jobs.log_input import LogInput

    result = calibrate_fleet(
        LogInput(logs, map_file, nodata),
        model,
        out,
        by_folder=by_folder,
        coverage=coverage,
        workers=workers,
        scheduler=scheduler,
    )
    print_result(as_json, result.summary, _calibrate_tables(result, out))
    return ExitStatus.NOT_ADMISSIBLE if result.calibration.objections else None


def _calibrate_tables(result: FleetCalibrateResult, out: Path) -> Iterator[Any]:
    from slopewise.models.calibration.force_fit import NAMES

    c = result.calibration
    fits = c.surfaces.values()
    rows = [
        (name, *(f"{f.mean[k]:.4f} ± {float(f.spread[k, k]) ** 0.5:.4f}" for f in fits))
        for k, name in enumerate(NAMES)
    ]
    rows.append(("stop to stop", *(f"{f.scatter:.4f}" for f in fits)))
    rows.append(
        ("stops learned from", *(f"{int(f.inliers.sum())} of {len(f.inliers)}" for f in fits))
    )
    yield from table(
        ("mean ± from vehicle to vehicle", *(name or "base" for name in c.surfaces)),
        rows,
        title=f"fleet of {len(result.vehicles)} {result.model.name}",
    )
    yield f"dead time {c.dead_time.value:.3f} ± {c.dead_time.between_stops:.3f} s"
    vehicles = [
        (
            v.name,
            len(v.stops),
            *(f"{getattr(c.braking[v.name], name):.4f}" for name in NAMES),
            f"{c.braking[v.name].dead_time:.3f}",
            f"{c.braking[v.name].distance_offset:.3f}",
        )
        for v in result.vehicles
    ]
    columns = ("vehicle", "stops", *NAMES, "dead time\ns", "offset\nm")
    yield from table(columns, vehicles, more="more; --json gives all")
    yield from notes(f"{v.name} gets the fleet's mean: {v.note}" for v in result.vehicles if v.note)
    yield from notes(f"{name}: {text}" for name, texts in c.notes.items() for text in texts)
    for name, reasons in c.objections.items():
        yield from rejections(reasons, name, written=name in result.written)
    yield line(f"wrote {plural(len(result.written), 'model file')} to {out}")


def fleet_discrepancy(
    logs: options.LogFiles,
    models: Annotated[
        str,
        option(
            "Model file or name for all, or a folder with NAME.toml for each vehicle.", "MODEL|DIR"
        ),
    ],
    out: Annotated[Path, option("Folder of the results.", "DIR")],
    by_folder: ByFolder = False,
    map_file: options.GroundMap = None,
    nodata: options.NoDataValue = None,
    topics: options.Topics = None,
    false_alarm: options.FalseAlarm = 0.005,
    seed: options.Seed = 20,
    workers: Workers = None,
    scheduler: Scheduler = "",
    as_json: options.AsJson = False,
) -> None:
    r"""Compare the logs of many vehicles with their models: which lack which effect, how certainly.

    DIR/vehicles/NAME has discrepancy.json, model.toml and report.html as `slopewise discrepancy`
    writes them; DIR/findings one row per vehicle as Parquet; DIR/findings.jsonl a line each. A log
    that cannot be used is reported in its row. A second run examines what is new: logs that grew,
    models that changed. Needs the extra: pip install '.\[fleet]' in a clone.

    [bold]Examples[/]  slopewise fleet discrepancy logs/*.csv --models atv --out out/fleet
              slopewise fleet discrepancy logs/*/* --by-folder --models out/vehicles --out out/may
    """
    from slopewise.models.discrepancy.settings import DiscrepancySettings
    from slopewise.services.fleet.fleet_page import write_fleet_page
    from slopewise.services.fleet.investigate_fleet import PAGE, investigate_fleet
    from slopewise.services.fleet.vehicle_finding import FleetDiscrepancyRequest
    from slopewise.services.jobs.log_input import LogInput
    from slopewise.services.jobs.summary import from_options

    request = FleetDiscrepancyRequest(
        LogInput(logs, map_file, nodata, topics),
        models,
        out,
        by_folder,
        from_options(DiscrepancySettings, false_alarm=false_alarm, seed=seed),
        workers,
        scheduler,
    )
    rows, summary = investigate_fleet(request)
    page = out / PAGE
    write_fleet_page(page, rows, summary)
    print_result(as_json, summary, _discrepancy_tables(rows, summary), page)


def _discrepancy_tables(rows: list[Row], c: FleetSummary) -> Iterator[Any]:
    """The fleet by verdict and by effect, then the vehicles with the largest gaps."""
    from slopewise.services.fleet.fleet_summary import format_effects, sort_by_prediction_error
    from slopewise.services.fleet.investigate_fleet import LINES

    verdicts = ", ".join(f"{count} {name}" for name, count in c.verdicts.items())
    yield line(f"{c.examined} of {len(rows)} vehicles examined: {verdicts}")
    if c.effects:
        yield from table(
            ("effect", "missing in", "confidence", "of them right", "perhaps in", "numbers"),
            ((e.name, *e.cells(c.examined)) for e in c.effects),
            left=("numbers",),
        )
    yield from table(
        ("vehicle", "stops", "verdict", "effects", "stops off by\nm, before", "after"),
        (
            (
                row["vehicle"],
                row["stops"],
                row["verdict"],
                format_effects(row),
                *(f"{row[f'stop_distance_{moment}']:.2f}" for moment in ("before", "after")),
            )
            for row in sort_by_prediction_error(rows)
        ),
        left=("verdict", "effects"),
        more=f"more, in {LINES}",
    )
    yield line(c.false_alarms, "dim")
    yield from notes(c.list_failed(LISTED))
    if c.resumed:
        yield f"{c.resumed} of them were examined by an earlier run"
    if c.unexpected:
        vehicles = plural(c.unexpected, "vehicle")
        yield from notes([f"not among these: {vehicles} in the folder"])
