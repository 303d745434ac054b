"""Rows of the store: changes of parameters, and times that survive a clock that is set."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class BootTime:
    """A time whose age survives a restart and a clock that is set."""

    at: float  # wall clock [s since 1970]
    boot: str  # id of the boot of the machine
    uptime: float  # time since that boot [s], which no clock setting changes

    @classmethod
    def now(cls) -> BootTime:
        """The present time."""
        return cls(time.time(), _boot(), time.clock_gettime(time.CLOCK_BOOTTIME))

    def earlier(self, seconds: float) -> BootTime:
        """The time ``seconds`` before this one."""
        return BootTime(self.at - seconds, self.boot, self.uptime - seconds)

    def age(self, now: BootTime, oldest: float) -> float:
        """Time since then [s]; ``oldest`` where clocks cannot show it."""
        if self.boot and self.boot == now.boot:
            return min(max(now.uptime - self.uptime, 0.0), oldest)
        passed = now.at - self.at
        # A clock that was set back shows no age; the time since the boot has passed at least.
        return min(max(passed, now.uptime), oldest) if passed >= 0.0 else oldest


def _boot() -> str:
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


@dataclass(frozen=True, slots=True)
class StoredChange:
    """State of one group of parameters from a version on."""

    version: int  # version of all parameters; grows with every change
    group: str  # name of the group
    fingerprint: str  # digest of the vehicle
    cause: str  # reason as text
    who: str  # source or operator
    moment: BootTime  # time of the change
    state: bytes  # the group's state as JSON
    learned: bool = True  # True if no operator made the change; those of operators are evicted last
