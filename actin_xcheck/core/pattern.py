"""Sums of entries that share a place, into vectors and into matrices whose sparsity is found once."""

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array


def bincount(places: Indices, entries: Array, size: int) -> Array:
    """Sums of the entries (k,) that share a place (k,), (size,)."""
    return np.bincount(places, entries, size).astype(np.float64, copy=False)


class Pattern:
    """Sums entries given by row and column into a CSR matrix whose sparsity is found once.

    Parameters
    ----------
    rows, columns : where each entry goes, (k,).
    size : how many rows there are.
    width : how many columns; as many as there are rows where it is not given.
    """

    def __init__(self, rows: Indices, columns: Indices, size: int, width: int | None = None) -> None:
        self.size, self.width = size, width or size
        places, self._place = np.unique(rows * self.width + columns, return_inverse=True)
        self.rows, self.columns = np.divmod(places, self.width)
        self._indptr = np.searchsorted(self.rows, np.arange(size + 1)).astype(np.int32)
        self._indices = self.columns.astype(np.int32)

    def sum(self, entries: Array) -> sp.csr_matrix:
        """Return the matrix of entries (k,)."""
        return self.matrix(bincount(self._place, entries, self._indices.size))

    def matrix(self, data: Array) -> sp.csr_matrix:
        """Return the matrix with these values, one for each of `rows` and `columns`, zeros included."""
        return sp.csr_matrix((data, self._indices, self._indptr), (self.size, self.width))
