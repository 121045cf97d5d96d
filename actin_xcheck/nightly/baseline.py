"""A night against an earlier one: no number that does not depend on the machine may be worse."""

import math
from collections.abc import Mapping, Sequence

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.nightly.history.record import Judged, Kind, Night, Number
from actin_xcheck.nightly.history.steps import Difference, differences

ROUND_OFF = 1e-11
"""Values of claims and errors up to this are round-off, whose doubling is no news."""

_SAID = {
    Kind.CLAIM: "no claim's value is twice what it was",
    Kind.ERROR: "no error is twice what it was",
    Kind.ORDER: "no order is lower by a tenth",
    Kind.RATE: "no growth rate has moved by a twentieth",
    Kind.COUNT: "no counted work is 15 % more",
}


def against(
    night: Night,
    again: str,
    old: tuple[Sequence[Number], Mapping[str, Judged]],
    new: tuple[Sequence[Number], Mapping[str, Judged]],
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
    found = [
        one
        for one in differences(
            [one for one in before if one.key in common and math.isfinite(one.value)],
            [one for one in after if one.key in common],
        )
        if not one.key.startswith("red/")
    ]
    compared = {kind: sum(one.kind is kind for one in after if one.key in common) for kind in _SAID}
    if not any(compared.values()):
        return [_nothing_in_common(night, again)]
    return [
        _claim(night, again, kind, [one for one in found if one.kind is kind and _worse(one)], compared[kind])
        for kind in _SAID
        if compared[kind]
    ]


def _nothing_in_common(night: Night, again: str) -> Claim:
    return Claim(
        kind=ClaimKind.BASELINE,
        quantity="common",
        scene="baseline",
        methods=(),
        statement="there are numbers to compare",
        value=math.nan,
        bound=0.0,
        command=again,
        path="/baseline/common",
        note=f"nothing in common with {night.name}: no number that it has was found here",
    )


def _values(claims: Mapping[str, Judged]) -> list[Number]:
    return [
        Number(f"claim/{key}", Kind.CLAIM, one.claim.value) for key, one in claims.items() if one.claim.judged
    ]


def _worse(one: Difference) -> bool:
    small = one.kind in (Kind.CLAIM, Kind.ERROR) and one.new <= ROUND_OFF
    return not small and (one.direction in ("worse", "gone") or one.kind is Kind.RATE)


def _claim(night: Night, again: str, kind: Kind, worse: Sequence[Difference], compared: int) -> Claim:
    listed = "; ".join(f"{one.key}: {one.change}" for one in worse if one.weight >= 1)
    return Claim(
        kind=ClaimKind.BASELINE,
        quantity=kind,
        scene="baseline",
        methods=(),
        statement=_SAID[kind],
        value=max((one.weight for one in worse), default=0.0),
        bound=1.0,
        command=again,
        path=f"/baseline/{kind}",
        note=f"against {night.name}: {listed or f'{compared} numbers compared'}; "
        "value: largest change over the smallest of interest",
    )
