"""Plan requests, maps and services without a wire, for tests of this package."""

from __future__ import annotations

from typing import Any

import numpy as np

from slopewise.models.parameters import Model
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.map_store import MapSnapshot, MapStore
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import Planning, ServiceConfig
from slopewise.services.wire.plan_messages import Path, PlanReply, PlanRequest
from tests.services.service_process import flat

ATV = read_model(find_model("atv"))


def plan_service(model: Model = ATV, **planning: Any) -> PlanService:
    config = ServiceConfig(model="atv", planning=Planning(**planning))
    return PlanService(config, ActiveParameters(model))


def snapshot_of(store: MapStore) -> MapSnapshot:
    assert store.snapshot is not None
    return store.snapshot


def flat_snapshot(**changes: Any) -> MapSnapshot:
    store = MapStore()
    store.apply(flat(**changes), "map")
    return snapshot_of(store)


def straight(name: str, length: float, points: int = 20, **fields: Any) -> Path:
    x = np.linspace(0.0, length, points)
    return Path(name=name, points=np.stack([x, 0.0 * x], axis=1), **fields)


def answer(service: PlanService, *paths: Path, speed: float = 1.0, **fields: Any) -> PlanReply:
    request = PlanRequest(speed=speed, paths=list(paths), **fields)
    return service.answer(request, flat_snapshot(), "plan")
