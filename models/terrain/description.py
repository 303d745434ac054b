"""Two words for the ground: hard or soft from f_r, gripping or slippery from turning thrust.

Each is stated where the mean logarithm of the last seconds lies beyond the vehicle's threshold by
as many standard deviations as asked for; between them the ground is undecided. The spread counts
the scatter of stretches and of runs on one ground. A change of ground is a word that turns into its
opposite. Names of classes are no part of it: see :mod:`.agreement`.

Validity: the vehicle and load that the thresholds were made with. Omits: ground that differs in
neither resistance; slippery is seen in turns only. Source: BorealTC, decision 28.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.quantity import Quantities, positive, quantity
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.evidence import EvidenceWindow, MeanEvidence
from slopewise.models.terrain.observation import GroundObservation
from slopewise.models.vehicle import Vehicle

UNDECIDED = "undecided"
HARDNESS = ("hard", "soft")
GRIP = ("slippery", "gripping")
"""Texts below and above the threshold of f_r, and of turning thrust."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThresholdSettings(Quantities):
    """Thresholds of the two descriptions, and how certain a statement is.

    Attributes:
        soft_above: f_r at 0.3 m/s [1]; None: ground is neither called hard nor soft.
        slippery_below: turning thrust μ_t + (B/L) f_r [1]; None: neither slippery nor gripping.
    """

    soft_above: float | None = positive(
        "1", "f_r that separates hard from soft ground.", default=None
    )
    slippery_below: float | None = positive(
        "1", "Turning thrust that separates slippery from gripping.", default=None
    )
    motion_run_std: float = positive(
        "1", "Scatter of ln f_r from run to run on one ground.", default=0.17
    )
    turning_run_std: float = positive(
        "1", "Scatter of the turning thrust's logarithm likewise.", default=0.13
    )
    stated: float = positive(
        "1", "Standard deviations beyond a threshold that are stated.", default=1.0
    )
    relied_on: float = positive(
        "1", "Standard deviations that plans rely on: one-sided 95 %.", default=1.64
    )
    change: float = positive(
        "1", "Standard deviations on either side that are a change.", default=1.0
    )
    seconds: float = quantity("s", "Latest driving that is described.", default=12.0, at_least=1.0)
    change_seconds: float = quantity(
        "s", "Latest driving that shows a change.", default=6.0, at_least=1.0
    )


@dataclass(frozen=True, slots=True)
class GroundDescription:
    """The two words; scores are standard deviations above a threshold, NaN without evidence."""

    hardness: str = UNDECIDED
    grip: str = UNDECIDED
    hardness_score: float = math.nan  # positive: soft
    grip_score: float = math.nan  # positive: gripping

    @property
    def is_decided(self) -> bool:
        """True if neither is undecided."""
        return UNDECIDED not in (self.hardness, self.grip)

    def __str__(self) -> str:
        decided = [text for text in (self.hardness, self.grip) if text != UNDECIDED]
        return ", ".join(decided) or UNDECIDED


@dataclass(frozen=True, slots=True)
class GroundChange:
    """A description turned into its opposite: `hard` and `soft`, or `gripping` and `slippery`."""

    time: float  # end of the stretch that showed it [s]; the change is up to six seconds back
    strength: float  # standard deviations beyond the threshold over those of a change, above 1
    before: str
    now: str
    again: bool = False  # within ten seconds of another: patchy ground, or a return


_AGAIN = 10.0
"""Changes nearer to each other are patches of one ground [s]."""


class GroundDescriber:
    """Describes the ground of one run; one thread."""

    def __init__(self, settings: ThresholdSettings) -> None:
        """Begin without evidence."""
        self._settings = settings
        self.window = EvidenceWindow(max(settings.seconds, settings.change_seconds))
        self._axes = (
            ("motion", settings.soft_above, settings.motion_run_std, HARDNESS),
            ("turning", settings.slippery_below, settings.turning_run_std, GRIP),
        )
        self.begin_run()

    def begin_run(self) -> None:
        """Another run, perhaps on other ground."""
        self.window.drop_before(math.inf)
        self._lasting: dict[str, str] = {}
        self._changed_at = -math.inf

    def add(self, observation: GroundObservation) -> tuple[GroundChange, ...]:
        """Add a stretch; the change that it shows, if any."""
        self.window.add(observation)
        since = observation.end - self._settings.change_seconds
        changes = []
        for axis, threshold, run_std, texts in self._axes:
            score = _score(self.window.mean(axis, since), threshold, run_std)
            text = _text(score, self._settings.change, texts)
            if text == UNDECIDED:
                continue
            before = self._lasting.get(axis, text)
            self._lasting[axis] = text
            if text != before:
                strength = abs(score) / self._settings.change
                again = observation.end - self._changed_at < _AGAIN
                changes.append(GroundChange(observation.end, strength, before, text, again))
                self._changed_at = observation.end
        if changes:
            # The other word may have changed as well: it begins again with the new ground.
            self._lasting = {
                k: v for k, v in self._lasting.items() if v in {c.now for c in changes}
            }
            self.window.drop_before(since)
        return tuple(changes)

    def describe(self, *, relied_on: bool = False) -> GroundDescription:
        """Description of the last seconds, as certain as plans rely on if asked for."""
        settings = self._settings
        level = settings.relied_on if relied_on else settings.stated
        since = self.window.time - settings.seconds
        scores = [_score(self.window.mean(axis, since), x, std) for axis, x, std, _ in self._axes]
        hardness, grip = _text(scores[0], level, HARDNESS), _text(scores[1], level, GRIP)
        return GroundDescription(hardness, grip, *scores)


def _score(mean: MeanEvidence | None, threshold: float | None, run_std: float) -> float:
    """Standard deviations above a threshold; NaN without evidence or threshold."""
    if mean is None or threshold is None:
        return math.nan
    return (mean.log - math.log(threshold)) / math.sqrt(run_std**2 + mean.variance)


def _text(score: float, level: float, texts: tuple[str, str]) -> str:
    if not abs(score) >= level:
        return UNDECIDED
    return texts[score > 0.0]


def open_surfaces(
    classes: TerrainClasses,
    settings: ThresholdSettings,
    vehicle: Vehicle,
    description: GroundDescription,
) -> tuple[str, ...]:
    """Names of the classes that a description does not contradict."""
    lever = vehicle.track_width / vehicle.wheelbase
    names = []
    for terrain in classes.terrain:
        f_r, mu_t = terrain.motion_resistance, terrain.lateral_resistance
        rolling = None if f_r is None else f_r.mean
        turning = None if f_r is None or mu_t is None else mu_t.mean + lever * f_r.mean
        sides = (
            (description.hardness, HARDNESS, settings.soft_above, rolling),
            (description.grip, GRIP, settings.slippery_below, turning),
        )
        if all(
            text == UNDECIDED or value is None or limit is None or text == texts[value > limit]
            for text, texts, limit, value in sides
        ):
            names.append(terrain.name)
    return tuple(names)
