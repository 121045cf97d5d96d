"""What errors are held against, how well that is known, the errors of a run, and what is worth its work."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from actin_xcheck.core.model import Array
from actin_xcheck.runs.accuracy import SHARE
from actin_xcheck.scene.resolve import in_scene_frame, probe_points, turn_matrix
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.chart.measure import SampleAnswer, cloud

PRINTED = 1e-9
"""Reference values are printed to ten digits."""


class ChartedQuantity(StrEnum):
    """What an error is charted of."""

    CONCENTRATION = "a"
    """At the end, L2 over the material disk, relative."""
    AREA = "area"
    """Largest over the output times, relative."""
    PROBES = "probes"
    """Largest over the scene's probes and the output times, absolute."""

    @property
    def heading(self) -> str:
        """What it is, for a reader."""
        return _WORDS[self][0]

    @property
    def words(self) -> str:
        """How its error is measured."""
        return _WORDS[self][1]


_WORDS = {
    ChartedQuantity.CONCENTRATION: ("Concentration", "at the end, relative L2 over material points"),
    ChartedQuantity.AREA: ("Area", "relative, largest over the output times"),
    ChartedQuantity.PROBES: (
        "Probes",
        "concentration at the scene's probes, largest over them and the output times",
    ),
}


@dataclass(frozen=True)
class KnownError:
    """How a quantity is known: from where, in words, and up to which error (0: exactly, nan: not at all)."""

    source: str
    floor: float


@dataclass(frozen=True, eq=False)
class ChartTruth:
    """What a scene's runs are held against.

    Attributes
    ----------
    scene : whose.
    fine : the run that gives whatever nothing else does.
    area, probe_a : at the output times, (k,) and (k, n).
    known : how each quantity is known.
    """

    scene: Scene
    fine: SampleAnswer
    area: Array
    probe_a: Array
    known: dict[ChartedQuantity, KnownError]


def truth_of(scene: Scene, coarse: SampleAnswer, fine: SampleAnswer, words: str) -> ChartTruth:
    """Return the truth for a scene: the exact solution, else reference values, else the finer run (in words).

    The error of the finer run is `accuracy.SHARE` of its difference to the coarser one.
    """
    times = scene.output_times
    area, probe_a = np.full(len(times), np.nan), np.full((len(times), len(scene.probes.points)), np.nan)
    area[: len(fine.area)], probe_a[: len(fine.area)] = fine.area, fine.probe_a
    known = {
        quantity: KnownError(words, SHARE * change)
        for quantity, change in _errors(scene, coarse, fine.cloud_a, area, probe_a).items()
    }
    if fine.ending != "completed":
        reason = f"nothing: the reference run ends ({fine.ending}: {fine.message})"
        known = {quantity: KnownError(reason, np.nan) for quantity in ChartedQuantity}
    if reference := scene.expect.reference:
        stated = KnownError(reference.origin, PRINTED)
        at = [(times.index(values.time), values) for values in reference.at]
        if all(values.area is not None for _, values in at):
            area[:] = np.nan
            area[[row for row, _ in at]] = [values.area for _, values in at]
            known[ChartedQuantity.AREA] = stated
        if all(values.probe_a is not None for _, values in at):
            probe_a[:] = np.nan
            probe_a[[row for row, _ in at]] = [values.probe_a for _, values in at]
            known[ChartedQuantity.PROBES] = stated
    if scene.expect.exact:
        known |= dict.fromkeys(
            (ChartedQuantity.CONCENTRATION, ChartedQuantity.PROBES), KnownError("the exact solution", 0.0)
        )
    return ChartTruth(scene, fine, area, probe_a, known)


