"""A night at work: its checks in processes of their own, each begun only if it is expected to fit.

A check that breaks down is red and says why.  One that the budget, its patience, a machine without memory or
disk, or somebody else has stopped is not run, for that says nothing about the code.  The night goes on either
way, and what is over is kept at once.
"""

import signal
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import starved
from actin_xcheck.core.work import WORK
from actin_xcheck.nightly.checks import Checked, Control, Found, Item, NotDecided, night_long
from actin_xcheck.nightly.groups import no_verdict
from actin_xcheck.nightly.history.record import Kind, Number
from actin_xcheck.nightly.plan import Past, Plan
from actin_xcheck.nightly.record import Done, Journal, Kept, NotRun
from actin_xcheck.runs.alone import prepare, work_alone
from actin_xcheck.runs.executor import Executor, Lost, executor
from actin_xcheck.runs.machine import forget_peak, peak_memory
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.version import code
from actin_xcheck.runs.workers import Report, in_turn
from actin_xcheck.studies.faults.checks import QUIET
from actin_xcheck.studies.faults.fault import Calls

PATIENCE = 10.0
"""How many times as long as expected a check may take."""

LEAST_PATIENCE = 300.0
"""Seconds that every check may take."""

SOLVERS = sorted({method.solver.split(":")[0] for method in METHODS.values()})
"""What the processes of the checks find imported."""

TRIED = 4
"""Checks that a control is reckoned to need until one turns red."""

FOLDER = "checks"
"""Where the files of the checks are, in a night's folder."""


@dataclass(frozen=True)
class Task:
    """A check as it is handed to a process.

    Attributes
    ----------
    item : what to carry out.
    night : folder of the night.
    expected : seconds that it will take.
    deadline : moment by which it must be over, in seconds since the epoch; inf without a limit.
    code : version of the code that asks.
    fault : a deliberate fault to switch on; empty without.
    """

    item: Item
    night: Path
    expected: float
    deadline: float
    code: str
    fault: str = ""

    @property
    def folder(self) -> Path:
        """Where its files go."""
        return self.night / FOLDER / "".join(c if c.isalnum() or c in "-." else "_" for c in self.item.name)


Work = Callable[[Task], Done | NotRun]
"""What a process does with a check that it is given."""


class _OutOfTime(BaseException):
    """Not an Exception, so that nothing takes it for one of its own."""


@dataclass(frozen=True)
class _Answer:
    """What the process of a check tells: what it found or why not, and what that took."""

    found: Found | None
    trouble: str
    undecided: str
    called: bool
    seconds: float
    memory: int
    work: Mapping[str, int]


def carry_out(task: Task) -> Done | NotRun:
    """Carry out a check in a process of its own, unless it is not expected to be over in time."""
    name, left = task.item.name, task.deadline - time.time()
    if task.expected > left:
        return NotRun(name, f"{task.expected:.1f} s expected, {max(left, 0):.1f} s left")
    patience = max(PATIENCE * task.expected, LEAST_PATIENCE)
    task.folder.mkdir(parents=True, exist_ok=True)
    prepare([Found.__module__, *SOLVERS])
    began = time.perf_counter()
    try:
        with _limited(min(patience, left)):
            answer = work_alone(_find, task, QUIET)
    except _OutOfTime:
        spent = time.perf_counter() - began
        why = "at the end of the budget, " if left < patience else ""
        said = f"stopped {why}after {spent:.1f} s; {task.expected:.1f} s had been expected"
        return NotRun(name, said, spent)
    if isinstance(answer, Lost):
        return ended(name, answer, time.perf_counter() - began)
    if answer.undecided:
        return NotRun(name, answer.undecided)
    return _done(task, answer)


def ended(name: str, lost: Lost, seconds: float) -> Done | NotRun:
    """A check whose process has ended: not run where that was killed, else red, for it came to no verdict."""
    if lost.killed:
        return NotRun(name, lost.message, seconds)
    trouble = f"broke down: {lost.message}"
    return Done(name, (no_verdict(name, trouble),), ("",), (), seconds, trouble)


def _find(task: Task, report: Report) -> _Answer:
    """In the process: carry the check out and measure it."""
    found, trouble, undecided = None, "", ""
    WORK.clear()
    forget_peak()
    before, began = peak_memory(), time.perf_counter()
    with _faulty(task.fault) as calls, in_turn():
        try:
            found = task.item.find(task.folder)
        except NotDecided as error:
            undecided = str(error)
        except Exception as error:
            said = " ".join(f"{type(error).__name__}: {error}".split())
            if starved(error):
                undecided = f"the machine has not enough memory, disk or files for it ({said})"
            else:
                trouble = f"broke down: {said}"
    seconds = time.perf_counter() - began
    memory = max(peak_memory() - before, 0)
    return _Answer(found, trouble, undecided, calls.count > 0, seconds, memory, dict(WORK))


