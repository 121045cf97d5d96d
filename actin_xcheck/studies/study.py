"""What a study is, and how one is carried out.

A study is a generator.  It yields tasks, is sent their answers in the same order, may ask again, and returns
its report:

    def ripples(scene) -> Study:
        answers = yield [Task(measure, Case(scene.text, m), seconds=2.0) for m in range(2, 9)]
        return Report("Ripples", "How fast ...", {"ripples": Table("Ripples", answers)})

Everything else is done here, once: answers that the same code has given before are taken up again, others
come from this machine's cores or a cluster, the longest first, and are kept as they come; what is timed runs
by itself, when they are over.  The report is written to `<name>.h5`, of which alone its page is made.
"""

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

import h5py
import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import locked
from actin_xcheck.report.exhibits import Chapter, write_chapters
from actin_xcheck.runs.executor import Executor
from actin_xcheck.runs.processes import Lost, portable, prepare, work_alone
from actin_xcheck.runs.provenance import ONE_AT_A_TIME, check_code, code, provenance
from actin_xcheck.runs.records import write_table
from actin_xcheck.runs.store import state, writing
from actin_xcheck.studies.journal import FILE_NAME, Journal, files_in, key_of, reports_in, stated
from actin_xcheck.studies.underway import Underway

if TYPE_CHECKING:
    from actin_xcheck.verdicts.final import FinalValue

PAGE = "index.html"

Tell = Callable[[str, float, float], None]
"""Told of a label, seconds of work that are over, and seconds in all, as they were expected."""

Alone = Callable[[Callable[[Any], Any], Any], Any]
"""Returns what work makes of a task in a process of its own, or Lost; see `runs.processes.work_alone`."""


@dataclass(frozen=True)
class Task:
    """Something to be computed in a process of its own.

    Attributes
    ----------
    work : a module's function of what is asked and of the study's folder; it is annotated with the dataclass
        that it returns.
    ask : what is asked: a frozen dataclass of plain values, or plain values.
    seconds : that it is expected to take on one core.
    files : what it leaves in the folder: without one of them its answer is not taken up again.
    lost : makes what stands in for the answer, of what was asked and a `Lost`, where every process ended
        under it or its work returned one; without one the study cannot go on.
    alone : whether it is timed: it then runs on this machine, one at a time, in a process of its own.
    turn : those with a smaller one begin first, however long they take.
    """

    work: Callable[[Any, Path], Any]
    ask: Any
    seconds: float = 1.0
    files: tuple[str, ...] = ()
    lost: Callable[[Any, Lost], Any] | None = None
    alone: bool = False
    turn: int = 0

    @property
    def answer(self) -> type:
        """The class of its answer."""
        kind: type = get_type_hints(self.work)["return"]
        return kind


class Batch(tuple[Task, ...]):
    """Tasks, where more will be asked for when these are answered: about so many seconds of them."""

    later: float

    def __new__(cls, tasks: Iterable[Task], later: float) -> "Batch":
        """Tasks and the seconds of those that come later."""
        batch = super().__new__(cls, tasks)
        batch.later = later
        return batch


@dataclass(frozen=True)
class Table:
    """Rows of one dataclass, or columns by name, with a title and a note; `shown` are on a page, else all."""

    title: str
    rows: Sequence[Any] | Mapping[str, Any]
    note: str = ""
    shown: tuple[str, ...] = ()

    @property
    def columns(self) -> dict[str, list[Any]]:
        """Numbers and text by column, those alone that are shown."""
        if isinstance(self.rows, Mapping):
            every = {name: list(values) for name, values in self.rows.items()}
        else:
            names = list(vars(self.rows[0])) if len(self.rows) else []
            every = {name: [getattr(row, name) for row in self.rows] for name in names}
        chosen = [name for name in self.shown if name in every] or list(every)
        plain = (bool, int, float, str, np.number)
        return {name: every[name] for name in chosen if all(isinstance(one, plain) for one in every[name])}


