"""The equations linearised about a = 1, u = 0 on a mesh: rates of the semi-discrete system (B.21), (B.22).

No time step, no fit.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, FacetBasis, MeshTri
from skfem.helpers import div, dot

from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Closure, Model, Rheology
from fem import forms
from fem.force_balance import ForceBalance

P1 = ElementTriP1()


@BilinearForm
def _load_inside(f, w, _):  # type: ignore[no-untyped-def]
    """-f div w (B.16a,b)."""
    return -f * div(w)


@BilinearForm
def _load_on_rim(f, w, fields):  # type: ignore[no-untyped-def]
    """The boundary integral of f w.n (B.16a,b)."""
    return f * dot(fields["n"], w)


@BilinearForm
def _dilation_inside(u, w, _):  # type: ignore[no-untyped-def]
    """The same load for f = div u: the pressure falls as the cell dilates."""
    return -div(u) * div(w)


@BilinearForm
def _dilation_on_rim(u, w, fields):  # type: ignore[no-untyped-def]
    return div(u) * dot(fields["n"], w)


@BilinearForm
def _dilution(v, b, _):  # type: ignore[no-untyped-def]
    """b div v, with a = 1."""
    return b * div(v)


class Spectrum:
    """Generalised eigenvalues of P1 elements on the disk at rest, exact in time.

    A uniform f exerts no force in any configuration, so that the geometry enters at second order only and

        lambda A u = -B u + f' L a - p_e N u,    lambda (D u + M a) = -(k_a M + d K) a,

    L being the load of a unit of f and N that of a unit of div u; for `viscous` A u = f' L a with u the
    velocity.  For `traction-free` both loads are balanced by a uniform force and torque per area, a term of
    rank three.

    Parameters
    ----------
    model : delta constant where p != 0.
    mesh : the reference mesh.
    slope, pressure : f' and p_e of the linear theory; they are the model's derivatives at a = 1.
    """

    def __init__(self, model: Model, mesh: Mesh, slope: float, pressure: float) -> None:
        balance = ForceBalance(model, mesh)
        still, rest = mesh.xi, np.ones(mesh.triangles.shape)
        viscosity = balance.assemble(still, rest, 0.0).matrix
        elasticity = balance.assemble(still, rest, 1.0).matrix - viscosity
        triangles = mesh.triangles.astype(np.int32, order="C")
        plain, vector = MeshTri(np.ascontiguousarray(mesh.xi), triangles, sort_t=False), ElementVector(P1)
        inside, rim = Basis(plain, vector, intorder=2), FacetBasis(plain, vector, intorder=3)
        scalar = Basis(plain, P1, intorder=2)
        on_rim = _load_on_rim.assemble(rim.with_element(scalar.elem), rim)
        load = slope * (_load_inside.assemble(scalar, inside) + on_rim)
        mass, stiffness = forms.mass.assemble(scalar), forms.stiffness.assemble(scalar)
        decay = model.reaction_rate() * mass + model.parameters.d * stiffness
        free = balance.constraint.prolongation(still)
        dilution, A = _dilution.assemble(inside, scalar) @ free, free.T @ viscosity @ free
        if model.rheology is Rheology.VISCOUS:
            loads = sp.hstack([-viscosity @ free, load])
            lower, right = [-dilution, -decay], [[0 * A, None], [None, mass]]
        else:
            elasticity += pressure * (_dilation_inside.assemble(inside) + _dilation_on_rim.assemble(rim))
            loads = sp.hstack([-elasticity @ free, load])
            lower, right = [0 * dilution, -decay], [[A, None], [dilution, mass]]
        self._left = sp.vstack([free.T @ loads, sp.hstack(lower)]).tocsc()
        self._right = sp.block_array(right).tocsc()
        self._a = slice(A.shape[0], None)
        size = self._left.shape[0]
        self._balance = np.zeros((size, 0)), np.zeros((0, size))
        if model.closure is Closure.TRACTION_FREE:
            rigid, weighted = balance.rigid(still)
            force = free.T @ weighted @ np.linalg.inv(rigid.T @ weighted)
            self._balance = np.vstack([force, np.zeros((mass.shape[0], 3))]), (loads.T @ rigid).T

    def nearest(self, rate: complex, count: int) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the `count` rates nearest to `rate`, by distance, and their concentrations (N, count)."""
        shift = rate + 1e-3j * (1 + abs(rate))  # off the rate itself, where the matrix is singular
        factor = spl.splu((self._left - shift * self._right).tocsc())
        force, net = self._balance
        answer = factor.solve(force.astype(complex))
        capacitance = np.eye(net.shape[0]) - net @ answer

        def inverse(y: NDArray[np.complex128]) -> NDArray[np.complex128]:
            """Of left - force net - shift right, by Woodbury, times right."""
            z = factor.solve(self._right @ y)
            return np.asarray(z + answer @ np.linalg.solve(capacitance, net @ z))

        size = len(force)
        start = np.random.default_rng(0).normal(size=size).astype(complex)
        operator = spl.LinearOperator((size, size), inverse, dtype=np.complex128)
        values, vectors = spl.eigs(operator, k=count, v0=start)
        rates = shift + 1 / values
        order = np.argsort(np.abs(rates - rate))
        return rates[order], vectors[self._a][:, order]
