"""Deliberate faults: every check once without a fault, then every fault until a check turns red.

The clean run tells which functions each check calls, and how long it takes.  A fault is therefore held
against those checks alone that call its target, the quickest first, those last that it could make endless.
"""

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.errors import UserError, starved
from actin_xcheck.core.mesh import signed_areas
from actin_xcheck.core.model import Array, Model
from actin_xcheck.runs.numerics import command
from actin_xcheck.studies.faults import mechanics, one_sided, transport
from actin_xcheck.studies.faults.fault import (
    Catalogue,
    ControlError,
    Fault,
    Function,
    injected,
    there,
    watched,
)
from actin_xcheck.studies.study import Report, Study, Table, Task

CLEAR = 2.0
"""By how many bounds a claim must fail for the hunt to end; for less, or without a number, it looks on."""

CHECK_SECONDS, FAULT_SECONDS = 4.0, 6.0
"""What a check and a fault take, about."""


class Check(Protocol):
    """A few runs and what is claimed of them."""

    @property
    def name(self) -> str:
        """What a reader calls it: command, scene, methods."""
        ...

    @property
    def bounded(self) -> bool:
        """Whether a fault cannot make it take much longer: its runs have a fixed number of steps."""
        ...

    def claims(self, folder: Path) -> list[Claim]:
        """Run everything afresh, into a folder of its own, and judge it."""
        ...


@dataclass(frozen=True)
class Clean:
    """A check without any fault.

    Attributes
    ----------
    name : of the check.
    red : claims that do not hold: there must be none.
    judged : how many claims hold or do not.
    reached : targets that were called.
    seconds : how long it took.
    trouble : why it came to no verdict; empty where it did.
    """

    name: str
    red: tuple[Claim, ...]
    judged: int
    reached: tuple[str, ...]
    seconds: float
    trouble: str = ""

    @property
    def green(self) -> bool:
        """Whether it can turn red."""
        return not self.red and not self.trouble


@dataclass(frozen=True)
class Caught:
    """What became of a fault.

    Attributes
    ----------
    name, sentence, code, target : of the fault, see `Fault`.
    check : the check that turned red, its name; empty where none did.
    claim : the claim that failed by most; None without one.
    others : how many more claims of that check failed.
    passed : names of the checks that ran and stayed green.
    seconds : how long it took.
    trouble : why the control proves nothing; empty where it does.
    """

    name: str
    sentence: str
    code: str
    target: str
    check: str
    claim: Claim | None
    others: int
    passed: tuple[str, ...]
    seconds: float
    trouble: str = ""

    @property
    def caught(self) -> bool:
        """Whether a check turned red."""
        return self.claim is not None


def hunt(faults: Sequence[Fault], suite: Sequence[Check]) -> Study:
    """Carry the suite out without a fault, then with one fault at a time until a check turns red."""
    targets = tuple(dict.fromkeys(fault.target for fault in faults))
    clean: list[Clean] = yield [Task(without, (check, targets), CHECK_SECONDS) for check in suite]
    known = sorted(
        (pair for pair in zip(suite, clean, strict=True) if pair[1].green),
        key=lambda pair: (not pair[0].bounded, pair[1].seconds),
    )
    caught: list[Caught] = yield [
        Task(
            held_against, (fault, tuple(check for check, one in known if fault.target in one.reached)),
            FAULT_SECONDS,
        )
        for fault in faults
    ]  # fmt: skip
    controls = [control(one) for one in caught]
    held = sum(one.caught for one in caught)
    return Report(
        f"{held} of {len(caught)} deliberate faults caught",
        _LEAD,
        {
            "faults": Table("Faults", caught, "", ("name", "code", "target", "check", "others", "seconds")),
            "checks": Table("The checks, without a fault", [_row(one, caught) for one in clean]),
        },
        (*controls, *map(_green, clean)),
    )


