"""Element integrals of isoparametric P_k elements, for all cells at once: what one step assembles.

`forms.py` states the weak forms; here the same integrals are array arithmetic on a fixed topology, held to
those forms by the tests.  scikit-fem supplies nodes, basis values and quadrature once (see `space.py`).

Axes: a, b nodes of a cell, i, j components, q quadrature points, e cells.  An axis of length 1 broadcasts:
a straight cell has one gradient for all of its points, and the points of all cells share basis values.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.linear import Pattern, bincount
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array
from fem import forms


@dataclass(frozen=True, eq=False)
class CellRule:
    """Quadrature points in the cells of a space and the basis there: numbers that motion does not change.

    Attributes
    ----------
    cells : nodes of each cell, (a, e).
    weights : weights on the reference triangle (or edge), negative in cells numbered clockwise, (q, e or 1).
    values : basis functions, (a, q, e or 1).
    slopes : their derivatives on the reference triangle, (a, i, q or 1, e or 1).
    """

    cells: Indices
    weights: Array
    values: Array
    slopes: Array

    def blend(self, local: Array) -> Array:
        """Values at the cells' own nodes (..., a, e) at the points, (..., q, e)."""
        return np.einsum("aqe,...ae->...qe", self.values, local)

    def tangent_map(self, x: Array) -> Array:
        """Jacobian dx_i/dX_j of the reference triangle's map to the configuration x (2, N), (i, j, q, e)."""
        return np.einsum("ajqe,iae->ijqe", self.slopes, x[:, self.cells])

    def pushed(self, tangent_map: Array) -> tuple[Array, Array]:
        """Gradients with respect to x (a, i, q or 1, e) and the determinant (q or 1, e) of a tangent map."""
        (x_r, x_s), (y_r, y_s) = tangent_map
        determinant = x_r * y_s - x_s * y_r
        inverse = np.array([[y_s, -x_s], [-y_r, x_r]]) / determinant
        return np.einsum("ajqe,jiqe->aiqe", self.slopes, inverse), determinant

    def at(self, x: Array) -> "CellSample":
        """Return the points in the configuration x (2, N)."""
        gradients, determinant = self.pushed(self.tangent_map(x))
        return CellSample(self, gradients, self.weights * determinant)


@dataclass(frozen=True, eq=False)
class CellSample:
    """A rule in one configuration: gradients with respect to the current x (a, i, q or 1, e), dx (q, e)."""

    rule: CellRule
    gradients: Array
    dx: Array

    def strain(self, u: Array) -> tuple[Array, Array]:
        """eps(u) (i, j, q or 1, e) and div u (q or 1, e) of nodal vectors u (2, N)."""
        gradient = np.einsum("aiqe,jae->ijqe", self.gradients, u[:, self.rule.cells])
        return (gradient + gradient.swapaxes(0, 1)) / 2, gradient[0, 0] + gradient[1, 1]

    def stiffness(self) -> Array:
        """K of (B.22) in each cell, (a, b, e)."""
        return np.einsum("aiqe,biqe->abe", self._weighted(), self.gradients)

    def mass(self) -> Array:
        """M of (B.22) in each cell, (a, b, e)."""
        values = self.rule.values[..., 0]
        return np.tensordot(values[:, None] * values, self.dx, 1)

    def isotropic(self, moduli: tuple[float, float]) -> Array:
        """`forms.isotropic`, first eps(v) : eps(w) + second (div v)(div w), in each cell, (a, i, b, j, e)."""
        shear, bulk = moduli[0] / 2, moduli[1]
        products = np.einsum("aiqe,bjqe->aibje", self._weighted(), self.gradients)
        entries = bulk * products
        entries += shear * products.swapaxes(1, 3)
        laplacian = shear * (products[:, 0, :, 0] + products[:, 1, :, 1])
        entries[:, 0, :, 0] += laplacian
        entries[:, 1, :, 1] += laplacian
        return entries

    def stress_load(self, pressure: Array, strain: Array) -> Array:
        """The integral of (pressure I + strain) : grad w in each cell, (a, i, e).

        Parameters
        ----------
        pressure : isotropic stress, (q or 1, e).
        strain : the rest of it, symmetric, (i, j, q or 1, e).
        """
        stress = strain + np.eye(2)[..., None, None] * pressure
        return np.einsum("ajqe,jiqe->aie", self.gradients, stress * self.dx)

    def load(self, density: Array) -> Array:
        """The integral of density (q, e) against w in each cell, (a, e)."""
        return np.einsum("aqe,qe->ae", self.rule.values, density * self.dx)

    def _weighted(self) -> Array:
        """Gradients times dx; a constant gradient takes the sum of dx at once."""
        if self.gradients.shape[2] == 1:
            return self.gradients * self.dx.sum(axis=0, keepdims=True)
        return self.gradients * self.dx


@dataclass(frozen=True, eq=False)
class RimRule(CellRule):
    """Points on the rim, e counting its edges; `direction` (i, e) is an edge in the reference triangle."""

    direction: Array

    def at(self, x: Array) -> "RimSample":
        """Return the points in the configuration x (2, N)."""
        tangent_map = self.tangent_map(x)
        x_s, y_s = np.einsum("ijqe,je->iqe", tangent_map, self.direction)
        stretch = np.hypot(x_s, y_s)
        gradients, _ = self.pushed(tangent_map)
        return RimSample(self, gradients, self.weights * stretch, np.array([y_s, -x_s]) / stretch)


@dataclass(frozen=True, eq=False)
class RimSample(CellSample):
    """A rim in one configuration: outward normals (i, q, e), dx being ds.

    The rim is small: its weak forms are evaluated as they stand, on the vector basis functions.
    """

    normals: Array

    def normal_load(self, f: Array | float) -> Array:
        """The integral of f (q, e) w.n on each edge, (a, i, e)."""
        density = forms.rim_load.form(self._vectors(), {"f": f, "n": self.normals})
        return np.einsum("aiqe,qe->aie", density, self.dx)

    def friction(self) -> Array:
        """Slip friction of modulus 1 on each edge, (a, i, b, j, e)."""
        v, normals = self._vectors(), self.normals
        density = forms.slip_friction(1.0).form(v, v[:, :, :, None, None], {"n": normals})
        return np.einsum("aibjqe,qe->aibje", density, self.dx)

    def _vectors(self) -> Array:
        """Vector basis functions at the points, (component, a, i, q, e)."""
        return np.einsum("aqe,ki->kaiqe", self.rule.values, np.eye(2))


class Scatter:
    """Sums what the cells contribute to vectors and matrices.

    Parameters
    ----------
    unknowns : global numbers of the local unknowns of each cell, (m, e).
    size : number of global unknowns.
    """

    def __init__(self, unknowns: Indices, size: int) -> None:
        self._unknowns = unknowns.ravel()
        shape = (len(unknowns), *unknowns.shape)
        rows, columns = (np.broadcast_to(index, shape) for index in (unknowns[:, None], unknowns))
        self.pattern = Pattern(rows.ravel(), columns.ravel(), size)

    def vector(self, entries: Array) -> Array:
        """Sum local vectors, (m, e) in any shape, into (size,)."""
        return bincount(self._unknowns, entries.ravel(), self.pattern.size)

    def matrix(self, entries: Array) -> sp.csr_matrix:
        """Sum local matrices, (m, m, e) in any shape, into (size, size)."""
        return self.pattern.sum(entries.ravel())
