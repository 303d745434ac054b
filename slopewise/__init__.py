"""How fast may an off-road robot go here, so that it can always still stop?

    import slopewise

    model = slopewise.read_model("atv")
    ground, paths = slopewise.read_map("dem.tif"), slopewise.read_paths("paths.csv")
    for plan in slopewise.plan(model, ground, paths, start_speed=1.5):
        print(plan.candidate, plan.status.value, plan.travel_time, plan.reason)

The names below are stable from release to release; everything else may move. SI units and radians
throughout. A name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slopewise._calibration import calibrate, find_discrepancies
    from slopewise._io import read_drive_log, read_map, read_model, read_paths, write_model
    from slopewise._planning import Horizon, check_plan, plan
    from slopewise.models.candidate_path import CandidatePath
    from slopewise.models.elevation_map import ElevationMap
    from slopewise.models.errors import SlopewiseError
    from slopewise.models.parameters import Model
    from slopewise.planner.horizon.answer import PlanarState
    from slopewise.planner.plan import SpeedPlan
    from slopewise.services.check.check_report import CheckReport
    from slopewise.services.check.external_plan import GivenPlan
    from slopewise.services.client import PlanClient
    from slopewise.services.io.drive_log import DriveLog

__all__ = [
    "CandidatePath",
    "CheckReport",
    "DriveLog",
    "ElevationMap",
    "GivenPlan",
    "Horizon",
    "Model",
    "PlanClient",
    "PlanarState",
    "SlopewiseError",
    "SpeedPlan",
    "calibrate",
    "check_plan",
    "find_discrepancies",
    "plan",
    "read_drive_log",
    "read_map",
    "read_model",
    "read_paths",
    "write_model",
]

_HOMES = {
    "CandidatePath": "slopewise.models.candidate_path",
    "CheckReport": "slopewise.services.check.check_report",
    "DriveLog": "slopewise.services.io.drive_log",
    "ElevationMap": "slopewise.models.elevation_map",
    "GivenPlan": "slopewise.services.check.external_plan",
    "Horizon": "slopewise._planning",
    "Model": "slopewise.models.parameters",
    "PlanClient": "slopewise.services.client",
    "PlanarState": "slopewise.planner.horizon.answer",
    "SlopewiseError": "slopewise.models.errors",
    "SpeedPlan": "slopewise.planner.plan",
    "calibrate": "slopewise._calibration",
    "check_plan": "slopewise._planning",
    "find_discrepancies": "slopewise._calibration",
    "plan": "slopewise._planning",
    "read_drive_log": "slopewise._io",
    "read_map": "slopewise._io",
    "read_model": "slopewise._io",
    "read_paths": "slopewise._io",
    "write_model": "slopewise._io",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module 'slopewise' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
