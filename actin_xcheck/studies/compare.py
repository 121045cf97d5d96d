"""Scenes x methods -> runs, claims and one comparison file."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs import store
from actin_xcheck.runs.commands import command as command_of
from actin_xcheck.runs.fidelity import Fidelity
from actin_xcheck.runs.march import step_count
from actin_xcheck.runs.method import Method
from actin_xcheck.runs.run import numerics, run
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.scene.scene import Scene
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


@dataclass(frozen=True)
class Job:
    """One run of a comparison."""

    scene: Scene
    method: Method
    refine: int
    dt: float
    path: Path
    rtol: float | None = None
    coarser: int = 0
    """How many times coarser than asked for, see `companions`."""

    @property
    def label(self) -> str:
        """What progress is reported under."""
        return f"{self.scene.name} · {self.method.name}" + (
            f" (refine {self.refine})" if self.coarser else ""
        )

    @property
    def cost(self) -> float:
        """About how long it takes, in any unit: finite volumes take twice as long as finite elements."""
        steps = step_count(self.dt, self.scene.output_times)
        return steps * 4.0**self.refine * self.method.space**2 * (2 if self.method.family == "fv" else 1)

    @property
    def command(self) -> str:
        """The command that makes this run again."""
        return command_of(
            "run",
            self.scene.origin,
            method=self.method.name,
            refine=self.refine,
            dt=self.dt,
            rtol=self.rtol,
            fidelity=Fidelity.FULL,
            out=self.path.name,
        )


def jobs_of(
    scenes: Sequence[Scene],
    methods: Sequence[Method],
    folder: Path,
    refine: int | None,
    dt: float | None,
    rtol: float | None = None,
) -> list[Job]:
    """Return the runs of a comparison, each with a file of its own in `folder`.

    `rtol` is for the adaptive methods among them; the others take equal steps of at most `dt`.
    """
    jobs = []
    for scene in scenes:
        _, step = numerics(scene, refine, dt)
        for method in methods:
            path = folder / f"{scene.name}--{method.name}.vtkhdf"
            tolerance = rtol if method.adaptive else None
            jobs.append(Job(scene, method, refine or DEFAULT_REFINE, step, path, tolerance))
    return jobs


def companions(jobs: Sequence[Job]) -> list[Job]:
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


def _coarser(job: Job, times: int) -> Job:
    """The job with h doubled so many times; its steps are the multiple that fits the output times best."""
    method, growth = job.method, 2.0 ** (times * job.method.order_h)
    intervals = [end - start for start, end in pairwise((0.0, *job.scene.output_times))]
    steps = [step_count(job.dt, [length]) / growth ** (1 / method.order_dt) for length in intervals]
    dt = max(length / max(round(number), 1) for length, number in zip(intervals, steps, strict=True))
    return replace(
        job,
        refine=job.refine - times,
        dt=dt,
        path=job.path.with_name(f"{job.path.stem}--coarser-{times}.vtkhdf"),
        rtol=None if job.rtol is None else job.rtol * growth,
        coarser=times,
    )


def compare(
    jobs: Sequence[Job], folder: Path, command: str, report: Report = lambda label, done, total: None
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
    run_all([*jobs, *beside], report)
    claims: list[Claim] = []
    triangles: list[Triangle] = []
    known: dict[str, KnownTo] = {}
    for scene in {job.scene.name: job.scene for job in jobs}.values():
        levels = [_levels(job, beside) for job in jobs if job.scene.name == scene.name]
        found = triangulate(scene, levels)
        runs = {one.method.name: one.runs[0] for one in levels}
        claims += judge(scene, runs)
        claims += [
            triangle.claim(again(scene, *(runs[one] for one in triangle.methods))) for triangle in found
        ]
        triangles += found
        known[scene.name] = known_to(scene, levels)
    files = {f"{job.scene.name}/{job.method.name}": job.path for job in jobs}
    stated = {"command": command, **store.provenance()}
    store.write_comparison(folder / FILE_NAME, claims, files, stated)
    coarse = {f"{job.scene.name}/{job.method.name}/{job.coarser}": job.path for job in beside}
    attach(folder / FILE_NAME, triangles, coarse)
    keep(folder / FILE_NAME, known)
    return claims


def _levels(job: Job, beside: Sequence[Job]) -> Levels:
    """The stored run of a job and of its companions, finest first."""
    ours = [one for one in beside if (one.scene.name, one.method) == (job.scene.name, job.method)]
    return Levels(job.method, tuple(store.read_run(one.path) for one in (job, *ours)))


def run_all(jobs: Sequence[Job], report: Report) -> None:
    """Run jobs on all cores, those that take longest first."""
    work_off(_run, sorted(jobs, key=lambda job: job.cost, reverse=True), report, lambda job: job.label)


def is_done(job: Job, versions: dict[str, str]) -> bool:
    """Whether a whole file of the same scene, resolution and code lies where the job would write."""
    commit = versions["commit"]
    if not job.path.exists() or commit.endswith("-dirty") or commit == "unknown":  # which code was it?
        return False
    try:
        stated = store.read_run(job.path).attributes
    except UserError:
        return False
    return bool(stated["scene"] == job.scene.text and json.loads(stated["versions"]) == versions)


def _run(job: Job, report: Report) -> None:
    run(
        job.scene,
        job.method,
        job.refine,
        job.dt,
        job.path,
        job.command,
        lambda done, total: report(job.label, done, total),
        job.rtol,
    )
