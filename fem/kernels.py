"""Element integrals of isoparametric P_k elements, for all cells at once: what one step assembles.

`forms.py` states the weak forms; here the same integrals are array arithmetic on a fixed topology, held to
those forms by the tests.  scikit-fem supplies nodes, basis values and quadrature once (see `space.py`).

Axes: a, b nodes of a cell, i, j components, q quadrature points, e cells.  An axis of length 1 broadcasts:
a straight cell has one gradient for all of its points, and the points of all cells share basis values.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from actin_xcheck.core.linear import Pattern, bincount
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array


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
    _last: list[Any] = field(default_factory=list, init=False, repr=False)

    @property
    def shared(self) -> bool:
        """Whether all cells have the same basis values, so that BLAS serves all at once."""
        return self.values.shape[2] == 1

    @cached_property
    def tables(self) -> tuple[Array, Array]:
        """The values (q, a) and slopes (i q, a) that cells share."""
        slopes = self.slopes[..., 0].transpose(1, 2, 0)
        return np.ascontiguousarray(self.values[..., 0].T), slopes.reshape(-1, slopes.shape[2]).copy()

    def blend(self, local: Array) -> Array:
        """Values at the cells' own nodes (..., a, e) at the points, (..., q, e)."""
        if not self.shared:
            return np.einsum("aqe,...ae->...qe", self.values, local)
        return self.tables[0] @ local

    def differentiate(self, local: Array) -> Array:
        """Slopes on the reference triangle, (..., i, q or 1, e), of values at cells' nodes (..., a, e)."""
        if not self.shared:
            return np.einsum("aiqe,...ae->...iqe", self.slopes, local)
        flat = self.tables[1] @ local
        return flat.reshape(*flat.shape[:-2], 2, -1, flat.shape[-1])

    def tangent_map(self, x: Array) -> Array:
        """Jacobian dx_i/dX_j of the reference triangle's map to the configuration x (2, N), (i, j, q, e)."""
        return self.differentiate(x[:, self.cells])

    def inverted(self, tangent_map: Array) -> tuple[Array, Array]:
        """Inverse dX_j/dx_i (j, i, q or 1, e) and determinant (q or 1, e) of a tangent map."""
        (x_r, x_s), (y_r, y_s) = tangent_map
        determinant = x_r * y_s - x_s * y_r
        return np.array([[y_s, -x_s], [-y_r, x_r]]) / determinant, determinant

    def at(self, x: Array) -> "CellSample":
        """Return the points in the configuration x (2, N); the last one is remembered: much asks for it."""
        if not (self._last and self._last[0] is x):
            inverse, determinant = self.inverted(self.tangent_map(x))
            self._last[:] = x, CellSample(self, inverse, self.weights * determinant)
        sample: CellSample = self._last[1]
        return sample


