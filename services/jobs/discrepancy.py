"""Search drive logs for effects that a model lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from slopewise.models.discrepancy.findings import Findings
from slopewise.models.discrepancy.progress import Stage
from slopewise.models.discrepancy.report.evidence import Evidence
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate_with_evidence
from slopewise.services.io.drive_log import read_logs
from slopewise.services.io.findings_file import findings_as_json, source_of
from slopewise.services.io.log_checks import names_of
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.no_data import NoData
from slopewise.services.io.track_grade import grade_by_map
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import input_errors


@dataclass(frozen=True, slots=True)
class DiscrepancyResult:
    """Findings, and the evidence that they rest on."""

    findings: Findings
    evidence: Evidence

    @property
    def summary(self) -> dict[str, Any]:
        """Content of discrepancy.json."""
        return findings_as_json(self.findings)


def discrepancy(
    logs: Sequence[Path],
    model_file: str,
    *,
    settings: DiscrepancySettings | None = None,
    map_file: Path | None = None,
    nodata: NoData = None,
    topics: Path | None = None,
    columns: str = "",
    quiet: bool = True,
) -> DiscrepancyResult:
    """Read and investigate.

    Args:
        logs: tables or recordings.
        model_file: model file or shipped vehicle.
        settings: rate of false alarms, sizes that matter, seed.
        map_file: elevation map that x, y of the logs lie on.
        nodata: height of the map that marks unknown ground [m].
        topics: topic mapping of recordings.
        columns: names and units of tables that differ.
        quiet: without a progress bar.

    Raises:
        InputError: names file and field, or says why there are too few stops.
    """
    model_path = find_model(model_file)
    model = read_model(model_path)
    with progress_bar("comparing", Stage.FINDINGS + 1, quiet=quiet) as advance:
        log = read_logs(logs, topics, columns)
        ground = grade_by_map(log, map_file, model.vehicle, nodata)
        advance(1)
        with input_errors(names_of(logs)):
            findings, evidence = investigate_with_evidence(
                log.columns,
                log.runs,
                model,
                ground=ground,
                settings=settings,
                source=source_of(logs, model_path, f"{date.today()}"),
                advance=advance,
            )
    return DiscrepancyResult(findings, evidence)


def discrepancy_settings(**values: Any) -> DiscrepancySettings:
    """Settings from options.

    Raises:
        InputError: names the option.
    """
    with input_errors("", tuple(values)):
        return DiscrepancySettings(**values)
