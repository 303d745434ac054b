"""What was learned and found, as the live page shows it: parameters, stops, ground, findings."""

from __future__ import annotations

import logging
import time

from slopewise.services.dashboard import finding_board
from slopewise.services.dashboard.board import Board, GroundSeen, GroupSeen, StopSeen
from slopewise.services.parameters import replies
from slopewise.services.parameters.effects_group import EFFECTS
from slopewise.services.parameters.service import ParameterService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.connect import options
from slopewise.services.wire.parameter_messages import (
    HistoryEntry,
    ParameterGroup,
    ParameterQuestion,
)

_log = logging.getLogger("slopewise")

_RECALLED = 400
"""Changes of the past that the page begins with."""


class ParameterBoard:
    """Hands what is new to the page; called by the thread that learns."""

    def __init__(self, service: ParameterService, board: Board, config: ServiceConfig) -> None:
        """Show what ``service`` learns on ``board``."""
        self._service, self._board, self._id = service, board, config.id
        self._address = options(config)
        self._shown = 0
        self._ground = ("", 0.0)
        self._finding: object = None

    def recall(self) -> None:
        """What was learned before the last start."""
        question = ParameterQuestion(history=_RECALLED)
        try:
            known = replies.read(self._service, question, self._id)
            for entry in reversed(known.history):
                self._board.learned(_seen(entry, at=entry.at))
        except Exception:  # noqa: BLE001 - learning goes on without a picture of its past
            _log.exception("the page does not show what was learned before")

    def learned(self, message: ParameterGroup) -> None:
        """A group changed."""
        self._board.learned(_seen(message))

    def show(self) -> None:
        """Stops, the ground and what became of findings since the last call."""
        service = self._service
        count = service.learner.stop_count
        new = min(count - self._shown, len(service.learner.stops))
        self._shown = count
        for stop in list(service.learner.stops)[len(service.learner.stops) - new :]:
            self._board.stopped(
                StopSeen(
                    speed=stop.speed,
                    grade=stop.grade,
                    predicted=stop.predicted,
                    actual=stop.actual,
                    surface=stop.surface,
                    outcome=stop.outcome,
                    version=service.log.version,
                )
            )
        ground = service.learner.ground.told(time.monotonic())
        if ground != self._ground:
            self._ground = ground
            self._board.classified(GroundSeen(name=ground[0], probability=ground[1]))
        finding = service.log.last.get(EFFECTS), service.refused
        if finding != self._finding:
            self._finding = finding
            self._found()

    def _found(self) -> None:
        try:
            self._board.found(finding_board.newest(self._service, self._address))
        except Exception:  # noqa: BLE001 - learning goes on without a picture of its findings
            _log.exception("the page does not show what was found")


def _seen(told: ParameterGroup | HistoryEntry, **at: float) -> GroupSeen:
    return GroupSeen(
        group=told.group,
        names=list(told.values),
        value=list(told.values.values()),
        std=[told.stds.get(name) for name in told.values],
        valid=told.valid,
        version=told.version,
        cause=told.cause,
        **at,
    )
