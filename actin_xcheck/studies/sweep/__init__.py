"""A sweep: every run a file of its own, named by what it is, and all of them one table."""

import csv
import hashlib
import io
import json
import os
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.errors import Ending, UserError, brief
from actin_xcheck.core.files import replace_file
from actin_xcheck.runs.accuracy import OutOfReach, deliver, levels_of
from actin_xcheck.runs.executor import executor
from actin_xcheck.runs.method import METHODS, find_method
from actin_xcheck.runs.numerics import Wanted, run_seconds
from actin_xcheck.runs.processes import Lost
from actin_xcheck.runs.provenance import code
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import reading
from actin_xcheck.scene.scene import parse_scene
from actin_xcheck.studies.journal import Journal, key_of, stated
from actin_xcheck.studies.study import Report, Study, Table, Task, Tell, at_work, report_of, write_report
from actin_xcheck.studies.sweep.charts import MOST_RUNS, chapters_of, film_of
from actin_xcheck.studies.sweep.plan import SweepPoint, points_of
from actin_xcheck.studies.sweep.table import FILE_NAME, Row, SweepTable, is_number, read_table, table_of

ERROR = "error"
"""In place of an Ending, where there is no run: an exception, or a process that ended, every time."""

LOG = "starts.log"
"""In a sweep's folder: a line for every run that was begun, with when and where."""

CSV_NAME = "sweep.csv"


@dataclass(frozen=True)
class SweepRun:
    """A run to be made: scene (TOML), its origin, numerics, the sweep's command, how its file begins, and
    whether the page of its film is made too.
    """

    text: str
    origin: str = field(compare=False)
    numerics: Wanted
    command: str = field(compare=False, default="")
    words: str = field(compare=False, default="")
    filmed: bool = field(compare=False, default=False)

    @property
    def key(self) -> str:
        """The hash of scene, method and version."""
        chosen = self.numerics.accuracy is not None
        method = self.numerics.method if chosen else asdict(find_method(self.numerics.method))
        said = json.dumps([self.text, method, asdict(self.numerics), code()], sort_keys=True)
        return hashlib.sha256(said.encode()).hexdigest()[:24]

    @property
    def file(self) -> str:
        """Where it goes, in the sweep's folder."""
        return f"runs/{self.words}{self.key}.vtkhdf"

    @property
    def task(self) -> Task:
        """What makes it; UserError where the scene is none, or cannot be run like this."""
        scene, asked = parse_scene(self.text, self.origin), self.numerics
        every = [asked.on(scene)] if asked.accuracy is None else levels_of(scene, asked)
        seconds = sum(run_seconds(one, scene.output_times) for one in every)
        return Task(work, self, seconds, (self.file,), lost)


@dataclass(frozen=True)
class SweepRan:
    """How a run went: its outcome, numbers by name (none where it has no file), the page of its film."""

    outcome: str
    message: str
    fidelity: str = ""
    numbers: tuple[tuple[str, float], ...] = ()
    film: str = ""


def work(asked: SweepRun, folder: Path) -> SweepRan:
    """Make a run, unless its file is there, and return how it went."""
    path = folder / asked.file
    try:
        if not finished(path):  # by a process that was lost before it could say so
            _log(asked, folder)
            _run(asked, path)
        found = finished(path) or SweepRan(ERROR, "its file is gone")
        return replace(found, film=film_of(folder, asked.file)) if asked.filmed else found
    except Exception as error:  # one run's mistake must not end the others
        return SweepRan(ERROR, brief(f"{type(error).__name__}: {error}", 400))


def lost(asked: SweepRun, lost: Lost) -> SweepRan:
    """A run whose processes ended under it."""
    return SweepRan(ERROR, lost.message)


def _run(asked: SweepRun, path: Path) -> None:
    scene, wanted = parse_scene(asked.text, asked.origin), asked.numerics
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)  # what is there is not whole
    if wanted.accuracy is not None:
        with suppress(OutOfReach):  # its file says so
            deliver(scene, wanted.accuracy, path, asked.command, wanted=wanted.fidelity)
        return
    numerics = wanted.on(scene)
    for resume in (True, False):  # a lost worker's checkpoint is of use to a machine like its own only
        try:
            run(scene, numerics, path, asked.command, resume=resume)
            return
        except UserError:
            if not resume:
                raise


