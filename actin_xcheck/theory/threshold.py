"""The smallest contractility psi at which a mode of the moving cell stops decaying."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.model import Model
from actin_xcheck.theory.exact import DiskModes

LARGEST_PSI = 1e5
"""Beyond it a threshold is not looked for: the article's largest psi is 1.04e5."""


@dataclass(frozen=True)
class Threshold:
    """psi*(p, m): where some rate of angular number m first reaches Re lambda = 0.

    Attributes
    ----------
    m : angular number.
    psi : the threshold, None where there is none.
    omega : |Im lambda| there: 0 for a real crossing, > 0 for a pair; None where there is none.
    reason : why there is none, else empty.
    """

    m: int
    psi: float | None
    omega: float | None
    reason: str = ""

    @property
    def crossing(self) -> str:
        """How it crosses: as a "pair", a "real" rate, or "none"."""
        if self.psi is None or self.omega is None:
            return "none"
        return "pair" if self.omega > 1e-6 else "real"


def threshold(model: Model, m: int) -> Threshold:
    """Return psi* of angular number m for a model's other parameters (its own psi is ignored).

    psi is raised in steps of 10 % from 0 until a mode grows, and the step that did it bisected.
    """

    def modes(psi: float) -> DiskModes:
        return DiskModes(model.varied(psi=psi), m)

    blocking = {name: x for name, x in modes(0.0).boundary_points().items() if x >= 0}
    if blocking:
        named = ", ".join(f"{name} = {x:.6g}" for name, x in blocking.items())
        return Threshold(m, None, None, f"infinitely many modes grow for every psi: {named}")
    if modes(0.0).count(0.0):
        return Threshold(m, None, None, "a mode grows at psi = 0 already")
    low, high = 0.0, 1.0
    while not modes(high).count(0.0):
        low, high = high, 1.1 * high
        if high > LARGEST_PSI:
            return Threshold(m, None, None, f"no mode grows up to psi = {LARGEST_PSI:g}")
    while high - low > 1e-11 * high:
        middle = (low + high) / 2
        if modes(middle).count(0.0):
            high = middle
        else:
            low = middle
    critical = modes(high).rates(0.0)
    leading = critical[np.argmax(critical.real)]
    return Threshold(m, high, abs(float(leading.imag)))


def lowest(thresholds: Iterable[Threshold]) -> Threshold | None:
    """Return psi*(p), the least of psi*(p, m) over m, with its mode; None where no mode has a threshold."""
    found = [(one.psi, one) for one in thresholds if one.psi is not None]
    return min(found, key=lambda pair: pair[0])[1] if found else None
