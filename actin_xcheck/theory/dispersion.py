"""Neumann modes of the unit disk (A.1) and the dispersion relation (3.6)-(3.9), corrected and as printed.

Modes have the article's numbering (Remark A.1, Table 6).  For the relation, perturb a = 1, u = 0 of (3.2)
with delta constant (0 or 1) and k_a = 1 (0 where the scene switches polymerisation off).  For u = C grad w,
Delta w = -k^2 w, the force balance and the transport equation become

    (mu lambda + e) div u + f' a = 0,    e = 1 + nu' - p_e,    (lambda + k_a + d k^2) a + lambda div u = 0,

so that mu lambda^2 + b lambda + c = 0 with b = mu (k_a + d k^2) + e - f' and c = (k_a + d k^2) e.
Linearised at a = 1, where arctan a = pi/4 and its slope is 1/2, the pressure (2.5) gives p_e = p (1 +
delta/2) and f' = sigma'(1) + (p/pi) delta; the article expands arctan about 0: p and sigma'(1) + (2/pi) p
delta.

The `viscous` rheology has neither elasticity nor dilation, e = 0: beside the neutral root 0 there remains
lambda = f'/mu - k_a - d k^2.  The relation is exact on a static disk with closure `irrotational-wall`.
All quantities are non-dimensional.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0, jnp_zeros, jv, jvp, yvp

from actin_xcheck.core.model import Array, Closure, Delta, Laws, Model, Rheology
from actin_xcheck.core.parameters import Parameters


@lru_cache(maxsize=4096)
def wavenumber(m: int, n: int) -> float:
    """Return j'_{m,n}, the n-th zero of J_m', counted as the article does: j'_{0,1} = 0, j'_{0,2} = 3.83171.

    Raises ValueError unless m >= 0 and n >= 1.
    """
    if m < 0 or n < 1:
        raise ValueError(f"no mode ({m}, {n}): m starts at 0 and n at 1")
    if m > 0:
        return float(jnp_zeros(m, n)[-1])
    return float(jnp_zeros(0, n - 1)[-1]) if n > 1 else 0.0


@dataclass(frozen=True)
class Mode:
    """The eigenmode w_{m,n} = J_m(k r) cos(m theta) of Remark A.1, with k = j'_{m,n}.

    Delta w = -k^2 w in the unit disk and n.grad w = 0 on its rim.  Points are arrays x of shape (2, n) in
    units of the cell's radius.  Raises ValueError for a mode that does not exist.
    """

    m: int
    n: int

    def __post_init__(self) -> None:
        wavenumber(self.m, self.n)

    def __str__(self) -> str:
        return f"w{self.m},{self.n}"

    @classmethod
    def named(cls, name: str) -> Self:
        """Return the mode that is called so: "w2,1"."""
        m, n = name.removeprefix("w").split(",")
        return cls(int(m), int(n))

    @property
    def k(self) -> float:
        """Wavenumber j'_{m,n} of (A.1)."""
        return wavenumber(self.m, self.n)

    @cached_property
    def norm2(self) -> float:
        """Integral of w^2 over the unit disk."""
        if self.m == 0:
            return float(np.pi * j0(self.k) ** 2)
        return float(np.pi / 2 * (1 - (self.m / self.k) ** 2) * jv(self.m, self.k) ** 2)

    def value(self, x: Array) -> Array:
        """Return w at the points x (2, n): shape (n,)."""
        r, theta = np.hypot(*x), np.arctan2(x[1], x[0])
        return np.asarray(jv(self.m, self.k * r) * np.cos(self.m * theta))

    def gradient(self, x: Array) -> Array:
        """Return grad w at the points x (2, n): shape (2, n), exact at the origin too.

        (d_x -+ i d_y) lowers and raises the order of J_m(k r) e^{i m theta}, which leaves no division by r.
        """
        r, theta = np.hypot(*x), np.arctan2(x[1], x[0])
        below, above = jv(self.m - 1, self.k * r), jv(self.m + 1, self.k * r)
        down, up = (self.m - 1) * theta, (self.m + 1) * theta
        return (
            self.k
            / 2
            * np.stack(
                [
                    below * np.cos(down) - above * np.cos(up),
                    -below * np.sin(down) - above * np.sin(up),
                ]
            )
        )


