"""Everything at once: parameters, class and changes of terrain, sample by sample.

What a robot runs while it drives, and what a log is sent through afterwards: the same code.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from models.parameters import Model
from models.terrain.adaptation import AdaptiveClassifier
from models.terrain.change import ChangeDetector, ChangeSettings
from models.terrain.classes import RuleAnswer, TerrainClasses, by_rules
from models.terrain.classifier import Classification, ClassifierSettings, TerrainClassifier
from models.terrain.estimator import DriveSample, TerrainEstimator
from models.terrain.observation import GroundObservation
from models.terrain.phases import Phase
from models.terrain.resistances import TerrainEstimate
from models.terrain.settings import EstimatorSettings
from models.terrain.windows import summarise

_WINDOW = 1.0  # [s]
_ASSUMED_STD = 0.1  # of the model's f_r before the first straight


@dataclass(frozen=True, slots=True)
class GroundChange:
    """The ground changed.

    Attributes:
        time: when it was noticed [s]; it lies up to five seconds of driving back.
        strength: statistic over its threshold, above 1.
    """

    time: float
    strength: float


@dataclass(frozen=True, slots=True)
class Classified:
    """An observation with its class.

    Attributes:
        observation: what was measured.
        answer: of the classifier; its name is empty where nothing is known, and while stuck.
        rules: of the expert rules.
    """

    observation: GroundObservation
    answer: Classification
    rules: RuleAnswer


Event = Classified | GroundChange


class TerrainMonitor:
    """Estimator, classifier and detector of changes of one vehicle.

    Attributes:
        estimator: parameters of the ground.
        adaptive: classes that learn; None if they are to stay as they are.
    """

    def __init__(
        self,
        model: Model,
        classes: TerrainClasses,
        *,
        estimator: EstimatorSettings | None = None,
        classifier: ClassifierSettings | None = None,
        change: ChangeSettings | None = None,
        adaptive: AdaptiveClassifier | None = None,
        rates: int = 0,
    ) -> None:
        """Begin.

        Args:
            model: vehicle, and the terrain to begin with.
            classes: what is known.
            estimator, classifier, change: settings.
            adaptive: classifier that goes on learning, in place of fixed classes.
            rates: rates of turn in each sample beside the yaw rate, such as roll and pitch rate.

        Raises:
            ParameterError: the vehicle has no motor constants.
        """
        self._settings = EstimatorSettings() if estimator is None else estimator
        self.estimator = TerrainEstimator(
            model.vehicle,
            slip_track=model.terrain.slip_track,
            motion_resistance=TerrainEstimate(model.terrain.motion_resistance, _ASSUMED_STD),
            settings=self._settings,
        )
        self.adaptive = adaptive
        self._fixed = TerrainClassifier(classes, classifier)
        self._classes = classes
        self._change = ChangeDetector(1 + rates, change)
        self._window: list[tuple[float, ...]] = []
        self._window_end = -np.inf
        self._whole = True

    def begin_run(self) -> None:
        """Another run: perhaps other ground."""
        self.estimator.begin_run()
        self._change.begin()
        self._window = []
        self._window_end = -np.inf

    def update(
        self, sample: DriveSample, usable: bool = True, rates: tuple[float, ...] = ()
    ) -> tuple[Event, ...]:
        """One sample; see :meth:`TerrainEstimator.update`.

        Args:
            sample: what the estimator sees. usable: False excludes the sample.
            rates: further rates of turn [rad/s], as many as announced.

        Returns:
            What it completes; mostly nothing.
        """
        done = self.estimator.update(sample, usable)
        time, v_left, v_right, yaw_rate, current_left, current_right, pitch, _ = sample
        change = self._watch(time) if time >= self._window_end else None
        seen = (v_left, v_right, current_left, current_right, pitch, yaw_rate, *rates)
        self._window.append(seen)
        if not (usable and isfinite(sum(seen))) or self.estimator.phases.phase is Phase.STUCK:
            self._whole = False
        if done is None and change is None:
            return ()
        events: tuple[Event, ...] = () if done is None else (self._classified(done),)
        if change is not None:
            self.estimator.forget()
            events = (*events, change)
        return events

    def finish(self) -> tuple[Event, ...]:
        """The stretch that the run ended in."""
        done = self.estimator.finish()
        return () if done is None else (self._classified(done),)

    def _watch(self, time: float) -> GroundChange | None:
        """Close the window of the last second and compare it, if nothing is missing in it."""
        samples = self._window
        whole = self._whole and time - self._window_end < 0.5 * _WINDOW
        self._window, self._window_end, self._whole = [], time + _WINDOW, True
        if not (samples and whole):
            return None
        motion = self._settings.motion
        window = summarise(np.array(samples), motion.least_inner_speed, motion.turn_end)
        strength = None if window is None else self._change.update(window)
        return None if strength is None else GroundChange(time, strength)

    def _classified(self, observation: GroundObservation) -> Classified:
        known = observation.known
        if observation.phase is Phase.STUCK:
            nothing = (np.nan, np.nan, np.nan)
            return Classified(
                observation, self._fixed.classify(nothing), by_rules(self._classes, nothing)
            )
        if self.adaptive is None:
            answer = self._fixed.classify(known.values, known.stds)
            return Classified(observation, answer, by_rules(self._classes, known.values))
        classes = self.adaptive.classes
        answer = self.adaptive.observe(known.values, known.stds)
        return Classified(observation, answer, by_rules(classes, known.values))
