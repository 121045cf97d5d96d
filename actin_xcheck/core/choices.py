"""What is chosen by a word: readings of the model, how much of it is solved, what is drawn.

Nothing else is imported here: a command's help needs no more.
"""

from enum import StrEnum


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
