"""An estimator is a class and a line in the registry; everything else follows."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters import learner_state, replies
from slopewise.services.parameters.group_registry import GROUPS
from slopewise.services.parameters.learner import Learner
from slopewise.services.parameters.parameter_group import (
    DriveUpdate,
    GroupDescription,
    ParameterGroups,
    State,
)
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.learning_settings import Learning, StoreSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.parameter_messages import ParameterQuestion
from tests.services.parameters.parameter_fixtures import ATV, samples


class WheelsStub(ParameterGroups):
    """The highest speed driven, as a limit of the wheels: the smallest estimator there can be."""

    def __init__(self, prior: Model, settings: Learning) -> None:
        self._max_speed = prior.vehicle.max_wheel_speed
        self._values: dict[str, float] = {}

    def names(self) -> list[str]:
        return ["wheels"]

    def drive(self, samples: DriveUpdate) -> set[str]:
        self._values = {"max_wheel_speed": min(float(samples.columns["v"].max()), self._max_speed)}
        return {"wheels"}

    def apply(self, model: Model) -> Model:
        return dataclasses.replace(
            model, vehicle=dataclasses.replace(model.vehicle, **self._values)
        )

    def describe(self, group: str) -> GroupDescription:
        values = {"max_wheel_speed": self._max_speed, **self._values}
        return GroupDescription(values=values, valid=bool(self._values), age=0.0)

    def state(self, group: str) -> State | None:
        return {"values": self._values} if self._values else None

    def restore(self, group: str, state: State | None, age: float) -> None:
        self._values = {} if state is None else dict(state["values"])

    def set(self, group: str, values: Mapping[str, float]) -> None:
        if set(values) != {"max_wheel_speed"}:
            raise ParameterError("values", "max_wheel_speed")
        self._values = dict(values)


@pytest.mark.parametrize("make", GROUPS)
def test_a_registered_group_starts_from_the_model_file_and_is_restored(make) -> None:  # type: ignore[no-untyped-def]
    """Nothing is stored before anything is learned; an operator's values are restored."""
    groups, model = make(ATV, Learning()), ATV
    alone = Learner(model, Learning())
    assert groups.apply(model) == model
    for name in groups.names():
        assert groups.owns(name)
        assert type(alone.state.group(name)) is type(groups)
        assert groups.state(name) is None
        known = groups.describe(name)
        assert np.isfinite(list(known.values.values())).all()
        assert set(known.unit) <= set(known.values)
        with pytest.raises(ParameterError):
            groups.set(name, {"no such value": 1.0})
        value = next(iter(known.values))
        groups.set(name, {value: known.values[value]})
        again = make(ATV, Learning())
        again.restore(name, groups.state(name), 0.0)
        assert again.describe(name).values == pytest.approx(groups.describe(name).values)
        again.restore(name, None, 0.0)
        assert again.apply(model) == model


def test_names_are_unique() -> None:
    names = Learner(ATV, Learning()).state.names()
    assert len(set(names)) == len(names)
    assert names == ["braking", "terrain", "limits", "effects"]


def test_an_estimator_in_the_registry_is_used_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It receives samples, is planned with, published, stored, restored, set and rolled back."""
    monkeypatch.setattr(learner_state, "GROUPS", (*GROUPS, WheelsStub))
    store = StoreSettings(path=str(tmp_path / "p.sqlite"), retry=0.05)
    config = ServiceConfig(model="atv", store=store)
    first = ParameterService(config, ATV)
    assert first.learner.state.names()[-2:] == ["wheels", "effects"]
    t, speed = np.arange(50) * 0.02, np.full(50, 1.5)
    drive = samples({"t": t, "v": speed, "v_cmd": speed, "pitch": 0.0 * t})
    receipt = first.observe("drive", drive, "k", time.monotonic())
    assert receipt.status == "taken"
    assert first.changed >= {"wheels"}
    assert first.active.model.vehicle.max_wheel_speed == 1.5
    learned = first.history.version
    first.close()

    again = ParameterService(config, ATV)
    assert again.active.model.vehicle.max_wheel_speed == 1.5
    again.set_values("wheels", {"max_wheel_speed": 1.0}, "ann")
    assert again.active.model.vehicle.max_wheel_speed == 1.0
    message = replies.group_message(again, "wheels")
    assert (message.values, message.valid, message.who) == ({"max_wheel_speed": 1.0}, True, "ann")
    again.roll_back(learned, "wheels", "ann")
    assert again.active.model.vehicle.max_wheel_speed == 1.5
    reply = replies.read(again, ParameterQuestion(group="wheels", history=9))
    assert [entry.values["max_wheel_speed"] for entry in reply.history] == [1.5, 1.0, 1.5]
    again.close()
