"""What tests do in place of processes, and with those of a real scheduler."""

import json
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from actin_xcheck.runs.processes import Lost

posix = pytest.mark.skipif(os.name != "posix", reason="needs kills, limits or links that only POSIX has")


class InTurn:
    """Processes without processes: interrupted after so many tasks, losing those that ask for this."""

    workers = 1

    def __init__(self, after=None, lost=()):
        self.after, self.lost = after, lost

    def results(self, work, tasks):
        for number, task in enumerate(tasks):
            if self.after is not None and number == self.after:
                raise KeyboardInterrupt
            yield number, Lost("killed") if self.lost and task.task.ask in self.lost else work(task)


def started(folder: Path, line: str, *more: object, **how) -> subprocess.Popen[str]:
    """A command that has begun, in a process of its own."""
    words = [sys.executable, "-W", "error", "-m", "actin_xcheck", *shlex.split(line), *map(str, more)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(words, cwd=folder, **pipes | how)


@contextmanager
def in_turn(jobs, scheduler=None):
    """In place of `executor`."""
    yield InTurn()


def wait_until(condition, seconds: float) -> None:
    """Wait for something that must happen within so many seconds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.05)


@contextmanager
def cluster(
    folder: Path,
    workers: int,
    alone: tuple[str, ...] = ("--nthreads", "1", "--no-nanny"),
    scheduler: tuple[str, ...] = (),
) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """A scheduler and workers, in processes of their own; without nannies nothing starts a lost one again."""
    address = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    here = ["--scheduler-file", str(address), "--no-dashboard"]
    processes = [
        subprocess.Popen(
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *here, *scheduler], **quiet
        )
    ]
    try:
        wait_until(address.exists, 60)
        own = [*alone, "--local-directory", str(folder)]
        processes += [subprocess.Popen([*dask, "worker", *here, *own], **quiet) for _ in range(workers)]
        from distributed import Client

        found = json.loads(address.read_text())["address"]
        if workers:
            with Client(found, set_as_default=False) as client:
                client.wait_for_workers(workers, timeout=60)
        yield found, processes
    finally:
        for process in reversed(processes):
            process.terminate()  # a nanny takes its worker along, which it could not where it is killed
        for process in processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
