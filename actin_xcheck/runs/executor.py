"""One seam to processes, of this machine or of a cluster: results of tasks, as they come or in their order.

A task whose process ends (killed, out of memory, a machine that is gone) is given to another one, see
`processes`; a cluster's scheduler does as much for its workers.
"""

import logging
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.processes import Lost, Processes

if TYPE_CHECKING:
    from distributed import Client

Task = TypeVar("Task")
Result = TypeVar("Result")

_ANSWER = 6.0
"""Seconds that a scheduler may take to answer."""

ALONE = 60.0
"""Seconds after which a scheduler without workers is left."""

_PAUSE = 0.05
"""Seconds between two looks at what has come."""


class Executor(Protocol):
    """Something that has processes."""

    @property
    def workers(self) -> int:
        """How many tasks it works on at a time."""
        ...

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        """Yield the number of each task and what `work` returned for it, in the order in which they come.

        `work` is a module's function and tasks are picklable.  Raises what `work` raises.
        """
        ...


def cores() -> int:
    """Return how many processors this process may use, where the system tells; else all there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def jobs_asked(jobs: int | None, scheduler: str | None) -> int:
    """Return how many processes `--jobs` asks for on this machine, its `cores` where it is not given.

    UserError where a scheduler is named too.
    """
    if jobs is not None and scheduler is not None:
        raise UserError("--jobs: not with --scheduler, which has its own workers; valid: one of the two")
    return jobs or cores()


IN_TURN = ContextVar("in turn", default=False)


@contextmanager
def in_turn() -> Iterator[None]:
    """Within it, tasks are worked off one by one in this process: others do not see what it has changed."""
    before = IN_TURN.set(True)
    try:
        yield
    finally:
        IN_TURN.reset(before)


@contextmanager
def executor(jobs: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Give as many processes as `jobs` on this machine, or those of the cluster at a scheduler's address.

    Those of this machine end with the context, so that what they have loaded serves all that is asked in it.

    UserError where no `dask.distributed` scheduler with workers answers there, or where it is not installed.
    """
    if IN_TURN.get():
        yield _InTurn()
        return
    if scheduler is None:
        with closing(Processes(jobs)) as processes:
            yield processes
        return
    import asyncio

    try:
        from distributed import Client, __version__
    except ImportError:
        raise UserError(
            "--scheduler: needs dask.distributed; valid: pip install 'actin-xcheck[cluster]'"
        ) from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what goes wrong is said here
    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook's has a loop already
            theirs = thread.submit(asyncio.run, _version(scheduler)).result()
        if theirs == __version__:
            client = Client(scheduler, timeout=_ANSWER, set_as_default=False)
    except Exception as error:  # whatever may listen there: it is no scheduler of ours
        said = str(error) or f"nothing that a scheduler says within {_ANSWER:.0f} s"
        raise UserError(f"--scheduler: {scheduler}: no scheduler answers ({said})") from None
    if theirs != __version__:
        raise UserError(
            f"--scheduler: {scheduler} has dask.distributed {theirs}, this is {__version__}; "
            "valid: the same version"
        )
    with client:
        if not client.nthreads():
            raise UserError(f"--scheduler: {scheduler} has no workers; valid: dask worker {scheduler}")
        yield _Cluster(client)


async def _version(scheduler: str) -> str:
    """Ask a scheduler for its version: a client of what is none, or of another's, waits or breaks down."""
    import asyncio

    from distributed import Security
    from distributed.comm import connect

    async with asyncio.timeout(_ANSWER):
        theirs = await connect(scheduler, timeout=_ANSWER / 2, **Security().get_connection_args("client"))
        try:
            await theirs.write({"op": "versions", "reply": True})
            return str((await theirs.read())["packages"]["distributed"])
        finally:
            theirs.abort()


class _InTurn:
    """This process alone."""

    workers = 1

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        yield from ((number, work(task)) for number, task in enumerate(tasks))


class _Cluster:
    """The scheduler gives a lost worker's tasks to others by itself."""

    def __init__(self, client: "Client") -> None:
        self._client = client

    @property
    def workers(self) -> int:
        return max(len(self._client.nthreads()), 1)

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
