"""The equations (3.2), once and for every discretisation: constitutive laws and their switches.

The article's laws stand here as arithmetic; a scene may have laws of its own, formulas in the same arguments.
Nothing here knows of meshes.  Functions are plain arithmetic on arrays of any shape; all quantities are
non-dimensional.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology

Array = NDArray[np.float64]


ARTICLE = {
    "contractility": "psi*a**2*exp(-a/a_sat)",
    "pressure": "p/(1+phi)*(1+2/pi*delta*arctan(a))",
    "kinetics": "1-a",
}
"""The laws (2.2), (2.5) and that of (2.1b) as a scene writes them."""

ARGUMENTS = {"contractility": ("a",), "pressure": ("a", "phi", "delta"), "kinetics": ("a",)}
"""What each law is a function of, beside the parameters."""

NEAR_REST = 1e-6
"""How far from a = 1, u = 0 slopes are taken to see whether a law has a kink there."""


class Law(Protocol):
    """A law of a scene's own: a formula in its `ARGUMENTS` and in parameters, all given by name."""

    def __call__(self, **values: Any) -> Array:
        """Values, of the shape of the arguments together."""

    def slope(self, along: str, **values: Any) -> Array:
        """Partial derivatives along one argument, of the same shape."""

    def mentions(self, name: str) -> bool:
        """Whether a name stands in the formula."""


@dataclass(frozen=True)
class Laws:
    """Laws in place of the article's, which None stands for, and parameters (name, value) of their own."""

    contractility: Law | None = None
    pressure: Law | None = None
    kinetics: Law | None = None
    own: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Model:
    """One reading of the model: parameters, the switches the article leaves open, and laws."""

    parameters: Parameters
    rheology: Rheology = Rheology.VISCOELASTIC
    closure: Closure = Closure.REFERENCE_NORMAL
    delta: Delta = Delta.RING
    reaction: bool = True
    laws: Laws = Laws()

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
        """sigma(a) = psi a^2 exp(-a/a_sat) (2.2), or the scene's own."""
        if self.laws.contractility is not None:
            return self.laws.contractility(**self._known, a=a)
        return self.parameters.psi * a**2 * np.exp(-a / self.parameters.a_sat)

    def pressure(self, a: Array, phi: Array, delta: Array | float) -> Array:
        """p(a) = p/(1+phi) [1 + (2/pi) delta arctan a] (2.5), or the scene's own; phi = div u."""
        if self.laws.pressure is not None:
            return self.laws.pressure(**self._known, a=a, phi=phi, delta=delta)
        return self.parameters.p / (1 + phi) * (1 + 2 / np.pi * delta * np.arctan(a))

    def dilated(self, t: float, phi: Array, place: Callable[[int], str]) -> Outcome:
        """Whether the pressure exists for dilations phi (n,) at t: it ends where 1 + phi <= 0 (2.5).

        `place` says where the entry of some number is.
        """
        worst = int(np.argmin(phi))
        if not self.sees("phi") or 1 + phi[worst] > 0:
            return COMPLETED
        where = f"1 + phi = {1 + phi[worst]:.3g} at t = {t:.6g} {place(worst)}"
        pressure = "the pressure (2.5)" if self.laws.pressure is None else "the pressure"
        return Outcome(Ending.SINGULAR_DILATION, f"{where}: {pressure} is singular there")

    @property
    def contracts(self) -> bool:
        """Whether there is a contractility."""
        return self.laws.contractility is not None or self.parameters.psi != 0

    @property
    def pressed(self) -> bool:
        """Whether there is a pressure."""
        return self.laws.pressure is not None or self.parameters.p != 0

    def sees(self, argument: str) -> bool:
        """Whether the pressure depends on "a", "phi" or "delta"."""
        law = self.laws.pressure
        return self.parameters.p != 0 if law is None else law.mentions(argument)

    @property
    def strength(self) -> float:
        """How strong the active stress is: psi + |p|; of laws of one's own the sum of its slopes at rest."""
        if self.laws == Laws():
            return self.parameters.psi + abs(self.parameters.p)
        return float(np.abs(self.slopes(delta=1.0)).sum())

    def slopes(self, a: float = 1.0, phi: float = 0.0, delta: float | None = None) -> tuple[float, float]:
        """df/da, df/dphi, exact to round-off: f', -p_e at rest; for constant delta, its own unless given."""
        delta = float(self.delta is Delta.FULL) if delta is None else delta
        if self.laws == Laws():
            return self._steps(self.active_stress, a, phi, delta)
        of_contractility = self._of_law(self.laws.contractility, "a", a=a)
        if of_contractility is None:
            of_contractility = self._steps(lambda a, phi, delta: self.contractility(a), a, phi, delta)[0]
        at = {"a": a, "phi": phi, "delta": delta}
        of_a, of_phi = (self._of_law(self.laws.pressure, along, **at) for along in ("a", "phi"))
        if of_a is None or of_phi is None:
            of_a, of_phi = self._steps(self.pressure, a, phi, delta)
        return of_contractility + of_a, of_phi

    @property
    def is_smooth_at_rest(self) -> bool:
        """Whether the laws have slopes at a = 1, u = 0: without them there is no linear theory."""
        if self.laws == Laws():
            return True
        after, before = (
            np.array(self.slopes(1 + side, side, delta=self.delta_on_rim()))
            for side in (NEAR_REST, -NEAR_REST)
        )
        return bool(np.all(np.abs(after - before) <= 1e3 * NEAR_REST * (1 + np.abs(after) + np.abs(before))))

    def _of_law(self, law: Law | None, along: str, **at: float) -> float | None:
        return None if law is None else float(law.slope(along, **self._known, **at))

    @staticmethod
    def _steps(of: Callable[..., Any], a: float, phi: float, delta: float) -> tuple[float, float]:
        """Slopes in a and phi of a function of (a, phi, delta), by complex steps."""
        tiny = 1e-30
        beside: Any = a + 1j * tiny
        dilated: Any = phi + 1j * tiny
        at: Any = a
        of_a, of_phi = of(beside, at * 0 + phi, delta), of(at, dilated, delta)
        return float(np.imag(of_a) / tiny), float(np.imag(of_phi) / tiny)

    @property
    def _known(self) -> dict[str, float]:
        """Parameters by name, those of laws of one's own among them."""
        return {**vars(self.parameters), **dict(self.laws.own)}

    def active_stress(self, a: Array, phi: Array, delta: Array | float) -> Array:
        """f = sigma(a) + p(a): the isotropic stress whose gradient drives the network (B.4)."""
        return self.contractility(a) + self.pressure(a, phi, delta)

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
    def breaks_down(self) -> bool:
        """Whether there is a dilation at which the pressure ends: p(a) of (2.5) sees it where u counts."""
        return self.rheology is Rheology.VISCOELASTIC and self.sees("phi")

    @property
    def rim_sees_dilation(self) -> bool:
        """Whether the load on a free rim depends on the dilation there."""
        return self.breaks_down and self.closure is not Closure.IRROTATIONAL_WALL

    def reaction_rate(self) -> float:
        """k_a in units of (3.1): 1 or what the scene's kinetics have, 0 where it switches them off."""
        if not self.reaction:
            return 0.0
        return (
            1.0 if self.laws.kinetics is None else -float(self.laws.kinetics.slope("a", **self._known, a=1.0))
        )

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