def table_6(orders: int = 6, zeros: int = 4) -> Array:
    """Return Table 6, shape (zeros, orders): row n - 1, column m holds j'_{m,n}."""
    return np.array([[wavenumber(m, n) for m in range(orders)] for n in range(1, zeros + 1)])


def count_below(k: float) -> Array:
    """Return, for m = 0, 1, ... < k, how many of the j'_{m,n} lie below k > 0 (j'_{0,1} = 0 is not counted).

    J_m' = N cos(phi) and Y_m' = N sin(phi) with phi = (n - 1/2) pi at the n-th positive zero of J_m', m > 0.
    The phase's whole turns come from Debye's expansion, its rest from the functions themselves: no search
    that could miss a zero.
    """
    m = np.arange(np.ceil(k))  # j'_{m,1} > m, so higher orders have no zero below k
    debye = np.sqrt(k**2 - m**2) - m * np.arccos(m / k) + np.pi / 4
    rest = np.arctan2(yvp(m, k), jvp(m, k))
    phase = rest + 2 * np.pi * np.round((debye - rest) / (2 * np.pi))
    count = np.floor(phase / np.pi + 0.5).astype(int)
    count[0] -= 1  # the phase of order 0 starts at pi/2: its first passage is j'_{0,1} = 0
    return count


def modes_below(k: float) -> tuple[Mode, ...]:
    """Return all modes with wavenumber below k by increasing wavenumber, the uniform one (0, 1) first."""
    if k <= 0:
        return ()
    count = count_below(k)
    count[0] += 1  # the uniform mode
    modes = (Mode(m, n) for m, zeros in enumerate(count) for n in range(1, zeros + 1))
    return tuple(sorted(modes, key=lambda mode: mode.k))


def contrast(parameters: Parameters) -> float:
    """Return kappa = (mu1/2)/(mu1 + mu2), 0.139 for Table 2."""
    return parameters.mu1 / 2 / parameters.mu


def ripple_exponent(closure: Closure, parameters: Parameters, m: int) -> float:
    """Return gamma: the amplitude of cos m theta, m >= 1, on a uniformly swelling disk goes like R^gamma.

    ValueError for m < 1 and for `irrotational-wall`, whose rim does not move.
    """
    if m < 1:
        raise ValueError(f"m = {m} is no ripple; valid: 1, 2, ...")
    if not _follows_the_rim(closure):
        return 0.0 if closure is Closure.TRACTION_FREE and m == 1 else 1.0
    kappa = contrast(parameters)
    return kappa * (m**2 - 1) / (m - kappa)


def advance_per_fold(parameters: Parameters) -> float:
    """How far, in wavelengths, a rim advances under `current-normal` while its ripples grow by e."""
    return 1 / (2 * math.pi * contrast(parameters))


def _follows_the_rim(closure: Closure) -> bool:
    if closure is Closure.IRROTATIONAL_WALL:
        raise ValueError(f"'{closure}' holds the rim still: there is no ripple to follow")
    return closure is Closure.CURRENT_NORMAL


ComplexArray = NDArray[np.complex128]


class Version(StrEnum):
    """Which linearisation of the pressure: ours or the article's."""

    CORRECTED = "corrected"
    """arctan a expanded about the steady state a = 1."""
    AS_PRINTED = "as printed"
    """arctan a expanded about 0, as in (3.3)-(3.8)."""


def sigma_prime(parameters: Parameters) -> float:
    """Return sigma'(1) = psi (2 - 1/a_sat) exp(-1/a_sat) (3.9)."""
    return parameters.psi * (2 - 1 / parameters.a_sat) * math.exp(-1 / parameters.a_sat)


def _constant_delta(model: Model) -> float:
    """Delta as a number; ValueError where it varies in space and matters."""
    if model.delta is Delta.FULL:
        return 1.0
    if model.delta is Delta.NONE or not model.sees("delta"):
        return 0.0
    if model.laws.pressure is not None:
        raise ValueError(f"linear theory takes delta constant: '{model.delta}' varies, as the pressure does")
    raise ValueError(
        f"linear theory takes delta constant where p != 0 (p = {model.parameters.p:g}): "
        f"'{model.delta}' varies in space, valid are '{Delta.NONE}' and '{Delta.FULL}'"
    )


