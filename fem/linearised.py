"""The equations linearised about a = 1, u = 0: for one angular number m on the ray, and on a mesh.

On a mesh, rates of the semi-discrete system (B.21), (B.22) are found: no time step, no fit.  On the ray,
perturbations are a = A(R) cos m theta, u = U cos m theta e_r + Z sin m theta e_theta, and the same turned by
a quarter of a period; test functions (w, z) likewise.  Then

    eps_rr = U',  eps_tt = (U + m Z)/R,  2 eps_rt = Z' - (m U + Z)/R,  phi = eps_rr + eps_tt,

and integrals over the disk become integrals R dR, but for a common factor.  A uniform f exerts no force in
any configuration, so that the geometry enters at second order only.  With f' = df/da and -p_e = df/dphi at
rest, (B.16) and (B.22) read

    N(mu1, mu2) v = -N(1, nu') u + F (f' A - p_e phi(u)),     u_t = v,
    M A_t + D v = -(k M + d K) A,

N being `forms.isotropic`, F the load -int f div w dx + [f w]_rim of a unit of f, and D the integrals
b div v dx; for `viscous` the first line is N(mu1, mu2) v = F f' A.  Closures: Z_t = 0 at the rim for both
normal ones; U_t = 0 there for `irrotational-wall`, whose friction adds mu1 Z_t z and Z z on the rim;
`traction-free` balances the load by a uniform force per area (m = 1) and torque (m = 0), and v has no mean
rigid motion.  At the centre fields are smooth: A(0) = 0 for m > 0, U(0) = -Z(0) for m = 1 and both are 0
otherwise.
"""

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, FacetBasis, MeshTri
from skfem.helpers import div, dot

from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array, Closure, Delta, Model, Rheology
from fem import forms
from fem.force_balance import ForceBalance
from fem.radial import Ray


def slopes(model: Model, a: float = 1.0, dilation: float = 0.0) -> tuple[float, float]:
    """df/da and df/dphi of the active stress by complex steps, exact to round-off; f' and -p_e at rest."""
    delta, tiny = float(model.delta is Delta.FULL), 1e-30
    beside: Any = a + 1j * tiny
    dilated: Any = dilation + 1j * tiny
    at: Any = a
    of_a, of_dilation = (
        model.active_stress(beside, at * 0 + dilation, delta),
        model.active_stress(at, dilated, delta),
    )
    return float(of_a.imag / tiny), float(of_dilation.imag / tiny)


