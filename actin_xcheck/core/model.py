"""The equations (3.2), once and for every discretisation: constitutive laws and their switches.

Nothing here knows of meshes.  Functions are plain arithmetic on arrays of any shape; all quantities are
non-dimensional.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """One reading of the model: parameters and the switches the article leaves open."""

    parameters: Parameters
    rheology: Rheology = Rheology.VISCOELASTIC
    closure: Closure = Closure.REFERENCE_NORMAL
    delta: Delta = Delta.RING
    reaction: bool = True

    def varied(self, **changes: Any) -> "Model":
        """Return the model with other parameters and switches, by name: model.varied(psi=3.0)."""
        switches = {name: changes.pop(name) for name in [*changes] if name in _SWITCHES}
        return replace(self, parameters=replace(self.parameters, **changes), **switches)

    def viscous_moduli(self) -> tuple[float, float]:
        """(mu1, mu2) of sigma_v = mu1 eps(v) + mu2 (div v) I (2.3)."""
        return self.parameters.mu1, self.parameters.mu2

    def elastic_moduli(self) -> tuple[float, float]:
        """(1, nu') of sigma_e = eps(u) + nu' phi I (2.4) in the units of (3.1)."""
        return 1.0, self.parameters.nu_prime

    def contractility(self, a: Array) -> Array:
        """sigma(a) = psi a^2 exp(-a/a_sat) (2.2)."""
        return self.parameters.psi * a**2 * np.exp(-a / self.parameters.a_sat)

    def pressure(self, a: Array, phi: Array, delta: Array | float) -> Array:
        """p(a) = p/(1+phi) [1 + (2/pi) delta arctan a] (2.5); phi is the dilation div u."""
        return self.parameters.p / (1 + phi) * (1 + 2 / np.pi * delta * np.arctan(a))

    def dilated(self, t: float, phi: Array, place: Callable[[int], str]) -> Outcome:
        """Whether the pressure exists for dilations phi (n,) at t: it ends where 1 + phi <= 0 (2.5).

        `place` says where the entry of some number is.
        """
        worst = int(np.argmin(phi))
        if self.parameters.p == 0 or 1 + phi[worst] > 0:
            return COMPLETED
        where = f"1 + phi = {1 + phi[worst]:.3g} at t = {t:.6g} {place(worst)}"
        return Outcome(Ending.SINGULAR_DILATION, f"{where}: the pressure (2.5) is singular there")

    def active_stress(self, a: Array, phi: Array, delta: Array | float) -> Array:
        """f = sigma(a) + p(a): the isotropic stress whose gradient drives the network (B.4)."""
        return self.contractility(a) + self.pressure(a, phi, delta)

    def slopes(self, a: float = 1.0, phi: float = 0.0) -> tuple[float, float]:
        """df/da, df/dphi for constant delta by complex steps, exact to round-off: f', -p_e at rest."""
        delta, tiny = float(self.delta is Delta.FULL), 1e-30
        beside: Any = a + 1j * tiny
        dilated: Any = phi + 1j * tiny
        at: Any = a
        of_a = self.active_stress(beside, at * 0 + phi, delta)
        return float(of_a.imag / tiny), float(self.active_stress(at, dilated, delta).imag / tiny)

    def feeding(self) -> float:
        """Estimate the rate at which quadratic terms feed small modes of a = 1, u = 0, per amplitude squared.

        Their stresses are the second derivatives of f and what geometry makes of first-order stresses, once
        in the load and once in the viscosity; |phi| is at most twice the largest entry of grad u.
        """
        h = 1e-4
        of_a, of_phi = self.slopes()
        of_aa, of_a_phi = (
            (plus - minus) / (2 * h)
            for plus, minus in zip(self.slopes(1 + h), self.slopes(1 - h), strict=True)
        )
        of_phi_phi = (self.slopes(1.0, h)[1] - self.slopes(1.0, -h)[1]) / (2 * h)
        one, nu_prime = self.elastic_moduli()
        stress = abs(of_aa) / 2 + 2 * abs(of_a)
        if self.rheology is Rheology.VISCOELASTIC:
            stress += 2 * abs(of_a_phi) + 2 * abs(of_phi_phi) + 2 * (2 * abs(of_phi) + one + 2 * nu_prime)
        return stress / self.parameters.mu + 2 * self.reaction_rate()

    @property
    def rim_sees_dilation(self) -> bool:
        """Whether the load on a free rim depends on the dilation there: p(a) of (2.5) does where u counts."""
        elastic = self.rheology is Rheology.VISCOELASTIC and self.parameters.p != 0
        return elastic and self.closure is not Closure.IRROTATIONAL_WALL

    def reaction_rate(self) -> float:
        """k_a in units of (3.1): 1, or 0 where the scene switches polymerisation off."""
        return 1.0 if self.reaction else 0.0

    def delta_on_cells(self, xi: Array) -> Array:
        """Delta on cells whose centroids were at xi, shape (2, n): shape (n,) of zeros and ones."""
        match self.delta:
            case Delta.RING:
                return (np.hypot(*xi) > self.parameters.l0).astype(float)
            case Delta.FULL:
                return np.ones(xi.shape[1])
            case _:
                return np.zeros(xi.shape[1])

    def delta_on_rim(self) -> float:
        """Delta as the boundary integral of f sees it."""
        return 0.0 if self.delta is Delta.NONE else 1.0


_SWITCHES = {one.name for one in fields(Model)} - {"parameters"}
