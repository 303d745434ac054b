"""The fastest profile below the bounds: time-optimal, then smoothed to limited jerk."""
