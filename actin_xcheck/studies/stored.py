"""Runs that a study rests on: those that leave film and series in its folder, those read off in memory."""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.contract import Probes, Solver
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.files import make_folder, replace_file
from actin_xcheck.runs.accuracy import OutOfReach, deliver
from actin_xcheck.runs.march import March, Progress
from actin_xcheck.runs.numerics import Numerics, run_seconds, step_count
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.study import Task

COMPANIONS = 2
"""Coarser runs beside each one; the first costs a sixteenth of it, the second shows the order."""


@dataclass(frozen=True)
class AskedRun:
    """A run that is asked for: what is run, and how."""

    scene: Scene
    numerics: Numerics

    @property
    def words(self) -> str:
        """How it is run, for a reader."""
        return f"{self.numerics.method.name}, {self.numerics.words}"

    @property
    def seconds(self) -> float:
        """About what it takes."""
        return run_seconds(self.numerics, self.scene.output_times)


@dataclass(frozen=True)
class Stored(AskedRun):
    """A run to be stored.

    Attributes
    ----------
    file : where it goes, in the study's folder.
    scene_file : where its scene is written for the run's command, in the study's folder; empty for a scene
        that is run as the user names it.
    pictures : of its film, see `run`.
    """

    file: str
    scene_file: str = ""
    pictures: int = 0

    @property
    def task(self) -> Task:
        """What makes it."""
        return Task(run_stored, self, self.seconds, tuple(filter(None, (self.file, self.scene_file))))


def companions_of(job: Stored, most: int = COMPANIONS) -> list[Stored]:
    """Return the job with h doubled once, twice, ... as far as the mesh allows."""
    return [_coarser(job, times) for times in range(1, most + 1) if job.numerics.refine > times]


def _coarser(job: Stored, times: int) -> Stored:
    """The job with h doubled so many times; its steps are the multiple that fits the output times best."""
    fine, method = job.numerics, job.numerics.method
    growth = 2.0 ** (times * method.order_h)
    intervals = [end - start for start, end in pairwise((0.0, *job.scene.output_times))]
    steps = [step_count(fine.dt, [length]) / growth ** (1 / method.order_dt) for length in intervals]
    dt = max(length / max(round(number), 1) for length, number in zip(intervals, steps, strict=True))
    rtol = None if fine.rtol is None else fine.rtol * growth
    file = f"{job.file.removesuffix('.vtkhdf')}--coarser-{times}.vtkhdf"
    coarser = replace(fine, refine=fine.refine - times, dt=dt, rtol=rtol)
    return replace(job, numerics=coarser, file=file, pictures=0)


@dataclass(frozen=True)
class Ran:
    """How a stored run ended, and what it took in seconds."""

    outcome: str
    message: str
    seconds: float


def leave_scene(folder: Path, file: str, text: str) -> Path:
    """Leave a scene in a study's folder, where the commands of its runs find it; return its path."""
    path = folder / file
    make_folder(path.parent)
    replace_file(path, text.encode())
    return path


def run_and_read(scene: Scene, numerics: Numerics, path: Path, made: str = "") -> Run:
    """Run into a file, by the command that is to be typed for it, and read it."""
    run(scene, numerics, path, made)
    return read_run(path)


def delivered_run(scene: Scene, accuracy: float, path: Path, made: str, **how: Any) -> Run:
    """Run to an accuracy, see `deliver`, and read; the file says so where that is out of reach."""
    with suppress(OutOfReach):
        deliver(scene, accuracy, path, made, **how)
    return read_run(path)


def run_stored(job: Stored, folder: Path, progress: Progress = lambda done, total: None) -> Ran:
    """Run, and store everything about it; `progress` is told of every step."""
    path, origin = folder / job.file, job.scene.origin
    make_folder(path.parent)
    if job.scene_file:
        origin = str(leave_scene(folder, job.scene_file, job.scene.text))
    made = job.numerics.command(origin, path.name)
    began = time.perf_counter()
    outcome = run(job.scene, job.numerics, path, made, progress, pictures=job.pictures)
    return Ran(str(outcome.ending), outcome.message, time.perf_counter() - began)


@dataclass(frozen=True)
class LastState:
    """What a run in memory says at its end, or in the last state that stood.

    Attributes
    ----------
    ending, message : its Outcome.
    t : the time it came to.
    area, total_actin : of the cell then.
    a, x : concentrations and positions (interleaved) of the points that were asked for.
    steps : that were made.
    residual : largest balance residual of one.
    seconds : what it took.
    """

    ending: str
    message: str
    t: float
    area: float
    total_actin: float
    a: tuple[float, ...]
    x: tuple[float, ...]
    steps: int
    residual: float
    seconds: float

    @property
    def completed(self) -> bool:
        """Whether it came to its end."""
        return self.ending == Ending.COMPLETED


def last_state(
    solver: Solver, numerics: Numerics, times: Sequence[float], probes: Probes, began: float
) -> LastState:
    """Run to the last of the times, or to where the run fails, and read its last state off.

    Parameters
    ----------
    solver, numerics, times : see `March`.
    probes : what reads the points that are asked for off a state.
    began : when the work on it did, by `time.perf_counter`.
    """
    march, residual = March(solver, numerics, times), 0.0
    for moment in march:
        residual = max(residual, abs(moment.state.balance_residual))
    with np.errstate(all="ignore"):  # what stood last may be as good as broken
        measured = solver.measure(march.state)
        a, x = probes(march.state)
    return LastState(
        ending=str(march.outcome.ending),
        message=march.outcome.message,
        t=float(march.state.t),
        area=measured.area,
        total_actin=measured.total_actin,
        a=tuple(a.tolist()),
        x=tuple(x.ravel().tolist()),
        steps=march.steps,
        residual=residual,
        seconds=time.perf_counter() - began,
    )
