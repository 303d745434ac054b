"""How well any unbiased estimator could learn a plant's coefficients from its stops.

The Fisher information of speed samples about held speed, force and onset of each stop, and through
them about what all stops share: four coefficients and a dead time. Noise, scatter and the law of
the plant are taken as known, speeds before the onset as held: more than any estimator knows.
"""

from __future__ import annotations

import numpy as np

from tests.models.calibration.plant import G, Plant, Truth

_BEFORE = 1.0  # [s] of the level that belongs to a stop


def min_covariance(plant: Plant, truth: Truth) -> np.ndarray:
    """(4, 4) lower bound of the covariance of m_m, b_m, m_b, b_b."""
    information = np.zeros((5, 5))
    for v, theta in zip(truth.speed, truth.grade, strict=True):
        force = float(plant.force(theta, v))
        a = G * (force + np.sin(theta))
        since = np.arange(-_BEFORE - plant.dead_time, v / a, 1.0 / plant.hz)
        down = since > 0.0
        by = np.column_stack((np.ones_like(since), -G * since * down, a * down))
        fisher = by.T @ by / plant.speed_noise**2
        fisher = (
            fisher[1:, 1:] - np.outer(fisher[1:, 0], fisher[0, 1:]) / fisher[0, 0]
        )  # held speed unknown
        # The force of a stop scatters, and an error of its grade is one of its force as well.
        m = plant.m_m * v + plant.b_m
        scatter = plant.scatter**2 + ((1.0 + m) * plant.pitch_noise) ** 2 / max(int(down.sum()), 1)
        fisher -= np.outer(fisher[:, 0], fisher[0]) * scatter / (1.0 + fisher[0, 0] * scatter)
        x = np.zeros((2, 5))
        x[0, :4] = v * theta, theta, v, 1.0
        x[1, 4] = 1.0
        information += x.T @ fisher @ x
    return np.asarray(np.linalg.inv(information)[:4, :4])
