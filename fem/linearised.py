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

How far such perturbations can grow before they decay is said by norms of exp(L t) in an energy.  That of a
perturbation, per angular number,

    E = (1/2) int a^2 + eps(u) : eps(u) + nu' phi^2 dx    (+ (1/2) oint u_t^2 beside a wall),

is what the elastic stress stores (2.4), with the wall's friction, beside the square of a; for `viscous`,
whose equations do not see u, it is that of a alone.  Its largest amplification over all starts,

    G(t) = max E(t)/E(0) = |R exp(L t) R^-1|^2,    E = y^T R^T R y,

is the square of a largest singular value, and its right singular vector the start that reaches it.  Starts
obey the closure as velocities do; rigid motions, which have no energy, are left out.  With p != 0 and a
`viscoelastic` cell whose rim is free G is infinite for every t > 0: the rim's load takes the trace of phi,
which no energy of first derivatives bounds (`Model.rim_sees_dilation`).
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from actin_xcheck.core.model import Array, Closure, Model, Rheology
from fem.radial import Ray
from fem.tableaux import TABLEAUX


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


ROUND_OFF = 1e-9
"""Of the spectral radius of a step that is not normal."""

Pair = tuple[Array, Array, Array, Array]
"""Explicit and implicit coefficients (s, s) of an additive Runge-Kutta pair, and the weights (s,) of both."""