def _log(asked: SweepRun, folder: Path) -> None:
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    line = f"{now} {asked.key} {socket.gethostname()} {os.getpid()}\n"
    with (folder / LOG).open("a", encoding="utf-8") as log:
        log.write(line)


def finished(path: Path) -> SweepRan | None:
    """What a whole file says: how the run went and the last row of its series; None where there is none.

    Vectors and probes become one number each: `centroid_x`, `probe_a_0`, `probe_x_0_x`.
    """
    if not path.exists():
        return None
    try:
        with reading(path, "run") as file:
            said, series = file["run"].attrs, file["run/series"]
            if Ending(said["outcome"]) is Ending.INTERRUPTED:
                return None
            numbers = {name: float(said[name]) for name in ("refine", "dt", "rtol", "wall_seconds")}
            numbers["steps"] = len(series["time"]) - 1
            for name, values in series.items():
                if name != "dt":  # the last step's: the asked one stands there
                    numbers |= _columns(name, values[-1])
            outcome, message = said["outcome"], said["message"]
            if "accuracy" in said:
                numbers |= {name: float(said[name]) for name in ("accuracy", "error_estimate")}
                if outcome == Ending.COMPLETED and not numbers["error_estimate"] <= numbers["accuracy"]:
                    outcome = ERROR
                    message = f"the accuracy is out of reach: about {numbers['error_estimate']:.1e} is left"
            return SweepRan(outcome, message, said["fidelity"], tuple(numbers.items()))
    except UserError:
        return None


def _columns(name: str, value: Any) -> dict[str, float]:
    """A number or an array (2,), (k,) or (k, 2) of a row as named numbers."""
    value = np.asarray(value)
    if name == "probe_x":
        return {
            f"{name}_{i}_{axis}": float(one)
            for i, row in enumerate(value)
            for axis, one in zip("xy", row, strict=True)
        }
    if value.ndim:
        labels = "xy" if name in ("centroid", "net_force") else range(len(value))
        return {f"{name}_{label}": float(one) for label, one in zip(labels, value, strict=True)}
    return {name: float(value)}


Runs = Sequence[tuple[SweepPoint, SweepRun]]
"""What is run in the order of the table, with what was varied."""


def runs_of(path: Path, methods: Sequence[str], asked: Wanted, command: str) -> Runs:
    """Return the runs that a sweep's file asks for, each with every method; UserError for a mistake in it.

    Where an accuracy is asked for there is no other method than the one that chooses.
    """
    if asked.accuracy is not None:
        if others := [name for name in methods if name != asked.method]:
            raise UserError(
                f"--accuracy: not with --method {', '.join(others)}; valid: --method {asked.method} alone"
            )
        return [(point, _asked(point, asked, command)) for point in points_of(path)]
    known = [find_method(name) for name in dict.fromkeys(methods)]
    if asked.rtol is not None and not any(method.adaptive for method in known):
        adaptive = ", ".join(name for name, method in METHODS.items() if method.adaptive)
        raise UserError(f"--rtol: {', '.join(methods)}: equal steps; valid with {adaptive}, or --dt instead")
    numerics = [
        replace(asked, method=method.name, rtol=asked.rtol if method.adaptive else None) for method in known
    ]
    return [(point, _asked(point, each, command)) for point in points_of(path) for each in numerics]


def _asked(point: SweepPoint, numerics: Wanted, command: str) -> SweepRun:
    """A run by its point; its file begins with what was varied, as "psi-3--p-0.26--", where that is short."""
    said = (
        f"{key.rpartition('.')[2]}-{value:.6g}" for key, value in point.values.items() if is_number(value)
    )
    words = "".join(f"{one}--" for one in said)
    return SweepRun(point.text, point.origin, numerics, command, words if len(words) <= 100 else "")


def sweep(runs: Runs, tasks: Sequence[Task]) -> Study:
    """Make the runs, by their tasks, and put them into one table."""
    return report(runs, (yield tasks))


