"""Classes that adapt: to a label, to slow change, and to ground that was never seen.

A class keeps count, mean and spread of each feature and forgets with a memory of so many
observations, so that it follows another season or other tyres. What is none of the known classes is
kept aside, and so is what fits one but for a feature: gross errors scatter, new ground repeats
itself. Once enough lies close together, density clustering makes a class of it, to be named later.
Slip, Sec. 4.2, asks for this and leaves it open. Source: running moments; HDBSCAN of Campello,
Moulavi and Sander (2013) as scikit-learn has it.

Validity: changes slower than the memory. Only sure answers teach a class, which by itself would
narrow it; a class's spread therefore never falls below a share of what it was given.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClass, TerrainClasses
from slopewise.models.terrain.classifier import (
    NONE,
    Classification,
    ClassifierSettings,
    TerrainClassifier,
)

Values = tuple[float, float, float]

_ENOUGH = 2  # features that an answer rests on before it teaches
_CLOSE = 3.0  # times the usual spread of a class: a cluster wider than that is no one ground
_USUAL = 0.15  # of the mean: spread of a class while none is known


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationSettings:
    """How fast classes change and arise."""

    memory: float = quantity(
        "1", "Observations that a class remembers.", default=50.0, at_least=3.0
    )
    sure: float = quantity(
        "1", "An answer this probable teaches its class.", default=0.9, above=0.5, at_most=1.0
    )
    least_spread: float = quantity(
        "1", "Share of its spread that a class keeps without labels.", default=0.7, above=0.0
    )
    new_class: float = quantity(
        "1", "Observations that make a new class.", default=6.0, at_least=3.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)


class AdaptiveClassifier:
    """A classifier whose classes change with what it is shown.

    Attributes:
        classes: as they are now.
        aside: observations of no known class that wait for more like them.
    """

    def __init__(
        self,
        classes: TerrainClasses,
        settings: AdaptationSettings | None = None,
        classifier: ClassifierSettings | None = None,
    ) -> None:
        """Begin with some classes, perhaps none."""
        self._settings = AdaptationSettings() if settings is None else settings
        self._classifier_settings = classifier
        self._given = {one.name: one for one in classes.terrain}
        self.aside: list[Values] = []
        self._waiting: dict[str, list[Values]] = {}
        self._replace(classes)

    def _replace(self, classes: TerrainClasses) -> None:
        self.classes = classes
        self._classifier = TerrainClassifier(classes, self._classifier_settings)

    def observe(self, values: Values, stds: Values) -> Classification:
        """Classify, and learn from it.

        Args:
            values: (f_r, μ_t, B_s), NaN where not known.
            stds: of the values.

        Returns:
            What the classes of before say; a new class answers from the next observation on.
        """
        answer = self._classifier.classify(values, stds)
        if answer.name == NONE or answer.doubtful:
            if np.isfinite(values).all():
                self.aside.append(values)
                self._look_for_new_classes()
        elif answer.probability >= self._settings.sure and np.isfinite(values).sum() >= _ENOUGH:
            self._update(answer.name, values, labelled=False)
        return answer

    def learn(self, name: str, values: Values) -> None:
        """One observation whose class is known; an unknown name begins a class.

        A class begins with as many observations as make a new one.
        """
        self._update(name, values, labelled=True)

    def rename(self, old: str, new: str) -> None:
        """Name a class that arose by itself.

        Raises:
            ParameterError: there is none of that name, or the new one is taken.
        """
        names = [one.name for one in self.classes.terrain]
        if old not in names:
            raise ParameterError("terrain", f"one of {', '.join(names)}, got {old}")
        terrain = tuple(
            dataclasses.replace(one, name=new) if one.name == old else one
            for one in self.classes.terrain
        )
        self._given[new] = self._given.pop(old)
        self._replace(dataclasses.replace(self.classes, terrain=terrain))

    def _update(self, name: str, values: Values, *, labelled: bool) -> None:
        terrain = {one.name: one for one in self.classes.terrain}
        if name not in terrain:
            self._first(name, values)
            return
        features = terrain[name].features
        given = self._given[name].features
        moved = [
            feature
            if feature is None or first is None or not math.isfinite(value)
            else self._moved(feature, value, None if labelled else first)
            for feature, first, value in zip(features, given, values, strict=True)
        ]
        terrain[name] = TerrainClass(
            name=name,
            motion_resistance=moved[0],
            lateral_resistance=moved[1],
            slip_track=moved[2],
        )
        self._replace(dataclasses.replace(self.classes, terrain=tuple(terrain.values())))

    def _first(self, name: str, values: Values) -> None:
        """A label that has no class yet: wait for enough observations of it."""
        waiting = self._waiting.setdefault(name, [])
        waiting.append(values)
        if len(waiting) >= int(self._settings.new_class):
            self._add(name, self._waiting.pop(name))

    def _moved(
        self, feature: FeatureOfClass, value: float, given: FeatureOfClass | None
    ) -> FeatureOfClass:
        """Running mean and variance with one more value."""
        count = min(feature.samples + 1.0, self._settings.memory)
        off = value - feature.mean
        variance = feature.std**2 * (count - 2.0) / (count - 1.0) + off**2 / count
        std = math.sqrt(variance)
        if given is not None:
            std = max(std, self._settings.least_spread * given.std)
        return dataclasses.replace(feature, mean=feature.mean + off / count, std=std, samples=count)

    def _add(self, name: str, rows: Sequence[Values]) -> None:
        found = class_of(name, np.array(rows))
        self._given[name] = found
        self._replace(dataclasses.replace(self.classes, terrain=(*self.classes.terrain, found)))

    def _look_for_new_classes(self) -> None:
        """Clusters among what was put aside become classes; the rest goes on waiting."""
        least = int(self._settings.new_class)
        if len(self.aside) < least:
            return
        rows = np.array(self.aside)
        scale = self._scale(rows)
        labels = clusters(rows, scale, least)
        for label in range(labels.max() + 1):
            together = rows[labels == label]
            if np.any(np.std(together, axis=0) > _CLOSE * scale):
                labels[labels == label] = -1
                continue
            self._add(self._free_name(), [tuple(row) for row in together.tolist()])
        self.aside = [tuple(row) for row in rows[labels < 0].tolist()]

    def _scale(self, rows: Floats) -> Floats:
        """Usual spread of each feature within a class."""
        columns = zip(*(one.features for one in self.classes.terrain), strict=True)
        spreads = [[f.std for f in column if f is not None] for column in columns]
        if not spreads or not all(spreads):
            return np.asarray(np.fmax(_USUAL * np.abs(np.mean(rows, axis=0)), 1e-6))
        return np.array([float(np.median(spread)) for spread in spreads])

    def _free_name(self) -> str:
        taken = {one.name for one in self.classes.terrain}
        return next(name for i in range(1, 10_000) if (name := f"new_{i}") not in taken)


def class_of(name: str, rows: Floats) -> TerrainClass:
    """A class from observations (n, 3), NaN where not known; a feature needs two values."""
    return TerrainClass(
        name=name,
        motion_resistance=_feature(rows[:, 0]),
        lateral_resistance=_feature(rows[:, 1]),
        slip_track=_feature(rows[:, 2]),
    )


def _feature(column: Floats) -> FeatureOfClass | None:
    known = column[np.isfinite(column)]
    if len(known) < 2:
        return None
    mean, spread = float(np.mean(known)), float(np.std(known, ddof=1))
    # values that agree to the last digit are copies, not certainty
    return FeatureOfClass(mean=mean, std=max(spread, 1e-3 * abs(mean), 1e-6), samples=len(known))


def classes_of(name: str, labels: Sequence[str], rows: Floats) -> TerrainClasses:
    """Classes from labelled observations, for another vehicle or season.

    Args:
        name: of the set.
        labels: (n) names of classes; an empty one is left out.
        rows: (n, 3) features, NaN where not known.
    """
    array = np.array(labels)
    names = [label for label in dict.fromkeys(labels) if label]
    return TerrainClasses(name=name, terrain=tuple(class_of(n, rows[array == n]) for n in names))


def clusters(rows: Floats, scale: Floats, least: int) -> Ints:
    """(n,) cluster of each observation, −1 for none.

    Args:
        rows: (n, 3) complete observations.
        scale: (3,) usual spread of each feature.
        least: observations that make a cluster.

    Raises:
        ParameterError: scikit-learn is not installed.
    """
    try:
        from sklearn.cluster import HDBSCAN
    except ImportError:
        raise ParameterError(
            "--adapt", "scikit-learn for new classes, got none: pip install '.[learn]' in a clone"
        ) from None
    model = HDBSCAN(min_cluster_size=least, allow_single_cluster=True, copy=True)
    labels: Ints = model.fit_predict(rows / scale)
    return labels
