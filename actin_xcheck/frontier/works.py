"""What a worker does: one run, kept in the journal as soon as it is over."""

from dataclasses import dataclass

from actin_xcheck.frontier.answers import Answer, Truth, answer_of, truth_of
from actin_xcheck.frontier.journal import Journal
from actin_xcheck.frontier.planes import REFINE, Point
from actin_xcheck.registry import find_method
from actin_xcheck.workers import Report

_TRUTH = 200
"""Cost of a truth, in steps of the article's scheme on the standard mesh."""


@dataclass(frozen=True)
class Task:
    """A point, or a scene (TOML) whose truth is wanted, and where the answer is kept."""

    what: Point | str
    journal: Journal

    @property
    def cost(self) -> int:
        """About how long it takes, in steps of the article's scheme on the standard mesh; at least 1."""
        if isinstance(self.what, str):
            return _TRUTH
        method, cells = find_method(self.what.method), 4.0 ** (self.what.refine - REFINE)
        per_step = (1 + 2.5 * (method.order_dt - 1)) * (1 if method.family == "fem" else 3)
        return max(1, round(self.what.steps * per_step * cells * method.space**2))


def work(task: Task, report: Report) -> Answer | Truth:
    """Do a task, keep what was found and say so."""
    found = truth_of(task.what) if isinstance(task.what, str) else answer_of(task.what)
    task.journal.keep(task.what, found)
    report("", task.cost, task.cost)
    return found
