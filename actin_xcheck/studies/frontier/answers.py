"""What a run answers, what a converged one answers, and what a run is worth by how far they are apart."""

import math
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Probes
from actin_xcheck.core.errors import Ending
from actin_xcheck.runs.accuracy import LEVELS, AccuracyLevel, estimated
from actin_xcheck.runs.numerics import Numerics, chosen_steps, seconds_of
from actin_xcheck.runs.processes import Lost
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.resolve import probe_points
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.frontier.planes import MOST_STEPS, Point
from actin_xcheck.studies.stored import LastState, last_state, leave_scene

BOUND = 1e-2
"""A completed run whose error is larger is silently wrong."""

TIME_BOUND = 0.1
"""Where the model ends, the largest relative error of the time at which a run says so."""

TRUTH_LEVELS = (1, 4)
"""Which of `LEVELS` converged runs are made on, the first and one behind; each is held against the last."""

TRUTH_SHARE = 0.1
"""Of a bound, the part that may be left to the truth's own uncertainty before a finer level is tried."""

TRUTH_MOST = 0.5
"""Of a bound, the part at which it decides nothing any more."""


@dataclass(frozen=True)
class PlaceTruth:
    """The answer of a converged run, by the finest level that was needed.

    Attributes
    ----------
    answer : of that level.
    level : its method, mesh and tolerance in words.
    uncertainty : estimated error; of a model that ends, the relative one of the time. nan where two levels
        do not end alike.
    """

    answer: LastState
    level: str
    uncertainty: float

    @property
    def bound(self) -> float:
        """What errors against it are held to."""
        return BOUND if self.answer.completed else TIME_BOUND

    @property
    def known(self) -> bool:
        """Whether it can decide anything: levels end alike, of nothing but the model."""
        ended = self.answer.ending in (Ending.COMPLETED, Ending.SINGULAR_DILATION)
        return ended and self.uncertainty <= TRUTH_MOST * self.bound


def lost_answer(asked: object, lost: Lost) -> LastState:
    """The answer of a run whose processes ended under it: a failure of which nothing else is known."""
    unknown = dict.fromkeys(("t", "area", "total_actin", "residual", "seconds"), math.nan)
    return LastState(str(Ending.INTERRUPTED), lost.message, a=(), x=(), steps=0, **unknown)


def lost_truth(asked: "ConvergedPlace", lost: Lost) -> PlaceTruth:
    """The same of a converged run: a truth that decides nothing."""
    return PlaceTruth(lost_answer(asked, lost), "", float("nan"))


ERRORS = ("area", "total_actin", "a", "x")
"""Kinds of errors: relative for integrals, root mean square over the cloud for concentrations (relative) and
positions (in radii of the disk)."""


def errors_between(answer: LastState, truth: LastState) -> tuple[float, ...]:
    """The errors of `ERRORS` between two completed runs."""
    a, x = np.subtract(answer.a, truth.a), np.subtract(answer.x, truth.x).reshape(-1, 2)
    return (
        abs(answer.area / truth.area - 1),
        abs(answer.total_actin / truth.total_actin - 1),
        float(np.linalg.norm(a) / np.linalg.norm(truth.a)),
        float(np.sqrt((x**2).sum(axis=1).mean())),
    )


def answer_of(point: Point, folder: Path) -> LastState:
    """Run a point in memory with equal steps, and leave its scene, which the point's command names."""
    leave_scene(folder, point.file, point.scene)
    return _run(_parsed(point.scene), point.numerics)


@dataclass(frozen=True)
class ConvergedPlace:
    """A scene (TOML) whose truth is asked for, by which of `accuracy.LEVELS`: the first and one behind."""

    scene: str
    levels: tuple[int, int] = TRUTH_LEVELS

    @property
    def seconds(self) -> float:
        """About what it takes where the first two levels agree."""
        return sum(
            seconds_of(one.method, one.refine, chosen_steps(one.method, one.rtol))
            for one in LEVELS[self.levels[0] :][:2]
        )


def truth_of(asked: ConvergedPlace, folder: Path) -> PlaceTruth:
    """Run a scene on finer and finer levels until two agree to `TRUTH_SHARE` of the bound."""
    answers: list[LastState] = []
    truth: PlaceTruth | None = None
    first, behind = asked.levels
    scene, levels = _parsed(asked.scene), LEVELS[first:behind]
    for level in levels:
        numerics = level.on(scene)
        answers.append(_run(scene, numerics))
        if len(answers) > 1:
            words = f"{level.method.name}, {numerics.words}"
            truth = PlaceTruth(answers[-1], words, _uncertainty(answers, levels))
            if truth.uncertainty <= TRUTH_SHARE * truth.bound:
                break
    assert truth is not None
    return truth


def _parsed(text: str) -> Scene:
    return parse_scene(text, "a point of the plane")


def _uncertainty(answers: Sequence[LastState], levels: Sequence[AccuracyLevel]) -> float:
    """Of the last level, by the changes to it and to those before."""
    changes = [_change(one, other) for one, other in pairwise(answers)]
    return estimated(changes, [level.share for level in levels[1 : len(answers)]])


