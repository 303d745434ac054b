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
from slopewise.services.io.model_file import find_model, read_model
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
from slopewise.services.wire.observations import DriveSamples
from slopewise.services.wire.parameter_messages import ParameterQuestion


class Wheels(ParameterGroups):
    """The highest speed driven, as a limit of the wheels: the smallest estimator there can be."""

    def __init__(self, prior: Model, settings: Learning) -> None:
        self._most = prior.vehicle.max_wheel_speed
        self._values: dict[str, float] = {}

    def names(self) -> list[str]:
        return ["wheels"]

    def drive(self, samples: DriveUpdate) -> set[str]:
        self._values = {"max_wheel_speed": min(float(samples.columns["v"].max()), self._most)}
        return {"wheels"}

    def apply(self, model: Model) -> Model:
        return dataclasses.replace(
            model, vehicle=dataclasses.replace(model.vehicle, **self._values)
        )

    def describe(self, group: str) -> GroupDescription:
        values = {"max_wheel_speed": self._most, **self._values}
        return GroupDescription(values=values, valid=bool(self._values), age=0.0)

    def state(self, group: str) -> State | None:
        return {"values": self._values} if self._values else None

    def restore(self, group: str, state: State | None, age: float) -> None:
        self._values = {} if state is None else dict(state["values"])

    def set(self, group: str, values: Mapping[str, float]) -> None:
        if set(values) != {"max_wheel_speed"}:
            raise ParameterError("values", "max_wheel_speed")
        self._values = dict(values)


def atv() -> Model:
    return read_model(find_model("atv"))


def samples(sequence: int, speed: float) -> DriveSamples:
    t = np.arange(50) * 0.02
    values = np.stack([t, np.full(50, speed), np.full(50, speed), np.zeros(50)])
    return DriveSamples(
        source="robot",
        sequence=sequence,
        time=float(sequence),
        columns=["t", "v", "v_cmd", "pitch"],
        values=values,
    )


@pytest.mark.parametrize("make", GROUPS)
def test_a_registered_group_begins_with_the_model_file_and_comes_back_as_it_was(make) -> None:  # type: ignore[no-untyped-def]
    """Names are its own alone, nothing is kept before anything is learned, and values are finite.

    What an operator sets is told, kept, and restored by another one of the kind.
    """
    groups, model = make(atv(), Learning()), atv()
    alone = Learner(model, Learning())
    assert groups.apply(model) == model
    for name in groups.names():
        assert groups.owns(name)
        assert type(alone.state.group(name)) is type(groups)
        assert groups.state(name) is None
        told = groups.describe(name)
        assert np.isfinite(list(told.values.values())).all()
        assert set(told.unit) <= set(told.values)
        with pytest.raises(ParameterError):
            groups.set(name, {"no such value": 1.0})
        value = next(iter(told.values))
        groups.set(name, {value: told.values[value]})
        again = make(atv(), Learning())
        again.restore(name, groups.state(name), 0.0)
        assert again.describe(name).values == pytest.approx(groups.describe(name).values)
        again.restore(name, None, 0.0)
        assert again.apply(model) == model


def test_names_are_unique() -> None:
    names = Learner(atv(), Learning()).state.names()
    assert len(set(names)) == len(names)
    assert names == ["braking", "terrain", "limits", "effects"]


def test_a_line_in_the_registry_brings_an_estimator_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is fed, planned with, published, kept, restored, set and taken back."""
    monkeypatch.setattr(learner_state, "GROUPS", (*GROUPS, Wheels))
    store = StoreSettings(path=str(tmp_path / "p.sqlite"), retry=0.05)
    config = ServiceConfig(model="atv", store=store)
    first = ParameterService(config, atv())
    assert first.learner.state.names()[-2:] == ["wheels", "effects"]
    receipt = first.observe("drive", samples(1, 1.5), "k", time.monotonic())
    assert receipt.status == "taken"
    assert first.changed >= {"wheels"}
    assert first.active.model.vehicle.max_wheel_speed == 1.5
    learned = first.history.version
    first.close()

    again = ParameterService(config, atv())
    assert again.active.model.vehicle.max_wheel_speed == 1.5
    again.set_values("wheels", {"max_wheel_speed": 1.0}, "ann")
    assert again.active.model.vehicle.max_wheel_speed == 1.0
    told = replies.group_message(again, "wheels")
    assert (told.values, told.valid, told.who) == ({"max_wheel_speed": 1.0}, True, "ann")
    again.roll_back(learned, "wheels", "ann")
    assert again.active.model.vehicle.max_wheel_speed == 1.5
    reply = replies.read(again, ParameterQuestion(group="wheels", history=9), "planner")
    assert [entry.values["max_wheel_speed"] for entry in reply.history] == [1.5, 1.0, 1.5]
    again.close()
