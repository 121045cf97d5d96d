"""Work on all cores: tasks in processes of their own, with their progress passed on."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.executor import IN_TURN, Lost, Processes, Report, cores, portable

Task = TypeVar("Task")
Result = TypeVar("Result")


@dataclass(frozen=True)
class _Raised:
    """In place of a result: what was raised."""

    error: Exception


def work_off(
    work: Callable[[Task, Report], Result],
    tasks: Sequence[Task],
    report: Report,
    name: Callable[[Task], str],
) -> list[Result]:
    """Return the results of `work` on every task, in their order.

    Parameters
    ----------
    work : a module's function; it is handed a task and a Report of its own.
    tasks : picklable; the first are started first, so those that take longest should stand there.
    report : told of the tasks' progress, in this process.
    name : what a task is called where its processes end.

    Raises whatever `work` raises, after the others have finished, or UserError where every process that was
    given a task has ended; an interrupt ends the processes at once.
    """
    if IN_TURN.get():
        return [work(task, report) for task in tasks]
    with closing(Processes(min(len(tasks), cores()), report)) as processes:
        found = dict(processes.results(partial(_tried, work), tasks))
    results: list[Result] = []
    for number in range(len(tasks)):
        result = found[number]
        if isinstance(result, _Raised):
            raise result.error
        if not isinstance(result, Lost):
            results.append(result)
    lost = [f"{name(tasks[i])}: {one.message}" for i, one in sorted(found.items()) if isinstance(one, Lost)]
    if lost:
        raise UserError(f"{'; '.join(lost)}; what was finished is kept; valid: the same command again")
    return results


def _tried(work: Callable[[Task, Report], Result], task: Task, report: Report) -> Result | _Raised:
    """In a process: an error is a result, so that the others go on."""
    try:
        return work(task, report)
    except Exception as error:
        return _Raised(portable(error))
