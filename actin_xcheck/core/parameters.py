"""What is chosen of the model: parameters, as in (3.1) or dimensional (Table 1), and readings by a word.

Nothing else is imported here: a command's help needs no more.
"""

import math
from dataclasses import dataclass
from enum import StrEnum


@dataclass(frozen=True)
class Parameters:
    """Non-dimensional parameters of (3.2); the defaults are Table 2.

    Attributes
    ----------
    psi : contractile tonicity.
    p : pressure coefficient (negative values are allowed, section 5.4).
    d : diffusion coefficient of F-actin.
    a_sat : saturation concentration.
    mu1, mu2 : shear and bulk viscosity.
    nu : Poisson's ratio.
    l0 : radius beyond which delta of (2.6) is 1, as a fraction of the cell's radius.
    """

    psi: float
    p: float
    d: float = 0.4
    a_sat: float = 1.4
    mu1: float = 2.5
    mu2: float = 6.5
    nu: float = 0.3
    l0: float = 0.8

    @property
    def mu(self) -> float:
        """Total viscosity mu1 + mu2 of (3.5)."""
        return self.mu1 + self.mu2

    @property
    def nu_prime(self) -> float:
        """nu' = nu / (1 - 2 nu) of (3.2)."""
        return self.nu / (1 - 2 * self.nu)


UNITS = {
    **dict.fromkeys(("psi", "p", "E"), "dyn/cm^2"),
    **dict.fromkeys(("mu1", "mu2"), "dyn s/cm^2"),
    **{"D_a": "cm^2/s", "k_a": "1/s", "L": "cm"},
    **dict.fromkeys(("a_sat", "a_c"), "normalised density"),
    **dict.fromkeys(("nu", "l0"), "no unit"),
}
"""Of every key of `DimensionalParameters`, as Table 1 has them."""

IN_UNITS = "[dimensional] is in " + ", ".join(f"{name} ({unit})" for name, unit in UNITS.items())

IN_THE_ARTICLE = {
    "psi": (22.425, 1.04e5),
    "p": (0.026, 1.646),
    "d": (2.424e-6, 0.4),
    "a_sat": (1.4, 1.4),
    "mu1": (2.0624, 2.5),
    "mu2": (5.3625, 6.5),
}
"""Least and largest value of each group (of p: magnitude) in Table 2 and in sections 5 and 6."""

FAR = 1e3
"""Times what the article has: rather a slip of units than a cell."""


def far_from_the_article(parameters: Parameters) -> tuple[str, ...]:
    """Return a sentence for every group that is neither 0 nor within `FAR` of the article's values."""
    return tuple(
        f"{name} = {value:.4g} is more than {FAR:g} times {'below' if abs(value) < least else 'above'} "
        f"the article's {least:g}" + (f" to {largest:g}" if largest > least else "")
        for name, (least, largest) in IN_THE_ARTICLE.items()
        if (value := getattr(parameters, name)) and not least / FAR <= abs(value) <= largest * FAR
    )


@dataclass(frozen=True)
class DimensionalParameters:
    """Parameters in `UNITS`; the defaults are Table 1.

    Attributes
    ----------
    psi, p : contractile tonicity and pressure coefficient.
    E : Young's modulus.
    D_a : diffusion coefficient.
    k_a : polymerisation rate.
    mu1, mu2 : shear and bulk viscosity.
    a_sat, a_c : concentrations.
    L : length scale (the cell's radius).
    nu, l0 : Poisson's ratio and the ring's inner radius over L.
    """

    psi: float
    p: float
    E: float = 1.5
    nu: float = 0.3
    D_a: float = 0.012
    k_a: float = 0.03
    a_sat: float = 1.4
    mu1: float = 96.15
    mu2: float = 250.0
    l0: float = 0.8
    a_c: float = 1.0
    L: float = 1.0

    @property
    def scales(self) -> str:
        """What one unit of time and of length is, in words."""
        return f"t = 1 is {engineering(1 / self.k_a, 's')}, x = 1 is {engineering(self.L / 100, 'm')}"

    def non_dimensional(self) -> Parameters:
        """Return the groups of (3.1), stresses measured in E / (1 + nu)."""
        stress = self.E / (1 + self.nu)
        return Parameters(
            psi=self.psi * self.a_c**2 / stress,
            p=self.p / stress,
            d=self.D_a / (self.k_a * self.L**2),
            a_sat=self.a_sat / self.a_c,
            mu1=self.mu1 * self.k_a / stress,
            mu2=self.mu2 * self.k_a / stress,
            nu=self.nu,
            l0=self.l0,
        )


def engineering(value: float, unit: str) -> str:
    """Return a positive quantity with the prefix that suits it: 0.015 s is "15 ms"."""
    thousands = min(max(math.floor(math.log10(value) / 3 + 1e-9), -5), 4)
    return f"{value / 1000.0**thousands:.4g} {'fpnµm kMGT'[thousands + 5].strip()}{unit}"


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


class Fidelity(StrEnum):
    """How much of the model is solved; each choice is exact where it is valid."""

    AUTO = "auto"
    """The smallest of the others that is exact for the scene."""
    FULL = "full"
    """The whole cell, with all terms."""
    RADIAL = "radial"
    """One ray of an axisymmetric cell: a problem in R and t."""
    SECTOR = "sector"
    """Between two neighbouring mirror lines, with `symmetry` sides."""
    MODAL = "modal"
    """The linear modes of the rest state, as long as what they neglect stays below the tolerance."""


FIELDS = {"a": "a", "a_cells": "cell means of a", "u": "displacement", "v": "speed", "delta": "delta"}
"""What can be drawn, and what it is called in the picture."""
