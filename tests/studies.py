"""Studies carried out in this process, in turn, and comparisons whose runs are made up."""

import os
from math import nan

from actin_xcheck.runs.processes import Lost
from actin_xcheck.studies.compare import FILE_NAME, RunRow
from actin_xcheck.studies.study import Report, Table, carry_out, counted, write_report


class InTurn:
    """Has no processes: an executor in the shape of `runs.executor.Executor`."""

    workers = 1

    def __init__(self, after=None, lost=()):
        self.after, self.lost = after, lost

    def results(self, work, tasks):
        for number, task in enumerate(tasks):
            if self.after is not None and number == self.after:
                raise KeyboardInterrupt
            yield number, Lost("killed") if task.task.ask in self.lost else work(task)


def here(work, task):
    """What is timed runs in this process too."""
    return work(task)


def carry(folder, study, processes=None, name="squares", tell=lambda label, over, whole: None, alone=here):
    command = f"python -m actin_xcheck {name}"
    return carry_out(name, study, folder, command, processes or InTurn(), tell, alone)


def write_comparison(folder, claims, runs, command="python -m actin_xcheck compare"):
    """Write the file of a comparison with links to runs, files by "scene/method", and return its path."""
    rows = [
        RunRow(
            *name.split("/", 1),
            0,
            1,
            0.1,
            nan,
            "completed",
            "",
            1.0,
            f"runs/{name}",
            os.path.relpath(file, folder),
        )
        for name, file in runs.items()
    ]
    tables = {
        "runs": Table("Runs", rows),
        "triangles": Table("Triangles", []),
        "known_to": Table("Known to", []),
    }
    links = {row.place: row.file for row in rows}
    report = Report(counted(claims, "claims hold"), "By hand.", tables, tuple(claims), links=links)
    write_report(folder / FILE_NAME, "compare", report, command)
    return folder / FILE_NAME
