"""Everything at once: parameters, class and changes of terrain, sample by sample.

What a robot runs while it drives, and what a log is sent through afterwards: the same code.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from slopewise.models.parameters import Model
from slopewise.models.terrain.adaptation import AdaptiveClassifier
from slopewise.models.terrain.change import ChangeDetector, ChangeSettings
from slopewise.models.terrain.classes import RuleAnswer, TerrainClasses, by_rules
from slopewise.models.terrain.classifier import (
    NONE,
    Classification,
    ClassifierSettings,
    TerrainClassifier,
)
from slopewise.models.terrain.estimator import DriveSample, TerrainEstimator
from slopewise.models.terrain.observation import Features, GroundObservation
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.resistances import TerrainEstimate
from slopewise.models.terrain.settings import EstimatorSettings
from slopewise.models.terrain.signature_memory import MemorySettings
from slopewise.models.terrain.signature_model import SignatureModel
from slopewise.models.terrain.signature_watch import SignatureWatch
from slopewise.models.terrain.windows import summarise

_WINDOW = 1.0  # [s]
_PATCHY = 10.0  # [s] changes nearer to each other are patches of one
_ASSUMED_STD = 0.1  # of the model's f_r before the first straight
SURE = 0.9
"""A class this probable is believed: two of them one after the other are a change of ground."""


@dataclass(frozen=True, slots=True)
class GroundChange:
    """The ground changed.

    Attributes:
        time: when it was noticed [s]; it lies up to five seconds of driving back.
        strength: statistic over its threshold, above 1; where classes tell it, the new one's
            probability over what was asked of it.
        classes: (before, now) where two sure classes after each other tell it, else none.
        again: another change was told within ten seconds before: patchy ground, or the way back.
    """

    time: float
    strength: float
    classes: tuple[str, str] | None = None
    again: bool = False


@dataclass(frozen=True, slots=True)
class Classified:
    """An observation with its class.

    Attributes:
        observation: what was measured.
        answer: of the classifier; its name is empty where nothing is known, and while stuck. With a
            signature model it is the signatures' answer.
        rules: of the expert rules.
        by_parameters: what f_r, μ_t and B_s alone say; the answer itself without signatures.
    """

    observation: GroundObservation
    answer: Classification
    rules: RuleAnswer
    by_parameters: Classification


Event = Classified | GroundChange


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """Of a monitor and its parts.

    Attributes:
        estimator, classifier, change: of these; the parts' own where None.
        memory: how long the ground is taken to last, for signatures.
        rates: rates of turn in each sample beside the yaw rate, such as roll and pitch rate.
        keep_signatures: of a run, for who learns from it.
    """

    estimator: EstimatorSettings = field(default_factory=EstimatorSettings)
    classifier: ClassifierSettings | None = None
    change: ChangeSettings | None = None
    memory: MemorySettings | None = None
    rates: int = 0
    keep_signatures: bool = False


class TerrainMonitor:
    """Estimator, classifier and detector of changes of one vehicle.

    Attributes:
        estimator: parameters of the ground.
        adaptive: classes that learn; None if they are to stay as they are.
        signatures: of the run, with answers where there is a signature model.
        change: what follows the run second by second.
    """

    def __init__(
        self,
        model: Model,
        classes: TerrainClasses,
        settings: MonitorSettings | None = None,
        *,
        adaptive: AdaptiveClassifier | None = None,
        signatures: SignatureModel | None = None,
    ) -> None:
        """Begin.

        Args:
            model: vehicle, and the terrain to begin with.
            classes: what is known.
            settings: of its parts.
            adaptive: classifier that goes on learning, in place of fixed classes.
            signatures: classes told from all that is felt, in place of the three parameters alone.

        Raises:
            ParameterError: the vehicle has no motor constants.
        """
        wanted = MonitorSettings() if settings is None else settings
        self._settings = wanted.estimator
        self.estimator = TerrainEstimator(
            model.vehicle,
            slip_track=model.terrain.slip_track,
            motion_resistance=TerrainEstimate(model.terrain.motion_resistance, _ASSUMED_STD),
            settings=self._settings,
        )
        self.adaptive = adaptive
        self._fixed = TerrainClassifier(classes, wanted.classifier)
        self._classes = classes
        self.change = ChangeDetector(1 + wanted.rates, wanted.change)
        self._rates = wanted.rates
        motion = self._settings.motion
        self.signatures = SignatureWatch(
            model.vehicle,
            (motion.least_inner_speed, motion.turn_end),
            signatures,
            wanted.memory,
            keep=wanted.keep_signatures,
        )
        self._sure = ""
        self._changed_at = -np.inf
        self._window: list[tuple[float, ...]] = []
        self._window_end = -np.inf
        self._whole = True

    def begin_run(self) -> None:
        """Another run: perhaps other ground."""
        self.estimator.begin_run()
        self.change.begin()
        self.signatures.begin_run()
        self._sure = ""
        self._changed_at = -np.inf
        self._window = []
        self._window_end = -np.inf

    def update(
        self,
        sample: DriveSample,
        usable: bool = True,
        rates: tuple[float, ...] = (),
        accelerations: tuple[float, ...] = (),
    ) -> tuple[Event, ...]:
        """One sample; see :meth:`TerrainEstimator.update`.

        Args:
            sample: what the estimator sees. usable: False excludes the sample.
            rates: further rates of turn [rad/s], as many as announced.
            accelerations: along x, y, z [m/s²], gravity included; none if not measured.

        Returns:
            What it completes; mostly nothing.
        """
        done = self.estimator.update(sample, usable)
        time, v_left, v_right, yaw_rate, current_left, current_right, pitch, _ = sample
        changes = self._watch(time) if time >= self._window_end else ()
        seen = (
            v_left,
            v_right,
            current_left,
            current_right,
            pitch,
            yaw_rate,
            *rates,
            *accelerations,
        )
        self._window.append(seen)
        if not (usable and isfinite(sum(seen))) or self.estimator.phases.phase is Phase.STUCK:
            self._whole = False
        if done is None:
            return changes
        return (*self._classified(done), *changes)

    def finish(self) -> tuple[Event, ...]:
        """The stretch that the run ended in."""
        self.signatures.close()
        done = self.estimator.finish()
        return () if done is None else self._classified(done)

    def _watch(self, time: float) -> tuple[GroundChange, ...]:
        """Close the window of the last second and compare it, if nothing is missing in it."""
        samples = self._window
        whole = self._whole and time - self._window_end < 0.5 * _WINDOW
        self._window, self._window_end, self._whole = [], time + _WINDOW, True
        if not samples:
            return ()
        seen = np.array(samples)
        answer = self.signatures.second(seen if whole else None, self._rates)
        if self.signatures.change is not None:
            before, now, ratio = self.signatures.change
            self.estimator.forget()
            self.change.restart()
            return (self._changed(time, ratio, (before, now)),)
        if not whole:
            return ()
        motion = self._settings.motion
        felt = seen[:, : 6 + self._rates]
        window = summarise(felt, motion.least_inner_speed, motion.turn_end)
        strength = None if window is None else self.change.update(window)
        if strength is not None:
            self.estimator.forget()
            self.signatures.begin()
            return (self._changed(time, strength, None),)
        return () if answer is None else self._told(answer, time)

    def _changed(
        self, time: float, strength: float, classes: tuple[str, str] | None
    ) -> GroundChange:
        """A change, with what to remember of it."""
        again = time - self._changed_at < _PATCHY
        self._changed_at = time
        self._sure = "" if classes is None else classes[1]
        return GroundChange(time, strength, classes, again)

    def _told(
        self, answer: Classification, time: float, own: Features | None = None
    ) -> tuple[GroundChange, ...]:
        """A change, if a sure class follows another sure one.

        Args:
            answer: the latest. time: of it. own: what was measured with it.
        """
        if answer.name in ("", NONE) or not answer.probability >= SURE:
            return ()
        before, self._sure = self._sure, answer.name
        if before in ("", answer.name):
            return ()
        self.estimator.forget(own)
        return (self._changed(time, answer.probability / SURE, (before, answer.name)),)

    def _classified(self, observation: GroundObservation) -> tuple[Event, ...]:
        found = self._class_of(observation)
        if observation.phase is Phase.STUCK:
            return (found,)
        return (found, *self._told(found.answer, observation.end, observation.own))

    def _class_of(self, observation: GroundObservation) -> Classified:
        known = observation.known
        if observation.phase is Phase.STUCK:
            nothing = (np.nan, np.nan, np.nan)
            answer = self._fixed.classify(nothing)
            return Classified(observation, answer, by_rules(self._classes, nothing), answer)
        if self.adaptive is None:
            classes = self._classes
            answer = self._fixed.classify(known.values, known.stds)
        else:
            classes = self.adaptive.classes
            answer = self.adaptive.observe(known.values, known.stds)
        told = self.signatures.answer
        rules = by_rules(classes, known.values)
        return Classified(observation, answer if told is None else told, rules, answer)
