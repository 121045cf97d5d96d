"""One task at a time in a process of its own, which finds everything imported."""

import multiprocessing
from collections.abc import Callable, Iterable
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from actin_xcheck.runs.workers import Report, have_room_for_sockets

Task = TypeVar("Task")
Result = TypeVar("Result")

_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
_CONTEXT: Any = multiprocessing.get_context("forkserver" if _FORKS else "spawn")


def prepare(modules: Iterable[str]) -> None:
    """Name the modules that are imported once, in the process from which those of the tasks are forked.

    To be called before the first task; without effect where systems cannot fork.
    """
    if _FORKS:
        _CONTEXT.set_forkserver_preload(list(modules))


def work_alone(work: Callable[[Task, Report], Result], task: Task, report: Report) -> Result:
    """Return the result of `work` on a task, made in a process of its own while this one waits.

    Parameters
    ----------
    work : a module's function; it is handed the task and a Report of its own.
    task : picklable.
    report : told of the task's progress, in this process.

    Raises whatever `work` raises; ChildProcessError where the process ends without an answer.
    """
    have_room_for_sockets()
    receiver, sender = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_work, args=(sender, work, task), daemon=True)
    process.start()
    sender.close()
    try:
        while True:
            kind, answer = receiver.recv()
            if kind == "progress":
                report(*answer)
            elif kind == "raised":
                raise answer
            else:
                result: Result = answer
                return result
    except EOFError:
        process.join()
        raise ChildProcessError(f"a run's process ended with exit code {process.exitcode}") from None
    finally:
        receiver.close()
        process.terminate()  # it has answered, or nobody waits for it any more
        process.join()


def _work(sender: Connection, work: Callable[[Task, Report], Result], task: Task) -> None:
    """In the process: everything goes home through a pipe, progress about twenty times."""
    told = -1

    def report(label: str, done: int, total: int) -> None:
        nonlocal told
        if (part := 20 * done // max(total, 1)) != told:
            told = part
            sender.send(("progress", (label, done, total)))

    try:
        answer = "done", work(task, report)
    except Exception as error:
        sender.send(("raised", error))
    else:
        sender.send(answer)
