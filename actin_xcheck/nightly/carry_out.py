"""A night at work: a study whose tasks are checks, each begun only if it is expected to fit.

A check that breaks down is red and says why.  One that the budget, its patience, a machine without memory or
disk, or somebody else has stopped is not run, for that says nothing about the code: the journal keeps no
answer of it.  Each check has a process of its own, which can be stopped in time and tells its memory.
"""

import math
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import LONGEST, UserError, brief, starved
from actin_xcheck.core.files import locked
from actin_xcheck.core.linear import WORK
from actin_xcheck.nightly.differences import against
from actin_xcheck.nightly.history import (
    find_night,
    judged_in,
    numbers_of,
    read_claims,
    read_nights,
    read_numbers,
    remember,
)
from actin_xcheck.nightly.items import CheckItem, Control, Item, NotDecided, night_long, no_verdict
from actin_xcheck.nightly.plan import Tonight
from actin_xcheck.nightly.record import FILE_NAME, STUDY, Done, Kept, NotRun, Number, NumberKind, write_night
from actin_xcheck.runs.executor import Executor, in_turn
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.processes import Lost, how_ended, prepare, work_alone
from actin_xcheck.runs.provenance import check_code, code, forget_peak, peak_memory
from actin_xcheck.studies import faults
from actin_xcheck.studies.faults import FAULTS
from actin_xcheck.studies.faults.fault import Calls
from actin_xcheck.studies.study import Alone, Batch, Report, Study, Table, Task, Tell, report_of

PATIENCE, LEAST_PATIENCE = 10.0, 300.0
"""How many times as long as expected a check may take, and seconds that every check may take."""

TRIED = 4
"""Checks that a control is reckoned to need until one turns red."""


@dataclass(frozen=True)
class AskedItem:
    """A check as it is asked for.

    Attributes
    ----------
    item : what to carry out.
    fault : a deliberate fault to switch on; empty without.
    expected : seconds that it will take.
    deadline : moment by which it must be over, in seconds since the epoch.
    patience : seconds that it may take at least.
    away : whether a worker of a cluster does it, in whose threads nothing can be stopped.
    """

    item: Item
    fault: str = ""
    expected: float = field(default=0.0, compare=False)
    deadline: float = field(default=math.inf, compare=False)
    patience: float = field(default=LEAST_PATIENCE, compare=False)
    away: bool = field(default=False, compare=False)

    @property
    def folder(self) -> str:
        """Where its files go, in the night's folder."""
        return "checks/" + "".join(c if c.isalnum() or c in "-." else "_" for c in self.item.name)


@dataclass(frozen=True)
class Stopped(Lost):
    """Why there is no answer, which says nothing about the check; the seconds after which it was stopped."""

    seconds: float = 0.0


class _OutOfTime(BaseException):
    """Not an Exception, so that nothing takes it for one of its own."""


def carry_out(asked: AskedItem, night: Path) -> Done | Stopped:
    """Carry out a check, with files into the night's folder, unless it is not expected to be over in time."""
    if asked.away:
        return _elsewhere(asked, night)
    left = asked.deadline - time.time()
    if asked.expected > left:
        return Stopped(f"{asked.expected:.1f} s expected, {max(left, 0):.1f} s left")
    patience = max(PATIENCE * asked.expected, asked.patience)
    (night / asked.folder).mkdir(parents=True, exist_ok=True)
    prepare([__name__])
    began = time.perf_counter()
    try:
        with _limited(min(patience, left)):
            alone = asked.item.timed  # it has a process of its own already
            answer = _find((asked, night)) if alone else work_alone(_find, (asked, night))
    except _OutOfTime:
        spent = time.perf_counter() - began
        why = "at the end of the budget, " if left < patience else ""
        said = f"stopped {why}after {spent:.1f} s; {asked.expected:.1f} s had been expected"
        return Stopped(said, seconds=spent)
    if isinstance(answer, Done | Stopped):
        return answer
    return ended(asked.item.name, answer, time.perf_counter() - began)


def ended(name: str, lost: Lost, seconds: float) -> Done | Stopped:
    """A check whose process has ended: not run where that was killed, else red, for it came to no verdict."""
    if lost.killed:
        return Stopped(lost.message, seconds=seconds)
    trouble = f"broke down: {lost.message}"
    return Done(name, (no_verdict(name, trouble),), ("",), seconds=seconds, trouble=trouble)


