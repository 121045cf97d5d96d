"""What a worker does: one run, whose answer goes back to the process that asked for it."""

from dataclasses import dataclass

from actin_xcheck.runs.executor import Lost
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.version import ONE_AT_A_TIME, check_code
from actin_xcheck.studies.frontier.answers import Answer, Truth, answer_of, lost, truth_of
from actin_xcheck.studies.frontier.planes import REFINE, Point

_TRUTH = 200
"""Cost of a truth, in steps of the article's scheme on the standard mesh."""


@dataclass(frozen=True)
class Task:
    """A point, or a scene (TOML) whose truth is wanted, and the version of the code that asks."""

    what: Point | str
    code: str

    @property
    def cost(self) -> int:
        """About how long it takes, in steps of the article's scheme on the standard mesh; at least 1."""
        if isinstance(self.what, str):
            return _TRUTH
        method, cells = find_method(self.what.method), 4.0 ** (self.what.refine - REFINE)
        per_step = (1 + 2.5 * (method.order_dt - 1)) * (1 if method.family == "fem" else 3)
        return max(1, round(self.what.steps * per_step * cells * method.space**2))


def work(task: Task) -> Answer | Truth:
    """Do a task; UserError where this is not the code that asked for it."""
    check_code(task.code)
    with ONE_AT_A_TIME:
        return truth_of(task.what) if isinstance(task.what, str) else answer_of(task.what)


def without(task: Task, why: Lost) -> Answer | Truth:
    """In place of what a task finds, where every process ended under it: a failure that says so."""
    answer = lost(why.message)
    return Truth(answer, "", float("nan")) if isinstance(task.what, str) else answer