def active_slope(model: Model, version: Version = Version.CORRECTED) -> float:
    """Return f', the slope of the active stress in a at a = 1.

    Raises ValueError unless delta is constant.
    """
    if model.laws != Laws():
        return _own_slopes(model)[0]
    slope = 1 / np.pi if version is Version.CORRECTED else 2 / np.pi
    return float(sigma_prime(model.parameters) + slope * model.parameters.p * _constant_delta(model))


def stiffness(model: Model, version: Version = Version.CORRECTED) -> float:
    """Return e = 1 + nu' - p_e, the elastic stiffness less the pressure's; 0 for the `viscous` rheology.

    Raises ValueError unless delta is constant.
    """
    delta = _constant_delta(model)
    if model.rheology is Rheology.VISCOUS:
        return 0.0
    if model.laws != Laws():
        return 1 + model.parameters.nu_prime + _own_slopes(model)[1]
    share = 1 + delta / 2 if version is Version.CORRECTED else 1.0
    return 1 + model.parameters.nu_prime - model.parameters.p * share


def _own_slopes(model: Model) -> tuple[float, float]:
    """f' and -p_e of laws of one's own; ValueError where they have a kink."""
    if not model.is_smooth_at_rest:
        raise ValueError(
            "linear theory takes laws that have a slope at a = 1, phi = 0: these have a kink there"
        )
    return model.slopes(delta=_constant_delta(model))


def coefficients(model: Model, k2: ArrayLike, version: Version = Version.CORRECTED) -> tuple[Array, Array]:
    """Return b(k^2) and c(k^2) of (3.6) and (3.8), each of k2's shape.

    Raises ValueError unless delta is constant.
    """
    par, e = model.parameters, stiffness(model, version)
    decay = model.reaction_rate() + par.d * np.asarray(k2, dtype=float)
    return par.mu * decay + e - active_slope(model, version), decay * e


def _roots(leading: ArrayLike, b: Array, c: Array) -> ComplexArray:
    """Both roots of leading x^2 + b x + c, sorted as `growth_rates` says, without cancellation."""
    leading, b, c = np.broadcast_arrays(np.asarray(leading, dtype=float), b, c)
    discriminant = b**2 - 4 * leading * c
    q = -(b + np.copysign(np.sqrt(np.maximum(discriminant, 0)), b)) / 2
    one = q / leading
    other = np.divide(c, q, out=np.zeros_like(q), where=q != 0)
    imaginary = 1j * np.sqrt(np.maximum(-discriminant, 0)) / (2 * leading)
    oscillating = discriminant < 0
    return np.stack(
        [
            np.where(oscillating, -b / (2 * leading) + imaginary, np.maximum(one, other)),
            np.where(oscillating, -b / (2 * leading) - imaginary, np.minimum(one, other)),
        ]
    )


def growth_rates(model: Model, k2: ArrayLike, version: Version = Version.CORRECTED) -> ComplexArray:
    """Return the rates lambda(k^2), the roots of (3.6), by decreasing real part (+ imaginary part first).

    The shape is (2,) + k2's, for the `viscous` rheology with its single rate (1,) + k2's.  k^2 = 0 gives the
    polynomial's roots, but (3.6) is void there: a uniform perturbation has no force and decays with -k_a.
    Raises ValueError unless delta is constant.
    """
    b, c = coefficients(model, k2, version)
    if model.rheology is Rheology.VISCOUS:
        return np.asarray(-b / model.parameters.mu, dtype=complex)[np.newaxis]
    return _roots(model.parameters.mu, b, c)


def printed_3_7(model: Model, k2: ArrayLike) -> ComplexArray:
    """Return the two values of (3.7) exactly as printed, shape (2,) + k2's, by decreasing real part.

    (3.7) keeps k^2 under the root and in the denominator although (3.6) has divided by it.
    Raises ValueError unless k^2 > 0, the rheology is `viscoelastic` and delta is constant.
    """
    k2 = np.asarray(k2, dtype=float)
    if np.any(k2 <= 0):
        raise ValueError("(3.7) divides by k^2: every k^2 must be positive")
    if model.rheology is Rheology.VISCOUS:
        raise ValueError(f"(3.7) is printed for '{Rheology.VISCOELASTIC}' only, not for '{model.rheology}'")
    return _roots(model.parameters.mu * k2, *coefficients(model, k2, Version.AS_PRINTED))


