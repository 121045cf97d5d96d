"""What a claim is about: the lights of a night."""

import math
import re
from dataclasses import replace
from enum import StrEnum

from actin_xcheck.core.claim import Claim
from actin_xcheck.runs.commands import command


class Group(StrEnum):
    """A light; its value is what a reader sees."""

    CONSERVATION = "conservation"
    GEOMETRY = "geometric conservation"
    EXACT = "exact solutions"
    MODES = "modes"
    REFERENCE = "reference values"
    AGREEMENT = "FEM ~ FV ~ theory"
    ORDERS = "orders"
    REDUCTIONS = "smaller models, tolerances"
    ENDS = "runs to the end"
    CONTROLS = "negative controls"
    COST = "work and time"
    BASELINE = "against the baseline"
    OTHER = "other"


DILUTION = "uniform-dilution"
"""Name of the scene in which volumes alone change the concentration."""

ORDERS = ("/tables/orders", "/studies/")
"""Where the path of an observed order begins; the second in nights of before."""

FAULTS = "/faults/"
"""Where the path of a negative control begins."""

COST = "/cost/"
"""The same of a measured cost."""

BASELINE = "/baseline/"
"""And of a comparison with another night."""

_PLACES: dict[str | tuple[str, ...], Group] = {
    ORDERS: Group.ORDERS,
    FAULTS: Group.CONTROLS,
    COST: Group.COST,
    BASELINE: Group.BASELINE,
}

_WORDS = {
    "total actin obeys": Group.CONSERVATION,
    "concentration equals the exact": Group.EXACT,
    "mode (": Group.MODES,
    "area equals the reference": Group.REFERENCE,
    "total actin equals the reference": Group.REFERENCE,
    "concentration at the probes equals": Group.REFERENCE,
    "positions of the probes equal": Group.REFERENCE,
    "a sector and the whole": Group.REDUCTIONS,
    "steps chosen by": Group.REDUCTIONS,
    "runs to its end": Group.ENDS,
    "comes to a verdict": Group.ENDS,
}


def group_of(claim: Claim) -> Group:
    """The light of a claim, by where its numbers stand and how it begins."""
    if claim.scene == DILUTION and "exact solution" in claim.statement:
        return Group.GEOMETRY
    if claim.path.startswith("/triangles/"):
        return Group.GEOMETRY if claim.path.endswith("--area") else Group.AGREEMENT
    for place, group in _PLACES.items():
        if claim.path.startswith(place):
            return group
    if " agrees with " in claim.statement:
        return Group.AGREEMENT
    return next((group for words, group in _WORDS.items() if claim.statement.startswith(words)), Group.OTHER)


def no_verdict(check: str, trouble: str) -> Claim:
    """What fails where a check broke down: it has the light of what it would have judged."""
    kind, _, subject = check.partition(" ")
    path = {"fault": FAULTS, "cost": COST}.get(kind, "/")
    again = command("nightly", only=check)
    name = subject if kind == "fault" else check
    return Claim(name, (), "comes to a verdict", math.nan, 0.0, again, f"{path}{subject}", trouble)


def lasting(claim: Claim) -> Claim:
    """The claim with a statement that is the same every night; what was measured goes into the note."""
    if claim.path.startswith("/triangles/"):
        quantity = claim.path.rsplit("--", 1)[-1].replace("_", " ")
        return _said(claim, f"both codes and theory agree on {quantity}", claim.statement)
    if claim.path.startswith(ORDERS):
        statement, _, reason = claim.statement.partition(": ")
        return _said(claim, statement, reason)
    if measured := re.search(r"; (measured [^)]*)\)", claim.statement):
        return _said(claim, claim.statement.replace(measured[0], ")"), measured[1])
    return claim


def _said(claim: Claim, statement: str, more: str) -> Claim:
    return replace(claim, statement=statement, note="; ".join(part for part in (more, claim.note) if part))
