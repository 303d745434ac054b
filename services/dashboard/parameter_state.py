"""Passes parameters, stops, terrain and findings of the service to the live page."""

from __future__ import annotations

import contextlib
import logging
import shlex
import time
from collections.abc import Sequence
from itertools import islice

from slopewise.services.dashboard.live_state import MAX_ENTRIES, LiveState, ProposalEntry
from slopewise.services.parameters import replies
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.parameters.store import StoreError
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.connect import options
from slopewise.services.wire.parameter_messages import (
    HistoryEntry,
    ParameterGroup,
    ParameterQuestion,
)

_log = logging.getLogger("slopewise")

_MAX_STEPS = 50  # past changes that are examined [1], more than operators make of one finding


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
    """The finding that waits or is planned with, with its status; None without one.

    A restart changes none of it except a refusal. ``address``: options of a command that reaches
    the service.
    """
    effects, last = service.learner.state.effects, service.history.last.get(EFFECTS)
    offer = effects.proposal
    if last is None or offer is None:
        return None
    purpose, command = "adopt it", offer.command()
    if effects.adopted == offer.id:
        state, message = "adopted", f"by {last.who}, version {last.version}"
        purpose, command = "take it back", _rollback(service, offer.id, last.version)
    elif service.rejected[0] == offer.id:
        state, message = "refused", service.rejected[1]
    elif offer.obstacle:
        state, message = "refused" if offer.changes else "nothing", offer.obstacle
    else:
        state, message = "offered", "waits for an operator"
    if effects.adopted not in ("", offer.id):
        message += f"; plans use the finding {effects.adopted}"
    if not command:
        return ProposalEntry(offer, state, message)
    command = shlex.join([*shlex.split(command), *address])
    return ProposalEntry(offer, state, message, purpose, command)


def _rollback(service: ParameterService, adopted: str, version: int) -> str:
    """Command that goes back to before a finding was adopted; "" without a store."""
    effects = service.learner.state.effects
    with contextlib.suppress(StoreError):
        for change, state in islice(service.history.newest(EFFECTS, version - 1), _MAX_STEPS):
            with contextlib.suppress(ValueError, KeyError, TypeError):
                if effects.read(state)[1] != adopted:
                    return f"slopewise params {EFFECTS} --rollback {change.version}"
    return ""
