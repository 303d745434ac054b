"""Settings of the service's learning: what to listen to, how far to go, where to keep it.

And of the discrepancy workflow in the service: what to store, when to run, what follows.
"""

from __future__ import annotations

from dataclasses import dataclass

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import (
    Quantities,
    non_negative,
    positive,
    quantity,
    validate_quantities,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Learning:
    """How parameters change while the robot drives.

    Attributes:
        terrains: terrain file, or a shipped name, that ground is described by; empty: none.
        estimators: ids whose liveliness tokens have to be there; without one plans are slower.
    """

    enabled: bool = True  # False: the model file's parameters hold, observations are counted only
    terrains: str = ""
    estimators: tuple[str, ...] = ()
    degraded_speed: float = positive(
        "m/s", "Highest speed while an estimator is missing.", default=1.0
    )
    rise: float = positive(
        "1", "Highest rise of F_b/W in plans with one stop.", default=0.01, at_most=0.2
    )
    most_above_file: float = quantity(  # words: ok, a key of the file
        "1",
        "Share of the model file's F_b/W by which plans may count on more.",
        default=0.25,
        at_least=0.0,
        at_most=10.0,
    )
    stops_at_once: int = quantity(
        "1",
        "Stops that may come together; further ones only as fast as the vehicle can stop.",
        default=5,
        at_least=1,
        at_most=100_000,
    )
    change: float = positive(
        "1",
        "How far F_b/W may change with ground and load, standard deviation.",
        default=0.15,
        at_most=1.0,
    )
    grows_old: float = quantity(
        "s",
        "Time in which most of what was learned goes back to the model file.",
        default=3600.0,
        at_least=1.0,
    )
    oldest: float = quantity(
        "s", "Age from which on parameters lose no more.", default=14_400.0, at_least=1.0
    )
    refresh: float = quantity("s", "Time between updates of the age.", default=10.0, at_least=0.05)
    label_for: float = quantity("s", "How long a label of the ground holds.", default=5.0, above=0)
    sure: float = quantity(  # words: ok, a key of the file
        "1", "Probability from which on a label is accepted.", default=0.8, at_least=0.5, at_most=1
    )
    mount: float = quantity(
        "rad", "Offset of the pitch sensor.", default=0.0, at_least=-0.5, at_most=0.5
    )
    dive: float = non_negative("rad s²/m", "Pitch under braking.", default=0.0, at_most=0.1)
    queue: int = quantity(
        "1",
        "Observations that may wait; one more is lost and flagged.",
        default=256,
        at_least=1,
        at_most=65_536,
    )
    observation_bytes: int = quantity(
        "B",
        "Of an observation or a request to set.",
        default=1_000_000,
        at_least=1000,
        at_most=1_000_000_000,
    )
    early: float = positive(
        "s", "How far an observation's clock may run ahead of the time that passed.", default=2.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        for index, name in enumerate(self.estimators):
            if not name or any(c in name for c in "/*$?# "):
                expected = f"one word as in a liveliness token, got {name!r}"
                raise ParameterError(f"estimators[{index}]", expected)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreSettings(Quantities):
    """Where parameters are kept."""

    path: str = ""  # file, relative to the settings file; empty: nothing outlives the process
    megabytes: float = quantity(
        "MB", "Largest size of the file.", default=64.0, at_least=0.3, at_most=100_000.0
    )
    changes: int = quantity(
        "1",
        "Changes that are kept of one group; older ones are forgotten.",
        default=20_000,
        at_least=10,
        at_most=10_000_000,
    )
    retry: float = quantity(
        "s", "From one attempt to write to the next while that fails.", default=5.0, at_least=0.05
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Investigation(Quantities):
    """When the model is compared with the stops that were driven, and what may follow.

    Attributes:
        samples: folder of the stops' samples, relative to the settings file; empty: none are
            stored, and nothing is investigated.
        adopt_slower: True: a valid finding that makes no plan faster is adopted without an
            operator. All others always wait for one.
    """

    samples: str = ""
    megabytes: float = quantity(
        "MB",
        "Limit of all samples; the oldest stops are deleted.",
        default=32.0,
        at_least=0.1,
        at_most=100_000.0,
    )
    stops: int = quantity(
        "1", "Latest stops that are examined.", default=200, at_least=12, at_most=5000
    )
    every: float = non_negative(
        "s", "Time between scheduled investigations; 0: on request only.", default=0.0
    )
    fresh: int = quantity(
        "1", "New stops that a scheduled investigation needs.", default=20, at_least=1, at_most=5000
    )
    limit: float = quantity(
        "s", "Time that one investigation may take.", default=600.0, at_least=1.0, at_most=86_400.0
    )
    adopt_slower: bool = False
