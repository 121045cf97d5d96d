"""The network's matrix on straight P1 cells, with a third of the arithmetic of `kernels`.

The gradients of a cell's basis functions sum to zero, and so do the rows of a matrix made of products of
them: what couples the two ends of an edge is summed over its cells, and diagonal blocks follow.
"""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.core.pattern import bincount
from fem.kernels import Sample
from fem.space import Space

PAIRS = ((0, 1), (1, 2), (2, 0))
"""Local nodes of a cell's edges."""


class Network:
    """`Sample.isotropic` of a P1 space, summed by edges.

    Parameters
    ----------
    space : of order 1.
    """

    def __init__(self, space: Space) -> None:
        self._pattern = space.vectors.pattern
        self._count = space.xi.shape[1]
        first, second = space.cells[np.array(PAIRS).T]
        keys = np.minimum(first, second) * self._count + np.maximum(first, second)
        found, edge = np.unique(keys, return_inverse=True)
        self._ends = np.array(np.divmod(found, self._count))
        # an edge couples (i at its lower end, j at its upper one); a pair that runs down is transposed
        i, j = np.arange(2)[:, None, None, None], np.arange(2)[:, None, None]
        component = np.where(first > second, 2 * j + i, 2 * i + j)
        self._edges: Indices = (component * found.size + edge.reshape(first.shape)).ravel()
        self._places = self._sources()

    def matrix(self, sample: Sample, moduli: tuple[float, float]) -> sp.csr_matrix:
        """Return the matrix (2 N, 2 N) of first eps(v) : eps(w) + second (div v)(div w)."""
        shear, bulk = moduli[0] / 2, moduli[1]
        stretch = bulk + 2 * shear
        gradients = sample.gradients[:, :, 0]
        weighted = gradients * sample.dx.sum(axis=0)
        local = np.empty((2, 2, len(PAIRS), gradients.shape[-1]))
        for n, (a, b) in enumerate(PAIRS):
            (p, q), (r, s) = weighted[a], gradients[b]
            pr, ps, qr, qs = p * r, p * s, q * r, q * s
            local[0, 0, n] = stretch * pr + shear * qs
            local[1, 1, n] = stretch * qs + shear * pr
            local[0, 1, n] = bulk * ps + shear * qr
            local[1, 0, n] = bulk * qr + shear * ps
        coupled = bincount(self._edges, local.ravel(), 4 * self._ends.shape[1]).reshape(2, 2, -1)
        own = np.empty((2, 2, self._count))
        for i, j in ((0, 0), (0, 1), (1, 1)):
            own[i, j] = own[j, i] = -self._at_ends(coupled[i, j], coupled[j, i])
        return self._pattern.matrix(np.concatenate([coupled.ravel(), own.ravel()])[self._places])

    def _at_ends(self, lower: Array, upper: Array) -> Array:
        """Sum what edges give to their lower and to their upper ends, (N,)."""
        first, second = self._ends
        return bincount(first, lower, self._count) + bincount(second, upper, self._count)

    def _sources(self) -> Indices:
        """Where each entry of the pattern is among those of edges (i, j, edge), then of nodes (i, j, N)."""
        i, j = np.arange(2)[:, None, None], np.arange(2)[:, None]
        nodes = np.arange(self._count)
        rows = [2 * self._ends[0] + i + 0 * j, 2 * nodes + i + 0 * j]
        columns = [2 * self._ends[1] + j + 0 * i, 2 * nodes + j + 0 * i]
        row, column = (np.concatenate([part.ravel() for part in parts]) for parts in (rows, columns))
        mirrored = slice(4 * self._ends.shape[1])
        keys = np.concatenate([row * 2 * self._count + column, (column * 2 * self._count + row)[mirrored]])
        sources = np.arange(row.size)
        return np.concatenate([sources, sources[mirrored]])[np.argsort(keys)]