def k2_crit(model: Model, version: Version = Version.CORRECTED) -> float:
    """Return k^2_crit = -G/(mu d), where b(k^2) of (3.8) changes sign; negative where b > 0 for all k^2.

    Where G < 0 this is the article's |G|/(mu d).  Raises ValueError unless delta is constant.
    """
    g = float(coefficients(model, 0.0, version)[0])
    par = model.parameters
    return -g / (par.mu * par.d) if par.d > 0 else math.copysign(math.inf, -g)


def isolated_modes(model: Model, version: Version = Version.CORRECTED) -> tuple[Mode, ...]:
    """Return the modes with b(k^2) < 0 by increasing k, in the article's way: with (0, 1), as in Table 4.

    Raises ValueError where there are infinitely many (d = 0) or delta is not constant.
    """
    crit = k2_crit(model, version)
    if math.isinf(crit) and crit > 0:
        raise ValueError("without diffusion (d = 0) b < 0 for all modes: there are infinitely many")
    return modes_below(math.sqrt(max(crit, 0.0)))


def leading_growth_rate(model: Model, m: int, n: int) -> complex:
    """Return the rate of mode (m, n) with the largest real part (imaginary part >= 0), corrected.

    (0, 1), which (3.6) does not cover, decays with -k_a.  Raises ValueError for a mode that does not exist
    and unless delta is constant.
    """
    k2 = wavenumber(m, n) ** 2
    rates = growth_rates(model, k2)
    return complex(rates[0]) if k2 > 0 else complex(-model.reaction_rate())


def rate_in_words(rate: complex) -> str:
    """A growth rate, with its frequency where it has one."""
    return f"{rate.real:.4f}" + (f" ± {rate.imag:.4f}i" if rate.imag else "")


@dataclass(frozen=True)
class WallEigenfield:
    """A solution of the linearised equations: a = Re(e^{lambda t}) w, u = Re(C e^{lambda t}) grad w.

    Attributes
    ----------
    mode : the eigenmode w.
    rate : lambda, the mode's leading root.
    factor : C = (lambda + k_a + d k^2)/(lambda k^2), complex where the rate is.

    Fields are evaluated at points x (2, n), per unit of amplitude; a is the perturbation of 1.
    """

    mode: Mode
    rate: complex
    factor: complex

    def a(self, x: Array, t: float = 0.0) -> Array:
        """Concentration less 1, shape (n,)."""
        return np.exp(self.rate * t).real * self.mode.value(x)

    def u(self, x: Array, t: float = 0.0) -> Array:
        """Displacement, shape (2, n)."""
        return (self.factor * np.exp(self.rate * t)).real * self.mode.gradient(x)

    def v(self, x: Array, t: float = 0.0) -> Array:
        """Velocity u_t, shape (2, n)."""
        return (self.rate * self.factor * np.exp(self.rate * t)).real * self.mode.gradient(x)


def wall_eigenfield(model: Model, mode: Mode) -> WallEigenfield:
    """Return the leading eigenfield of a mode: exact for closure `irrotational-wall` to first order.

    C follows from a_t - d Delta a + div v + k_a a = 0 with v = lambda u = lambda C grad w and so
    div v = -lambda C k^2 w.  For `viscous` the same C makes u the displacement that v leaves behind; no
    stress depends on it.  The uniform mode (0, 1) has no displacement.  Raises ValueError at lambda = 0,
    where no finite u belongs to a, and unless delta is constant.
    """
    rate, k2 = leading_growth_rate(model, mode.m, mode.n), mode.k**2
    if k2 == 0:
        return WallEigenfield(mode, rate, 0j)
    if rate == 0:
        raise ValueError(f"the leading rate of {mode} is 0: no displacement belongs to its concentration")
    return WallEigenfield(mode, rate, (rate + model.reaction_rate() + model.parameters.d * k2) / (rate * k2))