def errors_of(truth: ChartTruth, answer: SampleAnswer) -> dict[ChartedQuantity, float]:
    """Return the errors of a run; nan where it failed or nothing is known."""
    scene, cloud_a, probe_a = truth.scene, truth.fine.cloud_a, truth.probe_a
    if scene.expect.exact and answer.ending == "completed":
        points, turn = probe_points(scene), turn_matrix(scene)
        cloud_a = _exact(scene, turn @ cloud(scene.parameters.l0)[0], answer.cloud_x, scene.output_times[-1])
        probe_a = np.array(
            [_exact(scene, points, x, t) for x, t in zip(answer.probe_x, answer.times, strict=True)]
        )
    found = _errors(scene, answer, cloud_a, truth.area, probe_a)
    return {
        quantity: np.nan if np.isnan(truth.known[quantity].floor) else found[quantity] for quantity in found
    }


def _exact(scene: Scene, points: Array, x: Array, t: float) -> Array:
    """The exact concentration (n,) of material points (2, n) that are at x (n, 2)."""
    assert scene.expect.exact is not None
    return in_scene_frame(scene, scene.expect.exact.a, x.T, points, t)


def _errors(
    scene: Scene, answer: SampleAnswer, cloud_a: Array, area: Array, probe_a: Array
) -> dict[ChartedQuantity, float]:
    """Errors against values on the cloud and at the output times; nan of a run that did not complete."""
    if answer.ending != "completed":
        return dict.fromkeys(ChartedQuantity, np.nan)
    _, weights = cloud(scene.parameters.l0)
    return {
        ChartedQuantity.CONCENTRATION: float(
            np.sqrt(weights @ (answer.cloud_a - cloud_a) ** 2 / (weights @ cloud_a**2))
        ),
        ChartedQuantity.AREA: _largest(answer.area / area - 1),
        ChartedQuantity.PROBES: _largest(answer.probe_a - probe_a),
    }


def _largest(differences: Array) -> float:
    """Largest size of those that are numbers; nan where none is."""
    sizes = np.abs(differences)[np.isfinite(differences)]
    return float(sizes.max()) if sizes.size else np.nan


class PointKind(StrEnum):
    """What a point is in a chart of one quantity."""

    JUDGED = "judged"
    """Its error is a number that means something."""
    FAILED = "failed"
    SILENT = "silently inaccurate"
    """It completed without a complaint, and is wrong."""
    BELOW = "below the reference's own error"
    UNKNOWN = "nothing to hold it against"


WRONG = 0.05
"""Relative L2 error of the concentration above which a completed run is silently inaccurate."""


def standing(
    answer: SampleAnswer,
    errors: Mapping[ChartedQuantity, float],
    quantity: ChartedQuantity,
    known: Mapping[ChartedQuantity, KnownError],
) -> PointKind:
    """Return what a run is in the chart of a quantity."""
    error, floor = errors[quantity], known[quantity].floor
    if answer.ending != "completed":
        return PointKind.FAILED
    if errors[ChartedQuantity.CONCENTRATION] > WRONG:
        return PointKind.SILENT
    if not np.isfinite(error):
        return PointKind.UNKNOWN
    return PointKind.BELOW if error <= floor else PointKind.JUDGED


TARGETS = tuple(10.0**-k for k in range(2, 13))
"""Errors advice is given for, as far as they are reached."""


def front(work: Sequence[float] | Array, error: Sequence[float] | Array) -> list[int]:
    """Return the points that no other one beats in both, by increasing work.

    Parameters
    ----------
    work, error : of each point, (n,); those without two finite numbers are left out.

    Of points that are equal in both the first one stands for all.
    """
    order = np.lexsort((np.asarray(error), np.asarray(work)))
    best, kept = math.inf, []
    for i in order.tolist():
        if math.isfinite(work[i]) and error[i] < best:
            best = error[i]
            kept.append(i)
    return kept


def advise(work: Sequence[float] | Array, error: Sequence[float] | Array) -> list[tuple[float, int]]:
    """Return each of `TARGETS` that any point reaches, largest error first, and its cheapest point."""
    kept = front(work, error)
    enough = [(target, [i for i in kept if error[i] <= target]) for target in TARGETS]
    return [(target, good[0]) for target, good in enough if good]
