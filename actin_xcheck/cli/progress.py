"""Progress of one or several runs: bars with the time left on a terminal, plain lines otherwise."""

import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

SECONDS_BETWEEN_LINES = 10.0


class Progress:
    """Told of labels and steps; writes to standard error, nothing when quiet."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        console = Console(stderr=True)
        self.bars = Bars(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            console=console,
            disable=quiet or not console.is_terminal,
        )
        self.tasks: dict[str, TaskID] = {}
        self.began: dict[str, float] = {}
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
        if self.bars.disable:
            self._line(label, done, total)
            return
        if label not in self.tasks:
            self.tasks[label] = self.bars.add_task(label, total=total)
        self.bars.update(self.tasks[label], completed=done)

    def _line(self, label: str, done: float, total: float) -> None:
        now = time.monotonic()
        began = self.began.setdefault(label, now)
        if self.quiet or (done < total and now - self.said.setdefault(label, now) < SECONDS_BETWEEN_LINES):
            return
        self.said[label] = now
        left = (now - began) / done * (total - done) if done else float("nan")
        print(f"{label}: {done / total:.0%}, {left:.0f} s left", file=sys.stderr, flush=True)
