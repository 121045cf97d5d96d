"""One task at a time in a process of its own, which finds everything imported."""

import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterable
from contextlib import closing
from multiprocessing.util import get_temp_dir
from typing import Any, TypeVar

from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.processes import Lost, Processes, Report

Task = TypeVar("Task")
Result = TypeVar("Result")

_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
_CONTEXT: Any = multiprocessing.get_context("forkserver" if _FORKS else "spawn")

_LONGEST = 70
"""Bytes of a folder in which sockets are: a path has 107 at most, macOS 103, and two more names in it."""

_FIRST = "actin_xcheck.runs.forking"
"""Sees to it that the process which imports them ends with this one, even before it is done."""


def prepare(modules: Iterable[str], now: bool = False) -> None:
    """Name the modules that are imported once, solvers beside them, where processes of tasks are forked from.

    To be called before the first task; without effect where systems cannot fork.  That process is started
    with the first task, or `now`, so that what is changed until then is not its code.
    """
    if _FORKS:
        solvers = sorted({method.solver.split(":")[0] for method in METHODS.values()})
        _CONTEXT.set_forkserver_preload([_FIRST, *modules, *solvers])
        if now:
            from multiprocessing.forkserver import ensure_running

            have_room_for_sockets()
            ensure_running()


def work_alone(work: Callable[..., Result], task: Task, report: Report | None = None) -> Result | Lost:
    """Return the result of `work` on a task, made in a process of its own while this one waits.

    Parameters
    ----------
    work : a module's function; it is handed the task, and a Report of its own where one is given.
    task : picklable.
    report : told of the task's progress, in this process.

    Raises whatever `work` raises; Lost where the process ends without an answer.
    """
    have_room_for_sockets()
    with closing(Processes(1, report, _CONTEXT, attempts=1)) as alone:
        ((_, result),) = alone.results(work, [task])
    return result


def have_room_for_sockets() -> None:
    """Let the sockets of multiprocessing lie where there is room for their paths: TMPDIR may be too long."""
    usual = tempfile.gettempdir()
    if os.name == "posix" and len(os.fsencode(usual)) > _LONGEST:
        tempfile.tempdir = "/tmp"
        try:
            get_temp_dir()  # from now on it is this one
        finally:
            tempfile.tempdir = usual