def _find(given: tuple[AskedItem, Path]) -> Done | Stopped:
    """In the process: carry the check out and measure it."""
    asked, night = given
    name, folder = asked.item.name, night / asked.folder
    found = Done(name, (), ())
    WORK.clear()
    forget_peak()
    before, began = peak_memory(), time.perf_counter()
    with _faulty(asked.fault) as calls, in_turn():
        try:
            found = asked.item.find(folder)
        except NotDecided as error:
            return Stopped(str(error))
        except Exception as error:
            said = brief(" ".join(f"{type(error).__name__}: {error}".split()), LONGEST)
            if starved(error):
                return Stopped(f"the machine has not enough memory, disk or files for it ({said})")
            trouble = f"broke down: {said}"
            found = Done(name, (no_verdict(name, trouble),), ("",), trouble=trouble)
    seconds, memory = time.perf_counter() - began, max(peak_memory() - before, 0)
    where = asked.folder
    if not any(folder.iterdir()):
        folder.rmdir()
        where = ""
    numbers = (
        Number(f"seconds/{name}", NumberKind.TIME, seconds, "s"),
        Number(f"memory/{name}", NumberKind.MEMORY, float(memory), "bytes"),
        *(Number(f"{what}/{name}", NumberKind.COUNT, float(count)) for what, count in sorted(WORK.items())),
        *(
            one if one.source.startswith("python ") else replace(one, source=f"{where}/{one.source}")
            for one in found.numbers
        ),
    )
    files = tuple(f"{where}/{file}" if file else "" for file in found.files)
    reached = (*found.reached, asked.fault) if calls.count > 0 else found.reached
    return replace(found, files=files, numbers=numbers, seconds=seconds, reached=reached, folder=where)


@contextmanager
def _faulty(fault: str) -> Iterator[Calls]:
    """A deliberate fault, whose warnings nobody needs."""
    with night_long(fault) if fault else nullcontext(Calls()) as calls, warnings.catch_warnings():
        if fault:
            warnings.simplefilter("ignore")
            np.seterr(all="ignore")
        yield calls


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise _OutOfTime after so many seconds, where the system can."""
    if not hasattr(signal, "setitimer") or seconds == math.inf:
        yield
        return

    def stop(*_: object) -> None:
        raise _OutOfTime

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, max(seconds, 1e-3))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _elsewhere(asked: AskedItem, night: Path) -> Done | Stopped:
    """Carry out a check for another machine, by a process whose main thread can be stopped in time.

    Times and memory are no numbers of that machine and are left out; `Done.seconds` stays, for the plan.
    Workers may be daemons, which `multiprocessing` allows no children.
    """
    call = [sys.executable, "-c", f"from {__name__} import answer; answer()"]
    began = time.perf_counter()
    with subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(pickle.dumps((code(), replace(asked, away=False), night)))
        process.stdin.flush()  # and not closed: that tells the process that its worker has ended
        said = process.stdout.read()
    if not said:
        return ended(asked.item.name, how_ended(process.returncode), time.perf_counter() - began)
    found: Done | Stopped | UserError = pickle.loads(said)
    if isinstance(found, UserError):
        raise found
    if isinstance(found, Stopped):
        return found
    numbers = tuple(one for one in found.numbers if not one.kind.of_machine)
    return replace(found, numbers=numbers, host=socket.gethostname())


def answer() -> None:
    """In the process: carry out the check that standard input holds; what else is printed is no answer."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    version, asked, night = pickle.load(sys.stdin.buffer)

    def follow() -> None:
        os.read(0, 1)  # its end, when the worker ends; sys.stdin would be locked when this process does
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    found: Done | Stopped | UserError
    try:
        check_code(version)  # of what is imported here, and serves other commands later
        if not (night / FILE_NAME).exists():
            raise UserError(
                f"the worker on {socket.gethostname()} does not see {night}; "
                "valid: --out names a folder that all machines share"
            )
        place = night / asked.folder
        place.parent.mkdir(parents=True, exist_ok=True)
        with locked(place):  # a check that nobody waits for any more may still be at work there
            found = carry_out(asked, night)
    except UserError as mistake:
        found = mistake
    with out:
        out.write(pickle.dumps(found))


