"""Models, stops, learners and services of the parameter tests, without a wire."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

from slopewise.models.parameters import Model
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.learning_settings import Learning, StoreSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.observations import ObservationAck, StopObservation

G = 9.80665
ATV, HUSKY = read_model(find_model("atv")), read_model(find_model("husky"))
NUMBERS = itertools.count(1)


def stop(force: float, surface: str = "", speed: float = 2.0, **more: Any) -> StopObservation:
    """A stop on level ground with F_b/W as given."""
    number = next(NUMBERS)
    fields: dict[str, Any] = {
        "source": "robot",
        "sequence": number,
        "time": float(number),
        "grade": 0.0,
        "deceleration": force * G,
        "deceleration_std": 0.02,
    }
    return StopObservation(**(fields | {"speed": speed, "surface": surface} | more))


def learner(model: Model = ATV, named: bool = False, **settings: Any) -> Learner:
    """A learner that accepts stops as fast as they arrive."""
    return Learner(model, Learning(**{"stops_at_once": 1000, **settings}), lambda: ("x",) * named)


def started(store: Path | str, model: Model = ATV, **learning: Any) -> ParameterService:
    settings = StoreSettings(path=str(store), retry=0.05)
    config = ServiceConfig(model="atv", learning=Learning(**learning), store=settings)
    return ParameterService(config, model)


def stopped(service: ParameterService, sequence: int, force: float, **more: Any) -> ObservationAck:
    fields = {"sequence": sequence, "time": float(sequence), "deceleration_std": 0.0, **more}
    return service.observe("stop", stop(force, **fields), "obs/stop", float(sequence))


def level_force(source: Learner | ParameterService, surface: str = "") -> float:
    """F_b/W that is planned with at 2 m/s on level ground."""
    model = source.active()[0] if isinstance(source, Learner) else source.active.model
    return (model.braking.on(surface) if surface else model.braking).level_force(2.0)
