"""Smooth fields on the unit disk for the identities of Appendix B, and how two sides are compared."""

from collections.abc import Callable

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.studies.audit.row import Finding, Judgement
from actin_xcheck.studies.audit.theory.measures import circle, disk_quadrature, found

POINTS, WEIGHTS = disk_quadrature()
"""Quadrature on the unit disk."""

RIM, NORMALS, LENGTH = circle()
"""Points on its rim, their normals and the length each stands for."""

Field = Callable[[Array], Array]


def derivative(g: Field, k: int, x: Array, step: float = 1e-4) -> Array:
    """Return the derivative of a field in direction k at points x (2, n), of fourth order."""
    e = np.zeros((2, 1))
    e[k] = step
    return (8 * (g(x + e) - g(x - e)) - g(x + 2 * e) + g(x - 2 * e)) / (12 * step)


def component(field: Field, k: int) -> Field:
    """Return one component of a vector field."""
    return lambda x: field(x)[k]


def divergence(field: Field, x: Array, step: float = 1e-4) -> Array:
    """Return the divergence of a vector field at points x (2, n)."""
    return derivative(component(field, 0), 0, x, step) + derivative(component(field, 1), 1, x, step)


def gradient(g: Field, x: Array, step: float = 1e-4) -> Array:
    """Return the gradient of a scalar field at points x (2, n), (2, n)."""
    return np.array([derivative(g, k, x, step) for k in range(2)])


def test_function(x: Array) -> Array:
    """Return a smooth w without symmetry."""
    return np.asarray(np.sin(1.3 * x[0] + 0.4) * np.exp(0.5 * x[1]))


def identity(name: str, left: float, right: float, reason: str) -> Finding:
    """Return the finding on an identity between two numbers."""
    difference = abs(left - right) / max(abs(left), 1e-3)
    return found(
        Judgement.REPRODUCED,
        f"{name}: {left:.10f} on the left, {right:.10f} on the right.",
        reason,
        holds=difference < 1e-7,
        numbers={"left": left, "right": right},
    )
