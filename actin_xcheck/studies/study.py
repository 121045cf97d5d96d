"""What a study is, and how one is carried out.

A study is a generator.  It yields tasks, is sent their answers in the same order, may ask again, and returns
its report:

    def ripples(scene) -> Study:
        answers = yield [Task(measure, Case(scene.text, m), seconds=2.0) for m in range(2, 9)]
        return Report("Ripples", "How fast ...", {"ripples": Table("Ripples", answers)})

Everything else is done here, once: answers that the same code has given before are taken up again, others
come from this machine's cores or a cluster, the longest first, and are kept as they come; the report is
written to `<name>.h5`, of which alone its page is made.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_type_hints

import h5py

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.report.exhibit_file import write_chapters
from actin_xcheck.report.exhibits import Chapter
from actin_xcheck.runs.executor import Executor, Lost, portable
from actin_xcheck.runs.records import write_table
from actin_xcheck.runs.store import provenance, state, writing
from actin_xcheck.runs.version import ONE_AT_A_TIME, check_code, code
from actin_xcheck.studies.journal import FILE_NAME, Journal, key_of, stated

Tell = Callable[[str, float, float], None]
"""Told of a label, seconds of work that are over, and seconds in all, as they were expected."""


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
    lost : makes what stands in for the answer, of what was asked and why, where every process ended under it;
        without one the study cannot go on.
    """

    work: Callable[[Any, Path], Any]
    ask: Any
    seconds: float = 1.0
    files: tuple[str, ...] = ()
    lost: Callable[[Any, str], Any] | None = None

    @property
    def answer(self) -> type:
        """The class of its answer."""
        kind: type = get_type_hints(self.work)["return"]
        return kind


@dataclass(frozen=True)
class Table:
    """Rows of one dataclass, with a title and a note; `shown` are the fields that a page shows, else all."""

    title: str
    rows: Sequence[Any]
    note: str = ""
    shown: tuple[str, ...] = ()


@dataclass(frozen=True)
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
    """

    title: str
    lead: str
    tables: Mapping[str, Table] = field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    findings: tuple[str, ...] = ()
    chapters: tuple[Chapter, ...] = ()
    links: Mapping[str, str] = field(default_factory=dict)
    verdicts: Mapping[str, int] = field(default_factory=dict)


Study = Generator[Sequence[Task], list[Any], Report]


def counted(claims: Sequence[Claim], words: str) -> str:
    """A title that says how many of the claims that are judged hold."""
    judged = [claim for claim in claims if claim.judged]
    return f"{sum(claim.holds for claim in judged)} of {len(judged)} {words}"


def carry_out(name: str, study: Study, folder: Path, command: str, processes: Executor, tell: Tell) -> Report:
    """Carry a study out in a folder that exists, write its report and return it.

    Parameters
    ----------
    name : of the study; its file is `<name>.h5`.
    command : what makes it again.
    processes : what has processes for its tasks.
    tell : see `Tell`.

    Raises UserError where the folder has another study, and for tasks whose processes ended every time.
    """
    journal = Journal(folder, name)
    (folder / "index.html").unlink(missing_ok=True)  # none must stand beside what it is not made of
    report = answered(study, lambda tasks: _answers(tasks, journal, folder, processes, tell, name))
    write_report(folder / f"{name}.h5", name, report, command)
    return report


def carry_out_here(name: str, study: Study, folder: Path, command: str) -> Report:
    """Carry a study out in this process, where faults are seen, afresh, and write its report."""
    report = answered(study, lambda tasks: [task.work(task.ask, folder) for task in tasks])
    write_report(folder / f"{name}.h5", name, report, command)
    return report


def begin_anew(folder: Path) -> None:
    """Remove the answers that a folder has, and the report of its study; what else lies there stays."""
    (folder / FILE_NAME).unlink(missing_ok=True)
    if report := study_file(folder):
        report.unlink()


def study_file(folder: Path) -> Path | None:
    """The file of a study in a folder, or one that cannot be opened and may be it; None without either."""
    broken = None
    for path in sorted(path for path in Path(folder).glob("*.h5") if path.is_file()):
        try:
            with h5py.File(path) as file:
                if "study" in file.attrs:
                    return path
        except Exception:  # the library has its own for every way in which a file can be damaged
            broken = path
    return broken


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
    said = {"study": name, "command": command, "title": report.title, "lead": report.lead}
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


def _answers(
    tasks: Sequence[Task], journal: Journal, folder: Path, processes: Executor, tell: Tell, label: str
) -> list[Any]:
    """The answers to a batch, each question asked once."""
    if not tasks:
        return []
    wanted = {key_of(task.work, stated(task.ask)): task for task in tasks}
    answers = {
        key: journal.answer(key, task.answer)
        for key, task in wanted.items()
        if journal.whole(key, task.files)
    }
    answers = {key: answer for key, answer in answers.items() if answer is not None}
    open_ones = sorted((key for key in wanted if key not in answers), key=lambda key: -wanted[key].seconds)
    lost: list[str] = []
    raised: list[Exception] = []
    whole, over = sum(task.seconds for task in wanted.values()), sum(wanted[key].seconds for key in answers)
    tell(label, over, whole)
    asked = [_Asked(wanted[key], folder.resolve(), code()) for key in open_ones]
    for number, answer in processes.results(_work, asked):
        key = open_ones[number]
        task = wanted[key]
        if isinstance(answer, _Raised):
            raised.append(answer.error)
        elif not isinstance(answer, Lost):
            journal.keep(key, stated(task.ask), answer, task.files)
            answers[key] = answer
        elif task.lost:
            answers[key] = task.lost(task.ask, answer.message)
        else:
            what = task.files[0] if task.files else stated(task.ask)
            lost.append(f"{task.work.__name__} of {what} ({answer.message})")
        over += task.seconds
        tell(label, over, whole)
    if raised:
        raise raised[0]
    if lost:
        said = f"{label}: {len(lost)} lost, {'; '.join(lost)}"
        raise UserError(f"{said}; valid: the same command again, with --out {folder}")
    return [answers[key_of(task.work, stated(task.ask))] for task in tasks]


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
