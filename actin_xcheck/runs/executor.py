"""One seam to processes, of this machine or of a cluster: results of tasks as they come.

A task whose process ends (killed, out of memory, a machine that is gone) is given to another one; after
`ATTEMPTS` such ends it is `Lost`, and the others go on.
"""

import logging
import multiprocessing
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from actin_xcheck.core.errors import UserError

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""Processes that may end under a task; one more would most likely end under it too."""

_ANSWER = "10 s"
"""How long a scheduler may take to answer."""

ALONE = 60.0
"""Seconds after which a scheduler without workers is left."""

_PAUSE = 0.05
"""Seconds between two looks at what has come."""


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


def jobs_asked(jobs: int | None, scheduler: str | None) -> int:
    """Return how many processes `--jobs` asks for on this machine, its cores where it is not given.

    UserError where a scheduler is named too.
    """
    if jobs is not None and scheduler is not None:
        raise UserError("--jobs: not with --scheduler, which has its own workers; valid: one of the two")
    return jobs or os.cpu_count() or 1


@contextmanager
def executor(jobs: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Give as many processes as `jobs` on this machine, or those of the cluster at a scheduler's address.

    Those of this machine end with the context, so that what they have loaded serves all that is asked in it.

    UserError where no `dask.distributed` scheduler with workers answers there, or where it is not installed.
    """
    if scheduler is None:
        with closing(_Processes(jobs)) as processes:
            yield processes
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
    """Each process is a pool of its own, so that one that ends takes no other's task with it.

    They are started when there is work for them, and wait for more with all that they have loaded.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._idle: list[ProcessPoolExecutor] = []
        self._children: set[BaseProcess] = set()

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        waiting, ends = deque(range(len(tasks))), Counter[int]()
        busy: dict[Future[Result], tuple[int, ProcessPoolExecutor]] = {}

        def begin() -> None:
            while waiting and len(busy) < self._jobs:
                number = waiting.popleft()
                future, process = self._begin(work, tasks[number])
                busy[future] = number, process

        try:
            begin()
            while busy:
                for future in wait(busy, return_when=FIRST_COMPLETED).done:
                    number, process = busy.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        process.shutdown()
                        ends[number] += 1
                        if ends[number] < ATTEMPTS:
                            waiting.appendleft(number)
                            begin()
                            continue
                        result: Result | Lost = Lost(f"the process ended under this run, {ATTEMPTS} times")
                    else:
                        self._idle.append(process)
                        result = future.result()
                    begin()  # before the caller sees to the result, for which no process has to wait
                    yield number, result
        finally:
            if busy:  # an interrupt or a mistake: nobody waits for these
                self._idle += [process for _, process in busy.values()]
                self.close()
                for child in self._children:
                    child.terminate()

    def close(self) -> None:
        """Let the processes go."""
        while self._idle:
            self._idle.pop().shutdown(wait=False, cancel_futures=True)

    def _begin(
        self, work: Callable[[Task], Result], task: Task
    ) -> tuple[Future[Result], ProcessPoolExecutor]:
        """Hand a task to a process that is idle, or to a new one."""
        others = set(multiprocessing.active_children())
        while True:
            process = self._idle.pop() if self._idle else _process()
            try:
                future = process.submit(work, task)
            except BrokenProcessPool:  # it ended while it had nothing to do
                process.shutdown()
                continue
            self._children |= set(multiprocessing.active_children()) - others
            return future, process


def _process() -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(1, mp_context=context, initializer=end_with_parent)


def end_with_parent() -> None:
    """In a process: a parent that is killed says nothing, and its children would work or wait for ever."""
    if parent := multiprocessing.parent_process():

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
        from distributed.comm import CommClosedError

        futures: list[Any] = self._client.map(work, tasks, pure=False)
        numbers = {future.key: number for number, future in enumerate(futures)}
        try:
            for future in self._as_they_come(as_completed(list(futures), loop=self._client.loop)):
                try:
                    result: Result | Lost = future.result()
                except KilledWorker as error:
                    result = Lost(" ".join(str(error).split()))
                except (CancelledError, CommClosedError):
                    raise _gone() from None
                except ImportError as error:
                    raise UserError(
                        f"--scheduler: a worker cannot import {error.name}; "
                        "valid: workers of an environment in which actin_xcheck is installed"
                    ) from None
                except RuntimeError as error:  # what the scheduler says where it cannot read the tasks
                    if not isinstance(error.__cause__, ImportError):
                        raise
                    raise UserError(
                        f"--scheduler: it cannot import {error.__cause__.name}; "
                        "valid: one of an environment in which actin_xcheck is installed"
                    ) from None
                futures[numbers[future.key]] = None  # the cluster may forget it
                yield numbers[future.key], result
        finally:
            with suppress(OSError):  # where the scheduler is gone there is nothing to cancel
                self._client.cancel([future for future in futures if future is not None])

    def _as_they_come(self, coming: Any) -> Iterator[Any]:
        """Yield futures when they are done; UserError where no worker has been there for a while."""
        seen = time.monotonic()
        while coming.count():
            if coming.has_ready():
                yield next(coming)
                continue
            try:
                workers = self._client.nthreads()
            except OSError:
                raise _gone() from None
            if workers:
                seen = time.monotonic()
            elif time.monotonic() - seen > ALONE:
                raise UserError("--scheduler: its workers are gone; what was finished is kept")
            time.sleep(_PAUSE)


def _gone() -> UserError:
    return UserError("--scheduler: it is gone; what was finished is kept")