def carry_through(
    tonight: Tonight,
    history: Path,
    processes: Executor,
    tell: Tell,
    away: bool = False,
    patience: float = LEAST_PATIENCE,
    alone: Alone = work_alone,
) -> Kept:
    """Carry out what of a night has not been yet, judge all of it, and keep it.

    Parameters
    ----------
    history : of all nights.
    processes, tell, alone : see `studies.study.carry_out`; `away` where the processes are a cluster's.
    patience : see `Asked`.
    """
    kept, began = tonight.kept, time.time()
    report = report_of(STUDY, night(tonight, away, patience), kept.folder, processes, tell, alone)
    done, left_out = (tuple(report.tables[name].rows) for name in ("checks", "not run"))
    kept = replace(kept, done=done, left_out=left_out)
    for judge in (_against_baseline, _fault_missed):
        kept = replace(kept, done=(*kept.done, *judge(history, kept)))
    kept = replace(kept, seconds=kept.seconds + time.time() - began, closed=True)
    if not kept.begun.fault:
        remember(history, kept)
    write_night(kept)
    return kept


def night(tonight: Tonight, away: bool = False, patience: float = LEAST_PATIENCE) -> Study:
    """A night's checks, then its costs one by one on this machine, then its controls."""
    known, fault = tonight.known, tonight.kept.begun.fault
    controls = [item for item in tonight.items if isinstance(item, Control)]
    others = [item for item in tonight.items if not isinstance(item, Control)]

    def tasks(items: Sequence[Item]) -> list[Task]:
        found = []
        for turn, item in enumerate(items):
            seconds, there = known.expected(item), away and not item.timed
            asked = AskedItem(item, fault, seconds, tonight.deadline, patience, there)
            found.append(Task(carry_out, asked, seconds, lost=_left_out, alone=item.timed, turn=turn))
        return found

    later = sum(known.expected(item) for item in controls)
    answers: list[Done | NotRun] = yield Batch(tasks(others), later)
    ready, undecided = _controls(controls, list(zip(others, answers, strict=True)), known.pace)
    answers += yield tasks(sorted(ready, key=known.order))
    over = tuple(one for one in answers if isinstance(one, Done))
    left_out = (*(one for one in answers if isinstance(one, NotRun)), *undecided)
    return Report("", "", {"checks": Table("Checks", over), "not run": Table("Not run", left_out)})


def _left_out(asked: AskedItem, lost: Lost) -> Done | NotRun:
    """What stands for an answer that there is not."""
    found = lost if isinstance(lost, Stopped) else ended(asked.item.name, lost, 0.0)
    return found if isinstance(found, Done) else NotRun(asked.item.name, found.message, found.seconds)


def _controls(
    controls: Sequence[Control], judged: Sequence[tuple[Item, Done | NotRun]], pace: float
) -> tuple[list[Control], list[NotRun]]:
    """The controls with the checks that are green and call what they replace, the quickest first.

    Their guesses are tonight's seconds, in those that take `pace` of them.
    """
    green = [
        (item.check, one)
        for item, one in judged
        if isinstance(item, CheckItem) and isinstance(one, Done) and not one.red
    ]
    green.sort(key=lambda pair: (not pair[0].bounded, pair[1].seconds))
    whole = all(isinstance(one, Done) for item, one in judged if not item.timed)
    ready, undecided = [], []
    for control in controls:
        ours = [(check, one.seconds) for check, one in green if control.target in one.reached]
        if ours or whole:
            guess = sum(seconds for _, seconds in ours[:TRIED]) / pace
            checks = tuple(check for check, _ in ours)
            ready.append(replace(control, guess=guess, checks=checks, whole=whole))
        else:
            why = "no check that calls what it replaces was run and is green"
            undecided.append(NotRun(control.name, why))
    return ready, undecided


def _against_baseline(history: Path, kept: Kept) -> list[Done]:
    """The comparison with the baseline, as a check of its own, where there is one."""
    if not kept.begun.baseline:
        return []
    began = time.perf_counter()
    earlier = find_night(read_nights(history), kept.begun.baseline).night
    old = read_numbers(history, earlier.name), read_claims(history, earlier.name)
    new = list(numbers_of(kept)), {one.key: one for one in judged_in(kept.done)}
    again = command("diff", earlier.name, kept.begun.name, file=history)
    claims = tuple(against(earlier, again, old, new))
    return [
        Done(f"baseline {earlier.name}", claims, ("",) * len(claims), seconds=time.perf_counter() - began)
    ]


def _fault_missed(history: Path, kept: Kept) -> list[Done]:
    """A deliberate fault with which all stayed green, as a control that fails."""
    judged = [one for one in kept.done if not one.trouble and not one.name.startswith("baseline ")]
    if not kept.begun.fault or any(one.red for one in judged):
        return []
    passed = tuple(one.name for one in kept.done)
    why = f"missed: none of the night's {len(passed)} checks turned red"
    claim = faults.control(faults.missed(FAULTS[kept.begun.fault], passed, why))
    return [Done(f"fault {kept.begun.fault}", (claim,), ("",))]
