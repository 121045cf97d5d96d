"""Bases that move: evaluated once on the fixed reference mesh, seen in the current configuration.

With F = dx/dxi, gradients become grad w F^-1, areas dx = |F| dxi and rim elements n ds = |F| F^-T n0 ds0
(Nanson).  Motion then changes numbers only: no new mesh, no new basis, no stale cache.
"""

import copy
from dataclasses import dataclass

import numpy as np
from skfem import Basis, ElementTriP1, ElementVector, FacetBasis, MeshTri
from skfem.element import DiscreteField, ElementDG
from skfem.helpers import det, inv

from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array


def interleave(x: Array) -> Array:
    """Node vectors (2, N) as scikit-fem's vector dofs (2 N,)."""
    return x.T.ravel()


def separate(dofs: Array) -> Array:
    """Inverse of `interleave`."""
    return dofs.reshape(-1, 2).T


class MovingBasis:
    """A scikit-fem basis on the reference mesh together with the geometry that carries it along."""

    def __init__(self, basis: Basis | FacetBasis) -> None:
        self.reference = basis
        geometry = basis.with_element(ElementTriP1())
        shapes = [field for (field,) in geometry.basis]
        self._dofs = geometry.element_dofs
        self._values = np.array([np.broadcast_to(shape, basis.dx.shape) for shape in shapes])
        self._gradients = np.array([shape.grad for shape in shapes])

    def at(self, x: Array) -> Basis | FacetBasis:
        """Return the basis in the configuration with node positions x (2, N)."""
        nodes = x[:, self._dofs].swapaxes(0, 1)[..., None]  # (3, 2, n_elements, 1)
        deformation = sum(nodes[a, :, None] * self._gradients[a] for a in range(3))
        pull, jacobian = inv(deformation), det(deformation)
        moved = copy.copy(self.reference)
        moved.basis = [(_pushed(field, pull),) for (field,) in self.reference.basis]
        if isinstance(moved, FacetBasis):
            area_vector = jacobian * np.einsum("ij...,i...->j...", pull, np.asarray(self.reference.normals))
            stretch = np.sqrt((area_vector**2).sum(axis=0))
            moved.normals = DiscreteField(area_vector / stretch)
            moved.dx = self.reference.dx * stretch
        else:
            moved.dx = self.reference.dx * jacobian
        moved._global_coordinates = DiscreteField(sum(nodes[a] * self._values[a] for a in range(3)))
        return moved


def _pushed(field: DiscreteField, pull: Array) -> DiscreteField:
    """A basis function with its gradient taken with respect to x: grad_xi w F^-1."""
    if field.grad is None:
        return field
    gradient = sum(field.grad[..., j, None, :, :] * pull[j] for j in range(2))
    return DiscreteField(np.asarray(field), grad=gradient)


@dataclass(frozen=True)
class Bases:
    """Every basis the scheme needs, built once on the reference mesh."""

    vector: MovingBasis
    vector_load: MovingBasis
    corners_load: Basis
    rim: MovingBasis
    corners_rim: FacetBasis
    scalar: MovingBasis
    scalar_gradient: MovingBasis

    @classmethod
    def on(cls, mesh: Mesh) -> "Bases":
        """Build the bases; P1 gradients are constant, so one point integrates products of them exactly."""
        triangles = mesh.triangles.astype(np.int32, order="C")
        reference = MeshTri(np.ascontiguousarray(mesh.xi), triangles, sort_t=False)
        scalar, vector, corners = ElementTriP1(), ElementVector(ElementTriP1()), ElementDG(ElementTriP1())
        return cls(
            vector=MovingBasis(Basis(reference, vector, intorder=0)),
            vector_load=MovingBasis(Basis(reference, vector, intorder=2)),
            corners_load=Basis(reference, corners, intorder=2),
            rim=MovingBasis(FacetBasis(reference, vector, intorder=3)),
            corners_rim=FacetBasis(reference, corners, intorder=3),
            scalar=MovingBasis(Basis(reference, scalar, intorder=2)),
            scalar_gradient=MovingBasis(Basis(reference, scalar, intorder=0)),
        )
