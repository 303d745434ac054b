"""Settings of glibc's allocator for a process that runs for months with dozens of threads.

By default each thread gets a separate arena, and blocks as large as any that was ever freed are
taken from it: the memory of many simultaneous requests then remains in pieces that no other thread
can use. With 24 attackers memory grew by a quarter within ten minutes at constant use.
"""

from __future__ import annotations

import ctypes

_MMAP_THRESHOLD = -3  # parameter of mallopt, from malloc.h
_ARENA_MAX = -8  # numbers of parameters in glibc's malloc.h
_ARENAS = 2  # one for the planner's threads, one for zenoh's

_MAX_ARENA_BLOCK = 1 << 20
"""Larger blocks return to the system immediately when freed [bytes]: requests are smaller."""


def limit_malloc_arenas() -> bool:
    """Use few arenas and separate large blocks; False if the C library has no such settings.

    Threads keep the arena that they have: call it before any are started.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    results = mallopt(_ARENA_MAX, _ARENAS), mallopt(_MMAP_THRESHOLD, _MAX_ARENA_BLOCK)
    return all(results)
