"""One task at a time in a process of its own, which finds everything imported."""

import multiprocessing
from collections.abc import Callable, Iterable
from contextlib import closing
from typing import Any, TypeVar

from actin_xcheck.runs.executor import Lost, Processes, Report

Task = TypeVar("Task")
Result = TypeVar("Result")

_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
_CONTEXT: Any = multiprocessing.get_context("forkserver" if _FORKS else "spawn")

_FIRST = "actin_xcheck.runs.forking"
"""Sees to it that the process which imports them ends with this one, even before it is done."""


def prepare(modules: Iterable[str]) -> None:
    """Name the modules that are imported once, in the process from which those of the tasks are forked.

    To be called before the first task; without effect where systems cannot fork.
    """
    if _FORKS:
        _CONTEXT.set_forkserver_preload([_FIRST, *modules])


def work_alone(work: Callable[[Task, Report], Result], task: Task, report: Report) -> Result | Lost:
    """Return the result of `work` on a task, made in a process of its own while this one waits.

    Parameters
    ----------
    work : a module's function; it is handed the task and a Report of its own.
    task : picklable.
    report : told of the task's progress, in this process.

    Raises whatever `work` raises; Lost where the process ends without an answer.
    """
    with closing(Processes(1, report, _CONTEXT, attempts=1)) as alone:
        ((_, result),) = alone.results(work, [task])
    return result
