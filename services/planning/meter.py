"""What a question uses while it is answered, and who comes between its candidates."""

from __future__ import annotations

import time
from collections.abc import Callable

from slopewise.services.planning.admission import Admission, Lane, PendingQuery
from slopewise.services.planning.pace import TOO_MANY, TooLateError

_WAY = 0.02
"""So long a question waits between two candidates for one of a client that drives [s]."""

_TURN = 0.002
"""After so much time of its own a question lets those in who had less [s]."""


class Meter:
    """Called between the candidates of one question; by the thread that answers it."""

    def __init__(
        self,
        admission: Admission,
        question: PendingQuery,
        smaller: Callable[[PendingQuery], None] | None,
    ) -> None:
        """Begin now; ``smaller`` answers a question of somebody who had less, None: nobody may."""
        self._admission, self._question, self._smaller = admission, question, smaller
        self._charged = time.thread_time()

    def charge(self) -> None:
        """Put the time of this thread since the last call on the client's account."""
        now = time.thread_time()
        self._admission.shares.charge(self._question.client, now - self._charged)
        self._charged = now

    def __call__(self) -> None:
        """Leave off what comes too late; let in those who drive, and those who had less.

        Raises:
            TooLateError: nobody waits for the answer any more.
        """
        question, admission = self._question, self._admission
        if question.taken or time.monotonic() > question.due:
            raise TooLateError(TOO_MANY)
        if question.lane is Lane.REST:
            admission.give_way(_WAY)
        if self._smaller is None or time.thread_time() - self._charged < _TURN:
            return
        self.charge()
        other = admission.take_smaller(question)
        if other is not None:
            self._smaller(other)
            self._charged = time.thread_time()
