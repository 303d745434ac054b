"""Forces at any number of contact points that carry a vehicle, the general case of its wheel loads.

Each contact point gives three forces; together they balance six components of force and moment at
the centre of mass. More than two points leave the forces open: taken is the solution of least
squares, which shares horizontal forces evenly as print assumes.

Validity: quasi-static, rigid body, point contacts; a normal force that comes out negative says that
the contact would have to pull. Omits: friction limits. Source: Slip (15), (16); for four wheels
about a centre of mass in their middle the normal forces are (18)–(21), sign of (21) corrected.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError

_SINGULAR = 1e-9
"""Relative singular value below which the contact geometry is degenerate [1]."""


def grasp_matrix(contacts: Floats) -> Floats:
    """G (6, 3n) of Slip (15): forces of all contacts to force and moment at the centre of mass.

    ``contacts``: (n, 3) contact points from the centre of mass, vehicle frame [m].
    """
    matrix = np.zeros((6, 3 * len(contacts)))
    for i, (x, y, z) in enumerate(contacts.tolist()):
        columns = slice(3 * i, 3 * i + 3)
        matrix[:3, columns] = np.eye(3)
        matrix[3:, columns] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return matrix


def weight_in_vehicle_frame(weight: float, pitch: float, roll: float) -> Floats:
    """(6,) force and moment of W [N] at the centre of mass, vehicle frame. Source: Slip (17).

    ``pitch``: θ, nose down positive [rad]. ``roll``: φ, left side up positive [rad].
    """
    force = weight * np.array(
        [np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)]
    )
    return np.concatenate([force, np.zeros(3)])


def contact_forces(contacts: Floats, load: Floats) -> Floats:
    """(n, 3) forces of the ground on the contacts that balance a load [N]. Source: Slip (16).

    The least squares among all solutions of G F + load = 0; ``load``: (6,) force [N] and moment
    [N m] at the centre of mass. ParameterError if the contacts cannot balance it, as two points or
    points on one line cannot.
    """
    matrix = grasp_matrix(contacts)
    forces, _, rank, _ = np.linalg.lstsq(matrix, -load, rcond=_SINGULAR)
    size = max(float(np.abs(load).max()), 1.0)
    if rank < len(matrix) and float(np.abs(matrix @ forces + load).max()) > 1e-6 * size:
        raise ParameterError("contacts", f"three points or more off one line, got {len(contacts)}")
    return np.asarray(forces.reshape(-1, 3))
