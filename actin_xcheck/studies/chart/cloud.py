"""Material points at which all methods say their concentration, so that L2 norms need no common mesh."""

import numpy as np

from actin_xcheck.core.model import Array

RADII = (6, 3)
"""Gauss points in [0, l0] and in [l0, 1]: fields have a kink at the ring."""

ANGLES = 31
"""Odd, so that a field with mirror lines is seen at angles that its symmetry does not repeat."""


def cloud(l0: float) -> tuple[Array, Array]:
    """Return points (2, m) of a quadrature rule on the unit disk and their weights (m,), whose sum is pi."""
    radii, weights = [], []
    for number, low, high in zip(RADII, (0.0, l0), (l0, 1.0), strict=True):
        nodes, gauss = np.polynomial.legendre.leggauss(number)
        r = low + (high - low) * (nodes + 1) / 2
        radii.append(r)
        weights.append(gauss * (high - low) / 2 * r * 2 * np.pi / ANGLES)
    theta = 2 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    r = np.concatenate(radii)[:, None]
    points = np.array([r * np.cos(theta), r * np.sin(theta)]).reshape(2, -1)
    return points, np.repeat(np.concatenate(weights), ANGLES)
