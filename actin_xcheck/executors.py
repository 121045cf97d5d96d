"""One seam to processes, of this machine or of a cluster: results of tasks as they come.

A task whose process ends (killed, out of memory, a machine that is gone) is given to another one; after
`ATTEMPTS` such ends it is `Lost`, and the others go on.
"""

import logging
import multiprocessing
import os
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from actin_xcheck.errors import UserError

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""Processes that may end under a task; one more would most likely end under it too."""

_ANSWER = "10 s"
"""How long a scheduler may take to answer."""


@dataclass(frozen=True)
class Lost:
    """In place of a result: every process that was given the task has ended."""

    message: str


class Executor(Protocol):
    """Something that has processes."""

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        """Yield the number of each task and what `work` returned for it, in the order in which they come.

        `work` is a module's function and tasks are picklable.  Raises what `work` raises.
        """
        ...


@contextmanager
def executor(jobs: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Give as many processes as `jobs` on this machine, or those of the cluster at a scheduler's address.

    UserError where no `dask.distributed` scheduler with workers answers there, or where it is not installed.
    """
    if scheduler is None:
        yield _Processes(jobs)
        return
    try:
        from distributed import Client
        from distributed.comm import resolve_address
    except ImportError:
        raise UserError(
            "--scheduler: needs dask.distributed; valid: pip install 'actin-xcheck[cluster]'"
        ) from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what goes wrong is said here
    try:
        resolve_address(scheduler)  # a client of what is no address takes long to end
        client = Client(scheduler, timeout=_ANSWER, set_as_default=False)
    except (OSError, ValueError) as error:  # ValueError: what is no address
        raise UserError(f"--scheduler: {scheduler}: no scheduler answers ({error})") from None
    with client:
        if not client.nthreads():
            raise UserError(f"--scheduler: {scheduler} has no workers; valid: dask worker {scheduler}")
        yield _Cluster(client)


class _Processes:
    """Each process is a pool of its own, so that one that ends takes no other's task with it."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        waiting, ends = deque(range(len(tasks))), Counter[int]()
        idle = [_process() for _ in range(min(self._jobs, len(tasks)))]
        busy: dict[Future[Result], tuple[int, ProcessPoolExecutor]] = {}
        others = set(multiprocessing.active_children())
        try:
            while waiting or busy:
                while waiting and idle:
                    process, number = idle.pop(), waiting.popleft()
                    busy[process.submit(work, tasks[number])] = number, process
                for future in wait(busy, return_when=FIRST_COMPLETED).done:
                    number, process = busy.pop(future)
                    try:
                        result: Result | Lost = future.result()
                    except BrokenProcessPool:
                        process.shutdown()
                        process = _process()
                        ends[number] += 1
                        if ends[number] < ATTEMPTS:
                            waiting.appendleft(number)
                            idle.append(process)
                            continue
                        result = Lost(f"the process ended under this run, {ATTEMPTS} times")
                    idle.append(process)
                    yield number, result
        finally:
            for process in (*idle, *(process for _, process in busy.values())):
                process.shutdown(wait=False, cancel_futures=True)
            if busy:  # an interrupt or a mistake: nobody waits for these
                for child in set(multiprocessing.active_children()) - others:
                    child.terminate()


def _process() -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(1, mp_context=context, initializer=_end_with_parent)


def _end_with_parent() -> None:
    """In a worker: a parent that is killed says nothing, and its workers would wait for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


class _Cluster:
    """The scheduler gives a lost worker's tasks to others by itself."""

    def __init__(self, client: "Client") -> None:
        self._client = client

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        from distributed import KilledWorker, as_completed

        futures: list[Any] = self._client.map(work, tasks, pure=False)
        numbers = {future.key: number for number, future in enumerate(futures)}
        try:
            for future in as_completed(list(futures), loop=self._client.loop):
                try:
                    result: Result | Lost = future.result()
                except KilledWorker as error:
                    result = Lost(" ".join(str(error).split()))
                except CancelledError:
                    raise UserError("--scheduler: it is gone; what was finished is kept") from None
                except ImportError as error:
                    raise UserError(
                        f"--scheduler: a worker cannot import {error.name}; "
                        "valid: workers of an environment in which actin_xcheck is installed"
                    ) from None
                futures[numbers[future.key]] = None  # the cluster may forget it
                yield numbers[future.key], result
        finally:
            self._client.cancel([future for future in futures if future is not None])
