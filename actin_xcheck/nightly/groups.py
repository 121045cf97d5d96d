"""What a claim is about: the lights of a night."""

import math
from enum import StrEnum

from actin_xcheck.core.claim import Claim, ClaimKind
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


_LIGHTS = {
    ClaimKind.CONSERVATION: Group.CONSERVATION,
    ClaimKind.GEOMETRY: Group.GEOMETRY,
    ClaimKind.EXACT: Group.EXACT,
    ClaimKind.GROWTH_RATE: Group.MODES,
    ClaimKind.REFERENCE: Group.REFERENCE,
    ClaimKind.AGREEMENT: Group.AGREEMENT,
    ClaimKind.TRIANGLE: Group.AGREEMENT,
    ClaimKind.ORDER_H: Group.ORDERS,
    ClaimKind.ORDER_DT: Group.ORDERS,
    ClaimKind.REDUCTION: Group.REDUCTIONS,
    ClaimKind.TOLERANCE: Group.REDUCTIONS,
    ClaimKind.ENDS: Group.ENDS,
    ClaimKind.CONTROL: Group.CONTROLS,
    ClaimKind.CLEAN: Group.CONTROLS,
    ClaimKind.COST: Group.COST,
    ClaimKind.BASELINE: Group.BASELINE,
    ClaimKind.OTHER: Group.OTHER,
}


def group_of(claim: Claim) -> Group:
    """The light of a claim; codes and theory that agree on the area have moved the cell alike."""
    if claim.kind is ClaimKind.TRIANGLE and claim.quantity == "area":
        return Group.GEOMETRY
    return _LIGHTS[claim.kind]


def no_verdict(check: str, trouble: str) -> Claim:
    """What fails where a check broke down: it has the light of what it would have judged."""
    what, _, subject = check.partition(" ")
    return Claim(
        kind={"fault": ClaimKind.CONTROL, "cost": ClaimKind.COST}.get(what, ClaimKind.ENDS),
        scene=subject if what == "fault" else check,
        methods=(),
        statement="comes to a verdict",
        value=math.nan,
        bound=0.0,
        command=command("nightly", only=check),
        path=f"/{subject}",
        note=trouble,
    )
