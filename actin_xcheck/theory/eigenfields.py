"""The eigenfields (a, u, v) that belong to growth rates, for every closure, and their numbering.

For `irrotational-wall` mode (m, n) is the article's w_{m,n} with its leading rate (3.6).  For the closures of
the moving cell there are no w_{m,n}: (m, n) is the n-th rate of angular number m by decreasing real part, a
conjugate pair counting once.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import jv

from actin_xcheck.core.model import Array, Closure, Model
from actin_xcheck.theory.dispersion import Mode, active_slope, leading_growth_rate, wall_eigenfield
from actin_xcheck.theory.exact import ComplexArray, DiskModes


class Eigenfield(Protocol):
    """A solution of the linearised equations, as exp(rate t); a is the perturbation of 1."""

    @property
    def rate(self) -> complex:
        """Growth rate lambda, with imaginary part >= 0."""
        ...

    def a(self, x: Array, t: float = 0.0) -> Array:
        """Concentration less 1 at points x (2, n), per unit of amplitude: shape (n,)."""
        ...

    def u(self, x: Array, t: float = 0.0) -> Array:
        """Displacement, shape (2, n)."""
        ...

    def v(self, x: Array, t: float = 0.0) -> Array:
        """Velocity u_t, shape (2, n)."""
        ...


@dataclass(frozen=True)
class CellEigenfield:
    """An exact mode of the moving cell: the fields of `exact.py` with their coefficients.

    Attributes
    ----------
    modes : model and angular number.
    rate : one of its growth rates.
    coefficients : (alpha, eta, C, gamma), scaled so that |a| reaches 1 with a real there.
    """

    modes: DiskModes
    rate: complex
    coefficients: tuple[complex, complex, complex, complex]

    def a(self, x: Array, t: float = 0.0) -> Array:
        """Concentration less 1 at points x (2, n), shape (n,)."""
        r, theta = np.hypot(*x), np.arctan2(x[1], x[0])
        return np.asarray((np.exp(self.rate * t) * self._radial(r)[0]).real * np.cos(self.modes.m * theta))

    def u(self, x: Array, t: float = 0.0) -> Array:
        """Displacement, shape (2, n)."""
        return self._vector(x, np.exp(self.rate * t) / self._per_displacement())

    def v(self, x: Array, t: float = 0.0) -> Array:
        """Velocity u_t, shape (2, n)."""
        return self._vector(x, np.exp(self.rate * t) * self.rate / self._per_displacement())

    def _per_displacement(self) -> complex:
        """1 where the fields' u is the displacement, lambda where it is the velocity (`viscous`)."""
        return self.rate if self.modes.moduli(np.asarray(self.rate))[3] == 1 else 1

    def _vector(self, x: Array, factor: complex) -> Array:
        r, theta, m = np.hypot(*x), np.arctan2(x[1], x[0]), self.modes.m
        _, along, across = self._radial(r)
        radial = (factor * along).real * np.cos(m * theta)
        angular = (factor * across).real * np.sin(m * theta)
        c, s = np.cos(theta), np.sin(theta)
        return np.array([radial * c - angular * s, radial * s + angular * c])

    def _radial(self, r: Array) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """The factors of cos m theta, cos m theta and sin m theta in a, u_r and u_t, each of r's shape."""
        modes, m, z = self.modes, self.modes.m, np.asarray(self.rate, dtype=complex)
        alpha, eta, c, gamma = self.coefficients
        s1, _, K, rho = modes.moduli(z)
        d, slope = modes.model.parameters.d, active_slope(modes.model)
        q = z + modes.model.reaction_rate() - rho * slope / K
        kappa = np.sqrt(-q / d)
        _, U, V = modes.swirl(z)
        r = np.maximum(r, 1e-12)  # J_m(kappa r)/r has a limit at the centre
        j = jv(m, kappa * r) / kappa**m
        dj = m * j / r - kappa * jv(m + 1, kappa * r) / kappa**m
        outer, inner = r ** (m + 1), m * c * r ** max(m - 1, 0)
        return (
            alpha * K * q * j - rho * s1 * eta * r**m,
            -alpha * slope * d * dj + (eta * U - gamma / 8) * outer + inner,
            alpha * slope * d * m * j / r + (eta * V + gamma * 3 / 8) * outer - inner,
        )


def growth_rate(model: Model, m: int, n: int) -> complex:
    """Return the growth rate of mode (m, n), counted as this module says, with imaginary part >= 0.

    Raises ValueError for a mode that does not exist or lies left of where a list of rates can be complete.
    """
    if model.closure is Closure.IRROTATIONAL_WALL:
        return leading_growth_rate(model, m, n)
    return _nth_rate(model, m, n)


def eigenfield(model: Model, m: int, n: int) -> Eigenfield:
    """Return the eigenfield of mode (m, n), counted as this module says; raises as `growth_rate` does."""
    if model.closure is Closure.IRROTATIONAL_WALL:
        return wall_eigenfield(model, Mode(m, n))
    return cell_eigenfield(DiskModes(model, m), _nth_rate(model, m, n))


def cell_eigenfield(modes: DiskModes, rate: complex) -> CellEigenfield:
    """Return the field of one of the rates of `modes`, for a closure other than `irrotational-wall`.

    Raises ValueError where `rate` is none of its rates.
    """
    matrix = np.array(modes.conditions(np.asarray(rate, dtype=complex)))
    # sizes from nearby, because a whole row may vanish at the rate itself
    near = np.abs(modes.conditions(np.asarray(rate + 0.1 * (1 + abs(rate)), dtype=complex)))
    columns = near.max(axis=0)
    _, values, rows = np.linalg.svd(matrix / columns / (near / columns).max(axis=1)[:, None])
    if values[-1] > 1e-6 * values[0]:
        raise ValueError(f"{rate} is no growth rate of m = {modes.m}: {values[-1]:.2g} off")
    null = _four(np.conj(rows[-1]) / columns)
    r = np.linspace(0, 1, 201)
    a = CellEigenfield(modes, rate, null)._radial(r)[0]
    largest = a[np.argmax(np.abs(a))]
    return CellEigenfield(modes, rate, _four(np.array(null) / largest))


def _four(vector: NDArray[np.complex128]) -> tuple[complex, complex, complex, complex]:
    alpha, eta, c, gamma = np.pad(vector, (0, 4 - len(vector))).tolist()
    return alpha, eta, c, gamma


@lru_cache(maxsize=256)
def _nth_rate(model: Model, m: int, n: int) -> complex:
    modes = DiskModes(model, m)
    points = modes.boundary_points()
    nearest = max(points.values(), default=-64.0)
    if n < 1 or nearest >= 0:
        named = ", ".join(f"{name} = {value:.4g}" for name, value in points.items())
        raise ValueError(f"no mode ({m}, {n}): n starts at 1, and rates can be listed right of {named} only")
    for above in (0.0, *(nearest * (1 - 0.5**i) for i in range(1, 6))):
        rates = modes.rates(above)
        leading = rates[rates.imag >= 0]
        if len(leading) >= n:
            return complex(leading[n - 1])
    raise ValueError(f"no mode ({m}, {n}): m = {m} has {len(leading)} rates with Re lambda > {above:.4g}")
