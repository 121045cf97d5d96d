"""A run that is as accurate as asked: finer and finer levels until what changes between them is small.

Elements rise in order on few cells, then cells are halved.  Errors in time, which hardly depend on the mesh,
are measured first, on the coarsest one.  There e ~ N^-4 about in the number of steps N, so that of two runs

    |y_N - y_N'| = (1 - (N/N')^4) e_N,    e_N' = (N/N')^4 e_N.

Where e_N' is m times too large, m being small, a tolerance m^(5/4) times smaller is taken, unmeasured.  The
tolerance that was found serves all levels, whose steps are no longer than the longest there.  They are
nearly the same, and what changes from one to the next is the error of the coarser one in space, but for the
little that is left in the finer.  How little that is, the finer one's own polynomials tell: where their parts
of degrees k - 1 and k are q of those of degrees k - 3 and k - 2, two more degrees have left about q of the
error.  Of a lower degree on smaller cells they do not tell: all of the change is stated.
"""

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import Outcome, UserError
from actin_xcheck.core.files import publish
from actin_xcheck.core.lagrange import sizes_by_degree
from actin_xcheck.runs.fidelity import Fidelity, Reduction, reduced
from actin_xcheck.runs.growth import energy_growth, fitted_rate
from actin_xcheck.runs.march import Progress
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.numerics import Numerics, Wanted
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import Run, annotate, read_run
from actin_xcheck.scene.resolve import perturbation
from actin_xcheck.scene.scene import Scene

SHARE = 0.6
"""Of the last change, the part that may be left where nothing is known of how levels fall."""

BOTH = 0.5
"""The same where cells have been halved for a degree less, or two."""

LEAST, TIMES = 0.2, 2.0
"""Of the last change, the part that is left at least; times what a run's polynomials say that is left."""


@dataclass(frozen=True)
class AccuracyLevel:
    """A discretisation and how much better it is than the level before.

    Attributes
    ----------
    method, refine : elements and mesh.
    rtol : tolerance of a step that suits them where no accuracy is asked for.
    worth : about the error of a smooth scene in space; on the same cells at least `LEAST` of the one before.
    share : of the change to this level, the most that its own error is taken to be.
    """

    method: Method
    refine: int
    rtol: float
    worth: float
    share: float

    def on(self, scene: Scene) -> Numerics:
        """How the whole of a scene is run on it."""
        return Numerics(self.method, self.refine, scene.time.end, self.rtol)


LEVELS = (
    AccuracyLevel(METHODS["fem-p5-imex5"], 1, 1e-4, 1e-4, SHARE),
    AccuracyLevel(METHODS["fem-p7-imex5"], 1, 1e-5, 2e-5, BOTH),
    AccuracyLevel(METHODS["fem-p6-imex5"], 2, 1e-6, 1e-6, 0.25),
    AccuracyLevel(METHODS["fem-p8-imex5"], 2, 1e-7, 1e-8, 0.25),
    AccuracyLevel(METHODS["fem-p6-imex5"], 3, 1e-7, 6e-9, BOTH),
    AccuracyLevel(METHODS["fem-p8-imex5"], 3, 1e-8, 1e-10, 0.25),
    AccuracyLevel(METHODS["fem-p6-imex5"], 4, 1e-8, 6e-11, BOTH),
    AccuracyLevel(METHODS["fem-p8-imex5"], 4, 1e-9, 1e-12, 0.25),
)
"""Where a scene is smooth errors fall tenfold or more with the degree; where it is not, with the cells."""

LEVELS_ON_A_RAY = tuple(
    AccuracyLevel(METHODS["fem-p4-imex4"], refine, math.nan, 0.0, SHARE) for refine in (2, 3, 4, 5)
)
"""The same where the cell is axisymmetric: elements of degree 10 on a ray leave errors in time alone."""

SMALL = 0.1
"""Of the accuracy asked for, the part that a smaller model may use up."""

