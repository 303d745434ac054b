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
        # Each keeps its place, so that what is told changes no oftener than what there is to tell.
        said = {**self._said, words: time.monotonic()}
        while len(said) > _MOST:
            del said[min(said, key=said.__getitem__)]
        # Swapped whole: other threads may read meanwhile.
        self._said = said

    def take_back(self, words: str) -> None:
        """It is as it should be again."""
        self._said = {w: at for w, at in self._said.items() if w != words}

    def told(self) -> list[str]:
        """What has to be told now; from any thread."""
        late = time.monotonic() - self._seconds
        return [words for words, at in self._said.items() if at > late]
