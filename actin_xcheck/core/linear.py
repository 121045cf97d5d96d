"""Linear systems: how they are summed up and solved, and what is counted of it.

This is the one seam to sparse direct solvers; no residual above the tolerance passes in silence.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from math import isfinite, sqrt
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from actin_xcheck.core.preconditioner import Front, Preconditioner

TOLERANCE = 1e-10
"""Largest relative residual |Ax - b| / |b| that is not a failure.

Round-off alone leaves eps |A| |x| / |b|, which grows like h^-2: 5e-13 on 33025 nodes of P1, 1e-11 on 8321
of P4.
"""

ACCURACY = 1e-13
"""Relative residual at which an iteration stops."""

POLISH = 1e-2
"""Of what is left then, the part that a second iteration leaves: round-off, as of a factorisation."""

PATIENCE = 40
"""Iterations that cost as much as a factorisation."""


class Operator(Protocol):
    """A symmetric matrix that is applied without being there."""

    def __matmul__(self, vector: Array) -> Array:
        """Apply it to a vector (n,)."""
        ...

    def assembled(self) -> sp.csr_matrix:
        """The matrix (n, n) by its entries."""
        ...


def solve(matrix: sp.spmatrix, rhs: Array) -> tuple[Array, Outcome]:
    """Solve a structurally symmetric system directly, refine once and check the residual.

    Parameters
    ----------
    matrix : square sparse matrix (n, n) that needs no pivoting (positive definite or diagonally dominant).
    rhs : right-hand side (n,).

    Returns
    -------
    The solution (n,) and an Outcome, `not_converged` with the residual where it exceeds `TOLERANCE`.
    """
    return _checked(_superlu, matrix, rhs)


def _superlu(matrix: sp.spmatrix) -> Callable[[Array], Array]:
    from scipy.sparse.linalg import splu  # here: it takes over where the factorisation below fails

    options = {"SymmetricMode": True}
    factor = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return factor.solve


def _checked(
    factorise: Callable[[sp.spmatrix], Callable[[Array], Array]], matrix: sp.spmatrix, rhs: Array
) -> tuple[Array, Outcome]:
    scale = float(np.linalg.norm(rhs))
    if scale == 0.0:
        return np.zeros_like(rhs), COMPLETED
    if not np.isfinite(scale):
        return np.full_like(rhs, np.nan), Outcome(Ending.NON_FINITE, "the right-hand side is not finite")
    try:
        inverse = factorise(matrix)
    except RuntimeError as error:
        return np.full_like(rhs, np.nan), Outcome(Ending.NOT_CONVERGED, f"factorisation failed: {error}")
    WORK[FACTORISATIONS] += 1
    WORK[SOLVES] += 1
    solution = inverse(rhs)
    solution = solution + inverse(rhs - matrix @ solution)
    residual = float(np.linalg.norm(rhs - matrix @ solution)) / scale
    if not residual <= TOLERANCE:
        message = f"linear solve left a relative residual of {residual:.1e} (tolerance {TOLERANCE:.0e})"
        return solution, Outcome(Ending.NOT_CONVERGED, message)
    return solution, COMPLETED


class SymmetricSolver:
    """Solver of symmetric positive definite systems that share one sparsity pattern.

    A multifrontal Cholesky factorisation (Duff and Reid, ACM Trans. Math. Softw. 9, 1983): symbolic work
    is done here, once, and a factorisation is dense LAPACK on one small matrix per part of a dissection.
    A `Preconditioner` made of a matrix nearby saves that of the matrix itself.

    Parameters
    ----------
    rows, columns : pattern of the matrices, both triangles, in CSR order, (k,).
    parts : the part of a nested dissection each unknown belongs to, in order of elimination, (n,).
    """

    def __init__(self, rows: Indices, columns: Indices, parts: Indices) -> None:
        self._order = np.argsort(parts, kind="stable")
        rank = np.empty_like(self._order)
        rank[self._order] = np.arange(self._order.size)
        starts = np.flatnonzero(np.diff(parts[self._order], prepend=-1))
        bounds = np.append(starts, parts.size)
        row, column = rank[rows], rank[columns]
        upper = np.flatnonzero(row <= column)
        upper = upper[np.argsort(row[upper], kind="stable")]
        cuts = np.searchsorted(row[upper], bounds)
        children: list[list[int]] = [[] for _ in starts]
        self._fronts: list[Front] = []
        for number, (start, end) in enumerate(pairwise(bounds.tolist())):
            source = upper[cuts[number] : cuts[number + 1]]
            coupled = [column[source], *(self._fronts[child].boundary for child in children[number])]
            boundary = np.unique(np.concatenate(coupled))
            boundary = boundary[boundary >= end]
            front = np.concatenate([np.arange(start, end), boundary])
            place = (row[source] - start) * front.size + np.searchsorted(front, column[source])
            pieces = [(child, _pieces(front, self._fronts[child].boundary)) for child in children[number]]
            self._fronts.append(Front(slice(start, end), boundary, place, source, pieces))
            if boundary.size:
                children[int(np.searchsorted(starts, boundary[0], side="right")) - 1].append(number)

    def solve(
        self,
        matrix: "sp.csr_matrix | Operator",
        rhs: Array,
        near: Preconditioner | None = None,
        start: Array | None = None,
    ) -> tuple[Array, Outcome]:
        """Like `linear.solve`, which takes over where the matrix is not positive definite.

        Parameters
        ----------
        matrix, rhs : the system, (n, n) and (n,).
        near : of a matrix nearby: conjugate gradients then, as long as they are faster than a factorisation.
        start : where these begin, (n,); at zero if it is not given.
        """
        if near is not None and (solution := _iterated(matrix, rhs, near, start)) is not None:
            WORK[SOLVES] += 1
            return solution, COMPLETED
        if not sp.issparse(matrix):
            matrix = matrix.assembled()
        solution, outcome = _checked(self._factorise, matrix, rhs)
        return (solution, outcome) if outcome.ok else solve(matrix, rhs)

    def preconditioner(self, matrix: sp.csr_matrix) -> Preconditioner | None:
        """Return what stands for the inverses of matrices near this one; None if it has no factor."""
        WORK[FACTORISATIONS] += 1
        try:
            return Preconditioner(self._order, self._fronts, self._eliminated(matrix))
        except RuntimeError:
            return None

    def _factorise(self, matrix: sp.csr_matrix) -> Callable[[Array], Array]:
        """Return the solver of L L^T x = b."""
        blocks = list(self._eliminated(matrix))
        return lambda rhs: self._substitute(blocks, rhs)

    def _eliminated(self, matrix: sp.csr_matrix) -> Iterator[tuple[Array, Array]]:
        """Yield L by columns of blocks (pivots; boundary), front by front."""
        schur: list[Array | None] = [None] * len(self._fronts)
        for number, front in enumerate(self._fronts):
            pivots, size = front.pivots.stop - front.pivots.start, front.boundary.size
            dense = np.zeros((pivots + size, pivots + size))
            dense.ravel()[front.place] = matrix.data[front.source]
            for child, pieces in front.children:
                update, schur[child] = schur[child], None
                assert update is not None
                for i, j, k, m in pieces:
                    dense[i, j] += update[k, m]
            # LAPACK sees transposes: the upper triangle of rows is the lower one of its columns
            diagonal, info = dpotrf(dense[:pivots, :pivots].T, lower=1, clean=0)
            if info:
                raise RuntimeError("the matrix is not positive definite")
            below = dtrsm(1.0, diagonal, dense[:pivots, pivots:].T, side=1, lower=1, trans_a=1)
            schur[number] = dense[pivots:, pivots:] - below @ below.T
            yield diagonal, below

    def _substitute(self, blocks: list[tuple[Array, Array]], rhs: Array) -> Array:
        x = rhs[self._order]
        for front, (diagonal, below) in zip(self._fronts, blocks, strict=True):
            x[front.pivots] = y = dtrsv(diagonal, x[front.pivots], lower=1)
            x[front.boundary] -= below @ y
        for front, (diagonal, below) in zip(reversed(self._fronts), reversed(blocks), strict=True):
            y = x[front.pivots] - x[front.boundary] @ below
            x[front.pivots] = dtrsv(diagonal, y, lower=1, trans=1)
        solution = np.empty_like(x)
        solution[self._order] = x
        return solution


def _iterated(
    matrix: sp.csr_matrix | Operator, rhs: Array, near: Preconditioner, start: Array | None
) -> Array | None:
    """Solve by conjugate gradients, refined once; None where a factorisation is faster, or needed."""
    scale = sqrt(rhs @ rhs)
    if scale == 0.0 or not isfinite(scale):
        return None
    solution, residual = (start, rhs - matrix @ start) if start is not None else (np.zeros_like(rhs), rhs)
    # from zero a second iteration leaves round-off, as of a factorisation
    for goal in (ACCURACY * scale, None) if start is None else (ACCURACY * scale,):
        if goal is not None and sqrt(residual @ residual) <= goal:
            continue
        correction = _conjugate_gradients(matrix, residual, near, goal)
        if correction is None:
            if goal is not None:
                return None
            break
        solution = solution + correction
        residual = rhs - matrix @ solution
    return solution if sqrt(residual @ residual) <= TOLERANCE * scale else None


def _conjugate_gradients(
    matrix: sp.csr_matrix | Operator, rhs: Array, near: Preconditioner, goal: float | None
) -> Array | None:
    """Reduce the residual's norm to a goal, or to `POLISH` of what it is; None where that takes too long."""
    scale = sqrt(rhs @ rhs)
    if scale == 0.0 or not isfinite(scale):
        return None
    goal = POLISH * scale if goal is None else goal
    solution, residual, direction = np.zeros_like(rhs), rhs.copy(), np.zeros_like(rhs)
    first = before = 1.0
    for count in range(PATIENCE):
        correction = near(residual)
        WORK[ITERATIONS] += 1
        product = float(residual @ correction)
        direction = correction + product / before * direction
        image = matrix @ direction
        curvature = float(direction @ image)
        if not (product > 0 and curvature > 0):
            return None
        first = first if count else product
        # the energy of the error falls steadily, the residual need not
        if product / first > ACCURACY ** (2 * (count - 5) / PATIENCE):
            return None
        solution += product / curvature * direction
        residual -= product / curvature * image
        before = product
        if sqrt(residual @ residual) <= goal:
            return solution
    return None


def _pieces(front: Indices, boundary: Indices) -> list[tuple[slice, slice, slice, slice]]:
    """Upper-triangle rectangles that add a child's Schur complement to its parent's front: few, long runs."""
    target = np.searchsorted(front, boundary)
    breaks = np.flatnonzero(np.diff(target) != 1) + 1
    cuts = [0, *breaks.tolist(), target.size]
    child = [slice(a, b) for a, b in pairwise(cuts)]
    parent = [slice(int(target[s.start]), int(target[s.start]) + s.stop - s.start) for s in child]
    return [
        (parent[i], parent[j], child[i], child[j]) for i in range(len(child)) for j in range(i, len(child))
    ]


FACTORISATIONS = "factorisations"
"""Matrices factorised, preconditioners among them."""

SOLVES = "solves"
"""Linear systems solved, by whatever means, a right-hand side each."""

ITERATIONS = "iterations"
"""Of conjugate gradients."""

WORK: Counter[str] = Counter()
"""One number by name; whoever measures a run clears it before and reads it after."""


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
