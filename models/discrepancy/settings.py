"""How to look for a discrepancy."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs.find_stops import StopSettings


def _stops() -> StopSettings:
    # A turn is no reason to leave a stop out: it may be what the model misses.
    return StopSettings(turn_rate=math.inf)


_CALIBRATED_AT = 0.005  # share of false alarms that stands for the odds of prior.NAME [1]


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscrepancySettings:
    """Required confidence and sizes.

    Attributes:
        false_alarm: readiness to accept a name: its prior odds are in proportion.
        structure: p-value of an axis below which something follows it for certain.
        practical_share, practical_length: change of a stop, as a share of it and [m], of which the
            larger has to be reached by a named effect.
        noisy_share: share of a stop. Where half of all effects would have to change stops by more
            than that to be seen, an empty finding carries no information.
        resamples: draws of stops for stability and confidence intervals.
        folds: parts of the log, each predicted by a fit to the others.
        seed: of every random number.
        stops: definition of a stop.
    """

    false_alarm: float = _CALIBRATED_AT
    structure: float = 0.002
    practical_share: float = 0.01
    practical_length: float = 0.02
    noisy_share: float = 0.10
    resamples: int = 200
    folds: int = 5
    seed: int = 20
    stops: StopSettings = field(default_factory=_stops)

    def __post_init__(self) -> None:
        if not 0.0 < self.false_alarm < 0.5:
            raise ParameterError("false_alarm", f"a share in (0, 0.5), got {self.false_alarm:g}")
        for name in ("practical_share", "practical_length", "noisy_share"):
            value = getattr(self, name)
            if not 0.0 <= value < 1.0:
                raise ParameterError(name, f"a number in [0, 1), got {value:g}")

    @property
    def odds(self) -> float:
        """Odds of a cause before the log, over those that answers were calibrated with."""
        return self.false_alarm / _CALIBRATED_AT