@dataclass(frozen=True, repr=False)
class Report:
    """What a study comes to.

    Attributes
    ----------
    title, lead : what the page says first, such as `counted` makes, and how it was found.
    tables : by name.
    claims : what is judged.
    findings : sentences.
    chapters : what is drawn.
    links : files of the study's folder, such as runs, by the place in its file where they are linked.
    verdicts : how many of what it judges came out how, where its claims do not say that.
    known, values : the command's `known_to_percent` and `values` in JSON, see `cli.output.ReportAnswer`.
    command : what makes it again, where the one that was typed does not say all of that, such as a seed.
    """

    title: str
    lead: str
    tables: Mapping[str, Table] = field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    findings: tuple[str, ...] = ()
    chapters: tuple[Chapter, ...] = ()
    links: Mapping[str, str] = field(default_factory=dict)
    verdicts: Mapping[str, int] = field(default_factory=dict)
    known: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    values: Sequence["FinalValue"] = ()
    command: str = ""

    def __repr__(self) -> str:
        return f"<Report: {self.title}>"

    def _repr_html_(self) -> str:
        """For notebooks: title, findings and tables."""
        from actin_xcheck.report.notebook import table

        said = "".join(f"<p>{escape(one)}</p>" for one in (self.title, *self.findings))
        return said + "".join(
            f"<p><b>{escape(one.title)}</b></p>{table(list(columns), zip(*columns.values(), strict=True))}"
            for one in self.tables.values()
            if (columns := one.columns)
        )


Study = Generator[Sequence[Task], list[Any], Report]


def counted(claims: Sequence[Claim], words: str) -> str:
    """A title that says how many of the claims that are judged hold."""
    judged = [claim for claim in claims if claim.judged]
    return f"{sum(claim.holds for claim in judged)} of {len(judged)} {words}"


def carry_out(
    name: str,
    study: Study,
    folder: Path,
    command: str,
    processes: Executor,
    tell: Tell,
    alone: Alone = work_alone,
) -> Report:
    """Carry a study out in a folder that exists, write its report and return it.

    Parameters
    ----------
    name : of the study; its file is `<name>.h5`.
    command : what makes it again.
    processes : what has processes for its tasks.
    tell : see `Tell`.
    alone : what carries out tasks that are timed.

    Raises UserError where the folder has another study, and for tasks whose processes ended every time.
    """
    report = report_of(name, study, folder, processes, tell, alone)
    write_report(folder / f"{name}.h5", name, report, command)
    return report


def report_of(
    name: str, study: Study, folder: Path, processes: Executor, tell: Tell, alone: Alone = work_alone
) -> Report:
    """Carry a study out, see `carry_out`, and return its report, to be written to a file of another kind."""
    journal = Journal(folder, name)
    (folder / PAGE).unlink(missing_ok=True)  # none must stand beside what it is not made of
    return answered(study, _Course(journal, folder, processes, alone, tell, Underway(folder, name)).answers)


def carry_out_here(name: str, study: Study, folder: Path, command: str) -> Report:
    """Carry a study out in this process, where faults are seen, afresh, and write its report."""
    report = answered(study, lambda tasks: [task.work(task.ask, folder) for task in tasks])
    write_report(folder / f"{name}.h5", name, report, command)
    return report


@contextmanager
def at_work(folder: Path, force: bool = False) -> Iterator[None]:
    """Have a study's folder to oneself; with `force`, begin anew.  UserError where another process has it."""
    with locked(folder / PAGE):  # not the journal: without locks of the system, each look into that takes one
        if force:
            begin_anew(folder)
        yield


def begin_anew(folder: Path) -> None:
    """Remove the answers that a folder has, and the reports; what else lies there stays."""
    (folder / FILE_NAME).unlink(missing_ok=True)
    for path in reports_in(folder):
        path.unlink()


def study_file(folder: Path) -> Path | None:
    """The file of a study in a folder, or one that cannot be opened and may be it; None without either."""
    files = files_in(folder)
    studies = [path for path, stated_there in files if "study" in (stated_there or ())]
    return next(iter([*studies, *(path for path, stated_there in files if stated_there is None)]), None)


def answered(study: Study, answers_to: Callable[[Sequence[Task]], list[Any]]) -> Report:
    """Return a study's report, its tasks being answered by a function."""
    tasks = next(study)
    while True:
        try:
            tasks = study.send(answers_to(tasks))
        except StopIteration as end:
            report: Report = end.value
            return report