_LEAD = (
    "Each fault replaces one function by a wrong one; the checks of the harness must turn red. All of "
    "them were run once without a fault, when every claim must hold, and which of the functions each "
    "calls was noted. A fault is then held against the checks that call its function, the quickest "
    "first, until a claim fails by twice its bound or more, or there are no checks left; the claim that "
    "failed by most is shown. A function that is never called, and a check that breaks down, prove "
    "nothing and count as not caught."
)


@dataclass(frozen=True)
class CleanRow:
    """A check in the report: its claims, how many fail, and how many faults it catches."""

    name: str
    claims: int
    red: int
    catches: int
    seconds: float


def _row(clean: Clean, caught: Sequence[Caught]) -> CleanRow:
    catches = sum(one.check == clean.name for one in caught)
    return CleanRow(clean.name, clean.judged, len(clean.red), catches, clean.seconds)


def without(asked: tuple[Check, tuple[str, ...]], folder: Path) -> Clean:
    """Carry a check out, and note which targets it calls."""
    check, targets = asked
    began = time.perf_counter()
    claims, trouble = [], ""
    with watched(there(targets)) as calls, tempfile.TemporaryDirectory() as scratch:
        try:
            claims = check.claims(Path(scratch))
        except Exception as error:  # as with a fault: it has judged nothing
            if starved(error):
                raise
            trouble = f"broke down: {type(error).__name__}: {error}"
    judged = [claim for claim in claims if claim.judged]
    reached = tuple(target for target, one in calls.items() if one.count)
    red = tuple(claim for claim in judged if not claim.holds)
    return Clean(check.name, red, len(judged), reached, time.perf_counter() - began, trouble)


def held_against(asked: tuple[Fault, Sequence[Check]], folder: Path) -> Caught:
    """Return what the first of the checks that turns red with the fault says; ControlError as `injected`."""
    fault, checks = asked
    began = time.perf_counter()
    trouble = ""
    if not checks:
        trouble = (
            f"no green check calls {fault.target}" if there([fault.target]) else f"{fault.target} is gone"
        )
    passed: list[str] = []
    best, where, others = None, "", 0
    for check in checks:
        try:
            with injected(fault), tempfile.TemporaryDirectory() as scratch, np.errstate(all="ignore"):
                claims = check.claims(Path(scratch))
        except ControlError as error:
            trouble = str(error)
            break
        except Exception as error:  # no verdict: a harness that crashes has judged nothing
            if starved(error):  # and one whose machine lacks something is tried again
                raise
            trouble = f"{check.name} broke down: {type(error).__name__}: {error}"
            continue
        red = sorted((one for one in claims if one.judged and not one.holds), key=_excess, reverse=True)
        if not red:
            passed.append(check.name)
        elif best is None or _excess(red[0]) > _excess(best):
            best, where, others = red[0], check.name, len(red) - 1
        if red and _excess(red[0]) >= (True, CLEAR):
            break
    return Caught(
        **_about(fault),
        check=where,
        claim=best,
        others=others,
        passed=tuple(passed),
        seconds=time.perf_counter() - began,
        trouble="" if best else trouble,
    )


def missed(fault: Fault, passed: tuple[str, ...], trouble: str) -> Caught:
    """A fault that nothing has caught."""
    return Caught(
        **_about(fault), check="", claim=None, others=0, passed=passed, seconds=0.0, trouble=trouble
    )


def _about(fault: Fault) -> dict[str, Any]:
    return {name: getattr(fault, name) for name in ("name", "sentence", "code", "target")}


def _excess(claim: Claim) -> tuple[bool, float]:
    """By how much a claim fails: a claim without a number last, which says only that something broke.

    Returns
    -------
    Whether its value is a number, and that value in bounds; infinite where the bound is 0 or below.
    """
    if not np.isfinite(claim.value):
        return False, 0.0
    return True, claim.value / claim.bound if claim.bound > 0 else np.inf


