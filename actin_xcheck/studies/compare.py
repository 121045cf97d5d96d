"""Scenes x methods -> runs, claims and one comparison file."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from actin_xcheck.core.claim import Claim
from actin_xcheck.runs import store
from actin_xcheck.runs.march import step_count
from actin_xcheck.runs.method import Method
from actin_xcheck.runs.numerics import suited
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.stored import Stored, run_stored
from actin_xcheck.verdicts.judge import again, judge
from actin_xcheck.verdicts.known_to import KnownTo, keep, known_to
from actin_xcheck.verdicts.triangulate import Levels, Triangle, attach, triangulate

FILE_NAME = "comparison.h5"

DEFAULT_SCENES = ("mode-11-wall", "static-decay", "growing-disk", "fig14-four-fronts")
DEFAULT_METHODS = ("fem-p1-paper", "fv-coupled")
DEFAULT_REFINE = 5
"""2113 nodes for every scene: a comparison is over within a minute."""

COMPANIONS = 2
"""Coarser runs beside each one; the first costs a sixteenth of it, the second shows the order."""


def jobs_of(
    scenes: Sequence[Scene],
    methods: Sequence[Method],
    refine: int | None,
    dt: float | None,
    rtol: float | None = None,
) -> list[Stored]:
    """Return the runs of a comparison, each with a file of its own.

    `rtol` is for the adaptive methods among them; the others take equal steps of at most `dt`.
    """
    jobs = []
    for scene in scenes:
        _, step = suited(scene, refine, dt)
        for method in methods:
            file = f"{scene.name}--{method.name}.vtkhdf"
            tolerance = rtol if method.adaptive else None
            jobs.append(Stored(scene, method, refine or DEFAULT_REFINE, step, file, tolerance))
    return jobs


def companions(jobs: Sequence[Stored]) -> list[Stored]:
    """The coarser runs that give the jobs' uncertainties: errors in space and in time grow alike.

    That is h doubled, dt ~ h^(order_h/order_dt), rtol ~ h^order_h.
    None where a scene is run by one code only, for there is nothing to hold against the other, and none for
    a method that declares no order in space.
    """
    families: dict[str, set[str]] = {}
    for job in jobs:
        families.setdefault(job.scene.name, set()).add(job.method.family)
    return [
        _coarser(job, times)
        for job in jobs
        for times in range(1, COMPANIONS + 1)
        if len(families[job.scene.name]) > 1 and job.method.order_h and job.refine > times
    ]


def _coarser(job: Stored, times: int) -> Stored:
    """The job with h doubled so many times; its steps are the multiple that fits the output times best."""
    method, growth = job.method, 2.0 ** (times * job.method.order_h)
    intervals = [end - start for start, end in pairwise((0.0, *job.scene.output_times))]
    steps = [step_count(job.dt, [length]) / growth ** (1 / method.order_dt) for length in intervals]
    dt = max(length / max(round(number), 1) for length, number in zip(intervals, steps, strict=True))
    return replace(
        job,
        refine=job.refine - times,
        dt=dt,
        file=f"{job.file.removesuffix('.vtkhdf')}--coarser-{times}.vtkhdf",
        rtol=None if job.rtol is None else job.rtol * growth,
    )


def compare(
    jobs: Sequence[Stored], folder: Path, command: str, report: Report = lambda label, done, total: None
) -> list[Claim]:
    """Run every job on all cores, judge the stored runs and write `folder/comparison.h5`.

    Parameters
    ----------
    jobs : what to run, see `jobs_of`.
    folder : where files go; it exists.
    command : what reproduces the whole comparison.
    report : told of progress.

    Returns
    -------
    The claims, scene by scene.
    """
    beside = companions(jobs)
    first_long_ones = sorted([*jobs, *beside], key=lambda job: job.seconds, reverse=True)
    work_off(_run, [(job, folder) for job in first_long_ones], report, lambda task: _label(task[0]))
    claims: list[Claim] = []
    triangles: list[Triangle] = []
    known: dict[str, KnownTo] = {}
    for scene in {job.scene.name: job.scene for job in jobs}.values():
        levels = [_levels(job, beside, folder) for job in jobs if job.scene.name == scene.name]
        found = triangulate(scene, levels)
        runs = {one.method.name: one.runs[0] for one in levels}
        claims += judge(scene, runs)
        claims += [
            triangle.claim(again(scene, *(runs[one] for one in triangle.methods))) for triangle in found
        ]
        triangles += found
        known[scene.name] = known_to(scene, levels)
    files = {_name(job): folder / job.file for job in jobs}
    stated = {"command": command, **store.provenance()}
    store.write_comparison(folder / FILE_NAME, claims, files, stated)
    finest = {_name(job): job.refine for job in jobs}
    coarse = {f"{_name(job)}/{finest[_name(job)] - job.refine}": folder / job.file for job in beside}
    attach(folder / FILE_NAME, triangles, coarse)
    keep(folder / FILE_NAME, known)
    return claims


def _name(job: Stored) -> str:
    return f"{job.scene.name}/{job.method.name}"


def _label(job: Stored) -> str:
    """What progress is reported under."""
    return f"{job.scene.name} · {job.method.name} (refine {job.refine})"


def _levels(job: Stored, beside: Sequence[Stored], folder: Path) -> Levels:
    """The stored run of a job and of its companions, finest first."""
    ours = [one for one in beside if (one.scene.name, one.method) == (job.scene.name, job.method)]
    return Levels(job.method, tuple(store.read_run(folder / one.file) for one in (job, *ours)))


def _run(task: tuple[Stored, Path], report: Report) -> None:
    job, folder = task
    run_stored(job, folder, lambda done, total: report(_label(job), done, total))
