"""The finite elements' own growth rates about a = 1, held against the exact ones: no time step, no fit."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Closure, Model
from actin_xcheck.runs.method import SPECTRUM, load
from actin_xcheck.theory.dispersion import active_slope, stiffness
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.exact import threshold

_HARMONICS = 10


@dataclass(frozen=True)
class DiscreteRates:
    """Rates of one exact mode on a sequence of meshes.

    Attributes
    ----------
    m : angular number.
    exact : the leading rate, imaginary part >= 0.
    refine : the meshes, 2**refine layers each.
    rates : one per mesh.
    """

    m: int
    exact: complex
    refine: tuple[int, ...]
    rates: tuple[complex, ...]

    @property
    def orders(self) -> tuple[float, ...]:
        """Observed order between consecutive meshes.

        Of the rates' mean and product for a conjugate pair: the pair itself is a square root of them, which
        near a double root is not yet asymptotic when they are.
        """
        errors = [_distance(rate, self.exact) for rate in self.rates]
        return tuple(float(np.log2(one / other)) for one, other in pairwise(errors))


def discrete_rates(model: Model, m: int, refine: tuple[int, ...]) -> DiscreteRates:
    """Return the finite elements' counterpart of the leading exact mode of angular number m.

    Raises ValueError where the exact mode cannot be listed, ArithmeticError where a mesh has no counterpart.
    """
    exact = growth_rate(model, m, 2 if m == 0 and model.closure is Closure.IRROTATIONAL_WALL else 1)
    return DiscreteRates(m, exact, refine, tuple(_rate(model, m, n, exact) for n in refine))


def discrete_threshold(model: Model, m: int, refine: int) -> float:
    """Return the psi at which the finite elements' leading rate of angular number m crosses Re lambda = 0.

    A bracketed search from the exact threshold upwards, in steps of 5 %, for a finite mesh grows less.
    Raises ValueError where there is no exact threshold, or no discrete one within twice of it.
    """
    exact = threshold(model, m)
    if exact.psi is None or exact.omega is None:
        raise ValueError(f"m = {m}: {exact.reason}")
    frequency = exact.omega

    def growth(psi: float) -> float:
        at = model.varied(psi=psi)
        return _rate(at, m, refine, 1j * frequency).real

    for low in np.arange(0.95, 2.0, 0.05) * exact.psi:
        if growth(low) < 0 < growth(low + 0.05 * exact.psi):
            return float(brentq(growth, low, low + 0.05 * exact.psi, rtol=1e-5))
    raise ValueError(f"m = {m}: no discrete rate crosses between 0.95 and 2 of psi* = {exact.psi:g}")


def _distance(rate: complex, exact: complex) -> float:
    """Error of a real rate, or of a pair's mean and product."""
    if not exact.imag:
        return abs(rate - exact)
    return abs(complex(rate.real - exact.real, (abs(rate) ** 2 - abs(exact) ** 2) / (2 * abs(exact))))


def _rate(model: Model, m: int, refine: int, near: complex) -> complex:
    """The discrete rate of angular number m nearest to `near`."""
    mesh = disk(refine, model.parameters.l0)
    pressure = 1 + model.parameters.nu_prime - stiffness(model)  # `viscous` has none and ignores it
    spectrum = load(SPECTRUM)(model, mesh, active_slope(model), pressure)
    for count in (2, 4, 8, 16):
        rates, concentrations = spectrum.nearest(near, count)
        for rate, a in zip(rates, concentrations.T, strict=True):
            if _angular_number(mesh, a) == m:
                return complex(rate)
    raise ArithmeticError(
        f"m = {m}: none of the 16 discrete rates nearest to {near:.4g} has that angular number"
    )


def _angular_number(mesh: Mesh, a: NDArray[np.complex128]) -> int:
    """The strongest angular harmonic of nodal values on the mesh's circles."""
    radius = np.hypot(*mesh.xi).round(9)
    theta = np.arctan2(mesh.xi[1], mesh.xi[0])
    energy = np.zeros(_HARMONICS)
    for circle in np.unique(radius):
        on = radius == circle
        waves = np.exp(1j * np.outer(np.arange(_HARMONICS), theta[on]))
        known = np.arange(_HARMONICS) * 2 < on.sum()
        energy += known * (np.abs(waves @ a[on]) ** 2 + np.abs(waves.conj() @ a[on]) ** 2) / on.sum()
    energy[0] /= 2  # counted twice
    return int(np.argmax(energy))