IN_TIME, AT_MOST = 0.5, 0.75
"""Of the accuracy asked for, the part that steps may use up; and may before yet smaller ones are tried."""

LOOSER, LOOSEST, TIGHTEST, FINER = 10.0, 1e-2, 1e-13, 0.03
"""Tolerances of a step: times the accuracy, to begin with; at most, at least, and from one to the next."""

BERTH, FALL = 2.0, 4
"""Times an error in time on the coarsest mesh, that on others, whose steps differ a little; once more where
it is not measured but follows from one that was.  The power of the number of steps with which it falls."""

REACH = 3.0
"""Times what steps may use up, an error that follows, up to which a smaller tolerance is taken unmeasured."""

MORE = 1.25
"""Times as many steps: with fewer a change says nothing, as where output times cut all steps short."""

FAR = 3.0
"""Times the accuracy asked for, an estimate at which a lower degree on smaller cells will not do either."""

LOWEST = 5
"""The least degree of which two parts tell how they fall: the constant and the slope are the scene's own."""

SEEN = 8
"""Steps in the window of a growth rate, at least: what is fitted needs six samples."""

COARSE, FINE = "coarse", "fine"
"""Names of runs that are not delivered."""

AGAIN = 0.01
"""Two meshes that fail alike, at times this close to each other, relative: then it is the model that ends."""


@dataclass(frozen=True)
class Delivered:
    """What was reached.

    Attributes
    ----------
    outcome : how the last run ended.
    level : the last one.
    reduction : how much of the model was solved.
    estimate : of the largest error of area and total actin (relative), concentrations and positions at the
        probes and the centroid (absolute) over the output times, and of the growth rate or the energy's
        growth that the scene expects (relative); nan where fewer than two levels completed.
    changes : largest change from level to level.
    """

    outcome: Outcome
    level: AccuracyLevel
    reduction: Reduction
    estimate: float
    changes: tuple[float, ...]


class OutOfReach(UserError):
    """No level is as accurate as asked."""


