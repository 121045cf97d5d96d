"""Linear systems of the transport equation (B.22): a mass matrix, or one with diffusion added."""

from math import log2

import scipy.sparse as sp

from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import Preconditioner, SymmetricSolver
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from fem.space import Space


class TransportSolver:
    """Solves with multiples of M + s K, M and K of (B.22) in any configuration, s >= 0.

    The same matrix in a configuration nearby preconditions it, with s rounded to a fourth of an octave: few
    factorisations serve all steps, and what a solve returns depends on its arguments alone.

    Parameters
    ----------
    space : of the concentration.
    """

    def __init__(self, space: Space) -> None:
        self.space = space
        pattern = space.scalars.pattern
        self._solver = SymmetricSolver(pattern.rows, pattern.columns, space.parts)
        self._rest = Anchor(space.xi)

    def solve(
        self, matrix: sp.csr_matrix, rhs: Array, diffusion: float, anchor: Anchor | None = None
    ) -> tuple[Array, Outcome]:
        """Solve with a multiple (N, N) of M + s K, s being `diffusion`, for a right-hand side (N,).

        An anchor near, the reference disk if none is given, makes it fast.
        """
        rounded = 2.0 ** (round(4 * log2(diffusion)) / 4) if diffusion > 0 else 0.0
        anchor = anchor or self._rest
        return self._solver.solve(
            matrix, rhs, anchor.factor(rounded, lambda: self._factor(anchor.x, rounded))
        )

    def _factor(self, x: Array, diffusion: float) -> Preconditioner | None:
        space = self.space
        mass = space.scalars.matrix(space.inside.at(x).mass())
        stiffness = space.scalars.matrix(space.gradients.at(x).stiffness())
        return self._solver.preconditioner(
            space.scalars.pattern.matrix(mass.data + diffusion * stiffness.data)
        )
