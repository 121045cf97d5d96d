"""What a comparison asserts: one claim, one number, one bound."""

import math
from dataclasses import dataclass
from enum import StrEnum


def excess(value: float, bound: float) -> str:
    """Return a value and the bound that it exceeds in words; nan exceeds none, and proves nothing."""
    return "there is no number" if math.isnan(value) else f"{value:.3g} > {bound:.3g}"


class ClaimKind(StrEnum):
    """What a claim asserts, whatever its sentence says."""

    CONSERVATION = "conservation"
    GEOMETRY = "geometry"
    """Volumes alone change the concentration."""
    EXACT = "exact"
    GROWTH_RATE = "growth rate"
    REFERENCE = "reference"
    AGREEMENT = "agreement"
    """Of methods with each other."""
    TRIANGLE = "triangle"
    """Two codes and, where there is one, theory."""
    ORDER_H = "order in h"
    ORDER_DT = "order in dt"
    REDUCTION = "reduction"
    """A smaller model gives what the whole one gives."""
    INVARIANCE = "invariance"
    """What must not matter, as a turn, changes nothing."""
    TOLERANCE = "tolerance"
    ENDS = "ends"
    """A run ends, or a check comes to a verdict."""
    CONTROL = "control"
    """A deliberate fault is caught."""
    CLEAN = "clean"
    """Without a fault a check is green."""
    COST = "cost"
    BASELINE = "baseline"
    """No number is worse than in an earlier night."""
    OTHER = "other"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement about the runs of one scene that either holds or does not.

    Attributes
    ----------
    kind : what it asserts.
    quantity : of what, such as "area"; empty where the kind says it all.
    scene : name of the scene.
    methods : names of the methods it is about.
    statement : one sentence for a reader who knows the article.
    value : the measured number, smaller is better.
    bound : the largest value with which the claim holds; nan where it is not judged.
    command : what reproduces the value.
    path : HDF5 path, inside the comparison, of the numbers the value was made from.
    note : where the bound comes from, or any caveat.
    """

    kind: ClaimKind
    quantity: str = ""
    scene: str
    methods: tuple[str, ...]
    statement: str
    value: float
    bound: float
    command: str
    path: str
    note: str = ""

    @property
    def key(self) -> str:
        """Its name, which lasts when the sentence is improved, such as "reference/area/fig14/fem-p1+fv"."""
        return "/".join(filter(None, (self.kind, self.quantity, self.scene, "+".join(self.methods))))

    @property
    def judged(self) -> bool:
        """False where nobody stated a bound: the number is shown, and proves nothing."""
        return not math.isnan(self.bound)

    @property
    def holds(self) -> bool:
        """True where the value is finite and within the bound: a run that gave no number proves nothing."""
        return math.isfinite(self.value) and self.value <= self.bound

    @property
    def sentence(self) -> str:
        """The claim with what it is about, its number and its bound, in a line."""
        about = f"{self.scene} [{', '.join(self.methods)}]: {self.statement}"
        return f"{about}: {self.excess} ({self.note})"

    @property
    def excess(self) -> str:
        """Why it fails, for a reader: see `excess`."""
        return excess(self.value, self.bound)

    @property
    def verdict(self) -> str:
        """ "PASS" where the claim holds, "FAIL" where it does not, "NOT JUDGED" without a bound."""
        if not self.judged:
            return "NOT JUDGED"
        return "PASS" if self.holds else "FAIL"
