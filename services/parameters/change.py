"""What the store keeps: changes of parameters, and moments that survive clocks that jump."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Moment:
    """When something happened, so that its age survives a restart and a clock that jumps.

    Attributes:
        at: clock of the day [s since 1970], for people. boot, uptime: which boot of the machine,
            and the time since [s], which no clock setting changes.
    """

    at: float
    boot: str
    uptime: float

    @classmethod
    def now(cls) -> Moment:
        """The moment it is."""
        return cls(time.time(), _boot(), time.clock_gettime(time.CLOCK_BOOTTIME))

    def earlier(self, seconds: float) -> Moment:
        """The moment ``seconds`` before this one."""
        return Moment(self.at - seconds, self.boot, self.uptime - seconds)

    def age(self, now: Moment, oldest: float) -> float:
        """Time since [s]; what clocks cannot tell counts as ``oldest``."""
        if self.boot and self.boot == now.boot:
            return min(max(now.uptime - self.uptime, 0.0), oldest)
        passed = now.at - self.at
        # A clock that went back since says nothing; the time since the boot has passed at least.
        return min(max(passed, now.uptime), oldest) if passed >= 0.0 else oldest


def _boot() -> str:
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


@dataclass(frozen=True, slots=True)
class StoredChange:
    """One group of parameters as it was from one version on.

    Attributes:
        version: of all parameters; grows with every change. group: that changed.
        fingerprint: of the vehicle. cause: in words. who: source or operator.
        moment: when. state: of the group, as its owner writes it.
        learned: came by itself; what an operator did is kept longest.
    """

    version: int
    group: str
    fingerprint: str
    cause: str
    who: str
    moment: Moment
    state: bytes
    learned: bool = True
