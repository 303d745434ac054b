"""Passes parameters, stops, terrain and findings of the service to the live page."""

from __future__ import annotations

import contextlib
import logging
import shlex
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from slopewise.services.dashboard.live_state import MAX_ENTRIES, LiveState, ProposalEntry
from slopewise.services.parameters import replies
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.parameters.store import StoreError
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.connect import options
from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.parameter_messages import (
    HistoryEntry,
    ParameterGroup,
    ParameterQuestion,
)

_log = logging.getLogger("slopewise")

_MAX_STEPS = 50  # past changes that are examined [1], more than operators make of one finding


@dataclass(frozen=True, slots=True)
class _Step:
    """Proposal, and id of the finding in use, from a version on."""

    version: int
    who: str
    offer: ModelProposal | None
    adopted: str


class ParameterFeed:
    """Updates a live state from a service; called by the learning thread."""

    def __init__(self, service: ParameterService, page: LiveState, config: ServiceConfig) -> None:
        self._service, self._page = service, page
        self._address = options(config)
        self._shown_stops = 0
        self._ground = ("", 0.0)
        self._proposal: object = None

    def recall(self) -> None:
        """Add the changes from before the last start."""
        try:
            request = ParameterQuestion(history=MAX_ENTRIES)
            known = replies.read(self._service, request)
            for entry in reversed(known.history):
                self._page.add_change(entry)
        except Exception:  # noqa: BLE001 - learning continues without its past on the page
            _log.exception("the page does not show what was learned before")

    def learned(self, message: ParameterGroup) -> None:
        """Add a change of a group."""
        names = ("version", "group", "cause", "who", "values", "stds", "valid")
        entry = HistoryEntry(at=time.time(), **{name: getattr(message, name) for name in names})
        self._page.add_change(entry)

    def show(self) -> None:
        """Add stops, terrain and the status of findings since the last call."""
        service, learner = self._service, self._service.learner
        count, stops = learner.counters["stops"], list(learner.stops)
        new = min(count - self._shown_stops, len(stops))
        self._shown_stops = count
        for stop in stops[len(stops) - new :]:
            self._page.add_stop(stop, service.history.version)
        now = time.monotonic()
        surface = learner.ground.surface(now) or learner.ground.description()
        ground = surface, learner.ground.probability(now)
        if ground != self._ground:
            self._ground = ground
            self._page.set_ground(*ground)
        proposal = service.history.last.get(EFFECTS), service.rejected
        if proposal != self._proposal:
            self._proposal = proposal
            try:
                self._page.set_proposal(newest_proposal(service, self._address))
            except Exception:  # noqa: BLE001 - learning continues without findings on the page
                _log.exception("the page does not show what was found")


def newest_proposal(service: ParameterService, address: Sequence[str]) -> ProposalEntry | None:
    """The newest finding with its status, from the history; None before there was one.

    A restart changes none of it except a refusal. ``address``: options of a command that reaches
    the service.
    """
    steps = _steps(service)
    # A roll back to an older proposal does not make that the newest.
    offers = {(s.offer.id, s.offer.at): s.offer for s in steps if s.offer is not None}
    if not offers:
        return None
    offer = list(offers.values())[-1]
    while steps[0].offer != offer:
        del steps[0]
    now, version = steps[-1], _version_to_restore(steps, offer)
    rollback = f"slopewise params {EFFECTS} --rollback {version}" if version else ""
    if now.adopted == offer.id:
        state, message = "adopted", f"by {now.who}, version {now.version}"
        purpose, command = "take it back", rollback
    else:
        state, message = _status_unused(steps, offer, service.rejected)
        message += f"; plans use the finding {now.adopted}" if now.adopted else ""
        purpose, command = "bring it back", rollback
        if now.offer == offer:
            purpose, command = "adopt it", offer.command()
    if not command:
        return ProposalEntry(offer, state, message)
    command = shlex.join([*shlex.split(command), *address])
    return ProposalEntry(offer, state, message, purpose, command)


def _steps(service: ParameterService) -> list[_Step]:
    """Changes of proposals and findings, oldest first; the last one is the present."""
    effects, last = service.learner.state.effects, service.history.last.get(EFFECTS)
    if last is None:
        return []
    steps = [_Step(last.version, last.who, effects.proposal, effects.adopted)]
    # Without a store nothing can be rolled back: the present is all there is.
    with contextlib.suppress(StoreError):
        changes = service.history.newest(EFFECTS, last.version - 1)
        for change, state in islice(changes, _MAX_STEPS):
            with contextlib.suppress(ValueError, KeyError, TypeError):
                steps.append(_Step(change.version, change.who, *effects.read(state)))
    return steps[::-1]


def _version_to_restore(steps: Sequence[_Step], offer: ModelProposal) -> int:
    """Version from before it was adopted, else where it was adopted last, or offered; 0: none."""
    past = steps[:-1]
    adopted = [step.version for step in past if step.adopted == offer.id]
    if steps[-1].adopted == offer.id:
        versions = [step.version for step in past if step.adopted != offer.id]
    else:
        versions = adopted or [step.version for step in past if step.offer == offer]
    return max(versions, default=0)


def _status_unused(
    steps: Sequence[_Step], offer: ModelProposal, rejected: tuple[str, str]
) -> tuple[str, str]:
    """State and message of a finding that is not in use."""
    if rejected[0] == offer.id:
        return "refused", rejected[1]
    adopted = [step.adopted == offer.id for step in steps]
    held = adopted if any(adopted) else [step.offer == offer for step in steps]
    if not held[-1]:
        step = next(s for s, h in zip(steps[::-1], held[-2::-1], strict=False) if h)
        return "reverted", f"by {step.who}, version {step.version}"
    if offer.obstacle:
        return "refused" if offer.changes else "nothing", offer.obstacle
    return "offered", "waits for an operator"
