"""Settings of the discrepancy workflow in the service: what to store, when to run, what follows."""

from __future__ import annotations

from dataclasses import dataclass

from slopewise.models.quantity import quantity, validate_quantities


@dataclass(frozen=True, slots=True, kw_only=True)
class Investigation:
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
    every: float = quantity(
        "s",
        "Time between scheduled investigations; 0: on request only.",
        default=0.0,
        at_least=0.0,
    )
    fresh: int = quantity(
        "1",
        "New stops that a scheduled investigation needs.",
        default=20,
        at_least=1,
        at_most=5000,
    )
    limit: float = quantity(
        "s", "Time that one investigation may take.", default=600.0, at_least=1.0, at_most=86_400.0
    )
    adopt_slower: bool = False

    def __post_init__(self) -> None:
        validate_quantities(self)
