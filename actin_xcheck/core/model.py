"""The equations (3.2), once and for every discretisation: constitutive laws and their switches.

Nothing here knows of meshes.  Functions are plain arithmetic on arrays of any shape; all quantities are
non-dimensional.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.parameters import Parameters

Array = NDArray[np.float64]


class Rheology(StrEnum):
    """Which displacement the elastic stress sees (Remark 2.1, B.4)."""

    VISCOELASTIC = "viscoelastic"
    """u accumulates from the start: (2.4) and the linear theory (3.3)."""
    VISCOUS = "viscous"
    """u is reset every step, so elasticity and dilation vanish as dt -> 0."""


class Closure(StrEnum):
    """Mechanical conditions on the rim; (2.1f) alone is singular, so each reading completes it."""

    REFERENCE_NORMAL = "reference-normal"
    """Each rim point keeps to the normal of its initial position (B.7); no force along it."""
    CURRENT_NORMAL = "current-normal"
    """The rim moves along its current normal (2.1e): ill-posed where the rim advances."""
    TRACTION_FREE = "traction-free"
    """(2.1f) alone, gauged by zero mean translation and rotation."""
    IRROTATIONAL_WALL = "irrotational-wall"
    """v.n = 0 and curl v = 0 on a static circle: the problem the dispersion relation (3.6) is exact for."""


CAVEATS = {
    Closure.CURRENT_NORMAL: "current-normal is ill-posed where the rim advances (ripples of wave number k "
    "grow like 0.139 V |k| for Table 2's viscosities): finer meshes get worse, trust modest resolution only",
}
"""What a user must know of a closure before believing a result."""


class Delta(StrEnum):
    """Where polymerisation adds to the pressure: the indicator delta(xi) of (2.5)."""

    RING = "ring"
    """1 where |xi| > l0 (2.6)."""
    MEMBRANE = "membrane"
    """1 on the boundary only (5.1): seen by the boundary integral of f alone."""
    NONE = "none"
    """0 everywhere: the linear theory's inner case."""
    FULL = "full"
    """1 everywhere: the linear theory's outer case."""


@dataclass(frozen=True)
class Model:
    """One reading of the model: parameters and the switches the article leaves open."""

    parameters: Parameters
    rheology: Rheology = Rheology.VISCOELASTIC
    closure: Closure = Closure.REFERENCE_NORMAL
    delta: Delta = Delta.RING
    reaction: bool = True

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

    def active_stress(self, a: Array, phi: Array, delta: Array | float) -> Array:
        """f = sigma(a) + p(a): the isotropic stress whose gradient drives the network (B.4)."""
        return self.contractility(a) + self.pressure(a, phi, delta)

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
