"""The hunt: every check once without a fault, then every fault until a check turns red.

The clean run tells which functions each check calls, and how long it takes.  A fault is therefore held
against those checks alone that call its target, the quickest first, those last that it could make endless.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.studies.faults.checks import SUITE, Check
from actin_xcheck.studies.faults.fault import ControlError, Fault, injected, watched

CLEAR = 2.0
"""By how many bounds a claim must fail for the hunt to end; for less, or without a number, it looks on."""


@dataclass(frozen=True)
class Clean:
    """A check without any fault.

    Attributes
    ----------
    check : what was run.
    red : claims that do not hold: there must be none.
    judged : how many claims hold or do not.
    reached : targets that were called.
    seconds : how long it took.
    """

    check: Check
    red: tuple[Claim, ...]
    judged: int
    reached: frozenset[str]
    seconds: float


@dataclass(frozen=True)
class Caught:
    """What became of a fault.

    Attributes
    ----------
    fault : what was wrong.
    check : the check that turned red, its name; empty where none did.
    claim : the claim that failed by most; None without one.
    others : how many more claims of that check failed.
    passed : names of the checks that ran and stayed green.
    seconds : how long it took.
    trouble : why the control proves nothing; empty where it does.
    """

    fault: Fault
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


@dataclass(frozen=True)
class Hunt:
    """The suite without a fault and what became of every fault."""

    clean: tuple[Clean, ...]
    found: tuple[Caught, ...]

    @property
    def holds(self) -> bool:
        """Whether all was green without a fault, and red with each."""
        return not any(one.red for one in self.clean) and all(one.caught for one in self.found)


def hunt(
    faults: Sequence[Fault],
    report: Report = lambda label, done, total: None,
    suite: Sequence[Check] = SUITE,
) -> Hunt:
    """Run the suite without a fault, then once for every fault until a check turns red, on all cores.

    Parameters
    ----------
    faults : what is switched on, one at a time.
    report : told of progress, under "without a fault" and "with a fault".
    suite : the checks.

    A fault that is not caught, or whose control proves nothing, is part of the result.
    """
    targets = tuple(dict.fromkeys(fault.target for fault in faults))
    tasks = [(check, targets) for check in suite]
    clean = work_off(_without, tasks, _counted(report, "without a fault", len(tasks)), _named)
    order = sorted(
        (one for one in clean if not one.red), key=lambda one: (not one.check.bounded, one.seconds)
    )
    held = [(fault, [one.check for one in order if fault.target in one.reached]) for fault in faults]
    found = work_off(held_against, held, _counted(report, "with a fault", len(held)), _named)
    return Hunt(tuple(clean), tuple(found))


def _named(task: tuple[Check | Fault, object]) -> str:
    """What a task is called."""
    return task[0].name


def _counted(report: Report, label: str, total: int) -> Report:
    """Tell how many tasks are over, for tasks that report once."""
    over: list[str] = []

    def told(task: str, done: int, parts: int) -> None:
        over.append(task)
        report(label, len(over), total)

    return told


def _without(task: tuple[Check, tuple[str, ...]], report: Report) -> Clean:
    check, targets = task
    began = time.perf_counter()
    claims: list[Claim] = []
    with watched(targets) as calls, tempfile.TemporaryDirectory() as folder:
        claims = check.claims(Path(folder))
    judged = [claim for claim in claims if claim.judged]
    reached = frozenset(target for target, one in calls.items() if one.count)
    report(check.name, 1, 1)
    red = tuple(claim for claim in judged if not claim.holds)
    return Clean(check, red, len(judged), reached, time.perf_counter() - began)


def held_against(task: tuple[Fault, list[Check]], report: Report) -> Caught:
    """Return what the first of the checks that turns red with the fault says; ControlError as `injected`."""
    fault, checks = task
    began = time.perf_counter()
    trouble = "" if checks else f"no green check calls {fault.target}"
    passed: list[str] = []
    best: Caught | None = None
    for check in checks:
        try:
            with injected(fault), tempfile.TemporaryDirectory() as folder, np.errstate(all="ignore"):
                claims = check.claims(Path(folder))
        except ControlError as error:
            trouble = str(error)
            break
        except Exception as error:  # no verdict: a harness that crashes has judged nothing
            trouble = f"{check.name} broke down: {type(error).__name__}: {error}"
            continue
        red = sorted((one for one in claims if one.judged and not one.holds), key=_excess, reverse=True)
        if not red:
            passed.append(check.name)
        elif best is None or best.claim is None or _excess(red[0]) > _excess(best.claim):
            best = Caught(fault, check.name, red[0], len(red) - 1, (), 0.0)
        if red and _excess(red[0]) >= (True, CLEAR):
            break
    report(fault.name, 1, 1)
    best = best or Caught(fault, "", None, 0, (), 0.0, trouble)
    return replace(best, passed=tuple(passed), seconds=time.perf_counter() - began)


def _excess(claim: Claim) -> tuple[bool, float]:
    """By how much a claim fails: a claim without a number last, which says only that something broke.

    Returns
    -------
    Whether its value is a number, and that value in bounds; infinite where the bound is 0.
    """
    if not np.isfinite(claim.value):
        return False, 0.0
    return True, claim.value / claim.bound if claim.bound else np.inf
