"""Terrain parameters of the ground driven now: f_r, μ_t, B_s. Source: Slip, Sec. 3.2.

Each is rounded towards slower by its standard deviation. Towards slower a new estimate counts at
once, towards faster by a share of the way, and with age they go back to the model file's where
those are slower.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters.group import Description, DriveNews, ParameterGroups, State
from slopewise.services.settings.learning_settings import Learning

TERRAIN = "terrain"
NAMES = ("motion_resistance", "lateral_resistance", "slip_track")
_UNITS = ("1", "1", "m")
_FASTER = 0.2
_SMALLEST = (0.001, 0.01, 1.0)
_LARGEST = (1.5, 3.0, 20.0)
"""What is beyond is a gross error: [1], [1], track widths. Steel wheels on rails roll at f_r 0.001,
and wet ice is far above μ_t 0.01."""

_NEWS = 0.01
"""Changes by a smaller share are none worth keeping."""


class TerrainGroup(ParameterGroups):
    """What driving teaches of the ground; one thread."""

    def __init__(self, prior: Model, settings: Learning) -> None:
        """Begin with the model file's terrain."""
        self._prior, self._settings = prior, settings
        self._values: dict[str, float] = {}
        self._stds: dict[str, float] = {}
        self._taught = time.monotonic()

    def drive(self, samples: DriveNews) -> set[str]:
        """Learn from what samples told of the ground."""
        ground = samples.ground
        changed = ground.changed and self._ground_changed()
        news = ground.features is not None and self.take(ground.features, valid=ground.valid)
        return {TERRAIN} if changed or news else set()

    def take(self, features: tuple[tuple[float, float], ...], *, valid: bool = True) -> bool:
        """Learn (value, standard deviation) of each parameter, NaN where not known; any news?

        Ground that is not surely of a known class, not ``valid``, teaches slower values only.
        """
        track = self._prior.vehicle.track_width
        news = False
        for name, smallest, largest, (value, std) in zip(
            NAMES, _SMALLEST, _LARGEST, features, strict=True
        ):
            width = track if name == "slip_track" else 1.0
            if not 0.0 <= value + std <= largest * width:
                continue
            slow = max(value + std, smallest * width)
            if name == "motion_resistance" and self._prior.braking.level < 1.0:
                # Part of the braking then is this resistance: more of it would count as brakes.
                continue
            old = self._now()[name]
            if slow < old and not valid:
                continue
            new = slow if slow >= old else old + _FASTER * (slow - old)
            self._stds[name] = std
            if abs(new - old) > _NEWS * max(abs(old), 1e-3):
                self._values[name], news = new, True
        if news:
            self._taught = time.monotonic()
        return news

    def distrust(self) -> set[str]:
        """Nowhere below the model file."""
        return {TERRAIN} if self._ground_changed() else set()

    def _ground_changed(self) -> bool:
        """What was known may hold no longer; did anything change with it?"""
        slower = {n: max(v, getattr(self._prior.terrain, n)) for n, v in self._values.items()}
        changed = slower != self._values
        self._values = slower
        return changed

    def _now(self) -> dict[str, float]:
        age = time.monotonic() - self._taught
        share = -math.expm1(-age / self._settings.grows_old)
        known = {name: float(getattr(self._prior.terrain, name)) for name in NAMES}
        for name, value in self._values.items():
            known[name] = value + share * max(known[name] - value, 0.0)
        known["slip_track"] = max(known["slip_track"], self._prior.vehicle.track_width)
        return known

    def apply(self, model: Model) -> Model:
        """To plan with."""
        return dataclasses.replace(model, terrain=dataclasses.replace(model.terrain, **self._now()))

    def names(self) -> list[str]:
        """The one."""
        return [TERRAIN]

    def describe(self, group: str) -> Description:
        """As planned with."""
        return Description(
            values=self._now(),
            stds=dict(self._stds),
            valid=bool(self._values),
            age=time.monotonic() - self._taught if self._values else 0.0,
            unit=dict(zip(NAMES, _UNITS, strict=True)),
        )

    def state(self, group: str) -> State | None:
        """What a restart needs."""
        return {"values": self._values, "stds": self._stds} if self._values else None

    def restore(self, group: str, state: State | None, age: float) -> None:
        """As it was ``age`` seconds ago."""
        values: dict[str, float] = {} if state is None else dict(state["values"])
        stds = {} if state is None else {n: float(s) for n, s in state["stds"].items()}
        self._check(values)
        self._values, self._stds, self._taught = values, stds, time.monotonic() - age

    def set(self, group: str, values: Mapping[str, float]) -> None:
        """An operator's values."""
        self._check(values)
        self._values = {**self._values, **values}
        self._taught = time.monotonic()

    def _check(self, values: Mapping[str, float]) -> None:
        track = self._prior.vehicle.track_width
        for name, value in values.items():
            if name not in NAMES:
                raise ParameterError(name, f"one of {', '.join(NAMES)}")
            i, width = NAMES.index(name), track if name == "slip_track" else 1.0
            low, high = _SMALLEST[i] * width, _LARGEST[i] * width
            if not low <= value <= high:
                expected = f"a number of {low:g} … {high:g} {_UNITS[i]}"
                raise ParameterError(name, f"{expected}, got {value:g}")
