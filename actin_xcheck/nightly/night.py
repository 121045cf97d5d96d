"""A night: how it begins or goes on, and what is judged of it when its checks are over."""

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.baseline import against
from actin_xcheck.nightly.checks import Checked, Item
from actin_xcheck.nightly.history.database import find_night, read_claims, read_nights, read_numbers
from actin_xcheck.nightly.nights import judged_in, machine, numbers_of
from actin_xcheck.nightly.plan import Plan
from actin_xcheck.nightly.record import Begun, Done, Kept
from actin_xcheck.runs.commands import command as command_of
from actin_xcheck.runs.store import provenance
from actin_xcheck.studies.faults.catalogue import FAULTS
from actin_xcheck.studies.faults.hunt import control, missed

Kind = TypeVar("Kind", bound=Item)


def begin(
    folder: Path, plan: Plan, budget: float | None, fault: str, baseline: str, command: str, kernel: float
) -> Begun:
    """Return what is known of a night before its first check.

    Parameters
    ----------
    folder : of the night, by which it is called.
    plan : what is to be done.
    budget : minutes in all; None: as long as it takes.
    fault, baseline : names of a deliberate fault and of a night to compare with; empty without.
    command : what makes it again.
    kernel : seconds of the reference kernel.
    """
    return Begun(
        folder.name,
        datetime.now(UTC).isoformat(timespec="microseconds"),  # by which it is told from others of the day
        provenance(),
        machine(),
        command,
        budget or math.inf,
        fault,
        baseline,
        tuple(item.name for item in plan.items),
        kernel,
    )


def without_watching(plan: Plan) -> Plan:
    """The plan for a night with a fault, whose checks need not tell what they call."""
    checks = (replace(item, watches=False) if isinstance(item, Checked) else item for item in plan.checks)
    return replace(plan, checks=tuple(checks))


def gone_on_with(kept: Kept, plan: Plan) -> Plan:
    """What a night had planned, in its order; UserError where a check of that name is no more."""
    items = {item.name: item for item in plan.items}
    if gone := [name for name in kept.begun.planned if name not in items]:
        raise UserError(
            f"--resume: {kept.folder} planned {gone[0]!r}, which is no check any more; valid: without"
        )
    place = {name: number for number, name in enumerate(kept.begun.planned)}

    def ours(part: Sequence[Kind]) -> tuple[Kind, ...]:
        planned = [item for item in part if item.name in place]
        return tuple(sorted(planned, key=lambda item: place[item.name]))

    return Plan(ours(plan.checks), ours(plan.controls), ours(plan.costs))


def check_same_code(kept: Kept) -> None:
    """UserError where other code began the night: its numbers would be those of two commits."""
    now, then = provenance(), dict(kept.begun.versions)
    if other := [
        f"{name} {then.get(name)} -> {now.get(name)}" for name in now if now[name] != then.get(name)
    ]:
        raise UserError(f"--resume: {kept.folder} was begun by other code ({other[0]}); valid: without")
    if now["commit"].endswith("-dirty") or now["commit"] == "unknown":
        print(f"warning: {kept.folder}: whether the code is the same cannot be told", file=sys.stderr)


def against_baseline(history: Path, kept: Kept) -> Done | None:
    """The comparison with the baseline, as a check of its own; None without one, or where it was made."""
    if not kept.begun.baseline or any(one.name.startswith("baseline ") for one in kept.done):
        return None
    began = time.perf_counter()
    night = find_night(read_nights(history), kept.begun.baseline).night
    old = read_numbers(history, night.name), read_claims(history, night.name)
    new = list(numbers_of(kept)), {one.key: one for one in judged_in(kept.done)}
    again = command_of("diff", night.name, kept.begun.name, file=history)
    claims = tuple(against(night, again, old, new))
    return Done(f"baseline {night.name}", claims, ("",) * len(claims), (), time.perf_counter() - began)


def fault_missed(kept: Kept) -> Done | None:
    """A deliberate fault with which all stayed green, as a control that fails; None without one."""
    judged = [one for one in kept.done if not one.trouble and not one.name.startswith("baseline ")]
    if not kept.begun.fault or any(one.red for one in judged):
        return None
    passed = tuple(one.name for one in kept.done)
    why = f"missed: none of the night's {len(passed)} checks turned red"
    claim = control(missed(FAULTS[kept.begun.fault], passed, why))
    return Done(f"fault {kept.begun.fault}", (claim,), ("",), (), 0.0)
