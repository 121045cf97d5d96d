"""What is different, in words: changes through the nights, two nights side by side, a baseline undercut."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.nightly.history import JudgedNumber, Series
from actin_xcheck.nightly.record import Night, Number, NumberKind

ROUND_OFF = 1e-11
"""Values of claims and errors up to this are round-off, whose doubling is no news."""

_SAID = {
    NumberKind.CLAIM: "no claim's value is twice what it was",
    NumberKind.ERROR: "no error is twice what it was",
    NumberKind.ORDER: "no order is lower by a tenth",
    NumberKind.RATE: "no growth rate has moved by a twentieth",
    NumberKind.COUNT: "no counted work is 15 % more",
}


class Shape(StrEnum):
    """How a sequence changes; `LOST`, what could not be had any more, is not for the values to say."""

    STEP = "step"
    DRIFT = "drift"
    SUSPECT = "suspect"
    LOST = "lost"


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A number that is not the same in two nights.

    Attributes
    ----------
    key, kind, unit : of the number.
    old, new : its values; nan where a night does not have it.
    weight : its change over the smallest of interest; inf where a night does not have it.
    """

    key: str
    kind: NumberKind
    unit: str
    old: float
    new: float
    weight: float

    @property
    def direction(self) -> str:
        """ "worse", "better", or "other" where neither way is; "gone" and "new" where a night lacks it."""
        if math.isnan(self.new) or math.isnan(self.old):
            return "gone" if math.isnan(self.new) else "new"
        return _direction(self.kind, self.new - self.old)

    @property
    def change(self) -> str:
        """The change in words."""
        both = f"{self.old:.4g} -> {self.new:.4g}"
        if not math.isfinite(self.new - self.old):
            return both
        if not self.kind.logarithmic or not self.old:
            return f"{both} ({self.new - self.old:+.3g})"
        ratio = self.new / self.old
        return f"{both} ({100 * (ratio - 1):+.3g} %)" if 0.5 < abs(ratio) < 2.0 else f"{both} (x {ratio:.3g})"


@dataclass(frozen=True, kw_only=True)
class Event(Difference):
    """A change of a number, between its levels before and after.

    Attributes
    ----------
    shape : a step, a drift, a suspect: the newest night or two stand out, too few to be sure; or lost: asked
        for and not had any more.
    night : the first that has it.
    within : nights in which it may have begun, at 95 %, in order.
    together : numbers that say so, this one included.
    until : the night from which on it is whole; `night` but for a drift.
    news : what changed with that night: commit, versions, machine, in words.
    size : of the change on the number's scale.
    p : bound on its probability in independent noise, over all nights; 0 where there is none.
    exact : whether the numbers around are equal to round-off, so that there is no doubt.
    """

    shape: Shape
    night: Night
    within: tuple[Night, ...]
    together: int = 1
    until: Night
    news: tuple[str, ...]
    size: float = math.nan
    p: float = 0.0
    exact: bool = True

    @property
    def direction(self) -> str:
        """ "worse", "better", or "other" where neither way is."""
        return _direction(self.kind, self.size)

    @property
    def minor(self) -> bool:
        """Whether it is certain, but smaller than what is of interest."""
        return self.weight < 1.0 and self.exact


@dataclass(frozen=True)
class Turned:
    """A claim whose verdict is not the same in two nights.

    Attributes
    ----------
    key : of the claim.
    was, now : its verdicts; "none" where a night does not have it.
    old, new, bound : its values and its present bound; nan where a night does not have it.
    """

    key: str
    was: str
    now: str
    old: float
    new: float
    bound: float


