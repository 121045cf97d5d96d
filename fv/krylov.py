"""The linear systems of the diamond scheme: FiPy's matrix preconditions itself plus the cross flux.

FiPy's two-point matrix is symmetric with four entries a row, and its factors hardly fill in; those of the sum
fill in four times as much, and it is not symmetric.  The sum is therefore applied, never formed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from actin_xcheck.core import linear
from actin_xcheck.core.errors import COMPLETED, Outcome
from actin_xcheck.core.linear import FACTORISATIONS, ITERATIONS, SOLVES, WORK
from actin_xcheck.core.model import Array

Inverse = Callable[[Array], Array]

GOAL = 1e-14
"""Relative residual at which the iteration stops."""

ACCEPTED = 1e-12
"""Largest relative residual it may leave; above, the sum is solved directly, by `linear.solve`'s own rule."""

MOST = 40
"""Iterations: a direct solution of the sum costs about as much."""

DIRECTIONS, CYCLES = 60, 10
"""Between restarts; and how many of these."""


@dataclass(frozen=True, eq=False)
class TransportOperator:
    """FiPy's matrix minus `scale` times the cross flux, applied factor by factor.

    Attributes
    ----------
    two_point : FiPy's matrix, (n_cells, n_cells).
    from_vertices, to_vertices : the two factors of the cross flux, (n_cells, N) and (N, n_cells).
    scale : its coefficient.
    """

    two_point: sp.csr_matrix
    from_vertices: sp.csr_matrix
    to_vertices: sp.csr_matrix
    scale: float

    def __call__(self, a: Array) -> Array:
        """Apply to cell averages (n_cells,)."""
        product: Array = self.two_point @ a - self.scale * (self.from_vertices @ (self.to_vertices @ a))
        return product

    def matrix(self) -> sp.csr_matrix:
        """The sum itself."""
        return self.two_point - self.scale * (self.from_vertices @ self.to_vertices)


def factorise(matrix: sp.csr_matrix, single: bool = False) -> Inverse | None:
    """Return the solver of FiPy's symmetric matrix, perhaps in single precision; None where it has none."""
    try:
        factor = spl.splu(
            (matrix.astype(np.float32) if single else matrix).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            relax=1,  # columns of so little fill do not gather into blocks
            panel_size=1,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
    WORK[FACTORISATIONS] += 1
    if single:
        return lambda rhs: factor.solve(rhs.astype(np.float32)).astype(np.float64)
    solve: Inverse = factor.solve
    return solve


def iterate(
    apply: Inverse, rhs: Array, inverse: Inverse, goal: float, most: int, guess: Array | None = None
) -> Array:
    """BiCGStab (van der Vorst, SIAM J. Sci. Stat. Comput. 13, 1992), for the caller to check.

    Parameters
    ----------
    apply, rhs : the system, (n,).
    inverse : that of a matrix nearby.
    goal : relative residual at which to stop.
    most : iterations, of two applications each.
    guess : where to start, (n,); 0 without one.
    """
    return _iterated(spl.bicgstab, apply, rhs, inverse, rtol=goal, maxiter=most, x0=guess)


def minimise(apply: Inverse, rhs: Array, inverse: Inverse, goal: float, guess: Array) -> Array:
    """GCROT (Hicken and Zingg, SIAM J. Sci. Comput. 32, 2010), where distorted cells stall BiCGStab.

    Its residual never rises, for which it keeps `DIRECTIONS` vectors (n,).  Parameters as of `iterate`.
    """
    return _iterated(spl.gcrotmk, apply, rhs, inverse, rtol=goal, maxiter=CYCLES, m=DIRECTIONS, x0=guess)


def _iterated(method: Callable[..., Any], apply: Inverse, rhs: Array, inverse: Inverse, **how: Any) -> Array:
    def count(_: Array) -> None:
        WORK[ITERATIONS] += 1

    WORK[SOLVES] += 1
    system, near = (
        spl.LinearOperator((rhs.size, rhs.size), one, dtype=np.float64) for one in (apply, inverse)
    )
    found: Array = method(system, rhs, atol=0.0, M=near, callback=count, **how)[0]
    return found


def solve(
    operator: TransportOperator, rhs: Array, guess: Array, inverse: Inverse | None
) -> tuple[Array, Outcome]:
    """Solve a system of transport by iteration, directly where that fails.

    Parameters
    ----------
    operator, rhs : the system, of which the sum of all rows is the balance of total actin.
    guess : where to start, (n_cells,).
    inverse : of FiPy's matrix here or in a configuration close by.

    Returns
    -------
    The solution and an Outcome, that of the direct solution where it takes one.
    """
    scale = float(np.linalg.norm(rhs))
    if inverse is None or not np.isfinite(scale) or scale == 0.0:
        return linear.solve(operator.matrix(), rhs)
    a = iterate(operator, rhs, inverse, GOAL, MOST, guess)
    residual = rhs - operator(a)
    # a constant has no flux: it takes out of the sum of all rows what the iteration left there
    a = a + residual.sum() / operator(np.ones_like(a)).sum()
    left = float(np.linalg.norm(rhs - operator(a))) / scale
    return (a, COMPLETED) if left <= ACCEPTED else linear.solve(operator.matrix(), rhs)
