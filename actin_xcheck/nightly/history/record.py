"""What is kept of a night: where and of what it was made, its numbers, its claims.

A number is known by its key from night to night, and its kind says how it is read: on the logarithm or not,
which way is worse, and how large a change must be to be of interest.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array


class Kind(StrEnum):
    """What a number is."""

    ERROR = "error"
    ORDER = "order"
    RATE = "rate"
    TIME = "time"
    MEMORY = "memory"
    COUNT = "count"
    CLAIM = "claim"

    @property
    def worse(self) -> int:
        """1 where larger is worse, -1 where smaller is, 0 where either is news."""
        return {Kind.ORDER: -1, Kind.RATE: 0}.get(self, 1)

    @property
    def logarithmic(self) -> bool:
        """Whether numbers are compared by their ratio."""
        return self not in (Kind.ORDER, Kind.RATE)

    @property
    def of_machine(self) -> bool:
        """Whether numbers of different machines say nothing about each other."""
        return self in (Kind.TIME, Kind.MEMORY)


_LEAST = {Kind.ERROR: 1e-16, Kind.CLAIM: 1e-16, Kind.TIME: 1e-6, Kind.MEMORY: 1.0, Kind.COUNT: 0.5}
"""Below this, numbers on a logarithm are one: smaller errors are round-off, and 0 has no logarithm."""

_INTEREST = {
    Kind.ERROR: math.log(2.0),
    Kind.CLAIM: math.log(2.0),
    Kind.TIME: math.log(1.15),
    Kind.MEMORY: math.log(1.15),
    Kind.COUNT: math.log(1.15),
    Kind.ORDER: 0.1,
}
"""The smallest change of interest, on the number's scale."""

_RATE_INTEREST = 0.05
"""The same of a rate, in parts of its median size."""


@dataclass(frozen=True)
class Number:
    """One number of a night.

    Attributes
    ----------
    key : its name, the same every night, such as "error/area/fig14-four-fronts/fem-p1-paper".
    kind, value, unit : what it is; the value is nan where it was asked for and could not be had.
    source : where it comes from, the run's file or the command that makes it again.
    """

    key: str
    kind: Kind
    value: float
    unit: str = ""
    source: str = ""


@dataclass(frozen=True)
class Judged:
    """A claim as it came out in a night: in which check, how long its runs took, the file that holds them."""

    claim: Claim
    check: str
    seconds: float = math.nan
    source: str = ""

    @property
    def key(self) -> str:
        """Its name, the same every night."""
        return f"{self.claim.key} · {self.check}"


@dataclass(frozen=True)
class Night:
    """Where, when and of what the numbers of a night were made.

    Attributes
    ----------
    name : by which it is asked for, such as "2026-03-04".
    date : its beginning, ISO 8601, UTC; nights are in the order of their dates.
    commit : of the code.
    versions : by package.
    machine : what tells it from others whose times and memory are not comparable.
    command : what makes it again.
    budget, seconds : wall time it was given and took; inf without a limit, nan where unknown.
    """

    name: str
    date: str
    commit: str
    versions: Mapping[str, str]
    machine: str
    command: str = ""
    budget: float = math.inf
    seconds: float = math.nan

    def differences(self, before: "Night") -> tuple[str, ...]:
        """What of the code, its libraries and the machine is not as it was in another night, in words."""
        words = [
            f"{name} {old or 'none'} -> {new or 'none'}"
            for name, old, new in (
                ("commit", _short(before.commit), _short(self.commit)),
                *(
                    (package, before.versions.get(package, ""), self.versions.get(package, ""))
                    for package in sorted({*before.versions, *self.versions})
                ),
                ("machine", before.machine, self.machine),
            )
            if old != new
        ]
        return tuple(words)


def _short(commit: str) -> str:
    """A commit as it is read; one with changes that were not committed stays told from the others."""
    revision, dash, state = commit.partition("-")
    return revision[:12] + dash + state


@dataclass(frozen=True, eq=False)
class Series:
    """A number through the nights that asked for it.

    Attributes
    ----------
    key, kind, unit : of the number.
    nights : in order.
    values : (n,), nan where a night could not have it.
    """

    key: str
    kind: Kind
    unit: str
    nights: tuple[Night, ...]
    values: Array

    @property
    def scaled(self) -> Array:
        """The values on the scale on which they are compared, (n,)."""
        if not self.kind.logarithmic:
            return self.values
        return np.log(np.maximum(np.abs(self.values), _LEAST[self.kind]))

    @property
    def interest(self) -> float:
        """The smallest change of interest, on that scale."""
        if self.kind is Kind.RATE:
            return _RATE_INTEREST * float(np.nanmedian(np.abs(self.values)))
        return _INTEREST[self.kind]

    def only(self, places: Indices) -> "Series":
        """The same of the nights at these places."""
        nights = tuple(self.nights[place] for place in places)
        return Series(self.key, self.kind, self.unit, nights, self.values[places])
