"""The dispersion relation (3.6)-(3.9), corrected and as printed, for both rheologies.

Perturb a = 1, u = 0 of (3.2) with delta constant (0 or 1) and k_a = 1 (0 where the scene switches
polymerisation off).  For u = C grad w, Delta w = -k^2 w, the force balance and the transport equation become

    (mu lambda + e) div u + f' a = 0,    e = 1 + nu' - p_e,    (lambda + k_a + d k^2) a + lambda div u = 0,

so that mu lambda^2 + b lambda + c = 0 with b = mu (k_a + d k^2) + e - f' and c = (k_a + d k^2) e.  Linearised
at a = 1, where arctan a = pi/4 and its slope is 1/2, the pressure (2.5) gives p_e = p (1 + delta/2) and
f' = sigma'(1) + (p/pi) delta; the article expands arctan about 0: p and sigma'(1) + (2/pi) p delta.

The `viscous` rheology has neither elasticity nor dilation, e = 0: beside the neutral root 0 there remains
lambda = f'/mu - k_a - d k^2.  The relation is exact on a static disk with closure `irrotational-wall`.
All quantities are non-dimensional.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from actin_xcheck.core.model import Array, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.theory.modes import Mode, modes_below, wavenumber

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
    if model.delta is Delta.NONE or model.parameters.p == 0:
        return 0.0
    raise ValueError(
        f"linear theory takes delta constant where p != 0 (p = {model.parameters.p:g}): "
        f"'{model.delta}' varies in space, valid are '{Delta.NONE}' and '{Delta.FULL}'"
    )


def active_slope(model: Model, version: Version = Version.CORRECTED) -> float:
    """Return f', the slope of the active stress in a at a = 1.

    Raises ValueError unless delta is constant.
    """
    slope = 1 / np.pi if version is Version.CORRECTED else 2 / np.pi
    return float(sigma_prime(model.parameters) + slope * model.parameters.p * _constant_delta(model))


def stiffness(model: Model, version: Version = Version.CORRECTED) -> float:
    """Return e = 1 + nu' - p_e, the elastic stiffness less the pressure's; 0 for the `viscous` rheology.

    Raises ValueError unless delta is constant.
    """
    delta = _constant_delta(model)
    if model.rheology is Rheology.VISCOUS:
        return 0.0
    share = 1 + delta / 2 if version is Version.CORRECTED else 1.0
    return 1 + model.parameters.nu_prime - model.parameters.p * share


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


def unstable_modes(model: Model, version: Version = Version.CORRECTED) -> tuple[Mode, ...]:
    """Return the modes with Re lambda > 0 by increasing k.

    With c >= 0 the roots' sum is -b/mu and their product c/mu >= 0: Re lambda > 0 just where b < 0 (Table 3).
    Raises ValueError where there are infinitely many (c < 0, or d = 0) or delta is not constant.
    """
    if stiffness(model, version) < 0:
        raise ValueError("p_e > 1 + nu' makes c(k^2) < 0 for all k: every mode is unstable (Table 3)")
    return tuple(mode for mode in isolated_modes(model, version) if mode.k > 0)


def leading_growth_rate(model: Model, m: int, n: int) -> complex:
    """Return the rate of mode (m, n) with the largest real part (imaginary part >= 0), corrected.

    (0, 1), which (3.6) does not cover, decays with -k_a.  Raises ValueError for a mode that does not exist
    and unless delta is constant.
    """
    k2 = wavenumber(m, n) ** 2
    rates = growth_rates(model, k2)
    return complex(rates[0]) if k2 > 0 else complex(-model.reaction_rate())


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
