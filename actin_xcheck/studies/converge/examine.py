"""Convergence studies at work: run their levels, read the orders off, write what was found."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from actin_xcheck.runs.commands import command as command_of
from actin_xcheck.runs.store import Run, provenance, read_run
from actin_xcheck.runs.workers import Report
from actin_xcheck.studies.compare import is_done, run_all
from actin_xcheck.studies.converge.record import FILE_NAME, Result, write_convergence
from actin_xcheck.studies.converge.studies import Refined, Study, Truth
from actin_xcheck.verdicts.orders import observe
from actin_xcheck.verdicts.quantities import change_between, error_of


def examine(studies: Sequence[Study], folder: Path, command: str, report: Report) -> list[Result]:
    """Run all levels of the studies, each once, judge them and write `folder/convergence.h5`.

    Runs that an interrupted report left in the folder are kept, where the same code made them.
    """
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    every = [study.job(level, folder) for study in studies for level in study.levels]
    jobs = {job.path: job for job in every}
    versions = provenance()
    run_all([job for job in jobs.values() if not is_done(job, versions)], report)
    results = [result_of(study, folder) for study in studies]
    write_convergence(folder / FILE_NAME, results, command)
    return results


def result_of(study: Study, folder: Path) -> Result:
    """Judge a study whose runs lie in the folder."""
    files = [study.job(level, folder).path for level in study.levels]
    runs = [read_run(file) for file in files]
    errors, endings = _errors(study, runs), [_ending(run) for run in runs]
    if study.truth is Truth.RICHARDSON:
        endings = [coarse or fine for coarse, fine in pairwise(endings)]
    levels = study.levels[: len(errors)]
    h, dt = np.array([study.steps_of(level) for level in levels]).T
    widths = (h if study.refined is Refined.H else dt).tolist()
    claimed = None if study.no_claim else study.declared
    observed = observe(widths, errors, claimed, study.at_least, study.floor)
    return Result(
        study.key,
        study.scene.name,
        study.scene.citation,
        study.method.name,
        str(study.refined),
        study.quantity.words,
        str(study.truth),
        study.declared,
        not study.no_claim,
        study.at_least,
        study.floor,
        np.array([level.refine for level in levels]),
        np.array([level.steps for level in levels]),
        h,
        dt,
        np.abs(errors),
        tuple(endings),
        replace(observed, reason=study.no_claim or observed.reason),
        command_of("converge", study.origin, method=study.method.name),
        tuple(file.relative_to(folder).as_posix() for file in files),
    )


def _errors(study: Study, runs: Sequence[Run]) -> list[float]:
    """One error per level, or per pair of successive levels."""
    if study.truth is Truth.RICHARDSON:
        return [change_between(study.scene, *pair, study.quantity) for pair in pairwise(runs)]
    return [error_of(study.scene, run, study.quantity) for run in runs]


def _ending(run: Run) -> str:
    """How a run failed; empty where it completed."""
    stated = run.attributes
    return "" if stated["outcome"] == "completed" else f"{stated['outcome']}: {stated['message']}"
