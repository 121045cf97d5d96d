"""Studies carried out in this process, in turn."""

from actin_xcheck.runs.executor import Lost
from actin_xcheck.studies.study import carry_out


class InTurn:
    """Has no processes: an executor in the shape of `runs.executor.Executor`."""

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