def write_report(path: Path, name: str, report: Report, command: str) -> None:
    """Write a report, replacing `path` atomically.

    A column is `/tables/<name>/<field>`, a claim a row of the columns `/claims/<field>`, an exhibit
    `/exhibits/<chapter>/<key>`, a link to a file whatever the report says.
    """
    said = {"study": name, "command": report.command or command}
    said |= {"title": report.title, "lead": report.lead}
    with writing(path, {**said, "findings": report.findings, **provenance()}) as file:
        tables = file.create_group("tables", track_order=True)
        for key, table in report.tables.items():
            group = tables.create_group(key, track_order=True)
            state(group, {"title": table.title, "note": table.note, "shown": table.shown})
            write_table(group, table.rows)
        write_table(file.create_group("claims", track_order=True), report.claims)
        write_chapters(file.create_group("exhibits", track_order=True), report.chapters)
        for place, target in report.links.items():
            file[place] = h5py.ExternalLink(target, "/")


@dataclass(frozen=True)
class _Asked:
    """A task on its way to a process."""

    task: Task
    folder: Path
    code: str


@dataclass
class _Course:
    """A study under way: where its answers are kept and come from, and the seconds of those that it has."""

    journal: Journal
    folder: Path
    processes: Executor
    alone: Alone
    told: Tell
    page: Underway
    over: float = 0.0
    known: list[tuple[str, Any]] = field(default_factory=list)

    def tell(self, whole: float) -> None:
        """Say how far it is, on the page too."""
        self.page.show(self.known, self.over, whole)
        self.told(self.page.name, self.over, whole)

    def answers(self, tasks: Sequence[Task]) -> list[Any]:
        """The answers to a batch, each question asked once."""
        asked = [stated(task.ask) for task in tasks]
        keys = [key_of(task.work, said) for task, said in zip(tasks, asked, strict=True)]
        wanted = dict(zip(keys, tasks, strict=True))
        found = self.journal.answers({key: (task.answer, task.files) for key, task in wanted.items()})
        whole = self.over + sum(task.seconds for task in wanted.values()) + getattr(tasks, "later", 0.0)
        self.over += sum(wanted[key].seconds for key in found)
        self.known += ((_place(wanted[key]), answer) for key, answer in found.items())
        if len(found) < len(wanted):  # else nothing may be left to do: what is said first is the cost
            self.tell(whole)
        lost: list[str] = []
        raised: list[Exception] = []
        said = dict(zip(keys, asked, strict=True))
        for key, answer in self._results({key: task for key, task in wanted.items() if key not in found}):
            task = wanted[key]
            if isinstance(answer, _Raised):
                raised.append(answer.error)
            elif not isinstance(answer, Lost):
                self.journal.keep(key, said[key], answer, task.files)
                found[key] = answer
            elif task.lost:
                found[key] = task.lost(task.ask, answer)
            else:
                what = task.files[0] if task.files else said[key]
                lost.append(f"{task.work.__name__} of {what} ({answer.message})")
            self.over += task.seconds
            if key in found:
                self.known.append((_place(task), found[key]))
            self.tell(whole)
        if raised:
            raise raised[0]
        if lost:
            ends = f"{self.page.name}: {len(lost)} lost, {'; '.join(lost)}"
            raise UserError(f"{ends}; valid: the same command again, with --out {self.folder}")
        return [found[key] for key in keys]

    def _results(self, tasks: Mapping[str, Task]) -> Iterator[tuple[str, Any]]:
        """Yield what comes of tasks, by their keys: the longest begin first, those that are timed last."""
        folder, version = self.folder.resolve(), code()
        asked = {key: _Asked(task, folder, version) for key, task in tasks.items()}
        timed = [key for key in tasks if tasks[key].alone]
        if timed:
            prepare([__name__, *{tasks[key].work.__module__ for key in timed}], now=self.alone is work_alone)
        together = [key for key in tasks if not tasks[key].alone]
        together.sort(key=lambda key: (tasks[key].turn, -tasks[key].seconds))
        if together:
            for number, answer in self.processes.results(_work, [asked[key] for key in together]):
                yield together[number], answer
        for key in timed:
            yield key, self.alone(_work, asked[key])


def _place(task: Task) -> str:
    """The file that a task leaves; empty without one."""
    return next(iter(task.files), "")


@dataclass(frozen=True)
class _Raised:
    """In place of an answer: what was raised, so that others are waited for and kept."""

    error: Exception


def _work(asked: _Asked) -> Any:
    """In a process: UserError where its code is not that of the one that asks."""
    check_code(asked.code)
    with ONE_AT_A_TIME:
        try:
            return asked.task.work(asked.task.ask, asked.folder)
        except Exception as error:
            return _Raised(portable(error))
