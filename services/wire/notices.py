"""What happened lately and has to be told for a while, in words."""

from __future__ import annotations

import time

_MOST = 8
_FOR = 600.0


class Notices:
    """Sentences with the time of the last occasion; the latest few, so that nobody fills them."""

    def __init__(self, seconds: float = _FOR) -> None:
        """Tell each for so long [s]."""
        self._seconds = seconds
        self._said: dict[str, float] = {}

    def say(self, words: str) -> None:
        """Something happened just now; one thread at a time."""
        said = {w: at for w, at in self._said.items() if w != words}
        said[words] = time.monotonic()
        # Swapped whole: other threads may read meanwhile.
        self._said = dict(list(said.items())[-_MOST:])

    def take_back(self, words: str) -> None:
        """It is as it should be again."""
        self._said = {w: at for w, at in self._said.items() if w != words}

    def told(self) -> list[str]:
        """What has to be told now; from any thread."""
        late = time.monotonic() - self._seconds
        return [words for words, at in self._said.items() if at > late]
