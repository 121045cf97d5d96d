"""Processes of this machine, each with a pipe of its own: tasks go in, and results come out as they come.

A task whose process ends (killed, out of memory) is given to another one; after `ATTEMPTS` such ends it is
`Lost`, and the others go on.  Processes end when the one that started them does.  What is timed has a process
of its own, in which everything is imported already.
"""

import ctypes
import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.util import get_temp_dir
from types import FrameType
from typing import Any, TypeVar

from actin_xcheck.runs.method import METHODS

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3
"""Processes that may end under a task; one more would most likely end under it too."""

_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of prctl(2)."""


@dataclass(frozen=True)
class Lost:
    """In place of a result: every process that was given the task has ended.

    Attributes
    ----------
    message : how, a sentence.
    killed : whether something from outside ended it (a signal, no memory, a machine that is gone), which says
        nothing about the task.
    """

    message: str
    killed: bool = True


class Processes:
    """Those of this machine, each with a pipe of its own: one that ends takes no other's task with it.

    They are started when there is work for them, and wait for more with all that they have loaded.

    Parameters
    ----------
    jobs : how many.
    context : how they are started, of `multiprocessing`; None: afresh.
    attempts : see `ATTEMPTS`.
    """

    def __init__(self, jobs: int, context: Any = None, attempts: int = ATTEMPTS) -> None:
        self._jobs, self._attempts = jobs, attempts
        self._context = context or multiprocessing.get_context("spawn")
        self._idle: list[_Process] = []

    @property
    def workers(self) -> int:
        """As an `Executor`'s."""
        return self._jobs

    def results(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | Lost]]:
        """As an `Executor`'s."""
        waiting, ends = deque(range(len(tasks))), Counter[int]()
        busy: dict[Connection, tuple[int, _Process]] = {}

        def begin() -> None:
            while waiting and len(busy) < self._jobs:
                process = self._begin(work, tasks[waiting[0]])
                busy[process.pipe] = waiting.popleft(), process

        try:
            begin()
            while busy:
                for pipe in wait(list(busy)):
                    number, process = busy[pipe]  # type: ignore[index]
                    kind, said = process.hear()
                    del busy[process.pipe]
                    if kind == "lost":
                        process.end()
                        ends[number] += 1
                        if ends[number] < self._attempts:
                            waiting.appendleft(number)
                            begin()
                            continue
                        said = replace(said, message=said.message + _times(self._attempts))
                    else:
                        self._idle.append(process)
                    if kind == "raised":
                        raise said
                    begin()  # before the caller sees to the result, for which no process has to wait
                    yield number, said
        finally:
            for _, process in busy.values():  # an interrupt or a mistake: nobody waits for these
                process.end()

    def close(self) -> None:
        """End the processes."""
        while self._idle:
            self._idle.pop().end()

    def _begin(self, work: Callable[[Any], Any], task: object) -> "_Process":
        """Hand a task to a process that is idle, or to a new one."""
        given = work, task
        while self._idle:
            process = self._idle.pop()
            try:
                process.pipe.send(given)
            except OSError:  # it ended while it had nothing to do
                process.end()
                continue
            return process
        process = _Process(self._context)
        with suppress(OSError):  # one that ends at once is heard of as others are
            process.pipe.send(given)
        return process


def _times(attempts: int) -> str:
    return f", {attempts} times" if attempts > 1 else ""


class _Process:
    """A process that does one task after another."""

    def __init__(self, context: Any) -> None:
        self.pipe, away = context.Pipe()
        self._process = context.Process(target=_serve, args=(away,))
        self._process.start()
        away.close()

    def hear(self) -> tuple[str, Any]:
        """What it says next: "done" or "raised" and what; "lost" and a Lost where it has ended."""
        try:
            kind, said = self.pipe.recv()
        except (EOFError, OSError):
            self._process.join()
            return "lost", how_ended(self._process.exitcode)
        return kind, said

    def end(self) -> None:
        """End it at once, whatever it does."""
        self.pipe.close()
        self._process.kill()
        self._process.join()


def how_ended(code: int) -> Lost:
    """How a process ended, by its exit code: signals come from outside, but for those of its own faults."""
    own = {getattr(signal, name, None) for name in ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE", "SIGILL")}
    if code >= 0:
        return Lost(f"its process ended with exit code {code}", False)
    number = signal.Signals(-code)
    memory = ", or the system out of memory" if number.name == "SIGKILL" else ""
    return Lost(f"its process was ended by {number.name} (by somebody{memory})", number not in own)


def _serve(pipe: Connection) -> None:
    """In a process: do what comes through the pipe, and send home what comes of it."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's: the one that started this process ends it
    while True:
        try:
            work, task = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send(("done", work(task)))
        except Exception as error:
            pipe.send(("raised", portable(error)))


def portable(error: Exception) -> Exception:
    """The error with a note of where it was raised; what it says, where it does not survive the way home."""
    error.add_note(traceback.format_exc())
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def end_with_parent() -> None:
    """In a process: a parent that is killed says nothing, and its children would work or wait for ever.

    Linux ends it at once; elsewhere it is a thread of its own that does, once imports and long calls let it.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    if parent := multiprocessing.parent_process():

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()


def end_all() -> None:
    """End every process that this one has started and that is still there."""
    for child in multiprocessing.active_children():
        child.kill()


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


def work_alone(work: Callable[[Task], Result], task: Task) -> Result | Lost:
    """Return the result of `work` on a task, made in a process of its own while this one waits.

    Parameters
    ----------
    work : a module's function; it is handed the task.
    task : picklable.

    Raises whatever `work` raises; Lost where the process ends without an answer.
    """
    have_room_for_sockets()
    with closing(Processes(1, _CONTEXT, attempts=1)) as alone:
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


def ending_signals() -> list[signal.Signals]:
    """Those that ask this process to end, Ctrl-C's among them; none that is ignored, as under `nohup`."""
    asked = (getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP"))
    return [number for number in asked if number and signal.getsignal(number) is not signal.SIG_IGN]


@contextmanager
def stop_signals() -> Iterator[Callable[[], int]]:
    """Within it `ending_signals` are only noted; a second one does what it did before.

    The value gives the number of the one that came, 0 where none did.
    """
    noted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        if noted and callable(handler := before[signal.Signals(number)]):
            handler(number, frame)
        noted.append(number)

    before = {number: signal.signal(number, note) for number in ending_signals()}
    try:
        yield lambda: noted[0] if noted else 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
