"""The study of extremes at work: run everything on all cores, read the breakdown times off, write it down."""

from collections.abc import Sequence
from pathlib import Path

from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.studies.extremes.attempt import Attempt, attempt
from actin_xcheck.studies.extremes.breakdown import Breakdown, breakdowns
from actin_xcheck.studies.extremes.plan import Task
from actin_xcheck.studies.extremes.record import FILE_NAME, write_extremes


def examine(
    tasks: Sequence[Task], folder: Path, command: str, report: Report = lambda label, done, total: None
) -> tuple[list[Attempt], list[Breakdown]]:
    """Run the tasks and write `folder/extremes.h5`; `folder` exists."""
    finished = 0

    def count(label: str, done: int, total: int) -> None:
        nonlocal finished
        finished += done == total
        report("runs", finished, len(tasks))

    attempts = work_off(attempt, tasks, count, lambda task: task.command)
    found = breakdowns(attempts)
    write_extremes(folder / FILE_NAME, attempts, found, command)
    return attempts, found
