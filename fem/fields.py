"""P_k fields: integrals over the curved cell, material points in it, and how its fields are stored.

They are stored by their values at equispaced nodes, in VTK's order (`lagrange.py`), which have counterparts
among ours one by one.  It is the same polynomial; from k = 3 on its values there are sums, which round.  On
an edge they follow from its k + 1 values there alone, so that both cells of an edge agree.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import Grid
from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.lagrange import lagrange, nodes
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.core.observables import Measures
from fem.kernels import CellRule
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


def _determinant(rule: CellRule, x: Array) -> Array:
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
        (a, b), (c, d) = np.einsum("iaq,ajq->ijq", nodes, slopes)
        determinant = a * d - b * c
        steps = np.array([d * left[0] - b * left[1], a * left[1] - c * left[0]])
        # a point of the cell has coordinates in [0, 1]: nothing is lost, and nothing runs away
        before, r = r, np.clip(r + steps / np.where(determinant == 0, 1.0, determinant), -1, 2)
        lost = (np.abs(r - 0.5) == 1.5).any(axis=0)  # held at the bounds, outside of the cell
        if (lost | (np.abs(r - before).max(axis=0) < 1e-8)).all():  # errors are squared
            break
    outside = np.maximum(np.maximum(-r, 0).max(axis=0), r.sum(axis=0) - 1)
    missed = np.hypot(*(points - np.einsum("iaq,aq->iq", nodes, element.tabulate(r)[0]))) > 1e-10
    return r, np.where(missed, np.inf, outside)


class Lattice:
    """The equispaced nodes of a space, numbered like its own.

    Parameters
    ----------
    space : on some mesh.
    triangles : vertices of the mesh's cells, counter-clockwise, (3, n_cells).

    Attributes
    ----------
    grid : what is stored.
    """

    def __init__(self, space: Space, triangles: Indices) -> None:
        uniform = lagrange(space.order).uniform
        self._change: sp.csr_matrix | None = None
        if space.order > 2:
            self._change = _change(space.cells, lagrange(space.order).tabulate(uniform[1:])[0].T)
        local = _local_numbers(space.order, uniform, space.cells, triangles)
        cells = np.take_along_axis(space.cells, local, axis=0)
        self.grid = Grid(self.moved(space.xi), cells, space.order)

    def moved(self, nodal: Array) -> Array:
        """Values (..., N) at the equispaced nodes of a field with values (..., N) at the space's own."""
        return nodal if self._change is None else (self._change @ nodal.T).T


def _change(cells: Indices, local: Array) -> sp.csr_matrix:
    """The matrix (N, N) that is `local` (n_local, n_local) in each cell; cells that share a node agree."""
    count, owned = np.unique(cells, return_index=True)
    row, cell = np.divmod(owned, cells.shape[1])
    # on an edge nothing but the edge counts, and vertices are shared
    entries = np.where(np.abs(local - np.rint(local)) < 1e-13, np.rint(local), local)
    shape = (count.size, cells.shape[0])
    rows = np.broadcast_to(count[:, None], shape)
    matrix = sp.csr_matrix((entries[row].ravel(), (rows.ravel(), cells[:, cell].T.ravel())))
    matrix.eliminate_zeros()
    return matrix


def _local_numbers(order: int, own: Array, cells: Indices, triangles: Indices) -> Indices:
    """Which node of its cell each of VTK's nodes is, (n_local, n_cells).

    Cells of order 3 and more have their vertices in another order than the mesh's triangles.
    """
    vertex = (cells[:3, None] == triangles).argmax(axis=0)  # (3, n_cells): our number of VTK's vertices
    numbers = np.empty((len(cells), cells.shape[1]), dtype=np.int64)
    for kind in np.unique(vertex, axis=1).T:
        place = np.empty_like(own)
        place[kind] = nodes(order)
        found = np.abs(own[:, None] - place[..., None]).max(axis=0).argmin(axis=1)
        numbers[:, (vertex == kind[:, None]).all(axis=0)] = found[:, None]
    return numbers
