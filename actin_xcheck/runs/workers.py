"""Work on all cores: tasks in processes of their own, with their progress passed on."""

import multiprocessing
import os
import queue
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from multiprocessing.util import get_temp_dir
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

Report = Callable[[str, int, int], None]
"""Called with a label, parts done and parts in all."""

_LONGEST = 70
"""Bytes of a folder in which sockets are: a path has 107 at most, macOS 103, and two more names in it."""

_IN_TURN = ContextVar("in turn", default=False)


@contextmanager
def in_turn() -> Iterator[None]:
    """Within it, tasks are worked off one by one in this process: others do not see what it has changed."""
    before = _IN_TURN.set(True)
    try:
        yield
    finally:
        _IN_TURN.reset(before)


def work_off(work: Callable[[Task, Report], Result], tasks: Sequence[Task], report: Report) -> list[Result]:
    """Return the results of `work` on every task, in their order.

    Parameters
    ----------
    work : a module's function; it is handed a task and a Report of its own.
    tasks : picklable; the first are started first, so those that take longest should stand there.
    report : told of the tasks' progress, in this process.

    Raises whatever `work` raises, after the others have finished; an interrupt ends the workers at once.
    """
    if _IN_TURN.get():
        return [work(task, report) for task in tasks]
    if not tasks:
        return []
    context = multiprocessing.get_context("spawn")
    have_room_for_sockets()
    workers = min(len(tasks), os.cpu_count() or 1)
    with context.Manager() as manager, ProcessPoolExecutor(workers, mp_context=context) as pool:
        news = manager.Queue()
        futures = [pool.submit(_work, work, task, news) for task in tasks]
        try:
            while not all(future.done() for future in futures):
                _pass_on(news, report)
            _pass_on(news, report)
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
        return [future.result() for future in futures]


def have_room_for_sockets() -> None:
    """Let the sockets of multiprocessing lie where there is room for their paths: TMPDIR may be too long."""
    usual = tempfile.gettempdir()
    if os.name == "posix" and len(os.fsencode(usual)) > _LONGEST:
        tempfile.tempdir = "/tmp"
        try:
            get_temp_dir()  # from now on it is this one
        finally:
            tempfile.tempdir = usual


def _work(
    work: Callable[[Task, Report], Result], task: Task, news: "queue.Queue[tuple[str, int, int]]"
) -> Result:
    """In a worker: progress goes home through a queue, about fifty times a task."""

    def report(label: str, done: int, total: int) -> None:
        if done % max(1, total // 50) == 0 or done == total:
            news.put((label, done, total))

    return work(task, report)


def _pass_on(news: "queue.Queue[tuple[str, int, int]]", report: Report) -> None:
    try:
        while True:
            report(*news.get(timeout=0.2))
    except queue.Empty:
        return
