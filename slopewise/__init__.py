"""How fast may an off-road robot go here, so that it can always still stop?

    import slopewise

    model = slopewise.read_model("atv")
    ground, paths = slopewise.read_map("dem.tif"), slopewise.read_paths("paths.csv")
    for plan in slopewise.plan(model, ground, paths, start_speed=1.5):
        print(plan.candidate, plan.status.value, plan.travel_time, plan.reason)

The names below are stable from release to release; everything else may move. SI units and radians
throughout. An argument of a wrong kind is a ``ParameterError``, which is a :class:`SlopewiseError`,
and names it. A name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slopewise._calibration import calibrate as calibrate
    from slopewise._calibration import find_discrepancies as find_discrepancies
    from slopewise._io import read_drive_log as read_drive_log
    from slopewise._io import read_map as read_map
    from slopewise._io import read_model as read_model
    from slopewise._io import read_paths as read_paths
    from slopewise._io import write_model as write_model
    from slopewise._planning import check_plan as check_plan
    from slopewise._planning import plan as plan
    from slopewise.models.candidate_path import CandidatePath as CandidatePath
    from slopewise.models.elevation_map import ElevationMap as ElevationMap
    from slopewise.models.errors import SlopewiseError as SlopewiseError
    from slopewise.models.parameters import Model as Model
    from slopewise.planner.horizon.answer import PlanarState as PlanarState
    from slopewise.planner.horizon.horizon import Horizon as Horizon
    from slopewise.planner.plan import SpeedPlan as SpeedPlan
    from slopewise.services.check.check_report import CheckReport as CheckReport
    from slopewise.services.check.external_plan import GivenPlan as GivenPlan
    from slopewise.services.client import PlanClient as PlanClient
    from slopewise.services.guard.decide import GuardDecision as GuardDecision
    from slopewise.services.guard.decide import guard_decision as guard_decision
    from slopewise.services.io.drive_log import DriveLog as DriveLog

_NAMES = {
    "_calibration": "calibrate find_discrepancies",
    "_io": "read_drive_log read_map read_model read_paths write_model",
    "_planning": "check_plan plan",
    "models.candidate_path": "CandidatePath",
    "models.elevation_map": "ElevationMap",
    "models.errors": "SlopewiseError",
    "models.parameters": "Model",
    "planner.horizon.answer": "PlanarState",
    "planner.horizon.horizon": "Horizon",
    "planner.plan": "SpeedPlan",
    "services.check.check_report": "CheckReport",
    "services.check.external_plan": "GivenPlan",
    "services.client": "PlanClient",
    "services.guard.decide": "GuardDecision guard_decision",
    "services.io.drive_log": "DriveLog",
}
_HOMES = {name: f"{__name__}.{home}" for home, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_HOMES)


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
