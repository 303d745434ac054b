"""Passes parameters, stops, terrain and findings of the service to the live page."""

from __future__ import annotations

import logging
import time

from slopewise.services.dashboard import proposal_state
from slopewise.services.dashboard.live_state import MAX_ENTRIES, LiveState
from slopewise.services.parameters import replies
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.connect import options
from slopewise.services.wire.parameter_messages import (
    HistoryEntry,
    ParameterGroup,
    ParameterQuestion,
)

_log = logging.getLogger("slopewise")


class ParameterFeed:
    """Updates a live state from a service; called by the learning thread."""

    def __init__(self, service: ParameterService, page: LiveState, config: ServiceConfig) -> None:
        self._service, self._page, self._id = service, page, config.id
        self._address = options(config)
        self._shown_stops = 0
        self._ground = ("", 0.0)
        self._proposal: object = None

    def recall(self) -> None:
        """Add the changes from before the last start."""
        try:
            request = ParameterQuestion(history=MAX_ENTRIES)
            known = replies.read(self._service, request, self._id)
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
                self._page.set_proposal(proposal_state.newest(service, self._address))
            except Exception:  # noqa: BLE001 - learning continues without findings on the page
                _log.exception("the page does not show what was found")
