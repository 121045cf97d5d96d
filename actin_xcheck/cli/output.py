"""What commands say: how far they are, and with `--json` one object on a line that says what came out."""

import json
import math
import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import BaseModel, ConfigDict

from actin_xcheck.core.claim import ClaimKind

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID


class Answer(BaseModel):
    """What every command says; numbers that are not finite are null.  Built when one is said."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, defer_build=True)


class ListedScene(BaseModel):
    """What a list says of a scene."""

    name: str
    citation: str
    model: str


class ScenesAnswer(Answer):
    """`scenes`."""

    command: Literal["scenes"] = "scenes"
    scenes: tuple[ListedScene, ...]


class SweepAnswer(Answer):
    """`sweep`."""

    command: Literal["sweep"] = "sweep"
    folder: str
    table: str
    """The table in CSV; beside it lies the same in HDF5."""
    page: str
    runs: int
    made: int
    """Runs that had no file before."""
    outcomes: dict[str, int]
    """How many runs ended how."""


class FilesAnswer(Answer):
    """`render` and `export`."""

    command: Literal["render", "export"]
    files: tuple[str, ...]
    times: tuple[float, ...]
    """The output times that were drawn or written."""


class RunAnswer(Answer):
    """`run`."""

    command: Literal["run"] = "run"
    file: str
    outcome: str
    message: str
    fidelity: str
    left_out: tuple[str, ...]
    """What was not solved, and why."""
    estimated_error: float | None = None
    """With --accuracy, the error that was reached."""


class Stated(BaseModel):
    """A number by one code or by theory; null where there is no uncertainty or no order to observe."""

    value: float
    uncertainty: float | None
    observed_order: float | None


class ScenesValue(BaseModel):
    """A number of a scene at its end by every code, and by theory where that knows it."""

    scene: str
    quantity: str
    words: str
    by: dict[str, Stated]
    """By method; theory under its name, such as "reference"."""
    codes_agree_to_percent: float | None
    theory_to_percent: float | None
    digits: int
    """How many of them to believe."""


class ReportAnswer(Answer):
    """Commands that write a report."""

    command: Literal[
        "compare", "converge", "chart", "frontier", "paper", "faults", "closures", "distort", "extremes",
        "random", "coverage", "judge", "predict report", "predict transient", "report",
    ]  # fmt: skip
    page: str
    verdicts: dict[str, int] = {}
    """How many of what was judged came out how; empty where nothing is judged."""
    findings: tuple[str, ...] = ()
    """What is said of single ones: those that fail first of all."""
    known_to_percent: dict[str, dict[str, float | None]] = {}
    """Of `compare`, by scene: the largest error of area and of total actin; null where not known."""
    values: tuple[ScenesValue, ...] = ()
    """Of `compare`: what the scenes come to."""


class CostAnswer(Answer):
    """Commands with `--dry-run`."""

    command: str
    tasks: int
    """What is asked for first; of some studies that decides what is asked for next."""
    seconds: float
    """About what it takes on the processes there are."""


class FailedClaim(Answer):
    """A claim that fails."""

    check: str
    group: str
    key: str
    """Its name, which is the same every night and whatever its statement says."""
    kind: ClaimKind
    quantity: str
    scene: str
    methods: tuple[str, ...]
    statement: str
    value: float
    bound: float
    note: str
    command: str
    file: str
    path: str


class NightAnswer(Answer):
    """`nightly`."""

    command: Literal["nightly"] = "nightly"
    night: str
    folder: str
    page: str
    green: bool
    fault: str
    """The deliberate fault that was on; empty without."""
    seconds: float
    claims: dict[str, int]
    """How many have which verdict."""
    failed: tuple[FailedClaim, ...]
    flaky: tuple[str, ...] = ()
    """Keys of claims that the same code has seen hold and fail, with their checks behind."""
    troubles: dict[str, str]
    """Checks that came to no verdict, and why."""
    not_run: dict[str, str]
    """Checks that were left out, and why."""
    checks: dict[str, float]
    """Those that were run, with their seconds."""
    commit: str
    machine: str


def conclude(answer: ReportAnswer, found: str, as_json: bool) -> None:
    """Say what a report found: one object, or its findings line by line, `found` and its page."""
    if as_json:
        say(answer)
        return
    for finding in answer.findings:
        print(finding)
    print(f"{found}; report: {answer.page}" if found else f"report: {answer.page}")


def say(answer: Answer) -> None:
    """Print an answer, in ASCII: what stands for other letters in a terminal's encoding is no JSON."""
    print(json.dumps(json.loads(answer.model_dump_json()), separators=(",", ":")))


