"""A run that is as accurate as asked: finer and finer levels until what changes between them is small.

From level to level elements rise in order, then cells are halved, and the tolerance of a step falls by ten:
errors in space and in time fall together.  The change from one level to the next is the error of the coarser
one, but for the little that is left in the finer.
"""

import math
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.outcome import Outcome
from actin_xcheck.runs.fidelity import Fidelity, Reduction, reduced
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.recorder import Progress
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import Run, annotate, read_run
from actin_xcheck.scene.scene import Scene

SHARE = 0.6
"""Of the last change, the part that may be left where nothing is known of how levels fall."""


@dataclass(frozen=True)
class Level:
    """A discretisation and how much better it is than the level before.

    Attributes
    ----------
    method, refine, rtol : elements, mesh and tolerance of a step.
    share : of the change to this level, the part that its own error is taken to be: 1.2 to 2.5 times the most
        that was seen in 40 scenes whose finer levels are known; at refine 5 and on a ray none were.
    """

    method: Method
    refine: int
    rtol: float
    share: float


LEVELS = (
    Level(METHODS["fem-p2-imex3"], 2, 3e-4, math.nan),
    Level(METHODS["fem-p3-imex4"], 2, 3e-5, 0.2),
    Level(METHODS["fem-p4-imex4"], 2, 3e-6, SHARE),
    Level(METHODS["fem-p4-imex4"], 3, 3e-7, 0.25),
    Level(METHODS["fem-p4-imex4"], 4, 3e-8, 0.25),
    Level(METHODS["fem-p4-imex4"], 5, 3e-9, 0.25),
)
"""Errors fall tenfold or more from one level to the next, least from P3 to P4 on one mesh."""

LEVELS_ON_A_RAY = (
    Level(METHODS["fem-p4-imex4"], 2, 3e-5, math.nan),
    Level(METHODS["fem-p4-imex4"], 3, 3e-6, SHARE),
    Level(METHODS["fem-p4-imex4"], 3, 3e-7, SHARE),
    Level(METHODS["fem-p4-imex4"], 4, 3e-8, SHARE),
    Level(METHODS["fem-p4-imex4"], 4, 3e-9, SHARE),
    Level(METHODS["fem-p4-imex4"], 5, 3e-10, SHARE),
)
"""The same where the cell is axisymmetric: elements of degree 10 on a ray leave errors in time alone."""

SMALL = 0.1
"""Of the accuracy asked for, the part that a smaller model may use up."""


@dataclass(frozen=True)
class Delivered:
    """What was reached.

    Attributes
    ----------
    outcome : how the last run ended.
    level : the last one.
    reduction : how much of the model was solved.
    estimate : of the largest error of area and total actin (relative), concentrations and positions at the
        probes (absolute) over the output times; nan where fewer than two levels completed.
    changes : largest change from level to level.
    """

    outcome: Outcome
    level: Level
    reduction: Reduction
    estimate: float
    changes: tuple[float, ...]


def deliver(
    scene: Scene,
    accuracy: float,
    path: Path,
    command: str,
    progress: Progress = lambda done, total: None,
    wanted: Fidelity = Fidelity.AUTO,
) -> Delivered:
    """Run a scene on finer and finer levels until its estimated error is at most `accuracy`; keep the last.

    Parameters
    ----------
    scene : what to run; a model that breaks down is delivered as it ended.
    accuracy : largest error asked for, see `Delivered.estimate`.
    path : the `.vtkhdf` file to write.
    command : what reproduces it.
    progress : told of each level's run.
    wanted : how much of the model is solved.

    Raises UserError where the finest level does not reach it; the file then holds that level.
    """
    reduction = reduced(scene, LEVELS[-1].method, wanted, SMALL * accuracy)
    levels = LEVELS_ON_A_RAY if reduction.fidelity is Fidelity.RADIAL else LEVELS
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as folder:
        # a level is no answer: it stands beside until it is the last
        beside = Path(folder) / path.name
        reached = _finest_needed(scene, accuracy, beside, command, progress, levels, reduction)
        annotate(beside, {"accuracy": accuracy, "error_estimate": reached.estimate})
        os.replace(beside, path)
    if reached.outcome.ok and not reached.estimate <= accuracy:
        raise UserError(
            f"--accuracy: {accuracy:g} is out of reach; "
            f"valid: {reached.estimate:.1e} or more, as {path} holds"
        )
    return reached


def _finest_needed(
    scene: Scene,
    accuracy: float,
    path: Path,
    command: str,
    progress: Progress,
    levels: Sequence[Level],
    reduction: Reduction,
) -> Delivered:
    """Run levels until one is accurate enough, or fails; its run is left at `path`."""
    before: Run | None = None
    changes: list[float] = []
    # what linear modes leave out is the same on all levels: no change shows it
    neglected = SMALL * accuracy if reduction.fidelity is Fidelity.MODAL else 0.0
    for number, level in enumerate(levels):
        end = scene.time.end
        outcome = run(scene, level.method, level.refine, end, path, command, progress, level.rtol, reduction)
        now = read_run(path)
        if before is not None and outcome.ok:
            changes.append(change(before, now, scene.output_times))
        shares = [one.share for one in levels[1 : number + 1]]
        estimate = estimated(changes, shares) + neglected if outcome.ok else math.nan
        reached = Delivered(outcome, level, reduction, estimate, tuple(changes))
        if not outcome.ok or estimate <= accuracy:
            break
        before = now
    return reached


def change(coarse: Run, fine: Run, times: Sequence[float]) -> float:
    """Largest change between two levels over the output times: relative for integrals, absolute at probes."""
    largest = 0.0
    for t in times:
        one, other = (run.row_at(t) for run in (coarse, fine))
        for name in ("area", "total_actin"):
            largest = np.maximum(largest, abs(one[name] - other[name]) / other[name])
        for name in ("probe_a", "probe_x"):
            largest = np.maximum(largest, np.abs(one[name] - other[name]).max(initial=0.0))
    return float(largest)


def estimated(changes: Sequence[float], shares: Sequence[float]) -> float:
    """Estimate the error of the last level from all changes so far, nan without any.

    Parameters
    ----------
    changes : from level to level, (n,).
    shares : of the levels that were changed to, see `Level`, (n,).

    A change is the error of the level before, but for the little that is left.  Where it is larger than what
    that level's share had promised, levels do not resolve the scene yet: the next share is widened as much.
    """
    if not changes:
        return math.nan
    estimate = shares[0] * changes[0]
    for share, found in zip(shares[1:], changes[1:], strict=True):
        wider = 1.0 if found <= estimate else found / estimate if estimate > 0 else math.inf
        estimate = min(share * wider, 1.0) * found
    return estimate
