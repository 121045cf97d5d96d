"""Tasks for processes of their own, some of which end badly; a module that loads nothing else."""

import os
import signal
from pathlib import Path


def killed(task: tuple[Path, int]) -> int:
    """Square a number; the process is killed under 1 the first time and under 3 every time."""
    folder, number = task
    with (folder / "begun").open("a", encoding="utf-8") as log:
        log.write(f"{number}\n")
    mark = folder / f"killed-{number}"
    if number == 3 or (number == 1 and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def raises(task: int) -> int:
    raise ValueError(f"task {task}")


def process(task: object) -> int:
    return os.getpid()