def schemas() -> dict[str, dict[str, Any]]:
    """JSON Schemas of what the commands say, by the name of the class."""
    whole = [kind for kind in Answer.__subclasses__() if kind.__name__.endswith("Answer")]  # others are parts
    return {kind.__name__: kind.model_json_schema() for kind in whole}


SECONDS_BETWEEN_LINES = 10.0


class Progress:
    """How far a command is, on standard error: bars on a terminal, else a line now and then.

    Told of labels and steps; writes to standard error, nothing when quiet.

    Parameters
    ----------
    quiet : whether to write nothing.
    budget : seconds after which all is over, however much is left then.
    """

    def __init__(self, quiet: bool, budget: float = math.inf) -> None:
        self.quiet = quiet
        self.ends = time.monotonic() + budget
        self.bars = None if quiet or not sys.stderr.isatty() else _bars(self)
        self.tasks: dict[str, TaskID] = {}
        self.began: dict[str, tuple[float, float]] = {}
        self.done: dict[str, float] = {}
        self.said: dict[str, float] = {}
        self.whole: set[str] = set()

    def __enter__(self) -> Self:
        if self.bars:
            self.bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.bars:
            self.bars.stop()

    def report(self, label: str, done: float, total: float) -> None:
        """Parts done of parts in all for the work called `label`."""
        now = time.monotonic()
        if done < self.done.get(label, math.inf):  # it begins, or a batch after another does
            self.began[label] = now, done
        self.done[label] = done
        if not self.bars:
            self._line(label, done, total, now)
            return
        if label not in self.tasks:
            self.tasks[label] = self.bars.add_task(label, total=total)
        self.bars.update(self.tasks[label], completed=done, total=total)  # what is asked next has its own

    def say(self, sentence: str) -> None:
        """A line above what is told of progress."""
        if self.bars:
            self.bars.console.print(sentence, highlight=False, markup=False, soft_wrap=True)
        elif not self.quiet:
            print(sentence, file=sys.stderr, flush=True)

    def left(self, label: str, done: float, total: float) -> float:
        """Seconds until all is done at the pace so far, within the budget; inf where nothing tells."""
        now = time.monotonic()
        began, first = self.began[label]
        pace = (now - began) / (done - first) if done > first else math.inf
        return min(pace * (total - done) if done < total else 0.0, max(self.ends - now, 0.0))

    def _line(self, label: str, done: float, total: float, now: float) -> None:
        again = done < total or label in self.whole  # which a study that asks again comes to more than once
        if self.quiet or (again and now - self.said.setdefault(label, now) < SECONDS_BETWEEN_LINES):
            return
        self.said[label] = now
        if done >= total:
            self.whole.add(label)
        left = self.left(label, done, total)
        known = f", {left:.0f} s left" if math.isfinite(left) else ""
        print(f"{label}: {done / (total or 1):.0%}{known}", file=sys.stderr, flush=True)


def _bars(progress: Progress) -> "Bars":
    """A bar for each label, with the time that the progress says is left."""
    from rich.console import Console  # here: where nobody watches, nobody waits for it
    from rich.progress import BarColumn, ProgressColumn, Task, TaskProgressColumn, TextColumn
    from rich.progress import Progress as Bars
    from rich.text import Text

    class Left(ProgressColumn):
        def render(self, task: Task) -> Text:
            left = progress.left(task.description, int(task.completed), int(task.total or 0))
            return Text(f"{left:.0f} s left" if math.isfinite(left) else "")

    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), Left()
    return Bars(*columns, console=Console(stderr=True))
