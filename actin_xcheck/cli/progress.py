"""Progress of one or several runs: bars with the time left on a terminal, plain lines otherwise."""

import math
import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TaskID, TaskProgressColumn, TextColumn
from rich.progress import Progress as Bars
from rich.text import Text

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
        console = Console(stderr=True)
        self.bars = Bars(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            _Left(self),
            console=console,
            disable=quiet or not console.is_terminal,
        )
        self.tasks: dict[str, TaskID] = {}
        self.began: dict[str, tuple[float, float]] = {}
        self.done: dict[str, float] = {}
        self.said: dict[str, float] = {}

    def __enter__(self) -> Self:
        self.bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.bars.stop()

    def report(self, label: str, done: float, total: float) -> None:
        """Parts done of parts in all for the work called `label`."""
        now = time.monotonic()
        if done < self.done.get(label, math.inf):  # it begins, or a batch after another does
            self.began[label] = now, done
        self.done[label] = done
        if self.bars.disable:
            self._line(label, done, total, now)
            return
        if label not in self.tasks:
            self.tasks[label] = self.bars.add_task(label, total=total)
        self.bars.update(self.tasks[label], completed=done, total=total)  # what is asked next has its own

    def say(self, sentence: str) -> None:
        """A line above what is told of progress."""
        if not self.quiet:
            self.bars.console.print(sentence, highlight=False, markup=False, soft_wrap=True)

    def left(self, label: str, done: float, total: float) -> float:
        """Seconds until all is done at the pace so far, within the budget; inf where nothing tells."""
        now = time.monotonic()
        began, first = self.began[label]
        pace = (now - began) / (done - first) if done > first else math.inf
        return min(pace * (total - done) if done < total else 0.0, max(self.ends - now, 0.0))

    def _line(self, label: str, done: float, total: float, now: float) -> None:
        if self.quiet or (done < total and now - self.said.setdefault(label, now) < SECONDS_BETWEEN_LINES):
            return
        self.said[label] = now
        left = self.left(label, done, total)
        known = f", {left:.0f} s left" if math.isfinite(left) else ""
        print(f"{label}: {done / (total or 1):.0%}{known}", file=sys.stderr, flush=True)


class _Left(ProgressColumn):
    """The time left of a bar."""

    def __init__(self, progress: Progress) -> None:
        super().__init__()
        self._progress = progress

    def render(self, task: Task) -> Text:
        left = self._progress.left(task.description, int(task.completed), int(task.total or 0))
        return Text(f"{left:.0f} s left" if math.isfinite(left) else "")