def control(caught: Caught) -> Claim:
    """Whether a fault was caught: the bound of the claim that failed by most, in parts of its value."""
    claim, value, note = caught.claim, math.inf, caught.trouble
    said = "bound over value of the claim that failed by most"
    if claim is not None:
        value = claim.bound / claim.value if claim.bound > 0 else 0.0
        if not math.isfinite(claim.value):
            value, said = 1.0, "1, the worst of those that are caught: the claim that failed has no number"
        failed = f"{', '.join(claim.methods)}: {claim.statement}: {claim.excess}"
        note = f"caught by {caught.check} ({failed})"
    elif not note:
        note = f"{len(caught.passed)} checks stayed green"
    return Claim(
        kind=ClaimKind.CONTROL,
        scene=caught.name,
        methods=(caught.code,),
        statement=f"is caught: {caught.sentence}",
        value=value,
        bound=1.0,
        command=command("faults", only=caught.name),
        path="/tables/faults",
        note=f"{note}; value: {said}",
    )


def _green(clean: Clean) -> Claim:
    """Whether a check is green without a fault: how many of its claims fail, no number if it broke down."""
    said = clean.trouble or "; ".join(claim.sentence for claim in clean.red)
    return Claim(
        kind=ClaimKind.CLEAN,
        quantity=clean.name,
        scene="without a fault",
        methods=(),
        statement=f"{clean.name}: all of its {clean.judged} claims hold",
        value=math.nan if clean.trouble else float(len(clean.red)),
        bound=0.0,
        command=command("faults"),
        path="/tables/checks",
        note=said,
    )


def _next_cell(right: Function, held: Any, points: Array) -> Any:
    cells, weights = right(held, points)
    count = (held.triangles if hasattr(held, "triangles") else held.cells).shape[1]
    return (cells + 1) % count, weights


OF_JUDGES = Catalogue()


@OF_JUDGES("area-polygonal", "harness", "fem.imex:measure")
def _polygonal(right: Function, space: Any, x: Array, a: Array) -> Any:
    """The area of a cell with a curved rim is that of the polygon through its vertices."""
    polygon = float((space.orientation * signed_areas(x, space.cells[:3])).sum())
    return replace(right(space, x, a), area=polygon)


OF_JUDGES("probes-off-curved", "harness", "fem.imex:locate", "Probes in curved cells read the next cell.")(
    _next_cell
)
OF_JUDGES(
    "probes-off",
    "harness",
    "actin_xcheck.core.contract:locate",
    "Probes in straight cells read the next cell.",
)(_next_cell)


@OF_JUDGES("theory-wrong-root", "harness", "actin_xcheck.verdicts.judge:growth_rate")
def _next_root(right: Function, model: Model, m: int, n: int) -> complex:
    """Growth rates are held against the next root of the dispersion relation."""
    return complex(right(model, m, n + 1))


@OF_JUDGES("theory-wrong-area", "harness", "actin_xcheck.verdicts.known:_jacobian")
def _a_percent_more(right: Function, x: Array) -> Array:
    """The third corner, the exact area and total actin, is a hundredth too large."""
    return np.asarray(1.01 * right(x))


@OF_JUDGES("uncertainty-too-small", "harness", "actin_xcheck.verdicts.triangulate:uncertainty")
def _overconfident(right: Function, *arguments: Any) -> tuple[float, str]:
    """Uncertainties from coarser runs are ten times too small."""
    size, *how = right(*arguments)
    return size / 10, *how


FAULTS = {
    fault.name: fault for fault in (*mechanics.FAULTS, *one_sided.FAULTS, *transport.FAULTS, *OF_JUDGES)
}


def find_faults(names: Sequence[str] | None) -> list[Fault]:
    """Return the faults with these names, all without any; UserError lists the valid ones."""
    if unknown := [name for name in names or () if name not in FAULTS]:
        raise UserError(f"--only: {unknown[0]!r} is not a fault; valid: {', '.join(FAULTS)}")
    return [FAULTS[name] for name in dict.fromkeys(names or FAULTS)]
