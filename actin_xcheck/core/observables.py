"""What is measured on a state, the same for every method."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.mesh import Indices, Mesh, integral, signed_areas
from actin_xcheck.core.model import Array


@dataclass(frozen=True, eq=False)
class Measures:
    """What is measured on a state as a whole.

    Attributes
    ----------
    area, total_actin : of the cell, and the integral of a over it.
    centroid : (2,).
    rim : rim nodes, (2, n).
    jacobian_min : smallest det dx/dxi.
    """

    area: float
    total_actin: float
    centroid: Array
    rim: Array
    jacobian_min: float


def area(x: Array, triangles: Indices) -> float:
    """Area of the cell with node positions x (2, N)."""
    return float(signed_areas(x, triangles).sum())


def centroid(x: Array, triangles: Indices) -> Array:
    """Geometric centroid (2,) of the cell with node positions x (2, N)."""
    areas = signed_areas(x, triangles)
    return x[:, triangles].mean(axis=1) @ areas / areas.sum()


def total_actin(x: Array, triangles: Indices, corners: Array) -> float:
    """Integral of a: exact for P1, and sum a_i V_i for a mean-preserving reconstruction of cell averages."""
    return integral(x, triangles, corners)


def balance_residual(
    dt: float, rate: float, before: float, after: float, old_area: float, source: float
) -> float:
    """Relative residual of a first-order scheme's own balance of total actin over one step.

    [(1 + dt k) m(t+dt) - m(t) - dt (k |Omega(t)| + S)] / m(t+dt) with m total actin, k the reaction rate
    (1 or 0) and S the integrated source: the sum of all rows of (B.23b), and of the finite-volume equations.
    """
    return float(np.divide((1 + dt * rate) * after - before - dt * (rate * old_area + source), after))


def jacobian_min(mesh: Mesh, x: Array) -> float:
    """Smallest det dx/dxi over the cells."""
    return float((signed_areas(x, mesh.triangles) / signed_areas(mesh.xi, mesh.triangles)).min())


def probe(
    triangles: Indices, cells: Indices, weights: Array, corners: Array, x: Array
) -> tuple[Array, Array]:
    """Concentration (k,) and position (k, 2) of material points located by `geometry.locate`."""
    return (weights * corners[:, cells]).sum(axis=0), (weights * x[:, triangles[:, cells]]).sum(axis=1).T


def polarity(points: Array) -> float:
    """Minor over major axis of the minimum-area ellipse around points (2, n), to 1e-8.

    The index of polarity of section 5.3.1.  The ellipse {y : |A y + b| <= 1} maximises log det A; a
    log-barrier Newton method in its five unknowns follows the central path until the duality gap is below
    1e-11.  It has nothing to do where all points lie on the ellipse of their covariance, which then is the
    smallest one (John's theorem, with equal weights): a round cell is measured a hundred times faster.  nan
    where round-off hides it: of a cell all but a few points of whose rim have come together.
    """
    points = points - points.mean(axis=1, keepdims=True)
    scale = np.hypot(*points).max()
    if not 0 < scale < np.inf:  # one point, or a coordinate is no number
        return float("nan")
    y = points / scale
    squares, axes = np.linalg.eigh(np.cov(y, bias=True))
    if squares[0] <= 1e-15 * squares[1]:  # on a line
        return 0.0
    if np.ptp(((axes.T @ y) ** 2).T @ (1 / squares)) < 1e-11:
        return float(np.sqrt(squares[0] / squares[1]))
    with suppress(np.linalg.LinAlgError):
        return _ratio(_smallest(y))
    with suppress(np.linalg.LinAlgError):  # few points hold it: among points of a round cell they are easier
        rounding = (axes / np.sqrt(squares)).T
        z = rounding @ y
        return _ratio(_smallest(z / np.hypot(*z).max()) @ rounding)
    return float("nan")


def _ratio(stretch: Array) -> float:
    """Of the axes of the ellipse that a matrix (2, 2) takes to a circle."""
    lengths = np.linalg.svd(stretch, compute_uv=False)
    return float(lengths[1] / lengths[0])


def _smallest(y: Array) -> Array:
    """A (2, 2) of the smallest ellipse {y : |A y + b| <= 1} around points (2, n) of the unit disk."""
    # A = [[p, q], [q, r]], residual A y + b is linear in s = (p, q, r, b1, b2)
    zero, one = np.zeros(y.shape[1]), np.ones(y.shape[1])
    row1 = np.array([y[0], y[1], zero, one, zero])
    row2 = np.array([zero, y[0], y[1], zero, one])
    s = np.array([0.5, 0.0, 0.5, 0.0, 0.0])
    weight = 1.0
    while (gap := y.shape[1] / weight) > 1e-12:
        s = _centre(s, row1, row2, weight, tolerance=1e-8 if gap < 1e-10 else 0.5)
        weight *= 30.0
    return np.array([[s[0], s[1]], [s[1], s[2]]])


def _centre(s: Array, row1: Array, row2: Array, weight: float, tolerance: float) -> Array:
    """Newton's method with backtracking for the minimum of -weight log det A - sum log(1 - |A y + b|^2)."""
    value = _barrier(s, row1, row2, weight)
    for _ in range(60):
        (p, q, r), det = s[:3], s[0] * s[2] - s[1] ** 2
        first, second = s @ row1, s @ row2
        slack = 1 - first**2 - second**2
        normal = 2 * (first * row1 + second * row2) / slack
        adjugate = np.array([r, -2 * q, p, 0, 0]) / det
        gradient = -weight * adjugate + normal.sum(axis=1)
        curvature = np.zeros((5, 5))
        curvature[0, 2] = curvature[2, 0] = -1 / det
        curvature[1, 1] = 2 / det
        hessian = weight * (np.outer(adjugate, adjugate) + curvature)
        hessian += normal @ normal.T + 2 * ((row1 / slack) @ row1.T + (row2 / slack) @ row2.T)
        newton = -np.linalg.solve(hessian, gradient)
        decrement = -gradient @ newton
        if decrement < tolerance:
            return s + newton
        step, floor = 1.0, 1e-15 * abs(value)
        while (
            not (trial := _barrier(s + step * newton, row1, row2, weight)) <= value - 0.1 * step * decrement
        ):
            step *= 0.5
            if not step * decrement >= floor:  # round-off of the barrier value itself, or no number
                return s
        s, value = s + step * newton, trial
    return s


def _barrier(s: Array, row1: Array, row2: Array, weight: float) -> float:
    """The barrier function, infinite outside of its domain."""
    slack = 1 - (s @ row1) ** 2 - (s @ row2) ** 2
    det = s[0] * s[2] - s[1] ** 2
    if s[0] <= 0 or det <= 0 or slack.min() <= 0:
        return np.inf
    return float(-weight * np.log(det) - np.log(slack).sum())