def differences(old: Iterable[Number], new: Iterable[Number]) -> list[Difference]:
    """Return the numbers that differ between two nights by more than round-off, the largest change first."""
    before, after = ({one.key: one for one in numbers} for numbers in (old, new))
    found = []
    for key, known in {**before, **after}.items():
        values = np.array([night[key].value if key in night else math.nan for night in (before, after)])
        if np.isnan(values).all():
            continue
        pair = Series(key, known.kind, known.unit, (), values)
        size = abs(float(np.diff(pair.scaled)[0]))
        if math.isnan(size) or size > pair.round_off:
            weight = math.inf if math.isnan(size) else size / pair.interest
            was, now = values.tolist()
            found.append(
                Difference(key=key, kind=known.kind, unit=known.unit, old=was, new=now, weight=weight)
            )
    return sorted(found, key=lambda one: (-one.weight, one.key))


def turned(old: Mapping[str, JudgedNumber], new: Mapping[str, JudgedNumber]) -> list[Turned]:
    """Return the claims whose verdicts differ, those that fail in the new night first."""

    def stands(one: JudgedNumber | None) -> tuple[str, float, float]:
        return (one.claim.verdict, one.claim.value, one.claim.bound) if one else ("none", math.nan, math.nan)

    found = []
    for key in dict.fromkeys([*old, *new]):
        (was, before, _), (now, after, bound) = stands(old.get(key)), stands(new.get(key))
        if was != now:
            found.append(Turned(key, was, now, before, after, bound))
    return sorted(found, key=lambda one: (one.now != "FAIL", one.key))


def _direction(kind: NumberKind, size: float) -> str:
    if math.isnan(size):  # it was asked for and could not be had
        return "worse"
    if kind.worse == 0 or size == 0:
        return "other"
    return "worse" if size * kind.worse > 0 else "better"


def against(
    night: Night,
    again: str,
    old: tuple[Sequence[Number], Mapping[str, JudgedNumber]],
    new: tuple[Sequence[Number], Mapping[str, JudgedNumber]],
) -> list[Claim]:
    """Return a claim for every kind of number: that none is worse by what is of interest.

    Parameters
    ----------
    night : the earlier one.
    again : the command that shows both.
    old, new : numbers and claims by key, of the earlier night and of this one.

    Numbers that only one of them has are not compared, nor are times and memory, which the history judges
    over many nights.  Where nothing is left to compare, that is the one claim, and it fails.
    """
    before, after = ([*numbers, *_values(claims)] for numbers, claims in (old, new))
    common = {one.key for one in before} & {one.key for one in after}
    before = [one for one in before if one.key in common and math.isfinite(one.value)]
    after = [one for one in after if one.key in common]
    worse = [one for one in differences(before, after) if _worse(one) and not one.key.startswith("red/")]
    said: dict[str, tuple[str, float, str]] = {}
    for kind, statement in _SAID.items():
        if compared := sum(one.kind is kind for one in after):
            ours = [one for one in worse if one.kind is kind]
            listed = "; ".join(f"{one.key}: {one.change}" for one in ours if one.weight >= 1)
            note = f"against {night.name}: {listed or f'{compared} numbers compared'}; "
            note += "value: largest change over the smallest of interest"
            said[kind] = statement, max((one.weight for one in ours), default=0.0), note
    if not said:
        note = f"nothing in common with {night.name}: no number that it has was found here"
        said["common"] = "there are numbers to compare", math.nan, note
    return [
        Claim(
            kind=ClaimKind.BASELINE,
            quantity=quantity,
            scene="baseline",
            methods=(),
            statement=statement,
            value=value,
            bound=0.0 if quantity == "common" else 1.0,
            command=again,
            path=f"/baseline/{quantity}",
            note=note,
        )
        for quantity, (statement, value, note) in said.items()
    ]


def _values(claims: Mapping[str, JudgedNumber]) -> list[Number]:
    return [
        Number(f"claim/{key}", NumberKind.CLAIM, one.claim.value)
        for key, one in claims.items()
        if one.claim.judged
    ]


def _worse(one: Difference) -> bool:
    small = one.kind in (NumberKind.CLAIM, NumberKind.ERROR) and one.new <= ROUND_OFF
    return not small and (one.direction in ("worse", "gone") or one.kind is NumberKind.RATE)
