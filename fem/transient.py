"""How far small perturbations of a = 1, u = 0 can grow before they decay: norms of exp(L t) in an energy.

The energy of a perturbation (a, u), per angular number,

    E = (1/2) int a^2 + eps(u) : eps(u) + nu' phi^2 dx    (+ (1/2) oint u_t^2 beside a wall),

is what the elastic stress stores (2.4), with the wall's friction, beside the square of a; for `viscous`,
whose equations do not see u, it is that of a alone.  Its largest amplification over all starts,

    G(t) = max E(t)/E(0) = |R exp(L t) R^-1|^2,    E = y^T R^T R y,

is the square of a largest singular value, and its right singular vector the start that reaches it.  Starts
obey the closure as velocities do; rigid motions, which have no energy, are left out.  L is that of Galerkin's
method on the ray, see `linearised.py`.  With p != 0 and a `viscoelastic` cell whose rim is free G is infinite
for every t > 0: the rim's load takes the trace of phi, which no energy of first derivatives bounds
(`Model.rim_sees_dilation`).
"""

from functools import cached_property

import numpy as np
from scipy.linalg import block_diag, expm

from actin_xcheck.core.model import Array, Model, Rheology
from fem.linearised import AngularMode
from fem.radial import Ray
from fem.tableaux import TABLEAUX

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
