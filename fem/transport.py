"""Linear systems of the transport equation (B.22): a mass matrix, or one with diffusion added."""

from dataclasses import dataclass
from functools import cached_property
from math import log2

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.linear import Operator, Preconditioner, SymmetricSolver
from actin_xcheck.core.model import Array
from actin_xcheck.core.motion import Anchor
from fem.space import CELLWISE, Space


class TransportMatrices:
    """M and K of (B.22) in one configuration.

    Parameters
    ----------
    space : of the concentration.
    x : node positions (2, N).
    """

    def __init__(self, space: Space, x: Array) -> None:
        self.space, self.x = space, x

    @cached_property
    def mass(self) -> sp.csr_matrix | Operator:
        """M, (N, N)."""
        return CellTransport(self, 1.0, 0.0) if self.space.order >= CELLWISE else self._mass

    @cached_property
    def stiffness(self) -> sp.csr_matrix | Operator:
        """K, (N, N)."""
        return CellTransport(self, 0.0, 1.0) if self.space.order >= CELLWISE else self._stiffness

    def combined(self, mass: float, diffusion: float) -> sp.csr_matrix | Operator:
        """A multiple of M plus one of K."""
        if self.space.order >= CELLWISE:
            return CellTransport(self, mass, diffusion)
        return self.assembled(mass, diffusion)

    def assembled(self, mass: float, diffusion: float) -> sp.csr_matrix:
        """The same, entry by entry."""
        data = mass * self._mass.data + diffusion * self._stiffness.data
        return self.space.scalars.pattern.matrix(data)

    @cached_property
    def _mass(self) -> sp.csr_matrix:
        return self.space.scalars.matrix(self.space.inside.at(self.x).mass())

    @cached_property
    def _stiffness(self) -> sp.csr_matrix:
        return self.space.scalars.matrix(self.space.gradients.at(self.x).stiffness())

    def kept(self, a: Array, total: float) -> tuple[Array, Array]:
        """Shift a (N,) by what a solver has left of a total amount; also M a, whose sum that is."""
        content = self.mass @ a
        inside = self.space.inside.at(self.x)
        ones = self.space.scalars.vector(inside.load(np.ones_like(inside.dx)))
        shift = (total - content.sum()) / ones.sum()
        return a + shift, content + shift * ones

    def diagonal(self) -> Array:
        """Of M, (N,)."""
        if self.space.order < CELLWISE:
            return np.asarray(self._mass.diagonal())
        squares = self.space.inside.values[..., 0] ** 2
        return self.space.scalars.vector(squares @ self.space.inside.at(self.x).dx)


@dataclass(frozen=True, eq=False)
class CellTransport:
    """A multiple of M plus one of K, applied cell by cell: many numbers are never made."""

    of: TransportMatrices
    mass: float
    diffusion: float

    def __matmul__(self, a: Array) -> Array:
        """Apply it to a concentration (N,)."""
        space = self.of.space
        sample, (values, slopes), local = space.inside.at(self.of.x), space.inside.tables, a[space.cells]
        summed = np.zeros_like(local)
        if self.mass:
            summed += values.T @ (self.mass * sample.dx * (values @ local))
        if self.diffusion:
            flux = np.einsum("mnp,np->mp", sample.metric, (slopes @ local).reshape(2, -1))
            summed += self.diffusion * (slopes.T @ flux.reshape(-1, local.shape[1]))
        return space.scalars.vector(summed)

    def assembled(self) -> sp.csr_matrix:
        """The matrix."""
        return self.of.assembled(self.mass, self.diffusion)


class TransportSolver:
    """Solves with multiples of M + s K, M and K of (B.22) in any configuration, s >= 0.

    The same matrix in a configuration nearby preconditions it, with s rounded to a fourth of an octave, or to
    an octave where iterations are cheap: few factorisations serve all steps, and what a solve returns depends
    on its arguments alone.

    Parameters
    ----------
    space : of the concentration.
    """

    def __init__(self, space: Space) -> None:
        self.space = space
        pattern = space.scalars.pattern
        self._solver = SymmetricSolver(pattern.rows, pattern.columns, space.parts)
        self._rest = Anchor(space.xi)
        self._parts = 1 if space.order >= CELLWISE else 4

    def solve(
        self,
        matrix: sp.csr_matrix | Operator,
        rhs: Array,
        diffusion: float,
        anchor: Anchor | None = None,
        start: Array | None = None,
    ) -> tuple[Array, Outcome]:
        """Solve with a multiple (N, N) of M + s K, s being `diffusion`, for a right-hand side (N,).

        An anchor near, the reference disk if none is given, makes it fast, and so does a solution near.
        """
        rounded = 2.0 ** (round(self._parts * log2(diffusion)) / self._parts) if diffusion > 0 else 0.0
        anchor = anchor or self._rest
        return self._solver.solve(
            matrix, rhs, anchor.factor(rounded, lambda: self._factor(anchor.x, rounded)), start
        )

    def _factor(self, x: Array, diffusion: float) -> Preconditioner | None:
        return self._solver.preconditioner(TransportMatrices(self.space, x).assembled(1.0, diffusion))
