"""Everything together: parameters, description and changes of the ground, sample by sample.

A robot runs it while it drives, and logs are sent through it afterwards: the same code.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from slopewise.models.parameters import Model
from slopewise.models.terrain.agreement import ALPHA, agreement, name_of
from slopewise.models.terrain.classes import TerrainClasses, by_rules
from slopewise.models.terrain.description import (
    GroundChange,
    GroundDescriber,
    GroundDescription,
    ThresholdSettings,
    open_surfaces,
)
from slopewise.models.terrain.estimator import DriveSample, TerrainEstimator
from slopewise.models.terrain.observation import GroundObservation, TerrainEstimate
from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.settings import EstimatorSettings
from slopewise.models.terrain.vehicle_check import VehicleCheck

_ASSUMED_STD = 0.1
"""Standard deviation of the model's f_r before the first straight [1]: asphalt to sand."""


@dataclass(frozen=True, slots=True)
class DescribedStretch:
    """A stretch with the description of the ground once it ends.

    Attributes:
        observation: its measurements.
        description: description of the last seconds.
        p_values: agreement by class.
        agrees_with: classes that are not rejected, in their order; empty while stuck.
        name: the single class where one may be named, else empty.
        rules: class by the paper's table, for its vehicle and site; empty without one.
    """

    observation: GroundObservation
    description: GroundDescription
    p_values: dict[str, float]
    agrees_with: tuple[str, ...]
    name: str
    rules: str

    @property
    def is_stuck(self) -> bool:
        """True if the wheels spin: nothing is learned of the ground."""
        return self.observation.phase is Phase.STUCK


Event = DescribedStretch | GroundChange


class TerrainMonitor:
    """Estimator and description of the ground under one vehicle; one thread.

    Attributes:
        estimator: parameters of the ground.
        describer: description and changes.
        vehicle_check: whether the vehicle file can be right for what was measured.
    """

    def __init__(
        self,
        model: Model,
        classes: TerrainClasses,
        thresholds: ThresholdSettings | None = None,
        settings: EstimatorSettings | None = None,
    ) -> None:
        """Begin; ParameterError if the vehicle has no motor constants.

        Args:
            model: vehicle, and the terrain to begin with.
            classes: known classes of terrain.
            thresholds: those of the vehicle; without, nothing is stated.
            settings: those of the estimator.
        """
        self._model, self._classes = model, classes
        self._thresholds = ThresholdSettings() if thresholds is None else thresholds
        self.estimator = TerrainEstimator(
            model.vehicle,
            slip_track=model.terrain.slip_track,
            motion_resistance=TerrainEstimate(model.terrain.motion_resistance, _ASSUMED_STD),
            settings=settings,
        )
        self.describer = GroundDescriber(self._thresholds)
        self.vehicle_check = VehicleCheck(model.vehicle)

    def begin_run(self) -> None:
        """Another run, perhaps on other ground."""
        self.estimator.begin_run()
        self.describer.begin_run()

    def update(self, sample: DriveSample, usable: bool = True) -> tuple[Event, ...]:
        """One sample, see :meth:`.TerrainEstimator.update`; what it completes, mostly nothing."""
        done = self.estimator.update(sample, usable)
        if self.estimator.phases.phase is not Phase.REST:  # at rest the ground stays the same
            self.describer.window.expire(sample.time)
        return () if done is None else self._describe(done)

    def finish(self) -> tuple[Event, ...]:
        """The stretch that the run ended in."""
        done = self.estimator.finish()
        return () if done is None else self._describe(done)

    def open_surfaces(self) -> tuple[str, ...]:
        """Classes that the description, as certain as plans rely on, does not contradict."""
        description = self.describer.describe(relied_on=True)
        return open_surfaces(self._classes, self._thresholds, self._model.vehicle, description)

    def _describe(self, observation: GroundObservation) -> tuple[Event, ...]:
        classes, window = self._classes, self.describer.window
        if observation.phase is Phase.STUCK:
            return (DescribedStretch(observation, GroundDescription(), {}, (), "", ""),)
        self.vehicle_check.add(observation)
        changes = self.describer.add(observation)
        if changes:
            self.estimator.forget(observation.measured)
            observation = dataclasses.replace(observation, known=self.estimator.known)
        p_values = agreement(classes, window)
        stretch = DescribedStretch(
            observation,
            self.describer.describe(),
            p_values,
            tuple(label for label, p_value in p_values.items() if p_value > ALPHA),
            name_of(classes, window, p_values),
            by_rules(classes, observation.known.values),
        )
        return (*changes, stretch)
