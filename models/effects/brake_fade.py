"""Hot brakes bring less: F_b/(1 + k q), dq/dt = braking power per mass − q/τ.

Source: Braking Sec. 5.2 names heat. Omits: cooling that depends on the speed.
"""

from __future__ import annotations

from collections.abc import Iterator

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.effects.effect_law import POSITIVE, EffectLaw, Enters, Parameter, Search
from slopewise.models.effects.stops_seen import StopsSeen

_COOLING = (20.0, 40.0, 100.0, 300.0, 1000.0)  # [s] of the search
_HOTTEST = (0.0, 1.0, 5.0)
"""k q of the hottest brakes in columns of the search [1]: a straight line for small losses, and
curves that the law, or one that levels off sooner, follows."""


def remaining_share(heat: Elementwise, k: Elementwise, tau: Elementwise) -> Elementwise:
    """Share of F_b that hot brakes keep, 1/(1 + k q)."""
    return 1.0 / (1.0 + k * heat)


def _columns(stops: StopsSeen) -> Iterator[tuple[dict[str, float], Floats]]:
    for tau in _COOLING:
        heat = stops.heat(tau)
        for hottest in _HOTTEST:
            lost = heat * remaining_share(heat, hottest / max(float(heat.max()), 1e-9), tau)
            yield {"tau": tau}, -stops.built * lost * stops.passes


EFFECT = EffectLaw(
    missing="force falls as the brake heats and recovers as it cools",
    enters=Enters.FADE,
    law=remaining_share,
    parameters={
        "k": Parameter(
            unit="kg/J",
            plausible=(0.0, 0.1),
            bounds=POSITIVE,
            step=1e-6,
            relative_step=0.1,
            longer_stop=1,
            lighter_rear=-1,
        ),
        # Brakes that are cold again within seconds would be a curve over speed within each stop.
        "tau": Parameter(
            unit="s",
            plausible=(1.0, 36000.0),
            bounds=POSITIVE,
            step=1e-6,
            relative_step=0.1,
            typical=(20.0, 3600.0),
            longer_stop=1,
            lighter_rear=-1,
        ),
    },
    depends_on=frozenset(("heat",)),
    axis="brake_heat",
    experiment="stop with cold brakes, and again right after five hard stops",
    search=Search(columns=_columns, strength="k", one_sided=True, pauses_distinguish=True),
    once=True,
    only_reduces=lambda _: True,
)
