"""The motion laws of all registered effects, compiled as one sum.

Their number is part of the type of :class:`slopewise.models.effects.registry.MotionTerms`: kernels
that were compiled before an effect with another number of parameters came are compiled anew.
"""

from __future__ import annotations

from collections.abc import Callable

from slopewise.models.effects.registry import LAWS, MOTION_LAWS, MotionTerms
from slopewise.planner.kernels.compiled import inlined

_Law = Callable[[float, float, float, MotionTerms], float]


def _with(sum_so_far: _Law | None, name: str, first: int, last: int) -> _Law:
    """One more law, of the parameters from the first up to the last."""
    law = inlined(LAWS[name].law)
    if sum_so_far is None:

        def alone(speed: float, curvature: float, yaw: float, terms: MotionTerms) -> float:
            own: float = law(speed, curvature, yaw, *terms.values[first:last])
            return own

        return inlined(alone)
    before: _Law = sum_so_far

    def together(speed: float, curvature: float, yaw: float, terms: MotionTerms) -> float:
        own: float = law(speed, curvature, yaw, *terms.values[first:last])
        return before(speed, curvature, yaw, terms) + own

    return inlined(together)


def _all_laws() -> _Law:
    total, first = None, 0
    for name in MOTION_LAWS:
        last = first + len(LAWS[name].parameters)
        total, first = _with(total, name, first, last), last
    assert total is not None
    return total


motion_deceleration = _all_laws()
"""As :func:`slopewise.models.effects.registry.motion_deceleration`, for kernels."""
