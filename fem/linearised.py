"""The equations linearised about a = 1, u = 0 for one angular number m, on the ray.

Perturbations are a = A(R) cos m theta, u = U cos m theta e_r + Z sin m theta e_theta, and the same turned by
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

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from actin_xcheck.core.model import Array, Closure, Model, Rheology
from fem.radial import Ray


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
                self.velocities = displacements
            case Closure.IRROTATIONAL_WALL:
                self.velocities = np.hstack([centre, radial[:, :-1], angular])
            case Closure.REFERENCE_NORMAL | Closure.CURRENT_NORMAL:
                self.velocities = np.hstack([centre, radial, angular[:, :-1]])
        self.expansion = block_diag(np.eye(count)[:, min(m, 1) :], displacements)
        """From free unknowns to (A, U, Z) at the nodes, (3 N, n)."""
        self.restriction = (self.expansion / (self.expansion**2).sum(axis=0)).T
        """Back, (n, 3 N)."""
        self._propagator: tuple[float, Array] = np.nan, np.zeros(0)

    @cached_property
    def generator(self) -> Array:
        """L, (n, n)."""
        mass, count = self.mass, self.ray.nodes.size
        change = -self.dilution @ self.flow
        change[:, :count] -= self.model.reaction_rate() * mass
        change[:, :count] -= self.model.parameters.d * self.stiffness
        free = slice(min(self.m, 1), None)
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
        return self.flow_over(0.0)

    def flow_over(self, dt: float) -> Array:
        """The same by a step dt of (B.23a), in which the elasticity of what is moved counts, (2 N, 3 N)."""
        moving = self.velocities
        (mu1, mu2), (one, nu_prime) = self.model.viscous_moduli(), self.model.elastic_moduli()
        viscous = self.isotropic((mu1 + dt * one, mu2 + dt * nu_prime))
        matrix, load = moving.T @ viscous @ moving, moving.T @ self.load
        if self.rigid is None:
            return np.asarray(moving @ np.linalg.solve(matrix, load))
        weighted = moving.T @ self._mass_of_vectors @ self.rigid
        bordered = np.block([[matrix, weighted[:, None]], [weighted, np.zeros(1)]])
        return np.asarray(moving @ np.linalg.solve(bordered, np.vstack([load, 0 * load[:1]]))[:-1])

    @cached_property
    def load(self) -> Array:
        """F (f' A - p_e phi(u)) - N(1, nu') u for (A, U, Z) at the nodes, (2 N, 3 N)."""
        slope, stiffening = self.model.slopes()
        of_f = -self.dilation.T * self._area
        of_f[self.ray.nodes.size - 1, -1] += 1.0
        of_u = -self.isotropic(self.model.elastic_moduli()) + stiffening * of_f @ self.dilation
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

    def isotropic(self, moduli: tuple[float, float]) -> Array:
        """`forms.isotropic` and, beside a wall, the slip friction of the first modulus, (2 N, 2 N)."""
        first, second = moduli
        along, across, shear = self._strains
        terms = ((first, along), (first, across), (first / 2, shear), (second, self.dilation))
        matrix = np.sum([modulus * (strain.T * self._area) @ strain for modulus, strain in terms], axis=0)
        if self.model.closure is Closure.IRROTATIONAL_WALL:
            matrix[-1, -1] += first
        return np.asarray(matrix)

    @property
    def mass(self) -> Array:
        """M, (N, N)."""
        return np.asarray((self.ray.values.T * self._area) @ self.ray.values)

    @property
    def stiffness(self) -> Array:
        """K, (N, N)."""
        ray = self.ray
        matrix = (ray.slopes.T * self._area) @ ray.slopes
        matrix += self.m**2 * (ray.values.T * (self._area / ray.points**2)) @ ray.values
        return np.asarray(matrix)

    @property
    def dilution(self) -> Array:
        """D, the integrals of b div v, (N, 2 N)."""
        return np.asarray((self.ray.values.T * self._area) @ self.dilation)

    @property
    def _mass_of_vectors(self) -> Array:
        return np.asarray(block_diag(self.mass, self.mass))

    @cached_property
    def dilation(self) -> Array:
        """phi at the ray's points for (U, Z) at the nodes, (Q, 2 N)."""
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
