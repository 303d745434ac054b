"""Search drive logs for effects that a model lacks."""

from __future__ import annotations

from datetime import date

from slopewise.models.discrepancy.findings import Findings
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import HUNDREDTHS, investigate
from slopewise.services.io.findings_file import source_of
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.jobs.log_input import LogInput
from slopewise.services.jobs.progress import progress_bar
from slopewise.services.jobs.summary import input_errors


def discrepancy(
    logs: LogInput, model_file: str, *, settings: DiscrepancySettings | None = None
) -> Findings:
    model_path = find_model(model_file)
    model = read_model(model_path)
    with progress_bar("comparing", HUNDREDTHS + 1) as advance:
        log = logs.read_for(model)
        ground = logs.grade(log, model.vehicle)
        advance(1)
        with input_errors(logs.names):
            return investigate(
                log.columns,
                log.runs,
                model,
                ground=ground,
                settings=settings,
                source=source_of(logs.files, model_path, f"{date.today()}"),
                advance=advance,
            )
