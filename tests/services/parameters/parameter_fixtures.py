"""Models, stops, learners and services of the parameter tests, without a wire."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.parameters import Effect, Model
from slopewise.services.io.model_file import find_model, model_to_dict, read_model
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.learning_settings import Learning, StoreSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.model_proposal import ModelProposal, StopDistanceChange
from slopewise.services.wire.observations import DriveSamples, ObservationAck, StopObservation

G = 9.80665
ATV, HUSKY = read_model(find_model("atv")), read_model(find_model("husky"))
LAG = Effect(name="brake_lag", parameters={"tau": 0.3}, covariance=((0.01**2,),))
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


def proposal(number: int = 1, **changes: Any) -> ModelProposal:
    """An offer with numbers as the workflow writes them."""
    effect = {
        "name": "brake_lag",
        "parameters": {"tau": {"value": 0.2984, "std": 0.012, "unit": "s"}},
        "confidence": 0.98,
        "alternatives": [],
        "where": "",
    }
    gap = {"metric": "stopping distance", "before": 0.412, "after": 0.057, "noise_floor": 0.049}
    fields: dict[str, Any] = {
        "id": f"offer{number}",
        "at": 1e9 + number,
        "cause": "by schedule",
        "verdict": "missing_effect",
        "summary": "The model lacks: brakes that answer late.",
        "findings": {"effects": [effect], "stop_distance": gap, "seconds": 3.0},
        "data": "0",
        "stops": 26,
        "beside_file": StopDistanceChange(least=0.11, most=0.93, where="2 m/s"),
        "beside_use": StopDistanceChange(least=0.11, most=0.93, where="2 m/s"),
        "valid": True,
        "changes": True,
        "notes": [],
        "model": model_to_dict(dataclasses.replace(ATV, effect=(LAG,))),
    }
    return ModelProposal(**(fields | changes))


def samples(columns: dict[str, Any], source: str = "robot", surface: str = "") -> DriveSamples:
    """Samples of a drive, numbered after all observations before them."""
    number = next(NUMBERS)
    return DriveSamples(
        source=source,
        sequence=number,
        time=float(number),
        columns=list(columns),
        values=np.stack(list(columns.values())),
        surface=surface,
    )


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