class AngularMode:
    """The linear equations of one angular number, y_t = L y in the free unknowns y of A, U, Z at the nodes.

    Parameters
    ----------
    model : delta constant where p != 0.
    ray : where the fields live.
    m : angular number, >= 0.
    """

    def __init__(self, model: Model, ray: Ray, m: int) -> None:
        self.model, self.ray, self.m = model, ray, m
        count = ray.nodes.size
        radial, angular = np.eye(2 * count)[:, 1:count], np.eye(2 * count)[:, count + 1 :]
        centre = np.zeros((2 * count, int(m == 1)))
        centre[0], centre[count] = 1.0, -1.0
        displacements = np.hstack([centre, radial, angular])
        match model.closure:
            case Closure.TRACTION_FREE:
                self._velocities = displacements
            case Closure.IRROTATIONAL_WALL:
                self._velocities = np.hstack([centre, radial[:, :-1], angular])
            case Closure.REFERENCE_NORMAL | Closure.CURRENT_NORMAL:
                self._velocities = np.hstack([centre, radial, angular[:, :-1]])
        self.expansion = block_diag(np.eye(count)[:, min(m, 1) :], displacements)
        """From free unknowns to (A, U, Z) at the nodes, (3 N, n)."""
        self.restriction = (self.expansion / (self.expansion**2).sum(axis=0)).T
        """Back, (n, 3 N)."""
        self._propagator: tuple[float, Array] = np.nan, np.zeros(0)

    @cached_property
    def generator(self) -> Array:
        """L, (n, n)."""
        ray, values, m = self.ray, self.ray.values, self.m
        mass = (values.T * self._area) @ values
        stiffness = (ray.slopes.T * self._area) @ ray.slopes
        stiffness += m**2 * (values.T * (self._area / ray.points**2)) @ values
        change = -((values.T * self._area) @ self._dilation) @ self.flow
        change[:, : ray.nodes.size] -= self.model.reaction_rate() * mass
        change[:, : ray.nodes.size] -= self.model.parameters.d * stiffness
        free = slice(min(m, 1), None)
        rates = np.zeros_like(change)
        rates[free] = np.linalg.solve(mass[free, free], change[free])
        return np.asarray(self.restriction @ np.vstack([rates, self.flow]) @ self.expansion)

    def carried(self, values: NDArray[np.complex128], dt: float) -> NDArray[np.complex128]:
        """(A, U, Z) at the nodes, (3 N,), after a time dt; exp(L dt) is kept for the next step like it."""
        if self._propagator[0] != dt:
            self._propagator = dt, np.asarray(self.expansion @ expm(self.generator * dt) @ self.restriction)
        return np.asarray(self._propagator[1] @ values)

    @cached_property
    def flow(self) -> Array:
        """Velocities (U_t, Z_t) at the nodes for (A, U, Z) there, (2 N, 3 N)."""
        moving = self._velocities
        matrix, load = moving.T @ self._isotropic(self.model.viscous_moduli()) @ moving, moving.T @ self.load
        if self.rigid is None:
            return np.asarray(moving @ np.linalg.solve(matrix, load))
        weighted = moving.T @ self._mass_of_vectors @ self.rigid
        bordered = np.block([[matrix, weighted[:, None]], [weighted, np.zeros(1)]])
        return np.asarray(moving @ np.linalg.solve(bordered, np.vstack([load, 0 * load[:1]]))[:-1])

    @cached_property
    def load(self) -> Array:
        """F (f' A - p_e phi(u)) - N(1, nu') u for (A, U, Z) at the nodes, (2 N, 3 N)."""
        slope, stiffening = slopes(self.model)
        of_f = -self._dilation.T * self._area
        of_f[self.ray.nodes.size - 1, -1] += 1.0
        of_u = -self._isotropic(self.model.elastic_moduli()) + stiffening * of_f @ self._dilation
        if self.model.rheology is Rheology.VISCOUS:
            of_u = np.zeros_like(of_u)
        return np.hstack([slope * of_f @ self.ray.values, of_u])

    @property
    def rigid(self) -> Array | None:
        """The rigid motion (2 N,) that the gauge of `traction-free` takes out, where m has one."""
        if self.model.closure is not Closure.TRACTION_FREE or self.m > 1:
            return None
        nodes = self.ray.nodes
        if self.m == 0:
            return np.append(np.zeros_like(nodes), nodes)
        return np.append(np.ones_like(nodes), -np.ones_like(nodes))

    def _isotropic(self, moduli: tuple[float, float]) -> Array:
        """`forms.isotropic` and, beside a wall, the slip friction of the first modulus, (2 N, 2 N)."""
        first, second = moduli
        along, across, shear = self._strains
        terms = ((first, along), (first, across), (first / 2, shear), (second, self._dilation))
        matrix = np.sum([modulus * (strain.T * self._area) @ strain for modulus, strain in terms], axis=0)
        if self.model.closure is Closure.IRROTATIONAL_WALL:
            matrix[-1, -1] += first
        return np.asarray(matrix)

    @property
    def _mass_of_vectors(self) -> Array:
        mass = (self.ray.values.T * self._area) @ self.ray.values
        return np.asarray(block_diag(mass, mass))

    @cached_property
    def _dilation(self) -> Array:
        along, across, _ = self._strains
        return along + across

    @cached_property
    def _strains(self) -> tuple[Array, Array, Array]:
        """eps_rr, eps_tt and 2 eps_rt at the ray's points, (Q, 2 N) each."""
        over_r = self.ray.values / self.ray.points[:, None]
        slopes, nothing = self.ray.slopes, np.zeros_like(over_r)
        return (
            np.hstack([slopes, nothing]),
            np.hstack([over_r, self.m * over_r]),
            np.hstack([-self.m * over_r, slopes - over_r]),
        )

    @property
    def _area(self) -> Array:
        """R dR at the ray's points, (Q,)."""
        return self.ray.weights * self.ray.points


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