def deliver(
    scene: Scene,
    accuracy: float,
    path: Path,
    command: str,
    progress: Progress = lambda done, total: None,
    wanted: Fidelity = Fidelity.AUTO,
    pictures: int = 0,
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
    pictures : of its film, see `run`.

    Raises OutOfReach where the finest level does not reach it; the file then holds that level.
    """
    reduction = reduced(scene, LEVELS[-1].method, wanted, SMALL * accuracy)
    levels = LEVELS_ON_A_RAY if reduction.fidelity is Fidelity.RADIAL else LEVELS
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as folder:
        # a level is no answer: it stands beside until it is the last
        beside = Path(folder) / path.name

        def solve(level: AccuracyLevel, rtol: float, name: str, longest: float) -> tuple[Outcome, Run]:
            file = Path(folder) / name
            numerics = Numerics(level.method, level.refine, min(longest, scene.time.end), rtol, reduction)
            passing = name != path.name and not scene.expect.transient  # whose energy is that of frames
            outcome = run(scene, numerics, file, command, progress, passing=passing, pictures=pictures)
            return outcome, read_run(file)

        climb = _Climb(scene, accuracy, beside, reduction, solve)
        reached = climb.to_the_finest_needed(_that_serve(levels, accuracy))
        annotate(beside, {"accuracy": accuracy, "error_estimate": reached.estimate})
        publish(beside, path)
    if reached.outcome.ok and not reached.estimate <= accuracy:
        raise OutOfReach(
            f"--accuracy: {accuracy:g} is out of reach; "
            f"valid: {reached.estimate:.1e} or more, as {path} holds"
        )
    return reached


class _Climb:
    """Up the levels of one scene, with one tolerance of a step once it is found.

    Parameters
    ----------
    scene, accuracy, reduction : what is run, what for and how much of it.
    path : where the run of the last level is left.
    solve : runs a level with a tolerance and the longest step, and leaves it in a file beside `path`.
    """

    def __init__(
        self,
        scene: Scene,
        accuracy: float,
        path: Path,
        reduction: Reduction,
        solve: Callable[[AccuracyLevel, float, str, float], tuple[Outcome, Run]],
    ) -> None:
        self.scene, self.accuracy, self.reduction = scene, accuracy, reduction
        self.path, self.solve = path, solve
        # what linear modes leave out is the same on all levels: no change shows it
        self.neglected = SMALL * accuracy if reduction.fidelity is Fidelity.MODAL else 0.0
        rate, mode = scene.expect.growth_rate, scene.initial.eigenmode
        # a step's tolerance is relative to a = 1, what grows to how large it is
        size = perturbation(scene) if scene.expect.transient else mode.amplitude if rate and mode else 1.0
        self.rtol, self.in_time = float(f"{size * _loosest(accuracy):.3g}"), math.nan
        self.largest = float(np.ptp(rate.window)) / SEEN if rate else math.inf
        self.longest, self.shorter = self.largest, 1.0
        self.changes, self.shares = list[float](), list[float]()

    def to_the_finest_needed(self, levels: Sequence[AccuracyLevel]) -> Delivered:
        """Run levels until one is accurate enough, or two fail alike; the run of the last is left."""
        before: Run | None = None
        failed: Run | None = None
        estimate = math.nan
        for level in levels:
            if before and level.method.space < before.order and estimate > FAR * self.accuracy:
                continue
            # the first one to stand is never the last
            name = self.path.name if before or failed else COARSE
            reached = replace(level, rtol=self.rtol)
            outcome, now = self.solve(level, self.rtol, name, self.longest)
            estimate = math.nan
            if outcome.ok:
                if before is None or math.isnan(self.in_time):
                    now = self._with_tolerance(level, now)
                    self.longest = self.shorter * float(np.diff(now.series["time"]).max())
                else:
                    self.changes.append(self._change(before, now))
                    self.shares.append(self._share(level, before, now))
                    estimate = estimated(self.changes, self.shares) + self.in_time + self.neglected
                before = now
            if estimate <= self.accuracy or (not outcome.ok and failed and _alike(failed, now)):
                break
            failed = None if outcome.ok else now
            if failed and math.isnan(self.in_time):  # of what long steps make of an end nothing is known
                self.rtol = max(_finer(self.rtol), TIGHTEST)
        return Delivered(
            outcome=outcome,
            level=reached,
            reduction=self.reduction,
            estimate=estimate,
            changes=tuple(self.changes),
        )

    def _with_tolerance(self, level: AccuracyLevel, now: Run) -> Run:
        """A level's run with the tolerance at which steps use up no more than their part of the accuracy."""
        finer = self.rtol
        while True:
            finer = _finer(finer)
            outcome, better = self.solve(level, finer, FINE, self.largest)
            if not outcome.ok:
                return now
            fewer = len(now.series["time"]) / len(better.series["time"])
            tightest = FINER * finer < TIGHTEST
            if fewer * MORE > 1 and not tightest:
                continue
            fall = min(fewer, 1 / MORE) ** FALL
            error = self._change(now, better) / (1 - fall)
            self.in_time = BERTH * error
            if self.in_time <= IN_TIME * self.accuracy:
                return now
            self.rtol, now, self.in_time = finer, better, BERTH**2 * fall * error
            if self.in_time <= AT_MOST * self.accuracy or tightest:
                return now
            missed = self.in_time / (IN_TIME * self.accuracy)
            if missed <= REACH:  # another run would take longer than what levels save by it
                self.rtol = float(f"{finer * missed ** (-(FALL + 1) / FALL):.3g}")
                self.in_time, self.shorter = IN_TIME * self.accuracy, missed ** (-1 / FALL)
                return now

    def _share(self, level: AccuracyLevel, before: Run, now: Run) -> float:
        """Of the change to a level, the part that is its own error."""
        if now.order < LOWEST:  # of the ray's
            return level.share
        if now.order < before.order:  # halving cells may gain less than a lower degree loses
            return 1.0
        return min(level.share, max(LEAST, TIMES * _left(now)))

    def _change(self, coarse: Run, fine: Run) -> float:
        largest, expected = change(coarse, fine, self.scene.output_times), self.scene.expect
        for asked, measured in ((expected.growth_rate, fitted_rate), (expected.transient, energy_growth)):
            if asked:
                one, other = (measured(self.scene, run) for run in (coarse, fine))
                largest = float(np.maximum(largest, abs(one - other) / (abs(other) or 1.0)))
        return largest


def levels_of(scene: Scene, wanted: Wanted) -> list[Numerics]:
    """What is run for the accuracy that is wanted: all, where a scene is smooth."""
    assert wanted.accuracy is not None
    enough = next((n for n, one in enumerate(LEVELS[1:], 1) if one.worth <= wanted.accuracy), len(LEVELS) - 1)
    rtol = _loosest(wanted.accuracy)
    first, *others = _that_serve(LEVELS[: enough + 1], wanted.accuracy)
    runs = [(first, rtol), (first, _finer(rtol)), *((one, rtol) for one in others)]
    level = replace(wanted, dt=scene.time.end, accuracy=None)
    return [
        replace(level, method=one.method.name, refine=one.refine, rtol=rtol).on(scene) for one, rtol in runs
    ]


def _that_serve(levels: Sequence[AccuracyLevel], accuracy: float) -> list[AccuracyLevel]:
    """All but those that cannot be the last and that cells of a lower degree follow, which say too little."""
    followed = [after.method.space < one.method.space for one, after in pairwise(levels)]
    return [
        one
        for one, lower in zip(levels, [*followed, False], strict=True)
        if one is levels[0] or one.worth <= accuracy or not lower
    ]


def _loosest(accuracy: float) -> float:
    """The tolerance of a step to begin with."""
    return float(f"{min(LOOSEST, LOOSER * accuracy):.3g}")


def _left(run: Run) -> float:
    """What two more degrees leave of an error, by how parts of a run's polynomials fall with the degree."""
    fields = np.concatenate([run.a_points[:, None], run.u], axis=1)
    sizes = sizes_by_degree(run.order, fields[..., run.cells]).max(axis=(0, 1))
    largest = float(np.hypot(*sizes[-4:-2]))
    return float(np.hypot(*sizes[-2:])) / largest if largest else 0.0


def _finer(rtol: float) -> float:
    """The next tolerance, without digits that a product leaves."""
    return float(f"{FINER * rtol:.3g}")


def _alike(one: Run, other: Run) -> bool:
    """Whether two failed runs, the other one on smaller cells, ended in the same way at the same time."""
    same = one.attributes["outcome"] == other.attributes["outcome"]
    smaller = one.attributes["refine"] < other.attributes["refine"]
    ends = [run.series["time"][-1] for run in (one, other)]
    return bool(same and smaller and abs(ends[0] - ends[1]) <= AGAIN * ends[1])


def change(coarse: Run, fine: Run, times: Sequence[float]) -> float:
    """Largest change between two levels over the output times: of integrals relative, of others absolute."""
    largest = 0.0
    for t in times:
        one, other = (run.row_at(t) for run in (coarse, fine))
        for name in ("area", "total_actin"):
            largest = np.maximum(largest, abs(one[name] - other[name]) / other[name])
        for name in ("probe_a", "probe_x", "centroid"):
            largest = np.maximum(largest, np.abs(one[name] - other[name]).max(initial=0.0))
    return float(largest)


def estimated(changes: Sequence[float], shares: Sequence[float]) -> float:
    """Estimate the error of the last level from all changes so far, nan without any.

    Parameters
    ----------
    changes : from level to level, (n,).
    shares : of the levels that were changed to, see `AccuracyLevel`, (n,).

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
