"""A sweep carried out: what has no file yet is run, by whatever has processes, and all of it is one table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.executor import Lost, executor
from actin_xcheck.runs.method import METHODS, find_method
from actin_xcheck.runs.numerics import Wanted
from actin_xcheck.runs.version import code
from actin_xcheck.runs.workers import Report
from actin_xcheck.studies.sweep.plan import Point, points_of
from actin_xcheck.studies.sweep.table import SweepTable, table_of, write_table
from actin_xcheck.studies.sweep.task import Row, Task, failed, finished, work


@dataclass(frozen=True)
class Plan:
    """The runs of a sweep in the order of its table, and where they go."""

    folder: Path
    command: str
    runs: tuple[tuple[Point, Task], ...]


def plan(path: Path, methods: Sequence[str], asked: Wanted, folder: Path, command: str) -> Plan:
    """Return the runs that a sweep's file asks for, each with every method; UserError for a mistake in it."""
    known = [find_method(name) for name in dict.fromkeys(methods)]
    if asked.rtol is not None and not any(method.adaptive for method in known):
        adaptive = ", ".join(name for name, method in METHODS.items() if method.adaptive)
        raise UserError(f"--rtol: {', '.join(methods)}: equal steps; valid with {adaptive}, or --dt instead")
    numerics = [
        replace(asked, method=method.name, rtol=asked.rtol if method.adaptive else None) for method in known
    ]
    version, where = code(), folder.resolve()
    runs = [
        (point, Task(point.text, point.origin, each, where, version, command))
        for point in points_of(path)
        for each in numerics
    ]
    return Plan(folder, command, tuple(runs))


def carry_out(planned: Plan, jobs: int, scheduler: str | None, report: Report) -> tuple[SweepTable, int]:
    """Make the runs that have no whole file yet and write the sweep's table.

    Scenes are checked before the first of them is run.  The table is written at an interrupt too.

    Parameters
    ----------
    planned : see `plan`.
    jobs, scheduler : see `executor`.
    report : told of progress.

    Returns
    -------
    The table, and how many runs were made for it.
    """
    tasks = {task.key: task for _, task in planned.runs}
    rows: dict[str, Row] = {}
    for number, (key, task) in enumerate(tasks.items(), 1):
        if row := finished(task.path):
            rows[key] = row
            report("reading", number, len(tasks))
    waiting = [task for key, task in tasks.items() if key not in rows]
    checked = not waiting
    try:
        if waiting:
            with executor(jobs, scheduler) as processes:
                for number, task in enumerate(waiting, 1):
                    task.check()
                    report("checking", number, len(waiting))
                checked = True
                waiting[0].path.parent.mkdir(parents=True, exist_ok=True)
                for done, (number, found) in enumerate(processes.results(work, waiting), 1):
                    rows[waiting[number].key] = failed(found.message) if isinstance(found, Lost) else found
                    report("runs", done, len(waiting))
    finally:
        known = [_row(point, task, rows[task.key]) for point, task in planned.runs if task.key in rows]
        table = table_of(planned.folder, known)
        if checked and known:  # a mistake leaves the last table as it is
            write_table(table, planned.command)
    return table, len(waiting)


def _row(point: Point, task: Task, row: Row) -> Row:
    file = f"{task.path.parent.name}/{task.path.name}" if "steps" in row else ""
    varied = {key if "." in key else f"scene.{key}": value for key, value in point.values.items()}
    stated = {"scene": point.scene, **varied, "method": task.numerics.method}
    return {**stated, **row, "key": task.key, "file": file}
