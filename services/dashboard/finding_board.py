"""The newest finding as the live page shows it: what became of it, what an operator types next.

The history tells it, so that a restart changes nothing of what is shown but a refusal.
"""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from slopewise.services.dashboard.board import FindingSeen
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.service import ParameterService
from slopewise.services.parameters.store import StoreError
from slopewise.services.wire.model_proposal import ModelProposal

_MOST_STEPS = 50
"""Changes of the past that are looked through."""


@dataclass(frozen=True, slots=True)
class _Step:
    """What was offered, and the id of what was in use, from a version on."""

    version: int
    who: str
    offer: ModelProposal | None
    adopted: str


def newest(service: ParameterService, address: Sequence[str]) -> FindingSeen | None:
    """The finding that came last; None before there was one.

    Args:
        service: that found it. address: options with which a command reaches it.
    """
    steps = _steps(service)
    # Going back to an older offer does not make it a new one.
    found = {(s.offer.id, s.offer.at): s.offer for s in steps if s.offer is not None}
    if not found:
        return None
    offer = list(found.values())[-1]
    while steps[0].offer != offer:
        del steps[0]
    now, version = steps[-1], _version_to_go_to(steps, offer)
    back = f"slopewise params {EFFECTS} --rollback {version}" if version else ""
    if now.adopted == offer.id:
        state, words = "adopted", f"by {now.who}, version {now.version}"
        purpose, command = "take it back", back
    else:
        state, words = _waiting(steps, offer, service.refused)
        offered = now.offer == offer
        purpose, command = ("adopt it", offer.command()) if offered else ("bring it back", back)
        if now.adopted:
            words += f"; plans use the finding {now.adopted}"
    if command:
        command = shlex.join([*shlex.split(command), *address])
    return FindingSeen(
        offer=offer, state=state, words=words, purpose=purpose if command else "", command=command
    )


def _steps(service: ParameterService) -> list[_Step]:
    """Changes of the findings, oldest first; the last one is what is now."""
    effects, last = service.learner.effects, service.log.last.get(EFFECTS)
    if last is None:
        return []
    steps = [_Step(last.version, last.who, effects.offer, effects.adopted)]
    # Without a store nothing is ever taken back: what is now says all.
    with contextlib.suppress(StoreError):
        for change, state in islice(service.log.newest(EFFECTS, last.version - 1), _MOST_STEPS):
            with contextlib.suppress(ValueError, KeyError, TypeError):
                steps.append(_Step(change.version, change.who, *effects.read(state)))
    return steps[::-1]


def _version_to_go_to(steps: Sequence[_Step], offer: ModelProposal) -> int:
    """Before it was adopted, if it is; else where it was adopted last, or offered; 0: nowhere."""
    past = steps[:-1]
    adopted = [step.version for step in past if step.adopted == offer.id]
    if steps[-1].adopted == offer.id:
        versions = [step.version for step in past if step.adopted != offer.id]
    else:
        versions = adopted or [step.version for step in past if step.offer == offer]
    return max(versions, default=0)


def _waiting(
    steps: Sequence[_Step], offer: ModelProposal, refused: tuple[str, str]
) -> tuple[str, str]:
    """State and words of a finding that is not in use."""
    if refused[0] == offer.id:
        return "refused", refused[1]
    adopted = [step.adopted == offer.id for step in steps]
    held = adopted if any(adopted) else [step.offer == offer for step in steps]
    if not held[-1]:
        gone = next(s for s, h in zip(steps[::-1], held[-2::-1], strict=False) if h)
        return "reverted", f"by {gone.who}, version {gone.version}"
    if offer.obstacle:
        return "refused" if offer.changes else "nothing", offer.obstacle
    return "offered", "waits for an operator"
