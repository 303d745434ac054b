"""Slip, Tables 2 and 5, typed again from the paper."""

from __future__ import annotations

MEANS = {
    "asphalt": (0.03, 0.26, 1.00),
    "dirt_road": (0.13, 0.20, 1.15),
    "plowed_terrain": (0.21, 0.16, 1.26),
    "beach_sand": (0.30, 0.11, 1.62),
}
STDS = {
    "asphalt": (0.02, 0.01, 0.05),
    "dirt_road": (0.03, 0.02, 0.04),
    "plowed_terrain": (0.05, 0.01, 0.06),
    "beach_sand": (0.10, 0.02, 0.09),
}
OBSERVATIONS = [
    ((0.91, 0.26, 0.90), "asphalt"),  # as printed
    ((0.091, 0.26, 0.90), "asphalt"),  # as probably meant
    ((0.29, 0.20, 1.70), "beach_sand"),
    ((0.08, 0.28, 1.05), "asphalt"),
    ((0.15, 0.23, 1.10), "dirt_road"),
    ((0.28, 0.20, 1.20), "plowed_terrain"),
    ((0.21, 0.22, 1.29), "plowed_terrain"),
]
