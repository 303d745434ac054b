"""What can limit a plan at a station, by the names that plans and reports use."""

from __future__ import annotations

from enum import IntEnum


class Limiting(IntEnum):
    """The bound that holds at a station. Order breaks ties: the earlier name wins."""

    SPEED_LIMIT = 0
    STOPPING_PATH = 1
    TIP_OVER = 2
    ROLLOVER = 3
    LATERAL = 4
    WHEEL_SPEED = 5
    TRACTION = 6
    ACCEL = 7
    DECEL = 8
    JERK = 9
    UNKNOWN_TERRAIN = 10
    MODEL_VALIDITY = 11

    @property
    def label(self) -> str:
        """The word in files and on screens, e.g. ``stopping_path``."""
        return self.name.lower()
