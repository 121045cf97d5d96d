"""Scenes x methods -> runs, claims and one comparison file."""

import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from actin_xcheck import store
from actin_xcheck.claims import Claim
from actin_xcheck.errors import UserError
from actin_xcheck.registry import Method
from actin_xcheck.runs import numerics, run
from actin_xcheck.scene import Scene
from actin_xcheck.stepping import step_count
from actin_xcheck.verdicts import judge
from actin_xcheck.workers import Report, work_off

DEFAULT_SCENES = ("mode-11-wall", "static-decay", "growing-disk", "fig14-four-fronts")
DEFAULT_METHODS = ("fem-p1-paper", "fv-coupled")
DEFAULT_REFINE = 5
"""2113 nodes for every scene: a comparison is over within a minute."""


@dataclass(frozen=True)
class Job:
    """One run of a comparison."""

    scene: Scene
    method: Method
    refine: int
    dt: float
    path: Path
    rtol: float | None = None

    @property
    def label(self) -> str:
        """What progress is reported under."""
        return f"{self.scene.name} · {self.method.name}"

    @property
    def cost(self) -> float:
        """About how long it takes, in any unit: finite volumes take twice as long as finite elements."""
        steps = step_count(self.dt, self.scene.output_times)
        return steps * 4.0**self.refine * (1 if self.method.name.startswith("fem") else 2)

    @property
    def command(self) -> str:
        """The command that makes this run again."""
        words = ["run", self.scene.origin, "--method", self.method.name, "--refine", str(self.refine)]
        words += ["--dt", repr(self.dt)] if self.rtol is None else ["--rtol", repr(self.rtol)]
        return "python -m actin_xcheck " + shlex.join([*words, "--out", self.path.name])


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
    run_all(jobs, report)
    claims: list[Claim] = []
    for scene in {job.scene.name: job.scene for job in jobs}.values():
        runs = {job.method.name: store.read_run(job.path) for job in jobs if job.scene.name == scene.name}
        claims += judge(scene, runs)
    files = {f"{job.scene.name}/{job.method.name}": job.path for job in jobs}
    store.write_comparison(
        folder / "comparison.h5", claims, files, {"command": command, **store.provenance()}
    )
    return claims


def run_all(jobs: Sequence[Job], report: Report) -> None:
    """Run jobs on all cores, those that take longest first."""
    work_off(_run, sorted(jobs, key=lambda job: job.cost, reverse=True), report)


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
