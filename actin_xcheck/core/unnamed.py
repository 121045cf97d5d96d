"""Claims as files state them; of those that were stored without a kind it is read off the sentence, once."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from actin_xcheck.core.claim import Claim, ClaimKind


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
