"""What keeps passes along rows free of branches."""

from __future__ import annotations

import numpy as np

PLUS_ZERO = np.float32(0.0)
"""Added to what replaces an array's value only in some lanes: without a sum the compiler turns the
choice into a branch around the store, and works on one lane at a time, five times slower."""