def _change(coarse: LastState, fine: LastState) -> float:
    if coarse.ending != fine.ending:
        return float("nan")
    return max(errors_between(coarse, fine)) if fine.completed else abs(coarse.t / fine.t - 1)


_PROBES: dict[Hashable, Probes] = {}
"""What reads the cloud off states, by method, mesh and points: finding them takes longer than many a run."""


def _run(scene: Scene, numerics: Numerics) -> LastState:
    began, solver = time.perf_counter(), bind(scene, numerics)
    where = (numerics.method.name, numerics.refine, scene.parameters.l0, scene.domain.rotation)
    if (key := (*where, scene.probes.points)) not in _PROBES:
        _PROBES[key] = solver.probes(probe_points(scene))
    return last_state(solver, numerics, scene.output_times, _PROBES[key], began)


class AnswerKind(StrEnum):
    """The classes of runs; those that fail have their Outcome for a class too."""

    ACCURATE = "accurate"
    SILENT = "silently wrong"
    """It completes, and is further from the truth than the bound, or goes on where the model has ended."""
    ENDS = "ends with the model"
    """It fails with a singular dilation, as the converged run does near the same time: that is right."""
    FAILED = "failed"
    UNKNOWN = "truth unknown"
    """Converged runs do not agree closely enough to judge by."""
    NOT_RUN = "not run"
    """More steps than the budget of a point."""


_WORDS = dict(zip(ERRORS, ("area", "total actin", "concentration", "positions"), strict=True))


@dataclass(frozen=True)
class JudgedAnswer:
    """A run's class and why.

    Attributes
    ----------
    kind : its class.
    ending : its Outcome where it failed, else empty.
    errors : of `ERRORS`, nan each where they mean nothing.
    sentence : what happened, in words.
    """

    kind: AnswerKind
    ending: str
    errors: tuple[float, ...]
    sentence: str

    @property
    def label(self) -> str:
        """The class with the Outcome of a failure: what borders separate and colours show."""
        return f"{self.kind}: {self.ending}" if self.kind is AnswerKind.FAILED else str(self.kind)

    @property
    def error(self) -> float:
        """The largest of the errors, nan where they mean nothing."""
        return max(self.errors)


_NO_ERRORS = (float("nan"),) * len(ERRORS)

NOT_RUN = JudgedAnswer(AnswerKind.NOT_RUN, "", _NO_ERRORS, f"not run: more than {MOST_STEPS} steps")
"""Of points beyond the budget."""


def judge(point: Point, answer: LastState, truth: PlaceTruth) -> JudgedAnswer:
    """Hold a run against the truth at its psi and p."""
    ending, reference = "" if answer.completed else answer.ending, truth.answer
    if not truth.known:
        sentence = f"the truth is not known here: {why_unknown(truth)}"
        return JudgedAnswer(AnswerKind.UNKNOWN, "", _NO_ERRORS, sentence)
    if reference.completed and answer.completed:
        errors = errors_between(answer, reference)
        worst = max(range(len(errors)), key=errors.__getitem__)
        kind = AnswerKind.ACCURATE if errors[worst] <= truth.bound else AnswerKind.SILENT
        sentence = (
            f"completes with area {answer.area:.4g} for {reference.area:.4g}; "
            f"largest error {errors[worst]:.2g}, of the {_WORDS[ERRORS[worst]]}"
        )
        return JudgedAnswer(kind, "", errors, sentence)
    if answer.completed:
        sentence = f"completes, though the model ends at t = {reference.t:.4g}: {reference.message}"
        return JudgedAnswer(AnswerKind.SILENT, "", _NO_ERRORS, sentence)
    if not reference.completed and _ends_with(point, answer, reference):
        sentence = f"ends with the model, whose end is t = {reference.t:.4g}: {answer.message}"
        return JudgedAnswer(AnswerKind.ENDS, "", _NO_ERRORS, sentence)
    at = f" at t = {answer.t:.4g}" if math.isfinite(answer.t) else ""  # of a lost process nobody knows
    beside = "" if reference.completed else f", while the model ends at t = {reference.t:.4g}"
    sentence = f"{ending}{at}{beside}: {answer.message}"
    return JudgedAnswer(AnswerKind.FAILED, ending, _NO_ERRORS, sentence)


def _ends_with(point: Point, answer: LastState, reference: LastState) -> bool:
    """Whether a failure is the model's own end, as nearly in time as the run's step can tell."""
    too_late, too_early = answer.t - reference.t, reference.t - (answer.t + point.dt)
    near = max(too_late, too_early) <= TIME_BOUND * reference.t
    return near and answer.ending == Ending.SINGULAR_DILATION


def why_unknown(truth: PlaceTruth) -> str:
    """In words, of a truth that is not known."""
    if truth.answer.ending not in (Ending.COMPLETED, Ending.SINGULAR_DILATION):
        return f"the converged run ends with {truth.answer.ending}: {truth.answer.message}"
    if truth.uncertainty != truth.uncertainty:
        return "converged runs do not end alike"
    return f"the converged run is uncertain by {truth.uncertainty:.2g}"