@dataclass(frozen=True, eq=False)
class CellSample:
    """A rule in one configuration: dX_j/dx_i of the reference triangle (j, i, q or 1, e), dx (q, e)."""

    rule: CellRule
    inverse: Array
    dx: Array

    @cached_property
    def gradients(self) -> Array:
        """Gradients of the basis with respect to the current x, (a, i, q or 1, e)."""
        return np.einsum("ajqe,jiqe->aiqe", self.rule.slopes, self.inverse)

    def gradient(self, local: Array) -> Array:
        """Gradients with respect to x, (..., i, q or 1, e), of values at the cells' nodes (..., a, e)."""
        slopes = self.rule.differentiate(local)[..., None, :, :]
        return slopes[..., 0, :, :, :] * self.inverse[0] + slopes[..., 1, :, :, :] * self.inverse[1]

    def strain(self, u: Array) -> tuple[Array, Array]:
        """eps(u) (i, j, q or 1, e) and div u (q or 1, e) of nodal vectors u (2, N)."""
        return self.strain_of(u[:, self.rule.cells])

    def strain_of(self, local: Array) -> tuple[Array, Array]:
        """The same of vectors at the cells' own nodes, (i, a, e)."""
        gradient = self.gradient(local)
        return (gradient + gradient.swapaxes(0, 1)) / 2, gradient[0, 0] + gradient[1, 1]

    def stiffness(self) -> Array:
        """K of (B.22) in each cell, (a, b, e)."""
        if self.gradients.shape[2] == 1:
            return np.einsum("aiqe,biqe->abe", self._weighted(), self.gradients)
        weighted, plain = (of.reshape(len(of), -1, of.shape[-1]) for of in (self._weighted(), self.gradients))
        return (weighted.transpose(2, 0, 1) @ plain.transpose(2, 1, 0)).transpose(1, 2, 0)

    def mass(self) -> Array:
        """M of (B.22) in each cell, (a, b, e)."""
        values = self.rule.values[..., 0]
        return np.tensordot(values[:, None] * values, self.dx, 1)

    def isotropic(self, moduli: tuple[float, float]) -> Array:
        """`forms.isotropic`, first eps(v) : eps(w) + second (div v)(div w), in each cell, (a, i, b, j, e)."""
        shear, bulk = moduli[0] / 2, moduli[1]
        nodes, _, points, cells = self.gradients.shape
        if points == 1:
            products = np.einsum("aiqe,bjqe->aibje", self._weighted(), self.gradients)
        else:
            weighted, plain = (
                of.reshape(2 * nodes, points, cells) for of in (self._weighted(), self.gradients)
            )
            flat = weighted.transpose(2, 0, 1) @ plain.transpose(2, 1, 0)
            products = flat.transpose(1, 2, 0).reshape(nodes, 2, nodes, 2, cells)
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
        return self.flux_load(stress).swapaxes(0, 1)

    def flux_load(self, flux: Array) -> Array:
        """The integral of flux (..., i, q or 1, e) times grad w in each cell, (..., a, e)."""
        weighted = flux * self.dx
        if self.inverse.shape[2] == 1:
            weighted = weighted.sum(axis=-2, keepdims=True)
        pulled = (weighted[..., None, :, :, :] * self.inverse).sum(axis=-3)
        if not self.rule.shared:
            return np.einsum("aiqe,...iqe->...ae", self.rule.slopes, pulled)
        return self.rule.tables[1].T @ pulled.reshape(*pulled.shape[:-3], -1, pulled.shape[-1])

    @cached_property
    def metric(self) -> Array:
        """What two slopes on the reference triangle contribute to grad a . grad b dx, (j, j', q e)."""
        return ((self.inverse[:, None] * self.inverse).sum(axis=2) * self.dx).reshape(2, 2, -1)

    def elasticity(self, moduli: tuple[float, float]) -> Array:
        """The same for first eps(v) : eps(w) + second (div v)(div w), by component, (i j, i' j', q e)."""
        shear, bulk = moduli[0] / 2, moduli[1]
        products = (self.inverse * self.dx)[:, :, None, None] * self.inverse
        tensor = bulk * products.transpose(1, 0, 3, 2, 4, 5) + shear * products.transpose(3, 0, 1, 2, 4, 5)
        tensor = tensor.reshape(2, 2, 2, 2, -1)
        tensor[0, :, 0] += shear * self.metric
        tensor[1, :, 1] += shear * self.metric
        return tensor.reshape(4, 4, -1)

    def load(self, density: Array) -> Array:
        """The integral of density (q, e) against w in each cell, (a, e)."""
        if not self.rule.shared:
            return np.einsum("aqe,qe->ae", self.rule.values, density * self.dx)
        return self.rule.tables[0].T @ (density * self.dx)

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
        inverse, _ = self.inverted(tangent_map)
        return RimSample(self, inverse, self.weights * stretch, np.array([y_s, -x_s]) / stretch)


@dataclass(frozen=True, eq=False)
class RimSample(CellSample):
    """A rim in one configuration: outward normals (i, q, e), dx being ds.

    Load and friction are `forms.rim_load` and `forms.slip_friction` of basis functions of one component each.
    """

    normals: Array

    def normal_load(self, f: Array | float) -> Array:
        """The integral of f (q, e) w.n on each edge, (a, i, e)."""
        density = f * (self.normals * self.rule.values[:, None])
        return np.einsum("aiqe,qe->aie", density, self.dx)

    def friction(self) -> Array:
        """Slip friction of modulus 1 on each edge, (a, i, b, j, e)."""
        tangent = np.array([-self.normals[1], self.normals[0]])
        along = tangent * self.rule.values[:, None]
        return np.einsum("aibjqe,qe->aibje", along * along[:, :, None, None], self.dx)


class Scatter:
    """Sums what the cells contribute to vectors and matrices.

    Parameters
    ----------
    unknowns : global numbers of the local unknowns of each cell, (m, e).
    size : number of global unknowns.
    """

    def __init__(self, unknowns: Indices, size: int) -> None:
        self._unknowns = unknowns.ravel()
        self._local = unknowns
        shape = (len(unknowns), *unknowns.shape)
        rows, columns = (np.broadcast_to(index, shape) for index in (unknowns[:, None], unknowns))
        self.pattern = Pattern(rows.ravel(), columns.ravel(), size)

    @cached_property
    def of_cells(self) -> Indices:
        """Of vector fields: the unknowns of cells by component, (2, n_local, n_cells)."""
        return self._local.reshape(-1, 2, self._local.shape[1]).swapaxes(0, 1).copy()

    def vector(self, entries: Array) -> Array:
        """Sum local vectors, (m, e) in any shape, into (size,)."""
        return bincount(self._unknowns, entries.ravel(), self.pattern.size)

    def matrix(self, entries: Array) -> sp.csr_matrix:
        """Sum local matrices, (m, m, e) in any shape, into (size, size)."""
        return self.pattern.sum(entries.ravel())
