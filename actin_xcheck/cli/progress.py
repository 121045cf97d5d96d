"""How far a command is, on standard error: bars on a terminal, else a line now and then."""

import math
import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

SECONDS_BETWEEN_LINES = 10.0


class Progress:
    """Told of labels and steps; writes to standard error, nothing when quiet.

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
