"""The one seam to sparse direct solvers; no residual above the tolerance passes in silence."""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from actin_xcheck.model import Array
from actin_xcheck.result import COMPLETED, Ending, Outcome

TOLERANCE = 1e-12
"""Largest relative residual |Ax - b| / |b| that is not a failure."""


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
    scale = float(np.linalg.norm(rhs))
    if scale == 0.0:
        return np.zeros_like(rhs), COMPLETED
    if not np.isfinite(scale):
        return np.full_like(rhs, np.nan), Outcome(Ending.NON_FINITE, "the right-hand side is not finite")
    matrix = matrix.tocsc()
    try:
        factor = spl.splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        return np.full_like(rhs, np.nan), Outcome(Ending.NOT_CONVERGED, f"factorisation failed: {error}")
    solution = factor.solve(rhs)
    solution = solution + factor.solve(rhs - matrix @ solution)
    residual = float(np.linalg.norm(rhs - matrix @ solution)) / scale
    if not residual <= TOLERANCE:
        message = f"linear solve left a relative residual of {residual:.1e} (tolerance {TOLERANCE:.0e})"
        return solution, Outcome(Ending.NOT_CONVERGED, message)
    return solution, COMPLETED
