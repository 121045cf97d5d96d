"""What is measured on curved cells: integrals, material points, orientation."""

import numpy as np

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import Measures
from actin_xcheck.core.outcome import COMPLETED, Ending, Outcome
from fem.element import lagrange
from fem.kernels import Rule
from fem.space import Space


def measure(space: Space, x: Array, a: Array) -> Measures:
    """Integrals over the cell with nodes x (2, N) and concentrations a (N,), and its rim nodes.

    The smallest det dx/dxi is that at quadrature points.
    """
    rule = space.inside
    now, before = (_determinant(rule, nodes) for nodes in (x, space.xi))
    dx = rule.weights * now
    place, density = (rule.blend(nodal[..., space.cells]) for nodal in (x, a))
    area = float(dx.sum())
    centroid = (place * dx).sum(axis=(1, 2)) / area
    total, stretch = float((density * dx).sum()), float((now / before).min())
    return Measures(area, total, centroid, x[:, space.rim_nodes], stretch)


def cell_means(space: Space, x: Array, a: Array) -> Array:
    """Means (n_cells,) of concentrations a (N,) over the cells with nodes x (2, N), integrated exactly."""
    rule = space.rule(3 * space.order - 2)
    dx = rule.weights * _determinant(rule, x)
    return (rule.blend(a[space.cells]) * dx).sum(axis=0) / dx.sum(axis=0)


def _determinant(rule: Rule, x: Array) -> Array:
    """Determinant (q or 1, n_cells) of the map of the reference triangle to the configuration x (2, N)."""
    (x_r, x_s), (y_r, y_s) = rule.tangent_map(x)
    return x_r * y_s - x_s * y_r


def orientation(space: Space, t: float, x: Array) -> Outcome:
    """Check the Jacobian at all quadrature points: `tangled` names the worst cell if one has turned over."""
    areas = space.inside.at(x).dx
    if not np.isfinite(areas).all():
        return Outcome(Ending.NON_FINITE, f"node positions are not finite at t = {t:.6g}")
    worst = int(np.argmin(areas.min(axis=0)))
    if areas[:, worst].min() > 0:
        return COMPLETED
    where = space.xi[:, space.cells[:3, worst]].mean(axis=1)
    message = (
        f"cell {worst}, which started at ({where[0]:.3f}, {where[1]:.3f}), has turned over at one of its "
        f"quadrature points at t = {t:.6g}"
    )
    return Outcome(Ending.TANGLED, message)


def locate(space: Space, points: Array) -> tuple[Indices, Array]:
    """Find material points (2, k): their cells (k,) and the values of the cell's basis there (n_local, k).

    Of the cells around a point the one whose map reaches it from nearest to its inside.
    """
    nodes = space.xi[:, space.cells]
    size = np.ptp(nodes, axis=1)[:, None]
    near = np.abs(nodes.mean(axis=1)[:, None] - points[:, :, None]) < size  # its box, doubled
    point, cell = np.nonzero(near.all(axis=0))
    r, outside = _inverted(space, nodes[:, :, cell], points[:, point])
    order = np.lexsort((outside, point))
    best = order[np.searchsorted(point[order], np.arange(points.shape[1]))]
    return cell[best], lagrange(space.order).tabulate(r[:, best])[0]


def _inverted(space: Space, nodes: Array, points: Array) -> tuple[Array, Array]:
    """Newton's method for the reference points (2, q) that cells with nodes (2, n_local, q) map to `points`.

    Also how far outside of the reference triangle each one lies, (q,): infinitely where none was found.
    """
    element, r = lagrange(space.order), np.full_like(points, 1 / 3)
    for _ in range(30):
        values, slopes = element.tabulate(r)
        left = points - np.einsum("iaq,aq->iq", nodes, values)
        slopes = np.broadcast_to(slopes, (*slopes.shape[:2], r.shape[1]))
        (a, b), (c, d) = np.einsum("iaq,ajq->ijq", nodes, slopes)
        determinant = a * d - b * c
        steps = np.array([d * left[0] - b * left[1], a * left[1] - c * left[0]])
        # a point of the cell has coordinates in [0, 1]: nothing is lost, and nothing runs away
        r = np.clip(r + steps / np.where(determinant == 0, 1.0, determinant), -1, 2)
    outside = np.maximum(np.maximum(-r, 0).max(axis=0), r.sum(axis=0) - 1)
    missed = np.hypot(*(points - np.einsum("iaq,aq->iq", nodes, element.tabulate(r)[0]))) > 1e-10
    return r, np.where(missed, np.inf, outside)
