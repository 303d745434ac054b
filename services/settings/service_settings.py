"""The service's own settings: one TOML file, strict, every key with a range."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, fields
from pathlib import Path

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import (
    Quantities,
    non_negative,
    positive,
    quantity,
    validate_quantities,
)
from slopewise.planner.ground.uncertainty import QUANTILE, Uncertainty
from slopewise.planner.horizon.answer import HorizonSettings
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.decode import decode_table
from slopewise.services.io.files import read_toml, resolve_names
from slopewise.services.settings.learning_settings import Investigation, Learning, StoreSettings
from slopewise.services.settings.zenoh_session import ZenohSettings as ZenohSettings

_KEY = re.compile(r"[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*")
_MEGABYTE = 1_000_000
_MAX_QUEUE = 1024
"""Bytes of a megabyte, and entries of a queue at most [1]: each may hold a request of `sizes`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Planning(PlannerSettings):
    """Settings of the planner, and how long a request may wait."""

    workers: int = quantity("1", "Threads that plan.", default=1, at_least=1, at_most=16)
    queue: int = quantity(
        "1",
        "Requests that may wait; further ones are answered busy.",
        default=8,
        at_least=1,
        at_most=_MAX_QUEUE,
    )
    deadline: float = positive(
        "s", "From arrival to reply, unless the request states another.", default=0.1, at_most=60.0
    )
    longest_deadline: float = positive(
        "s", "Longest time that a request may wait.", default=10.0, at_most=600.0
    )
    early: float = non_negative(
        "s", "How long before its deadline a request is answered busy.", default=0.01
    )
    clients: int = quantity(
        "1", "Clients that are remembered.", default=8, at_least=1, at_most=1000
    )
    budget: float = positive("s", "Time for one cycle of a client.", default=0.02)
    period: float = positive("s", "From one cycle of a client to the next.", default=0.1)
    max_map_age: float = positive(
        "s",
        "Age of the map up to which plans are as fast as they may; at twice of it they stop.",
        default=30.0,
    )
    quantile: float = quantity(
        "1",
        "One-sided probability that margins cover the model's uncertainty.",
        default=QUANTILE,
        at_least=0.5,
        at_most=0.999999,
    )
    slope_std: float = non_negative(
        "rad", "Error of the map's grade and roll.", default=0.0, at_most=0.2
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if self.early >= self.deadline:
            raise ParameterError("early", f"less than deadline, {self.deadline:g} s")
        if self.deadline > self.longest_deadline:
            expected = f"at most longest_deadline, {self.longest_deadline:g} s"
            raise ParameterError("deadline", expected)

    def horizon(self) -> HorizonSettings:
        return HorizonSettings(budget=self.budget, period=self.period)

    def planner(self) -> PlannerSettings:
        values = {f.name: getattr(self, f.name) for f in fields(PlannerSettings)}
        return PlannerSettings(**values)

    def uncertainty(self) -> Uncertainty:
        """Uncertainty that the margins of plans cover."""
        return Uncertainty(quantile=self.quantile, slope_std=self.slope_std)


@dataclass(frozen=True, slots=True, kw_only=True)
class SizeLimits(Quantities):
    """Limits of messages: larger ones are answered with an error, or counted and ignored."""

    request_bytes: int = quantity(
        "B", "Of a request.", default=4 * _MEGABYTE, at_least=1000, at_most=1000 * _MEGABYTE
    )
    map_bytes: int = quantity(
        "B", "Of a map update.", default=64 * _MEGABYTE, at_least=1000, at_most=1000 * _MEGABYTE
    )
    candidates: int = quantity("1", "In one request.", default=1000, at_least=1, at_most=100_000)
    points: int = quantity("1", "Of one path.", default=5000, at_least=3, at_most=1_000_000)
    stations: int = quantity(
        "1",
        "Of all candidates of a request together.",
        default=200_000,
        at_least=100,
        at_most=10_000_000,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusSettings(Quantities):
    """When the status is published, and what it flags."""

    period: float = quantity("s", "From one status to the next.", default=1.0, at_least=0.05)
    map_age: float = positive("s", "A map older than that is flagged.", default=5.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSettings(Quantities):
    """A live page, health and metrics over HTTP, read-only and off by default.

    Attributes:
        token: file with a word that every request has to show; empty: none has to. It is sent
            as `Authorization: Bearer WORD`, or once as `?token=WORD`, which a cookie keeps.
    """

    enabled: bool = False
    host: str = "127.0.0.1"
    token: str = ""
    port: int = quantity("1", "Where it listens.", default=8177, at_least=1, at_most=65535)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceConfig:
    """One service."""

    model: str  # model file, or the name of a shipped vehicle; relative to the settings file
    namespace: str = "slopewise/robot"  # prefix of all keys
    id: str = "planner"  # name of this service, unique in its namespace
    map: str = ""  # first elevation map; empty: none until an update arrives
    zenoh: ZenohSettings = field(default_factory=ZenohSettings)
    planning: Planning = field(default_factory=Planning)
    sizes: SizeLimits = field(default_factory=SizeLimits)
    status: StatusSettings = field(default_factory=StatusSettings)
    page: PageSettings = field(default_factory=PageSettings)
    learning: Learning = field(default_factory=Learning)
    store: StoreSettings = field(default_factory=StoreSettings)
    discrepancy: Investigation = field(default_factory=Investigation)

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.namespace):
            raise ParameterError("namespace", f"words joined by /, got {self.namespace!r}")
        if not _KEY.fullmatch(self.id) or "/" in self.id:
            raise ParameterError("id", f"one word of letters, digits, _ . -, got {self.id!r}")

    def key(self, name: str) -> str:
        """The key of something, e.g. ``slopewise/robot/v1/plan``."""
        return f"{self.namespace}/v1/{name}"


def read_config(path: Path) -> ServiceConfig:
    """The settings in a TOML file; files named in it are taken relative to it."""
    data = read_toml(path)
    resolve_names(path, data, "model", "map", "zenoh.config", "learning.terrains", "page.token")
    resolve_names(path, data, "store.path", "discrepancy.samples", exists=False)
    return decode_table(ServiceConfig, data, str(path))
