"""One run of a sweep: what it is, the hash that names its file, and what a worker does with it."""

import hashlib
import json
import os
import socket
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.core.outcome import Ending
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Wanted, suited
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import reading
from actin_xcheck.runs.version import ONE_AT_A_TIME, check_code
from actin_xcheck.scene.scene import parse_scene

ERROR = "error"
"""In place of an Ending, where there is no run: an exception, or a process that ended, every time."""

LOG = "starts.log"
"""In a sweep's folder: a line for every run that was begun, with when and where."""

Row = Mapping[str, str | float]
"""What a sweep's table holds of a run, by column."""


@dataclass(frozen=True)
class Task:
    """A run to be made: a scene (TOML) and where that comes from, numerics, the folder, code and command."""

    text: str
    origin: str
    numerics: Wanted
    folder: Path
    code: str
    command: str

    @property
    def key(self) -> str:
        """The hash of scene, method and version."""
        method = asdict(find_method(self.numerics.method))
        stated = json.dumps([self.text, method, asdict(self.numerics), self.code], sort_keys=True)
        return hashlib.sha256(stated.encode()).hexdigest()[:24]

    @property
    def path(self) -> Path:
        """The run's file."""
        return self.folder / "runs" / f"{self.key}.vtkhdf"

    def check(self) -> None:
        """Raise UserError where the scene is none, or cannot be run like this."""
        suited(parse_scene(self.text, self.origin), self.numerics.refine, self.numerics.dt)


def work(task: Task) -> Row:
    """In a worker: make the run, unless its file is there, and return its row.

    UserError where the worker's code is not the one that the sweep was asked of.
    """
    check_code(task.code)
    with ONE_AT_A_TIME:
        try:
            if found := finished(task.path):  # by a worker that was lost before it could say so
                return found
            _log(task)
            _run(task)
            return finished(task.path) or failed("its file is gone")
        except Exception as error:  # one run's mistake must not end the others
            return failed(brief(f"{type(error).__name__}: {error}", 400))


def _run(task: Task) -> None:
    scene = parse_scene(task.text, task.origin)
    numerics = task.numerics.on(scene)
    task.path.unlink(missing_ok=True)  # what is there is not whole
    for resume in (True, False):  # a lost worker's checkpoint is of use to a machine like its own only
        try:
            run(scene, numerics, task.path, task.command, resume=resume)
            return
        except UserError:
            if not resume:
                raise


def _log(task: Task) -> None:
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    line = f"{now} {task.key} {socket.gethostname()} {os.getpid()}\n"
    with (task.folder / LOG).open("a", encoding="utf-8") as log:
        log.write(line)


def failed(message: str) -> Row:
    """The row of a run that has no file."""
    return {"outcome": ERROR, "message": message}


def finished(path: Path) -> Row | None:
    """The row of a whole file: how the run went and the last row of its series; None where there is none.

    Vectors and probes become one column each: `centroid_x`, `probe_a_0`, `probe_x_0_x`.
    """
    if not path.exists():
        return None
    try:
        with reading(path, "run") as file:
            run, series = file["run"], file["run/series"]
            names = ("outcome", "message", "refine", "dt", "rtol", "fidelity", "wall_seconds")
            stated = {name: run.attrs[name] for name in names}
            row: dict[str, Any] = {
                name: one.item() if isinstance(one, np.generic) else one for name, one in stated.items()
            }
            if Ending(row["outcome"]) is Ending.INTERRUPTED:
                return None
            row["steps"] = len(series["time"]) - 1
            for name, values in series.items():
                if name != "dt":  # the last step's: the asked one stands there
                    row |= _columns(name, values[-1])
    except UserError:
        return None
    return row


def _columns(name: str, value: Any) -> dict[str, float]:
    """A number or an array (2,), (k,) or (k, 2) of a row as named numbers."""
    value = np.asarray(value)
    if name == "probe_x":
        return {
            f"{name}_{i}_{axis}": float(one)
            for i, row in enumerate(value)
            for axis, one in zip("xy", row, strict=True)
        }
    if value.ndim:
        labels = "xy" if name in ("centroid", "net_force") else range(len(value))
        return {f"{name}_{label}": float(one) for label, one in zip(labels, value, strict=True)}
    return {name: float(value)}
