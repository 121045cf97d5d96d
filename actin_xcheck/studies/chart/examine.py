"""A chart at work: its runs one after another, each timed alone, and the file kept after every one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.runs.alone import prepare, work_alone
from actin_xcheck.runs.executor import Lost
from actin_xcheck.runs.machine import reference_kernel
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.recorder import PARTS
from actin_xcheck.runs.store import provenance
from actin_xcheck.runs.workers import Report
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.chart.measure import REPEATS, SHORT, Sample, measured
from actin_xcheck.studies.chart.points import Point, ladder, published, reference_points
from actin_xcheck.studies.chart.record import FILE_NAME, Chart, Charted, read_chart, write_chart
from actin_xcheck.studies.chart.truth import errors_of, truth_of
from actin_xcheck.studies.ledger import Entry, ledger

BUDGET = {False: 32.0, True: 8.0}
"""Processor seconds for the runs of one method, by whether the chart is a quick one; a busy machine must not
change what is charted.  The first run is made in any case."""

REFERENCE = {False: 65.0, True: 8.0}
"""Processor seconds that the runs of the reference are reckoned to take."""

NEEDED = 1e-4
"""Error by which the term ledger says whether the scene needs a term."""


def default_methods() -> list[Method]:
    """Those that move their own nodes."""
    return [method for method in METHODS.values() if method.driven_by is None]


def examine(
    scene: Scene, methods: Sequence[Method], folder: Path, command: str, quick: bool, report: Report
) -> Chart:
    """Measure all points of a scene's chart, then its terms, and write `folder/chart.h5` after every one.

    Runs that an interrupted chart left in the folder are kept, where the same code made them.

    Parameters
    ----------
    scene, methods : what is charted.
    folder : where the file goes; it exists.
    command : what reproduces the chart.
    quick : on short ladders, within a smaller `BUDGET`.
    report : told of progress.

    Raises UserError where the folder holds the chart of another scene.
    """
    solvers = sorted({method.solver.split(":")[0] for method in METHODS.values()})
    prepare(["__main__", measured.__module__, *solvers])
    path = folder / FILE_NAME
    versions = provenance()
    budget, start = BUDGET[quick], REFERENCE[quick]
    kept = finished(path, scene, versions)
    bench = _Bench(scene, kept, report, start + len(methods) * budget)
    shares = 0.12 * start, 0.88 * start  # eight times the work is in the finer one
    coarse, fine = (
        bench.measure(point, share)
        for point, share in zip(reference_points(scene, quick), shares, strict=True)
    )
    truth = truth_of(scene, coarse, fine)
    points: list[Charted] = []
    left_out: list[str] = []

    def save(entries: Sequence[Entry] = ()) -> None:
        about = {"command": command, "left_out": tuple(left_out), **versions}
        write_chart(path, scene, about, (coarse, fine), truth.known, points, entries)

    def add(point: Point, seconds: float) -> Sample:
        sample = bench.measure(point, seconds)
        points.append(Charted(sample, errors_of(truth, sample), point.command(scene)))
        if point.key not in kept:
            save()
        return sample

    if not kept:
        save()  # the reference alone takes a minute
    for number, method in enumerate(methods):
        bench.done = start + number * budget
        rungs, ours = ladder(scene, method, quick), list[Sample]()
        while rungs and (not ours or _cost(ours) + _expected(scene, ours[-1], rungs[0]) <= budget):
            ours.append(add(rungs[0], _expected(scene, ours[-1], rungs[0]) if ours else 1.0))
            del rungs[0]
        left_out += [f"{method.name} ({point.numerics})" for point in rungs]
        tried = {sample.point.key for sample in ours}
        for point in () if quick else published(scene, method):
            if point.key not in tried:
                add(point, 0.0)
    save(ledger(scene, NEEDED, report))
    return read_chart(path)


def _cost(samples: Sequence[Sample]) -> float:
    """Processor seconds that all repetitions of these runs took."""
    return sum(float(sample.cpu.sum()) for sample in samples)


def _expected(scene: Scene, before: Sample, point: Point) -> float:
    """Processor seconds that all repetitions of a point will take, by those of a smaller one."""
    times = scene.output_times
    once = float(np.median(before.cpu)) * point.cost(times) / before.point.cost(times)
    return once * (REPEATS if once < SHORT else 1)


def finished(path: Path, scene: Scene, versions: dict[str, str]) -> dict[str, Sample]:
    """Return the runs in `path` by key, if it holds a chart of this scene by this code.

    UserError where it holds a chart of another scene.
    """
    if not path.exists():
        return {}
    try:
        chart = read_chart(path)
    except UserError:  # not whole
        return {}
    stated = chart.attributes
    if stated["scene_name"] != scene.name:
        raise UserError(
            f"--out: {path.parent} holds a chart of {stated['scene_name']}; valid: another folder"
        )
    commit = versions["commit"]
    same = stated["scene"] == scene.text and all(
        stated[name] == version for name, version in versions.items()
    )
    if not same or commit.endswith("-dirty") or commit == "unknown":  # which code was it?
        return {}
    samples = [*chart.reference, *(point.sample for point in chart.points)]
    return {sample.point.key: sample for sample in samples}


class _Bench:
    """Where runs are timed: one after another, in processes of their own, the reference kernel between.

    Parameters
    ----------
    scene : what is run.
    kept : runs that need not be made again, by key.
    report : told of progress.
    total : processor seconds that all runs are reckoned to take.
    """

    def __init__(self, scene: Scene, kept: dict[str, Sample], report: Report, total: float) -> None:
        self._scene, self._kept, self._report, self._total = scene, kept, report, total
        self.done = 0.0
        """Seconds of the total that are over."""
        self._kernel: Array | None = None

    def measure(self, point: Point, seconds: float) -> Sample:
        """Measure a point, which is reckoned to take so many processor seconds."""
        if point.key in self._kept:
            return self._kept[point.key]

        def report(label: str, done: int, total: int) -> None:
            over = (self.done + seconds * done / total) / self._total
            self._report(f"{self._scene.name} · chart", round(PARTS * min(over, 1.0)), PARTS)

        before = reference_kernel() if self._kernel is None else self._kernel
        sample = work_alone(measured, (self._scene, point), report)
        if isinstance(sample, Lost):
            raise UserError(
                f"{point.method.name} ({point.numerics}): {sample.message}; what was measured is kept; "
                "valid: the same command again, --out names the folder"
            )
        self._kernel = reference_kernel()
        self.done += seconds
        return replace(sample, kernel=np.stack([before, self._kernel]))
