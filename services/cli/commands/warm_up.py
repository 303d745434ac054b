"""`slopewise warm-up`: compile all that plans need, once, before anybody waits for it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from rich.console import Console


@dataclass(frozen=True, slots=True)
class WarmUpResult:
    """How long it took [s], and a first plan after it."""

    seconds: float
    plan_seconds: float


def run() -> WarmUpResult:
    """Plan on all kinds of ground, then once more to see how long that takes."""
    begun = time.perf_counter()
    from slopewise.services.daemon import warm_up_requests
    from slopewise.services.io.model_file import find_model, read_model
    from slopewise.services.parameters.active_parameters import ActiveParameters
    from slopewise.services.planning.cold_start import compile_first
    from slopewise.services.planning.plan_service import PlanService
    from slopewise.services.settings.service_settings import ServiceConfig

    compile_first("on all cores")
    plans = PlanService(ServiceConfig(model="atv"), ActiveParameters(read_model(find_model("atv"))))
    warm_up_requests.run(plans)
    compiled = time.perf_counter()
    ground, request = next(warm_up_requests.requests())
    plans.answer(request, ground, warm_up_requests.CLIENT)
    return WarmUpResult(compiled - begun, time.perf_counter() - compiled)


def as_json(result: WarmUpResult) -> dict[str, Any]:
    """For machines."""
    return {"seconds": result.seconds, "plan_seconds": result.plan_seconds}


def show(result: WarmUpResult, console: Console) -> None:
    """One line."""
    first = f"ready after {result.seconds:.1f} s"
    console.print(f"{first}; a plan takes {1e3 * result.plan_seconds:.1f} ms from now on")
