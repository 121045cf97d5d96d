"""Runs that are as accurate as asked: elements as the climb chooses them, volumes refined level by level."""

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.errors import Ending, UserError
from actin_xcheck.core.files import make_folder
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs.accuracy import levels_of
from actin_xcheck.runs.method import Method, find_method, find_methods
from actin_xcheck.runs.numerics import CHOSEN, DEFAULT_REFINE, DEFAULT_STEPS, Numerics, Wanted, run_seconds
from actin_xcheck.runs.numerics import command as typed
from actin_xcheck.runs.store import annotate, read_run
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.stored import COMPANIONS, Ran, Stored, delivered_run
from actin_xcheck.studies.study import Batch, Task
from actin_xcheck.verdicts.triangulate import QUANTITIES, RELATIVE, Levels, estimate, reaches

COARSEST, FINEST = 4, 7
"""Refinement of the meshes that are tried, each with the coarser ones that give its uncertainty."""

STATED = 0.2
"""Seconds in which a level's uncertainties are found, about."""

_WHOLE = Fidelity.FULL
"""What is compared is the whole model: that a part is exact is one of the things to be seen."""


@dataclass(frozen=True)
class Climb:
    """A question: a scene by the elements, as accurate as asked, into a file; see `Stored`."""

    scene: Scene
    accuracy: float
    file: str
    pictures: int

    @property
    def task(self) -> Task:
        """What makes it, in the time of the first two levels where the scene is smooth."""
        every = levels_of(self.scene, Wanted(CHOSEN, fidelity=_WHOLE, accuracy=self.accuracy))
        seconds = sum(run_seconds(one, self.scene.output_times) for one in every)
        return Task(climbed, self, seconds, (self.file,))


@dataclass(frozen=True)
class Climbed:
    """What the climb has chosen, and how its run ended."""

    method: str
    refine: int
    rtol: float
    outcome: str
    message: str
    seconds: float


def climbed(asked: Climb, folder: Path) -> Climbed:
    """Run to the accuracy; where that is out of reach the file has what was reached."""
    path, began = folder / asked.file, time.perf_counter()
    make_folder(path.parent)
    wanted = {"method": CHOSEN, "accuracy": asked.accuracy, "fidelity": _WHOLE}
    made = typed("run", asked.scene.origin, **wanted, out=path.name)
    how = {"wanted": _WHOLE, "pictures": asked.pictures}
    said = delivered_run(asked.scene, asked.accuracy, path, made, **how).attributes
    return Climbed(
        method=str(said["method_name"]),
        refine=int(said["refine"]),
        rtol=float(said["rtol"]),
        outcome=str(said["outcome"]),
        message=str(said["message"]),
        seconds=time.perf_counter() - began,
    )


@dataclass(frozen=True)
class AskedError:
    """A question: a level and the coarser ones beside it, finest first, and the accuracy they are run for."""

    levels: tuple[Stored, ...]
    accuracy: float


@dataclass(frozen=True)
class StatedError:
    """The largest error that levels state, as an accuracy is meant; nan where one has none.

    `ended` says whether the two finest have both ended before their time: then it is the model that ends.
    """

    error: float
    ended: bool


def stated(asked: AskedError, folder: Path) -> StatedError:
    """Say how well the finest level is known; its file then says what it was run for."""
    scene, method = asked.levels[0].scene, asked.levels[0].numerics.method
    levels = Levels(method, tuple(read_run(folder / job.file) for job in asked.levels))
    largest = 0.0
    for quantity in QUANTITIES:
        last_only = quantity == "growth_rate"
        for t in scene.output_times[-1:] if last_only else scene.output_times:
            if (last_only and not scene.expect.growth_rate) or not reaches(levels.runs[0], t):
                continue
            values, error, *_ = estimate(scene, levels, quantity, t)
            size = float(np.abs(values).max(initial=0.0)) if quantity in RELATIVE else 1.0
            if values.size:
                largest = float(np.maximum(largest, error / size))
    annotate(levels.runs[0].path, {"accuracy": asked.accuracy})
    ended = all(run.attributes["outcome"] != Ending.COMPLETED for run in levels.runs[:2])
    return StatedError(largest, ended)


def checked(methods: Sequence[str]) -> Sequence[str]:
    """Names of methods that can be asked for an accuracy, as they are; UserError for others."""
    others_of(methods)
    return methods


