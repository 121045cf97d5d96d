"""Scenes x methods -> runs, claims and one comparison file."""

import multiprocessing
import os
import queue
import shlex
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from actin_xcheck import store
from actin_xcheck.claims import Claim
from actin_xcheck.registry import Method
from actin_xcheck.runs import numerics, run
from actin_xcheck.scene import Scene
from actin_xcheck.verdicts import judge

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

    @property
    def label(self) -> str:
        """What progress is reported under."""
        return f"{self.scene.name} · {self.method.name}"

    @property
    def command(self) -> str:
        """The command that makes this run again."""
        words = ["run", self.scene.origin, "--method", self.method.name, "--refine", str(self.refine)]
        return "python -m actin_xcheck " + shlex.join(
            [*words, "--dt", repr(self.dt), "--out", self.path.name]
        )


Report = Callable[[str, int, int], None]
"""Called with a job's label, its steps done and its steps in all."""


def jobs_of(
    scenes: Sequence[Scene], methods: Sequence[Method], folder: Path, refine: int | None, dt: float | None
) -> list[Job]:
    """Return the runs of a comparison, each with a file of its own in `folder`."""
    jobs = []
    for scene in scenes:
        _, step = numerics(scene, refine, dt)
        for method in methods:
            path = folder / f"{scene.name}--{method.name}.vtkhdf"
            jobs.append(Job(scene, method, refine or DEFAULT_REFINE, step, path))
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
    _run_all(jobs, report)
    claims: list[Claim] = []
    for scene in {job.scene.name: job.scene for job in jobs}.values():
        runs = {job.method.name: store.read_run(job.path) for job in jobs if job.scene.name == scene.name}
        claims += judge(scene, runs)
    files = {f"{job.scene.name}/{job.method.name}": job.path for job in jobs}
    store.write_comparison(
        folder / "comparison.h5", claims, files, {"command": command, **store.provenance()}
    )
    return claims


def _run_all(jobs: Sequence[Job], report: Report) -> None:
    """Run jobs in worker processes, those that take longest first, and pass their progress on."""
    context = multiprocessing.get_context("spawn")
    workers = min(len(jobs), os.cpu_count() or 1)
    order = sorted(jobs, key=lambda job: (job.method.name.startswith("fem"), job.scene.motion is not None))
    with context.Manager() as manager, ProcessPoolExecutor(workers, mp_context=context) as pool:
        news = manager.Queue()
        futures = [pool.submit(_work, job, news) for job in order]
        try:
            while not all(future.done() for future in futures):
                _pass_on(news, report)
            _pass_on(news, report)
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
        for future in futures:
            future.result()


def _pass_on(news: "queue.Queue[tuple[str, int, int]]", report: Report) -> None:
    try:
        while True:
            report(*news.get(timeout=0.2))
    except queue.Empty:
        return


def _work(job: Job, news: "queue.Queue[tuple[str, int, int]]") -> None:
    """One run in a worker process; progress is told about fifty times."""

    def progress(done: int, total: int) -> None:
        if done % max(1, total // 50) == 0 or done == total:
            news.put((job.label, done, total))

    run(job.scene, job.method, job.refine, job.dt, job.path, job.command, progress)
