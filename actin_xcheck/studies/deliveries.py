"""Is what `--accuracy` delivers as good as asked, and is its estimate worth its name?

Scenes that were drawn, by a seed that nobody tuned to, and modes are run to accuracies.  True errors are the
distance to a run that was asked for much more, of a mode that of its rate to the exact one.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import numpy as np

from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.errors import Ending
from actin_xcheck.runs.accuracy import change
from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.growth import fitted_rate
from actin_xcheck.runs.numerics import command
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.coverage import GENEROUS, RESOLVED, TRIVIAL, drawn
from actin_xcheck.studies.random_scenes import seed_of_today
from actin_xcheck.studies.stored import delivered_run
from actin_xcheck.studies.study import Report, Study, Table, Task
from actin_xcheck.theory.eigenfields import growth_rate

MODES = (
    "mode-11-wall",
    "mode-0-cell",
    "mode-1-cell",
    "mode-1-free-cell",
    "mode-1-viscous-cell",
    "mode-2-cell",
)

BETTER, BEST = 0.03, 1e-8
"""Of the smallest accuracy asked for, that of the run that stands for the truth; the least that it is."""

MISSED, FLATTERED = 0.01, 1.1
"""Share of deliveries that may be worse than asked, and the largest true error over its estimate."""

SECONDS = 60.0
"""What a scene takes, about."""


@dataclass(frozen=True)
class AskedDeliveries:
    """A question: a scene and the accuracies to which it is run."""

    scene: Scene
    accuracies: tuple[float, ...]


@dataclass(frozen=True)
class Delivery:
    """What came of an accuracy.

    Attributes
    ----------
    scene, accuracy : what was asked.
    outcome, method, refine, rtol : the run that was delivered.
    estimate, error : of its largest error, and the true one; nan where it did not come to its end.
    known_to : the estimated error of the truth.
    seconds : of processor time.
    """

    scene: str
    accuracy: float
    outcome: str
    method: str
    refine: int
    rtol: float
    estimate: float
    error: float
    known_to: float
    seconds: float

    @property
    def counts(self) -> bool:
        """Whether the run ended, and the truth is known so much better that the true error is."""
        return bool(max(self.estimate, self.error) > RESOLVED * self.known_to)

    @property
    def missed(self) -> bool:
        """Whether it is worse than asked, by what is true or by what it says."""
        return not max(self.estimate, self.error) <= self.accuracy


@dataclass(frozen=True)
class Deliveries:
    """All of a scene."""

    rows: tuple[Delivery, ...]


def delivered(asked: AskedDeliveries, folder: Path) -> Deliveries:
    """Run a scene to every accuracy, and to a much better one where no exact rate is known."""
    scene = asked.scene
    whole = Fidelity.FULL if scene.expect.growth_rate else Fidelity.AUTO
    with TemporaryDirectory(dir=folder) as place:

        def best(accuracy: float) -> Run:
            return delivered_run(scene, accuracy, Path(place) / f"{accuracy:g}.vtkhdf", "", wanted=whole)

        truth = None if scene.expect.growth_rate else best(max(BETTER * min(asked.accuracies), BEST))
        rows = []
        for accuracy in asked.accuracies:
            began = time.process_time()
            run = best(accuracy)
            rows.append(_delivery(scene, accuracy, run, truth, time.process_time() - began))
    return Deliveries(tuple(rows))


def _delivery(scene: Scene, accuracy: float, run: Run, truth: Run | None, seconds: float) -> Delivery:
    said = run.attributes
    ended = all(one is None or one.attributes["outcome"] == Ending.COMPLETED for one in (run, truth))
    return Delivery(
        scene=scene.name,
        accuracy=accuracy,
        outcome=str(said["outcome"]),
        method=str(said["method_name"]),
        refine=int(said["refine"]),
        rtol=float(said["rtol"]),
        estimate=float(said["error_estimate"]) if ended else nan,
        error=_error(scene, run, truth) if ended else nan,
        known_to=0.0 if truth is None else float(truth.attributes["error_estimate"]),
        seconds=seconds,
    )


def _error(scene: Scene, run: Run, truth: Run | None) -> float:
    """The true error, as an accuracy is meant."""
    if truth is not None:
        return change(run, truth, scene.output_times)
    expected = scene.expect.growth_rate
    assert expected is not None
    rate = growth_rate(scene.physics, expected.m, expected.n)
    return abs(fitted_rate(scene, run) - rate) / (abs(rate) or 1.0)


def deliveries(scenes: Sequence[Scene], accuracies: Sequence[float], made: str) -> Study:
    """Hold what accuracies deliver against the truth; `made` is the command that makes the report again."""
    found: list[Deliveries] = yield [
        Task(delivered, AskedDeliveries(scene, tuple(accuracies)), SECONDS) for scene in scenes
    ]
    rows = [row for one in found for row in one.rows]
    counted = [row for row in rows if row.counts]
    good = sum(not row.missed for row in counted)
    shown = ("scene", "accuracy", "outcome", "method", "refine", "rtol", "estimate", "error", "seconds")
    return Report(
        title=f"{good} of {len(counted)} accuracies delivered",
        lead="What --accuracy delivers, held against a run that was asked for much more, of a mode against "
        "its exact rate.  Scenes that break down, and those whose truth is not known "
        f"{RESOLVED:g} times better, do not count.",
        tables={"deliveries": Table("Deliveries", rows, shown=shown)},
        claims=tuple(claims_of(counted, made)),
    )


def claims_of(rows: Sequence[Delivery], made: str) -> Iterator[Claim]:
    """That accuracies are delivered, that no estimate flatters, and that half of them are near the error."""

    def claim(quantity: str, statement: str, value: float, bound: float) -> Claim:
        return Claim(
            kind=ClaimKind.COVERAGE,
            quantity=quantity,
            scene="deliveries",
            methods=(),
            statement=f"of {len(rows)} accuracies {statement}",
            value=value,
            bound=bound,
            command=made,
            path="/tables/deliveries",
        )

    told = [row for row in rows if row.error > TRIVIAL]
    missed = float(np.mean([row.missed for row in rows])) if rows else 0.0
    yield claim("missed", "nearly all are delivered (share that is not)", missed, MISSED)
    flattered = max((row.error / row.estimate for row in told), default=0.0)
    yield claim("flattered", "no estimate is below the true error (largest over it)", flattered, FLATTERED)
    near = float(np.median([row.estimate / row.error for row in told])) if told else 0.0
    yield claim("generous", "half have an estimate near the true error (median over it)", near, GENEROUS)


@dataclass(frozen=True)
class DeliveriesOfTheDate:
    """A night's check: the first scenes that the date draws, to accuracies."""

    count: int
    accuracies: tuple[float, ...]
    bounded: ClassVar[bool] = False  # steps are chosen by their error

    @property
    def name(self) -> str:
        """The words of the command but for the seed."""
        asked = ", ".join(f"{accuracy:g}" for accuracy in self.accuracies)
        return f"accuracies {asked} of {self.count} scenes of the date"

    @property
    def seconds(self) -> float:
        """About what it takes on one core."""
        return SECONDS / 4 * self.count  # the large accuracies cost little

    def claims(self, folder: Path) -> list[Claim]:
        """Of all scenes together, but for how near estimates are: a few smooth scenes do not tell."""
        seed = seed_of_today()
        made = command("coverage", seed=seed, count=self.count, accuracy=self.accuracies)
        found = [
            delivered(AskedDeliveries(scene, self.accuracies), folder) for scene in drawn(seed, self.count)
        ]
        rows = [row for one in found for row in one.rows if row.counts]
        return [claim for claim in claims_of(rows, made) if claim.quantity != "generous"]