def others_of(methods: Sequence[str]) -> list[Method]:
    """The methods that are run level by level; UserError for elements, and for one without an order."""
    found = find_methods([name for name in methods if name != CHOSEN])
    for method in found:
        if method.family == "fem" or not method.order_h:
            why = "elements are chosen" if method.family == "fem" else "it declares no order in space"
            raise UserError(
                f"--accuracy: not with --method {method.name}, for {why}; "
                f"valid: {CHOSEN}, and methods of other codes that declare an order, as fv"
            )
    return found


def accurate(
    scenes: Sequence[Scene], methods: Sequence[str], accuracy: float, pictures: int
) -> Generator[Sequence[Task], list[Any], list[tuple[tuple[Stored, Ran], ...]]]:
    """Ask for runs until every number is known to the accuracy, or there is no finer mesh.

    Returns of each scene by each method the run that is, and the coarser ones beside it, with how they ended.

    Parameters
    ----------
    scenes, accuracy : what is run, and the largest error of area, total actin, probes and growth rate.
    methods : names; "fem" is whichever of the elements' reaches it.
    pictures : of the films.
    """
    others = others_of(methods)
    climbs = [Climb(scene, accuracy, f"{scene.name}--{CHOSEN}.vtkhdf", pictures) for scene in scenes]
    climbs = climbs if CHOSEN in methods else []
    last = {
        (scene.name, one.name): _levels(scene, one, COARSEST, pictures) for scene in scenes for one in others
    }
    jobs = [job for levels in last.values() for job in levels]
    later = sum(_finer(levels)[0].seconds for levels in last.values())
    chosen, ran = yield from _answers(climbs, jobs, later)
    levels = dict(last)
    while levels:
        asked = [Task(stated, AskedError(one, accuracy), STATED) for one in levels.values()]
        errors: list[StatedError] = yield asked
        last |= levels
        levels = {
            key: _finer(one)
            for (key, one), said in zip(levels.items(), errors, strict=True)
            if not (said.error <= accuracy or said.ended or one[0].numerics.refine >= FINEST)
        }
        _, more = yield from _answers([], [one[0] for one in levels.values()])
        ran |= more
    found = {key: tuple((job, ran[job.file]) for job in one) for key, one in last.items()}
    found |= {(one[0].scene.name, CHOSEN): (one,) for one in chosen}
    return [found[scene.name, name] for scene in scenes for name in dict.fromkeys(methods)]


def _answers(
    climbs: Sequence[Climb], jobs: Sequence[Stored], later: float = 0.0
) -> Generator[Sequence[Task], list[Any], tuple[list[tuple[Stored, Ran]], dict[str, Ran]]]:
    """Ask for runs; what was chosen stands as a run that was asked for, others by their files."""
    tasks = [*(one.task for one in climbs), *(one.task for one in jobs)]
    answers = (yield Batch(tasks, later)) if tasks else []
    chosen = [
        (
            Stored(
                one.scene,
                Numerics(find_method(said.method), said.refine, one.scene.time.end, said.rtol),
                one.file,
                pictures=one.pictures,
            ),
            Ran(said.outcome, said.message, said.seconds),
        )
        for one, said in zip(climbs, answers, strict=False)
    ]
    return chosen, dict(zip((job.file for job in jobs), answers[len(climbs) :], strict=True))


def _levels(scene: Scene, method: Method, refine: int, pictures: int) -> tuple[Stored, ...]:
    """A run, and those on meshes twice and four times as coarse: errors in space and in time grow alike."""
    found = []
    for times in range(COMPANIONS + 1):
        coarser = DEFAULT_REFINE - (refine - times)
        dt = scene.time.end / DEFAULT_STEPS * 2.0 ** (coarser * method.order_h / method.order_dt)
        file = f"{scene.name}--{method.name}--refine-{refine - times}.vtkhdf"
        numerics = Numerics(method, refine - times, dt)
        found.append(Stored(scene, numerics, file, pictures=pictures))
    return tuple(found)


def _finer(levels: Sequence[Stored]) -> tuple[Stored, ...]:
    """The same a level further."""
    one = levels[0]
    return _levels(one.scene, one.numerics.method, one.numerics.refine + 1, one.pictures)
