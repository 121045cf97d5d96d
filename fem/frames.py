"""P_k fields as they are stored: by their values at equispaced nodes, in VTK's order (`lagrange.py`).

Our nodes are those, but for edges of order 3 and 4, whose Gauss-Lobatto nodes have equispaced counterparts
one by one.  A field's values there follow from its k + 1 values on the edge alone, so that both cells of an
edge agree.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.contract import Grid
from actin_xcheck.core.lagrange import nodes
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from fem.element import UNIFORM, barycentric, lagrange
from fem.space import Space


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
        uniform = UNIFORM[space.order].doflocs.T
        self._change: sp.csr_matrix | None = None
        if space.order > 2:
            self._change = _change(space.cells, lagrange(space.order).tabulate(uniform)[0].T)
        local = _local_numbers(space.order, barycentric(uniform), space.cells, triangles)
        cells = np.take_along_axis(space.cells, local, axis=0)
        self.grid = Grid(self.moved(space.xi), cells, space.order)

    def moved(self, nodal: Array) -> Array:
        """Values (..., N) at the equispaced nodes of a field with values (..., N) at the space's own."""
        return nodal if self._change is None else (self._change @ nodal.T).T


def _change(cells: Indices, local: Array) -> sp.csr_matrix:
    """The matrix (N, N) that is `local` (n_local, n_local) in each cell; cells that share a node agree."""
    count, owned = np.unique(cells, return_index=True)
    row, cell = np.divmod(owned, cells.shape[1])
    entries = np.where(np.abs(local) < 1e-13, 0, local)  # on an edge nothing but the edge counts
    shape = (count.size, cells.shape[0])
    rows = np.broadcast_to(count[:, None], shape)
    matrix = sp.csr_matrix((entries[row].ravel(), (rows.ravel(), cells[:, cell].T.ravel())))
    matrix.eliminate_zeros()
    return matrix


def _local_numbers(order: int, own: Array, cells: Indices, triangles: Indices) -> Indices:
    """Which node of its cell each of VTK's nodes is, (n_local, n_cells).

    Cells of order 3 and 4 have their vertices in another order than the mesh's triangles.
    """
    vertex = (cells[:3, None] == triangles).argmax(axis=0)  # (3, n_cells): our number of VTK's vertices
    numbers = np.empty((len(cells), cells.shape[1]), dtype=np.int64)
    for kind in np.unique(vertex, axis=1).T:
        place = np.empty_like(own)
        place[kind] = nodes(order)
        found = np.abs(own[:, None] - place[..., None]).max(axis=0).argmin(axis=1)
        numbers[:, (vertex == kind[:, None]).all(axis=0)] = found[:, None]
    return numbers
