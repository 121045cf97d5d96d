"""Studies: one scene under one reading, by one method, on several meshes and with several steps.

A study is run as the article ran it, at its own mesh and step, and on a family of coarser and finer ones from
which every readout is extrapolated to h = dt = 0.  A difference that goes away in the limit is the article's
resolution, one that stays is its model.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit.simulations.readouts import Readout
from actin_xcheck.studies.stored import Stored
from actin_xcheck.theory.growth import extrapolate

Level = tuple[int, float]
"""Mesh refinement and time step."""

Changes = tuple[tuple[str, Any], ...]
"""Keys of a scene file, dotted, with other values: (("model.closure", "traction-free"),)."""

FEM, FV = "fem-p1-paper", "fv-coupled"

FLOOR = 0.1
"""Least uncertainty of a limit, as a part of its distance from the value at the finest level."""


@dataclass(frozen=True)
class Study:
    """One scene under one reading, by one method.

    Attributes
    ----------
    scene : shipped scene.
    label : goes into the name of the scene as it is run, and so into file names.
    reading : rheology and closure, for tables.
    changes : what differs from the shipped scene.
    method : a method's name.
    levels : resolutions to extrapolate from.
    published : the article's own mesh and step, None where it prints none.
    """

    scene: str
    label: str
    reading: str
    changes: Changes
    method: str
    levels: tuple[Level, ...]
    published: Level | None = None

    @property
    def name(self) -> str:
        """The name of the scene as it is run."""
        return f"{self.scene}-{self.label}"

    def jobs(self) -> dict[Level, Stored]:
        """Return the study's runs."""
        changes = {"name": self.name, "expect": None, **dict(self.changes)}
        scene = load_scene(self.scene).varied(changes, f"scenes/{self.name}.toml")
        method = METHODS[self.method]
        levels = (*self.levels, *((self.published,) if self.published else ()))
        return {
            (refine, dt): Stored(
                scene,
                method,
                refine,
                dt,
                f"runs/{self.name}--{self.method}--{refine}--{dt:.6g}.vtkhdf",
                scene_file=scene.origin,
            )
            for refine, dt in levels
        }


@dataclass(frozen=True)
class Limit:
    """A readout at h = dt = 0 and by how much it may be off."""

    value: float
    uncertainty: float

    def __str__(self) -> str:
        if not math.isfinite(self.value):
            return "none"
        if not math.isfinite(self.uncertainty):
            return f"{self.value:.3g} (one level)"
        return f"{self.value:.4g} ± {self.uncertainty:.1g}"


@dataclass(frozen=True)
class Evidence:
    """The stored runs of a study."""

    study: Study
    files: Mapping[Level, Path]

    @classmethod
    def of(cls, study: Study, folder: Path) -> Self:
        """What a study has left in a folder."""
        return cls(study, {level: folder / job.file for level, job in study.jobs().items()})

    @cached_property
    def runs(self) -> dict[Level, Run]:
        """All runs, read once."""
        return {level: read_run(path) for level, path in self.files.items()}

    @property
    def failures(self) -> list[str]:
        """What ended the runs that did not complete, each once."""
        messages = (
            f"{run.attributes['outcome']}: {run.attributes['message']}"
            for run in self.runs.values()
            if run.attributes["outcome"] != "completed"
        )
        return list(dict.fromkeys(messages))

    @property
    def finest(self) -> Run:
        """The run to look at: the one on the finest mesh, with its smallest step."""
        return self.runs[max(self.runs, key=lambda level: (level[0], -level[1]))]

    def at_published(self, readout: Readout, t: float) -> float:
        """A readout at the article's own mesh and step; nan where it prints none or the run ended before."""
        published = self.study.published
        return _read(self.runs[published], readout, t) if published else math.nan

    def limit(self, readout: Readout, t: float) -> Limit:
        """A readout at h = dt = 0: least squares in h^2, dt and further terms the levels can tell apart.

        Its uncertainty is the largest change when any one level is left out, and no less than `FLOOR` of what
        was extrapolated: fits that agree by luck must not look certain.
        """
        values = {level: _read(run, readout, t) for level, run in self.runs.items()}
        known = {level: value for level, value in values.items() if math.isfinite(value)}
        if len(known) < 3:
            finest = max(known, key=lambda level: (level[0], -level[1]), default=None)
            return Limit(known[finest] if finest else math.nan, math.nan)
        full = _extrapolated(known)
        others = [_extrapolated({k: v for k, v in known.items() if k != left_out}) for left_out in known]
        least = FLOOR * abs(known[max(known, key=lambda level: (level[0], -level[1]))] - full)
        return Limit(full, max(least, *(abs(other - full) for other in others)))


def _read(run: Run, readout: Readout, t: float) -> float:
    """A readout, nan where the run ended before."""
    try:
        return readout(run, t)
    except ValueError:
        return math.nan


def _extrapolated(values: Mapping[Level, float]) -> float:
    refine, dt = np.array(list(values)).T
    if len(values) < 2 or np.ptp(list(values.values())) == 0:
        return next(iter(values.values()))
    return float(extrapolate(2.0**-refine, dt, list(values.values())).limit.real)
