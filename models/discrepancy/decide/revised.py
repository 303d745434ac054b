"""The model to plan with after an investigation: never faster than what is known allows.

Coefficients come with their covariance, effects with theirs. All uncertainty beyond that goes into
the safety offset: held-out stops that ended beyond their prediction, and alternatives that predict
more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.distance_table import Stops, SurfaceLaw, learn_distance
from slopewise.models.calibration.margins import offset_for
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood.refit import Refit
from slopewise.models.discrepancy.likelihood.weigh import LAG
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.effects.registry import LAWS
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.stop_distance import StopDistance

_OFFSET_COVERAGE = 0.995  # share of stops that the safety offset covers, as in calibration [1]
_RANGE_PAD = 0.1  # of a range: by which a log is extrapolated with new coefficients [1]


def revised(
    table: StopTable, decision: Decision, held_out: Floats, source: str
) -> tuple[Model, tuple[Effect, ...]]:
    """The model, and the effects in it that were not there before.

    Args:
        table: stops. decision: what the log allows to say.
        held_out: (S,) distances predicted by fits that had not seen their stop [m].
        source: name of the log.
    """
    fit = decision.explanation
    model = fit.hypothesis.model
    unclear = decision.verdict is Verdict.UNIDENTIFIABLE
    if decision.keeps_model or (unclear and not _refit_is_longer(table, fit)):
        as_it_is = distances(table, Hypothesis.configured(model))
        if decision.unchanged and decision.verdict is Verdict.UNKNOWN:
            model = replace(model, braking=_scattered(model.braking, fit))
        return _wider(model, table, decision, as_it_is), ()
    shift = fit.hypothesis.shift
    on = model.braking
    braking = replace(
        _scattered(on, fit),
        m_m=on.m_m + float(shift[0]),
        b_m=on.b_m + float(shift[1]),
        m_b=on.m_b + float(shift[2]),
        b_b=on.b_b + float(shift[3]),
        dead_time=fit.hypothesis.dead_time + _unnamed_build_up(decision),
        covariance=_matrix(fit.covariance[:4, :4]),
        speed_range=_within(on.speed_range, table.held),
        grade_range=_within(on.grade_range, table.grade),
    )
    if on.distance is not None:
        braking = replace(braking, distance=_promised_again(table, braking, held_out))
    added = tuple(e for e in _effects_of(fit, source) if e.name != LAG or LAG in decision.names)
    better = replace(model, braking=braking, effect=(*model.effect, *added))
    return _wider(better, table, decision, held_out), added


def _unnamed_build_up(decision: Decision) -> float:
    """Time constant of the short build-up that all brakes have, which counts as dead time [s]."""
    lags = [e for e in decision.explanation.hypothesis.added if e.name == LAG]
    return lags[0].parameters["tau"] if lags and LAG not in decision.names else 0.0


def _effects_of(fit: Refit, source: str) -> tuple[Effect, ...]:
    """Effects that were added, with the covariance of their parameters."""
    effects = []
    for effect, covariance in zip(fit.hypothesis.added, fit.of_effects, strict=True):
        values = {n: _inside(effect.name, n, float(v)) for n, v in effect.parameters.items()}
        effects.append(
            replace(effect, parameters=values, covariance=_matrix(covariance), source=source)
        )
    return tuple(effects)


def _scattered(braking: Braking, fit: Refit) -> Braking:
    """With at least the scatter from stop to stop that the log showed, unless distances have it."""
    if braking.distance is not None:
        return braking
    return replace(
        braking,
        force_std=max(braking.force_std, fit.whitener.force_std),
        dead_time_std=max(braking.dead_time_std, fit.whitener.dead_time_std),
    )


def _promised_again(table: StopTable, braking: Braking, held_out: Floats) -> StopDistance | None:
    """The distribution of what the stops of the log leave once the effects are in the law."""
    law = SurfaceLaw(
        np.array([braking.m_m, braking.b_m, braking.m_b, braking.b_b]), braking.dead_time
    )
    stops = Stops(
        table.held,
        table.grade.mean(axis=1),
        np.ones_like(table.held),
        table.distance,
        held_out,
        np.array(table.run_names),
    )
    try:
        return learn_distance(stops, law, (braking.speed_range, braking.grade_range)).table
    except ParameterError:  # too few of them end
        return braking.distance


def _inside(effect: str, name: str, value: float) -> float:
    low, high = LAWS[effect].parameters[name].bounds
    return min(max(value, low), high)


def _matrix(values: Floats) -> tuple[tuple[float, ...], ...]:
    even = 0.5 * (values + values.T)
    lowest = float(np.linalg.eigvalsh(even)[0])
    if lowest < 0.0:  # rounding
        even = even - lowest * np.eye(len(even))
    return tuple(tuple(float(v) for v in row) for row in even)


def _within(known: tuple[float, float], seen: Floats) -> tuple[float, float]:
    """Intersection of both ranges of validity; that of the model where they are disjoint."""
    pad = _RANGE_PAD * float(np.ptp(seen))
    low, high = max(known[0], float(seen.min()) - pad), min(known[1], float(seen.max()) + pad)
    return (low, high) if high > low else known


def _wider(model: Model, table: StopTable, decision: Decision, predicted: Floats) -> Model:
    """With a safety offset that covers stops held out, and the longest of all alternatives."""
    needed = 0.0
    if model.braking.distance is None:
        needed = offset_for(_OFFSET_COVERAGE, table.distance - predicted)
    if decision.alternatives:
        here = distances(table, decision.explanation.hypothesis)
        longer = [distances(table, r.hypothesis) - here for r in decision.alternatives]
        needed += max(0.0, *(float(np.quantile(more, _OFFSET_COVERAGE)) for more in longer))
    offset = max(model.braking.distance_offset, needed)
    return replace(model, braking=replace(model.braking, distance_offset=offset))


def _refit_is_longer(table: StopTable, fit: Refit) -> bool:
    """Whether the new coefficients stop later than those configured."""
    configured = Hypothesis.configured(fit.hypothesis.model)
    refitted = replace(fit.hypothesis, added=())
    return float(np.mean(distances(table, refitted) - distances(table, configured))) > 0.0
