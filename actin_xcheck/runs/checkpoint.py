"""Runs that are interrupted: when their checkpoints are written, and what goes on from one."""

import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Solver
from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.core.files import unfinished
from actin_xcheck.core.outcome import COMPLETED, Ending, Outcome
from actin_xcheck.runs.march import Checkpoint
from actin_xcheck.runs.store import Attributes, Run, RunWriter, read_run

REST = 50.0
"""Time from one checkpoint to the next, over what the one took to write: together they cost a run 2 %."""


class Keeper:
    """Writes a run's checkpoints: where it begins, then seldom enough to cost little, and where it stops.

    Parameters
    ----------
    solver, writer : of the run.
    began : when it would have begun had it never been interrupted, by `time.perf_counter`.
    stop : says whether it has to stop.
    """

    def __init__(
        self, solver: Solver, writer: RunWriter, began: float, stop: Callable[[], int] = lambda: 0
    ) -> None:
        self._solver, self._writer, self._began, self._stop = solver, writer, began, stop
        self._due = began

    def __call__(self, checkpoint: Checkpoint) -> Outcome:
        """Write a checkpoint if one is due; `interrupted` if the run has to stop there."""
        now, asked = time.perf_counter(), self._stop()
        here = Outcome(Ending.INTERRUPTED, f"at t = {checkpoint.state.t:.6g}; run with --resume goes on")
        if asked or now >= self._due:
            arrays = {**self._solver.memento(checkpoint.state), "pace": np.array(checkpoint.pace or ())}
            self._writer.checkpoint(arrays, here, now - self._began)
            written = time.perf_counter()
            self._due = written + REST * (written - now)
        return here if asked else COMPLETED


def earlier(path: Path, attributes: Attributes) -> Run | None:
    """Return what there is of the run that `path` is for: interrupted, or finished; None without either.

    Raises
    ------
    UserError : what is there is not whole, or another run; the sentence says what differs.
    """
    file = next((one for one in (unfinished(path), path) if one.exists()), None)
    if file is None:
        return None
    run = read_run(file)
    for name, value in attributes.items():
        stored = run.attributes.get(name)
        if name == "versions":
            stored, value = _unlike(str(stored), str(value))
        if name != "command" and stored != value and not (stored != stored and value != value):  # nan
            raise UserError(
                f"--resume: {file} holds another run, its {name} is {_shown(stored)}, not {_shown(value)}; "
                "valid: the same run, or --force to begin again"
            )
    return run


def _unlike(stored: str, now: str) -> tuple[str, str]:
    """The versions that differ, as they were and are; an update of the system changes no bit."""
    try:
        old, new = json.loads(stored), json.loads(now)
        names = sorted(name for name in {*old, *new} - {"platform"} if old.get(name) != new.get(name))
        was, is_now = (", ".join(f"{name} {one.get(name)}" for name in names) for one in (old, new))
    except (ValueError, TypeError, AttributeError):  # a damaged attribute
        return stored, now
    return was, is_now


def taken_up(solver: Solver, writer: RunWriter) -> Checkpoint:
    """Return the checkpoint that an interrupted run goes on from; UserError where it is not the solver's."""
    try:
        arrays = writer.last_checkpoint()
        pace = tuple(arrays["pace"].tolist())
        return Checkpoint(solver.restored(arrays), pace or None)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        reason = str(error).strip("'\"")
        raise UserError(
            f"--resume: the checkpoint is not whole ({reason}); valid: --force to begin again"
        ) from error


def _shown(value: object) -> str:
    """A value in a mistake's line."""
    return brief(f"{value:g}" if isinstance(value, float) else str(value))