def _done(task: Task, answer: _Answer) -> Done:
    """What is kept of a check."""
    name, found = task.item.name, answer.found or Found((no_verdict(task.item.name, answer.trouble),), ("",))
    where = task.folder.relative_to(task.night).as_posix()
    if not any(task.folder.iterdir()):
        task.folder.rmdir()
        where = ""
    numbers = [
        Number(f"seconds/{name}", Kind.TIME, answer.seconds, "s"),
        Number(f"memory/{name}", Kind.MEMORY, float(answer.memory), "bytes"),
        *(Number(f"{what}/{name}", Kind.COUNT, float(count)) for what, count in sorted(answer.work.items())),
        *(replace(one, source=_within(where, one.source)) for one in found.numbers),
    ]
    files = tuple(f"{where}/{file}" if file else "" for file in found.files)
    reached = (*found.reached, task.fault) if answer.called else found.reached
    return Done(name, found.claims, files, tuple(numbers), answer.seconds, answer.trouble, reached, where)


def _within(where: str, source: str) -> str:
    """The source of a number: files of the check's folder get that before them, commands do not."""
    return source if source.startswith("python ") else f"{where}/{source}"


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
    if not hasattr(signal, "setitimer") or seconds == float("inf"):
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


def work_through(
    plan: Plan,
    kept: Kept,
    journal: Journal,
    known: Past,
    processes: Executor,
    work: Work,
    deadline: float,
    report: Report,
) -> tuple[list[Done], list[NotRun]]:
    """Carry out what of a plan has not been yet, and keep it.

    Parameters
    ----------
    plan : what to do: first its checks, then its costs one by one on this machine, then its controls.
    kept : the night as far as it has come.
    journal : where results go.
    known : what the past says of the checks' times.
    processes, work : what has the processes for checks and controls, and what those do.
    deadline : moment of the budget's end, in seconds since the epoch.
    report : told how many are over.

    Returns
    -------
    What is over, earlier results among it, and what was left out.
    """
    began, over, left_out = time.time() - kept.seconds, list(kept.done), list[NotRun]()
    total = len(plan.items)

    def go_on(items: Sequence[Item], processes: Executor, work: Work) -> None:
        names = {one.name for one in over}
        tasks = [
            Task(item, kept.folder, known.expected(item), deadline, code(), kept.begun.fault)
            for item in items
            if item.name not in names
        ]
        for number, result in processes.results(work, tasks):
            if isinstance(result, Lost):
                result = ended(tasks[number].item.name, result, 0.0)
            if isinstance(result, Done):
                over.append(result)
                journal.keep(result, time.time() - began)
            else:
                left_out.append(result)
            report("night", len(over) + len(left_out), total)

    go_on(plan.checks, processes, work)
    with executor(1) as alone:
        go_on(plan.costs, alone, carry_out)
    controls, undecided = _controls(plan, over, left_out, known.pace)
    left_out += undecided
    go_on(sorted(controls, key=known.order), processes, work)
    return over, left_out


def _controls(
    plan: Plan, over: Sequence[Done], left_out: Sequence[NotRun], pace: float
) -> tuple[list[Control], list[NotRun]]:
    """The controls with the checks that are green and call what they replace, the quickest first.

    Their guesses are tonight's seconds, in those that take `pace` of them.
    """
    done = {one.name: one for one in over}
    green = sorted(
        (
            (item, done[item.name])
            for item in plan.checks
            if isinstance(item, Checked) and item.name in done and not done[item.name].red
        ),
        key=lambda pair: (not pair[0].check.bounded, pair[1].seconds),
    )
    whole = not {item.name for item in plan.checks} & {one.name for one in left_out}
    ready, undecided = [], []
    for control in plan.controls:
        ours = [(item.check, one.seconds) for item, one in green if control.target in one.reached]
        checks = tuple(check for check, _ in ours)
        if checks or whole:
            guess = sum(seconds for _, seconds in ours[:TRIED]) / pace
            ready.append(replace(control, guess=guess, checks=checks, whole=whole))
        else:
            undecided.append(
                NotRun(control.name, "no check that calls what it replaces was run and is green")
            )
    return ready, undecided
