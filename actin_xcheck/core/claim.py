"""What a comparison asserts: one claim, one number, one bound."""

import math
from dataclasses import dataclass


def excess(value: float, bound: float) -> str:
    """Return a value and the bound that it exceeds in words; nan exceeds none, and proves nothing."""
    return "there is no number" if math.isnan(value) else f"{value:.3g} > {bound:.3g}"


@dataclass(frozen=True)
class Claim:
    """A statement about the runs of one scene that either holds or does not.

    Attributes
    ----------
    scene : name of the scene.
    methods : names of the methods it is about.
    statement : one sentence for a reader who knows the article.
    value : the measured number, smaller is better.
    bound : the largest value with which the claim holds; nan where it is not judged.
    command : what reproduces the value.
    path : HDF5 path, inside the comparison, of the numbers the value was made from.
    note : where the bound comes from, or any caveat.
    """

    scene: str
    methods: tuple[str, ...]
    statement: str
    value: float
    bound: float
    command: str
    path: str
    note: str = ""

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
