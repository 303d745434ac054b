"""Unknown quantities, and the share of them that a plan survives.

Braking coefficients come with a covariance, stops scatter around them, maps are noisy, and what was
learned ages. All of it becomes a margin on the braking force, on the dead time and on the
loads, at a quantile that the user chooses. None raises a bound of the same station; where loads
slow a plan on a crest, stops from before it keep more of their brakes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from slopewise.models.arrays import Floats
from slopewise.models.effects.effect_law import Enters
from slopewise.models.effects.registry import LAWS, validate
from slopewise.models.input_errors import InputErrors, input_errors
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.quantity import GRAVITY, quantity, validate_quantities
from slopewise.models.stop_promise import promised

HOUR = 3600.0
"""[s]"""

QUANTILE = 0.999
"""Default of plans, offline as on the vehicle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Deviations from the model's mean that a plan survives."""

    quantile: float = quantity(
        "1",
        "One-sided quantile that stopping path and loads survive.",
        default=QUANTILE,
        at_least=0.5,
        at_most=0.999999,
    )
    slope_std: float = quantity(
        "rad", "Error of the map's grade and roll.", default=0.0, at_least=0.0, at_most=0.2
    )
    age: float = quantity("s", "Since the parameters were learned.", default=0.0, at_least=0.0)
    drift: float = quantity(
        "1/h^½", "Growth of the error of F_b/W with the root of age.", default=0.01, at_least=0.0
    )
    untrained_share: float = quantity(
        "1",
        "Share of the weakest known force that counts on surfaces never braked on.",
        default=0.6,
        above=0.0,
        at_most=1.0,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)

    @property
    def width(self) -> float:
        """How many standard deviations the quantile is away from the mean."""
        return float(ndtri(self.quantile))

    def force_matrix(self, braking: Braking) -> Floats:
        """(4, 4) matrix S with (margin of F_b/W)² = φᵀ S φ, φ = (θ v_i, θ, v_i, 1).

        Covariance, scatter, age, and what an error of the grade does to force and weight. Scatter
        in proportion to the force, r φᵀ β, adds r² β βᵀ.
        """
        learned = np.zeros((4, 4)) if braking.covariance is None else np.array(braking.covariance)
        applied = braking.share_at()
        learned = learned * applied**2
        learned[3, 3] += braking.force_std**2 + self.drift**2 * self.age / HOUR
        # Where the slope coefficients differ uphill, the sum of both is above either.
        shared = applied * braking.force_scatter
        slopes = [(braking.m_m, braking.b_m)]
        if braking.uphill is not None:
            slopes.append((braking.uphill.m_m, braking.uphill.b_m))
        for m_m, b_m in slopes:
            change = np.array([0.0, 0.0, applied * m_m, 1.0 + applied * b_m])
            force = shared * np.array([m_m, b_m, braking.m_b, braking.b_b])
            learned = learned + self.slope_std**2 * np.outer(change, change)
            learned = learned + np.outer(force, force)
        matrix: Floats = self.width**2 * learned
        return matrix

    def dead_time(self, braking: Braking) -> float:
        """Dead time that is rarely exceeded [s]."""
        return braking.dead_time + self.width * braking.dead_time_std

    def load_margin(self, model: Model) -> float:
        """By how much an error of grade or roll may unload an axle or a side.

        A share of load is cos θ ± (cg_z / lever) sin θ: no slope changes it faster than the root of
        1 + (cg_z / lever)². Source: Braking (5), Slip (18)-(21), sines corrected.
        """
        v = model.vehicle
        shorter = min(v.cg_x, v.wheelbase - v.cg_x, 0.5 * v.track_width)
        return self.width * self.slope_std * float(np.hypot(1.0, v.cg_z / shorter))

    def cautious(self, model: Model) -> Model:
        """The model with promised stop distances, and limits and effects where stops are longer.

        Friction is not moved here: its lower end caps the force that stops the vehicle, its upper
        end the one that unloads the rear axle
        (:func:`slopewise.planner.ground.surfaces.frictions`).
        """
        model = promised(model, self.quantile)
        margin = self.load_margin(model)
        limits = replace(model.limits, min_load=min(model.limits.min_load + margin, 0.9))
        effects = tuple(self._weaker(e) for e in model.effect)
        return replace(model, limits=limits, effect=effects)

    def _weaker(self, effect: Effect) -> Effect:
        """Keeps the covariance: the loads have to survive the other end."""
        law = LAWS[effect.name]
        if law.enters is Enters.CAP:
            return effect
        parameters = dict(effect.parameters)
        for name, parameter in law.parameters.items():
            sign = parameter.longer_stop
            if sign:
                moved = parameters[name] + sign * self.margin_of(effect, name)
                parameters[name] = max(moved, 1e-9) if sign < 0 else moved
        return replace(effect, parameters=parameters)

    def margin_of(self, effect: Effect, name: str) -> float:
        """How far a parameter of an effect may be from its value, in its unit."""
        if effect.covariance is None:
            return 0.0
        index = list(effect.parameters).index(name)
        return self.width * float(np.sqrt(effect.covariance[index][index]))

    def drag_spread(self, effects: tuple[Effect, ...], curvature: Floats, speed: float) -> Floats:
        """How much stronger drag may be than in the cautious model, as a share of the weight.

        Where the vehicle stops the least drag decides, on how far it is unloaded the most.

        Args:
            effects: those of the model. curvature: [1/m], any shape. speed: never exceeded [m/s].
        """
        spread = np.zeros_like(curvature)
        for effect in effects:
            law = LAWS[effect.name]
            if law.enters is not Enters.MOTION:
                continue
            lightest = validate(effect)
            heaviest = {
                n: v + 2.0 * law.parameters[n].lighter_rear * self.margin_of(effect, n)
                for n, v in lightest.items()
            }
            low, high = (
                law.law(speed, curvature, 0.0, *ends.values()) for ends in (lightest, heaviest)
            )
            spread += (high - low) / GRAVITY
        return spread

    def ground_margin(self, effect: Effect) -> float:
        """Margin of F_b/W for an effect that is uncertain, or that the map's errors change.

        To first order, at the largest that its factors can be on ground that is driven on; for
        ground terms and wind. Drag, lag, fade and friction are moved instead.
        """
        margin = 0.0
        if effect.covariance is not None:
            highest = LAWS[effect.name].max_force(effect.parameters)
            factor = np.array([highest.get(name, 0.0) for name in effect.parameters])
            # Each factor may have either sign where the vehicle is.
            spread = factor * np.sqrt(np.diag(np.array(effect.covariance)))
            margin = self.width * float(np.sum(spread))
        per_slope = LAWS[effect.name].per_slope
        if per_slope > 0.0:
            margin += self.width * self.slope_std * per_slope * abs(effect.parameters["k"])
        return margin


def survived_errors(model: Model, uncertainty: Uncertainty | None) -> InputErrors:
    """Errors of tracking that plans survive; None plans with the mean."""
    return input_errors(model.tracking, None if uncertainty is None else uncertainty.quantile)