def report(runs: Runs, answers: Sequence[SweepRan]) -> Report:
    """The table of a sweep, as far as there are answers, and the links to its files."""
    rows = [_row(point, run, ran) for (point, run), ran in zip(runs, answers, strict=True)]
    columns = table_of(Path(), rows).columns
    completed = sum(ran.outcome == Ending.COMPLETED for ran in answers)
    varied = dict.fromkeys(_varied(key) for point, _ in runs for key in point.values)
    shown = ("scene", *varied, "method", "outcome", "message", "steps", "area", "total_actin", "file", "film")
    note = "The last row of each run's series; all of its columns, and links to the runs, are in the file."
    return Report(
        f"{completed} of {len(rows)} runs completed",
        "Every run is a file of its own, named by what it is.",
        {"runs": Table("Runs", columns, note, tuple(one for one in shown if one in columns))},
        links={
            f"runs/{run.key}": run.file for (_, run), ran in zip(runs, answers, strict=True) if ran.numbers
        },
    )


def _row(point: SweepPoint, run: SweepRun, ran: SweepRan) -> Row:
    numbers: dict[str, Any] = dict(ran.numbers)
    head: dict[str, Any] = {name: numbers.pop(name) for name in ("refine", "dt", "rtol") if name in numbers}
    return {
        "scene": point.scene,
        **{_varied(key): value for key, value in point.values.items()},
        "method": run.numerics.method,
        "outcome": ran.outcome,
        "message": ran.message,
        **head,
        **({"fidelity": ran.fidelity} if ran.fidelity else {}),
        **numbers,
        "key": run.key,
        "file": run.file if ran.numbers else "",
        "film": ran.film,
    }


def _varied(key: str) -> str:
    """The column of what was varied."""
    return key if "." in key else f"scene.{key}"


@dataclass
class _WhenNeeded:
    """Processes that are asked for when there is something to run, and how much that was."""

    jobs: int
    scheduler: str | None
    made: int = 0

    @property
    def workers(self) -> int:
        """As an `Executor`'s, as far as this process can say without asking a scheduler."""
        return self.jobs

    def results(self, work: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """As an `Executor`'s."""
        with executor(self.jobs, self.scheduler) as processes:
            self.made += len(tasks)
            yield from processes.results(work, tasks)


def carry_out(
    runs: Runs,
    folder: Path,
    jobs: int,
    scheduler: str | None,
    tell: Tell,
    command: str,
    force: bool = False,
) -> tuple["SweepTable", int]:
    """Make the runs that have no whole file yet, with `force` all, and write the sweep's table, at an
    interrupt too.

    Scenes are checked before the first of them is run.

    Parameters
    ----------
    runs, command : see `runs_of`, and what makes them again.
    folder : where they go; it exists.
    jobs, scheduler : see `executor`.
    tell : told of progress.

    Returns
    -------
    The table, and how many runs were made for it.
    """
    filmed = len(runs) <= MOST_RUNS
    tasks = [replace(run, filmed=filmed).task for _, run in runs]
    processes = _WhenNeeded(jobs, scheduler)
    with at_work(folder, force):
        if force:
            for _, run in runs:
                (folder / run.file).unlink(missing_ok=True)
        try:
            write(folder, report_of("sweep", sweep(runs, tasks), folder, processes, tell), command)
        except BaseException:
            keys = [key_of(task.work, stated(task.ask)) for task in tasks]
            wanted = {key: (task.answer, task.files) for key, task in zip(keys, tasks, strict=True)}
            known = Journal(folder, "sweep").answers(wanted)
            if known:
                pairs = [(pair, known[key]) for pair, key in zip(runs, keys, strict=True) if key in known]
                write(folder, report([pair for pair, _ in pairs], [ran for _, ran in pairs]), command)
            raise
    return read_table(folder), processes.made


def write(folder: Path, said: Report, command: str) -> None:
    """Write `sweep.h5`, `sweep.csv` and the page into the sweep's folder, each whole or not at all."""
    from actin_xcheck.report.page import write_page  # here: a worker draws no page

    columns = said.tables["runs"].rows
    assert isinstance(columns, Mapping)
    varied = [name for name in columns if "." in name]
    chapters = chapters_of(folder, columns, varied)
    write_report(folder / FILE_NAME, "sweep", replace(said, chapters=chapters), command)
    write_page(folder / FILE_NAME)
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    replace_file(folder / CSV_NAME, text.getvalue().encode())