class Perturbations:
    """Perturbations of one angular number in coordinates whose Euclidean norm is the root of their energy.

    Parameters
    ----------
    model : delta constant where p != 0.
    m : angular number, >= 0.
    elements, degree : of the ray.
    over : a step of time; E then has d over/2 int |grad a|^2 beside, what diffusion takes in it.
    """

    def __init__(self, model: Model, m: int, elements: int = 4, degree: int = 12, over: float = 0.0) -> None:
        self.mode = AngularMode(model, Ray.on(model.parameters.l0, elements, degree), m)
        count, mode = self.mode.ray.nodes.size, self.mode
        self._nodal = np.eye(count)[:, min(m, 1) :]
        of_a = mode.mass + over * model.parameters.d * mode.stiffness
        energy = of_a[min(m, 1) :, min(m, 1) :]
        if model.rheology is Rheology.VISCOELASTIC:
            stored = mode.velocities.T @ mode.isotropic(model.elastic_moduli()) @ mode.velocities
            self._nodal = block_diag(self._nodal, mode.velocities)
            energy = block_diag(energy, stored)
        sizes, vectors = np.linalg.eigh(energy)
        kept = sizes > 1e-12 * sizes[-1]  # but for a rigid motion
        self._root = (vectors[:, kept] * np.sqrt(sizes[kept])).T
        self._lift = vectors[:, kept] / np.sqrt(sizes[kept])

    @cached_property
    def generator(self) -> Array:
        """L, (n, n)."""
        mode, expanded = self.mode, self._expanded
        mass, count = mode.mass, mode.ray.nodes.size
        change = -mode.dilution @ mode.flow @ expanded
        change -= (mode.model.reaction_rate() * mass + mode.model.parameters.d * mode.stiffness) @ (
            expanded[:count]
        )
        return self._coordinates(self._solved(mass, change), mode.flow @ expanded)

    def growth(self, t: float) -> float:
        """G(t)."""
        return float(np.linalg.norm(expm(self.generator * t), 2) ** 2)

    def start(self, t: float) -> tuple[Array, Array]:
        """The start of energy 1 that reaches G(t), and what becomes of it: (A, U, Z) at the nodes, (3 N,).

        The largest |A| of the start is positive.
        """
        moved = expm(self.generator * t)
        best = np.linalg.svd(moved)[2][0]
        fields = self._expanded @ best
        a = fields[: self.mode.ray.nodes.size]
        sign = np.sign(a[np.argmax(np.abs(a))])
        return sign * np.sqrt(2) * fields, sign * np.sqrt(2) * self._expanded @ moved @ best

    @property
    def initial_slope(self) -> float:
        """dG/dt at t = 0: twice the numerical abscissa of L, below which G <= exp(slope t)."""
        return float(np.linalg.eigvalsh(self.generator + self.generator.T)[-1])

    @property
    def leading_rate(self) -> float:
        """The largest real part of L's eigenvalues."""
        return float(np.linalg.eigvals(self.generator).real.max())

    def paper_step(self, dt: float) -> Array:
        """One step of (B.23) in these coordinates, (n, n).

        ((1 + k dt) M + dt d K) a' = M a + (1 + k dt) D (u - u'), u' = u + dt v(a, u).
        """
        mode, k, expanded = self.mode, self.mode.model.reaction_rate(), self._expanded
        velocity = mode.flow_over(dt) @ expanded
        left = (1 + k * dt) * mode.mass + dt * mode.model.parameters.d * mode.stiffness
        right = mode.mass @ expanded[: mode.ray.nodes.size] - (1 + k * dt) * dt * mode.dilution @ velocity
        moved = dt * velocity
        if mode.model.rheology is Rheology.VISCOELASTIC:
            moved = moved + expanded[mode.ray.nodes.size :]
        return self._coordinates(self._solved(left, right), moved)

    def pair_step(self, dt: float, pair: Pair | int) -> Array:
        """One step of an additive pair, (n, n): motion explicit, diffusion and reaction implicit.

        An `int` is the order of one of `tableaux.py`.  With P = M a + D u, u' = v(a, u) and
        P' = -(k M + d K) a: in each stage u is known before a is asked for.
        """
        explicit, implicit, b, b_implicit = _pair(pair)
        mode, count, expanded = self.mode, self.mode.ray.nodes.size, self._expanded
        decay = mode.model.reaction_rate() * mode.mass + mode.model.parameters.d * mode.stiffness
        elastic = mode.model.rheology is Rheology.VISCOELASTIC
        u0 = expanded[count:] if elastic else np.zeros((2 * count, expanded.shape[1]))
        content0 = mode.mass @ expanded[:count] + mode.dilution @ u0
        velocities: list[Array] = []
        rates: list[Array] = []
        for i in range(len(b)):
            u = u0 + dt * sum((w * v for w, v in zip(explicit[i], velocities, strict=False)), 0 * u0)
            known = content0 + dt * sum((w * g for w, g in zip(implicit[i], rates, strict=False)), 0.0)
            a = self._solved(mode.mass + dt * implicit[i, i] * decay, known - mode.dilution @ u)
            velocities.append(mode.flow @ np.vstack([a, u]))
            rates.append(-decay @ a)
        u = u0 + dt * np.tensordot(b, velocities, 1)
        content = content0 + dt * np.tensordot(b_implicit, rates, 1)
        return self._coordinates(self._solved(mode.mass, content - mode.dilution @ u), u)

    @cached_property
    def _expanded(self) -> Array:
        """From coordinates to (A, U, Z) at the nodes, (3 N, n); no U, Z for `viscous`."""
        nodal = self._nodal @ self._lift
        missing = 3 * self.mode.ray.nodes.size - len(nodal)
        return np.vstack([nodal, np.zeros((missing, nodal.shape[1]))])

    def _solved(self, matrix: Array, right: Array) -> Array:
        """Solve for nodal values of a, which are 0 at the centre but for m = 0."""
        free = slice(min(self.mode.m, 1), None)
        found = np.zeros_like(right)
        found[free] = np.linalg.solve(matrix[free, free], right[free])
        return found

    def _coordinates(self, a: Array, u: Array) -> Array:
        """From (A) and (U, Z) at the nodes to coordinates."""
        elastic = self.mode.model.rheology is Rheology.VISCOELASTIC
        nodal = np.vstack([a, u]) if elastic else a
        weights = (self._nodal**2).sum(axis=0)
        return np.asarray(self._root @ ((self._nodal.T @ nodal) / weights[:, None]))


def _pair(given: Pair | int) -> Pair:
    if isinstance(given, int):
        tableau = TABLEAUX[given]
        return tableau.explicit, tableau.implicit, tableau.b, tableau.b
    return given


def powers(step: Array) -> tuple[float, float]:
    """The largest amplification of an energy over powers of a step (n, n), and the step's spectral radius.

    It is inf where the radius exceeds 1.  Of the first 64 powers each is tried, of the next 64 every second
    one, of the next 128 every fourth and so on, until one has both halved and decayed below 1.
    """
    radius = float(np.abs(np.linalg.eigvals(step)).max())
    if radius > 1 + ROUND_OFF:
        return np.inf, radius
    largest, power = 1.0, np.eye(len(step))
    for count in range(32 * 40):
        if count >= 64 and count % 32 == 0:
            step = step @ step
        power = power @ step
        size = float(np.linalg.norm(power, 2) ** 2)
        largest = max(largest, size)
        if size < min(1.0, largest / 2):
            break
    return largest, radius
