"""The article's simulations, as `cells.toml` says them, and what is read off them in the limit.

Each scene is run as the article ran it, at its own mesh and step, and on a family of coarser and finer ones
from which every readout is extrapolated to h = dt = 0.  A difference that goes away in the limit is the
article's resolution, one that stays is its model.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Self

import numpy as np

from actin_xcheck.core.model import Closure, Rheology
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.store import Run, read_run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit import table
from actin_xcheck.studies.audit.readouts import Readout
from actin_xcheck.studies.stored import Stored
from actin_xcheck.theory.growth import extrapolate

Level = tuple[int, float]
"""Mesh refinement and time step."""

Changes = tuple[tuple[str, Any], ...]
"""Keys of a scene file, dotted, with other values: (("model.closure", "traction-free"),)."""

FEM, FV = "fem-p1-paper", "fv-coupled"

FLOOR = 0.1
"""Least uncertainty of a limit, as a part of its distance from the value at the finest level."""

_MOVING = (Closure.REFERENCE_NORMAL, Closure.CURRENT_NORMAL, Closure.TRACTION_FREE)


@dataclass(frozen=True)
class RunFamily:
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

    def jobs(self) -> dict[Level, Stored]:
        """Return the family's runs."""
        name = f"{self.scene}-{self.label}"
        changes = {"name": name, "expect": None, **dict(self.changes)}
        scene = load_scene(self.scene).varied(changes, f"scenes/{name}.toml")
        levels = (*self.levels, *((self.published,) if self.published else ()))
        return {
            (refine, dt): Stored(
                scene,
                Numerics(METHODS[self.method], refine, dt),
                f"runs/{name}--{self.method}--{refine}--{dt:.6g}.vtkhdf",
                scene.origin,
            )
            for refine, dt in levels
        }


@dataclass(frozen=True)
class RunCell:
    """A simulation of the article: a shipped scene, run as published and in families to extrapolate from.

    Attributes
    ----------
    scene : shipped scene.
    steps : of the family's largest time step.
    changes : output times, or another parameter of the same scene; not a reading.
    label : names the cell; tells those of one scene apart, where more than its output times is changed.
    rims : closures to read the rim's conditions as; one is enough where the cell stays a circle.
    levels : resolutions where there is but one family, of finite elements; without steps as published.
    """

    scene: str
    steps: int = 0
    changes: Changes = ()
    label: str = "audit"
    rims: tuple[Closure, ...] = _MOVING
    levels: tuple[Level, ...] = ()

    @classmethod
    def named(cls, name: str) -> Self:
        """The cell of this name in `cells.toml`."""
        said = dict(table("cells.toml")[name])
        changes = {
            key: tuple(map(time_of, value)) if key == "time.outputs" else value
            for key, value in said.pop("changes", {}).items()
        }
        rims, levels = said.pop("rims", _MOVING), map(tuple, said.pop("levels", ()))
        return cls(
            **said, changes=tuple(changes.items()), rims=tuple(map(Closure, rims)), levels=tuple(levels)
        )

    def families(self) -> tuple[RunFamily, ...]:
        """Finite elements, finite volumes, and finite elements under the other readings."""
        scene = load_scene(self.scene)
        published, physics = scene.as_published, scene.physics
        own: Level | None = None
        if published.refine and published.dt:
            own = published.refine, published.dt
        rheology = dict(self.changes).get("model.rheology", physics.rheology)
        reading = _reading(rheology, physics.closure)
        if alone := self.levels or (() if self.steps or not own else (own,)):
            return (RunFamily(self.scene, self.label, reading, self.changes, FEM, alone),)
        dt = dict(self.changes).get("time.end", scene.time.end) / self.steps
        family = ((3, dt), (4, dt), (5, dt), (4, dt / 2), (4, dt / 4))
        brief = (4, dt), (5, dt), (4, dt / 2)
        others = [
            pair for pair in product(Rheology, self.rims) if pair != (physics.rheology, physics.closure)
        ]
        return (
            RunFamily(self.scene, self.label, reading, self.changes, FEM, family, own),
            RunFamily(self.scene, self.label, reading, self.changes, FV, family),
            *(
                RunFamily(
                    self.scene,
                    f"{self.label}-{rheology}-{closure}",
                    _reading(rheology, closure),
                    (*self.changes, ("model.rheology", str(rheology)), ("model.closure", str(closure))),
                    FEM,
                    brief,
                )
                for rheology, closure in others
            ),
        )


def _reading(rheology: Rheology, closure: Closure) -> str:
    return f"{rheology}, {closure}"


def time_of(said: float | list[float]) -> float:
    """Return a time, given as such or as a number of steps and their length."""
    if isinstance(said, list):
        steps, dt = said
        return steps * dt
    return said


@dataclass(frozen=True)
class Limit:
    """A readout at h = dt = 0 and by how much it may be off."""

    value: float
    uncertainty: float

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        if not math.isfinite(self.value):
            return "none"
        if not math.isfinite(self.uncertainty):
            return f"{self.value:.3g} (one level)"
        return f"{self.value:.4g} ± {self.uncertainty:.1g}"


@dataclass(frozen=True)
class Evidence:
    """The stored runs of a family."""

    family: RunFamily
    files: Mapping[Level, Path]

    @classmethod
    def of(cls, family: RunFamily, folder: Path) -> Self:
        """What a family has left in a folder."""
        return cls(family, {level: folder / job.file for level, job in family.jobs().items()})

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
        return self.runs[max(self.runs, key=_fineness)]

    def at_published(self, readout: Readout, t: float) -> float:
        """A readout at the article's own mesh and step; nan where it prints none or the run ended before."""
        published = self.family.published
        return _read(self.runs[published], readout, t) if published else math.nan

    def limit(self, readout: Readout, t: float) -> Limit:
        """A readout at h = dt = 0: least squares in h^2, dt and further terms the levels can tell apart.

        Its uncertainty is the largest change when any one level is left out, and no less than `FLOOR` of what
        was extrapolated: fits that agree by luck must not look certain.
        """
        values = {level: _read(run, readout, t) for level, run in self.runs.items()}
        known = {level: value for level, value in values.items() if math.isfinite(value)}
        finest = known[max(known, key=_fineness)] if known else math.nan
        if len(known) < 3:
            return Limit(finest, math.nan)
        full = _extrapolated(known)
        others = [_extrapolated({k: v for k, v in known.items() if k != left_out}) for left_out in known]
        return Limit(full, max(FLOOR * abs(finest - full), *(abs(other - full) for other in others)))


def _fineness(level: Level) -> tuple[int, float]:
    return level[0], -level[1]


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
