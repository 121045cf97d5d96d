"""What a comparison asserts: one claim, one number, one bound.

Of claims that were stored before they had kinds, the kind is read off the sentence, once.
"""

import math
import re
from collections.abc import Container, Mapping
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any


def excess(value: float, bound: float) -> str:
    """Return a value and the bound that it exceeds in words; nan exceeds none, and proves nothing."""
    return "there is no number" if math.isnan(value) else f"{value:.3g} > {bound:.3g}"


def free_name(name: str, taken: Container[str]) -> str:
    """Return the name, with the first number behind that makes it free."""
    count, free = 1, name
    while free in taken:
        free = f"{name}-{(count := count + 1)}"
    return free


class ClaimKind(StrEnum):
    """What a claim asserts, whatever its sentence says."""

    CONSERVATION = "conservation"
    GEOMETRY = "geometry"
    """Volumes alone change the concentration."""
    EXACT = "exact"
    GROWTH_RATE = "growth rate"
    TRANSIENT = "transient growth"
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
    COVERAGE = "coverage"
    """What is stated covers the true error."""
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


@dataclass(frozen=True)
class Unnamed:
    """A claim that was stored before claims had kinds; see `Claim`."""

    scene: str
    methods: tuple[str, ...]
    statement: str
    value: float
    bound: float
    command: str
    path: str
    note: str = ""

    @property
    def named(self) -> Claim:
        """The same with the kind and the quantity that its path and its sentence tell.

        Where neither does, the sentence is the quantity, which keeps it apart from others.
        """
        for text, patterns in ((self.path, _PATHS), (self.statement, _SENTENCES)):
            for pattern, kind, quantity in patterns:
                if found := re.match(pattern, text):
                    return Claim(kind=self._kind(kind), quantity=found.expand(quantity), **asdict(self))
        return Claim(kind=ClaimKind.OTHER, quantity=self.statement, **asdict(self))

    def _kind(self, kind: ClaimKind) -> ClaimKind:
        """The kind; in the scene in which volumes alone change the concentration, that is what is judged."""
        diluted = self.scene == "uniform-dilution" and kind is ClaimKind.EXACT
        return ClaimKind.GEOMETRY if diluted else kind


_PATHS = (
    (r"/triangles/.*--(\w+)$", ClaimKind.TRIANGLE, r"\1"),
    (r"/studies/.*--h--(\w+)$", ClaimKind.ORDER_H, r"\1"),
    (r"/studies/.*--dt--(\w+)$", ClaimKind.ORDER_DT, r"\1"),
    (r"/faults/", ClaimKind.CONTROL, ""),
    (r"/cost/", ClaimKind.COST, ""),
    (r"/baseline/(\w+)", ClaimKind.BASELINE, r"\1"),
    (r"/tables/breakdowns", ClaimKind.AGREEMENT, "breakdown_time"),
)
"""How paths begin, the kind, and the quantity."""

_SENTENCES = (
    (r"runs to its end|comes to a verdict", ClaimKind.ENDS, ""),
    (r"total actin obeys", ClaimKind.CONSERVATION, "total_actin"),
    (r"concentration equals the exact", ClaimKind.EXACT, "concentration"),
    (r"mode \(", ClaimKind.GROWTH_RATE, "growth_rate"),
    (r"area equals the reference", ClaimKind.REFERENCE, "area"),
    (r"total actin equals the reference", ClaimKind.REFERENCE, "total_actin"),
    (r"concentration at the probes equals", ClaimKind.REFERENCE, "probe_a"),
    (r"positions of the probes equal", ClaimKind.REFERENCE, "probe_x"),
    (r".* agrees with ", ClaimKind.AGREEMENT, "concentration"),
    (r"steps chosen by", ClaimKind.TOLERANCE, ""),
    (r"a sector and the whole", ClaimKind.REDUCTION, ""),
    (r"(.*): all of its \d+ claims hold", ClaimKind.CLEAN, r"\1"),
)
"""The same of sentences."""


def claim_of(said: Mapping[str, Any]) -> Claim:
    """Return the claim whose fields a file states, among others; KeyError where one is missing."""
    methods = {"methods": tuple(said["methods"])}
    if "kind" not in said:
        return Unnamed(**{field.name: said[field.name] for field in fields(Unnamed)} | methods).named
    stated = {field.name: said[field.name] for field in fields(Claim)}
    return Claim(**stated | methods | {"kind": ClaimKind(said["kind"])})
