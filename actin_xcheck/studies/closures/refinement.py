"""One scene under both readings of its rim, on finer and finer meshes: what the rim does, step by step.

Meshes are counted by the nodes of their rim, of which P_k has k a cell; the time step goes with them, dt ~ h,
so that the coarser run's times are the finer one's too.  Steps are equal: no step control puts off the end of
a rim that is lost.
"""

from dataclasses import dataclass
from math import ceil, log2
from pathlib import Path

import numpy as np

from actin_xcheck.core.files import replace_file
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.core.outcome import Ending
from actin_xcheck.runs.march import integrate
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import Scene, load_scene
from actin_xcheck.studies.closures.rims import Rims, distance, mean_radius, roughness

FEWEST_STEPS = 10
"""On the coarsest mesh."""

LOST = 2.0
"""A rim is lost once it is so many times rougher than under `reference-normal` on the same mesh."""

SMOOTH = 1e-9
"""Roughness below this is round-off."""


@dataclass(frozen=True)
class Course:
    """A run that is asked for.

    Attributes
    ----------
    scene : a shipped scene's name.
    method : of its numerics.
    closure : the reading of the rim.
    level : 0 for the coarsest mesh, of 32 rim nodes; each next one has twice as many, and steps.
    """

    scene: str
    method: str
    closure: Closure
    level: int

    @property
    def refine(self) -> int:
        """The mesh has 2**refine layers; P_k needs log2 k fewer for as many rim nodes."""
        return 3 + self.level - ceil(log2(find_method(self.method).space))

    @property
    def steps(self) -> int:
        """Equal steps to the end."""
        return FEWEST_STEPS * 2**self.level

    @property
    def key(self) -> str:
        """Its name in files."""
        return f"{self.scene}--{self.method}--{self.closure}--{self.level}"

    @property
    def dt(self) -> float:
        """The time step."""
        return load_scene(self.scene).time.end / self.steps

    @property
    def numerics(self) -> Numerics:
        """How its scene is run."""
        return Numerics(find_method(self.method), self.refine, self.dt)

    @property
    def seconds(self) -> float:
        """About what it takes."""
        method = find_method(self.method)
        nodes = 4.0**self.refine * method.space**2
        return self.steps * nodes / 4e4 * method.order_dt * (3 if method.family == "fv" else 1)

    @property
    def file(self) -> str:
        """Where its scene is written, in the report's folder."""
        return f"scenes/{self.scene}--{self.closure}.toml"

    @property
    def command(self) -> str:
        """The command that makes the run again, in the report's folder."""
        return self.numerics.command(self.file, f"{self.key}.vtkhdf")


@dataclass(frozen=True, eq=False)
class Rim:
    """What a run's rim did.

    Attributes
    ----------
    course : the run.
    times : of every state that stands, (n_states,).
    rims : the rim's nodes, (n_states, 2, n).
    outcome, message : how the run ended.
    """

    course: Course
    times: Array
    rims: Array
    outcome: str
    message: str

    @property
    def nodes(self) -> int:
        """Of the rim."""
        return self.rims.shape[-1]

    @property
    def radius(self) -> Array:
        """Mean radii (n_states,)."""
        return mean_radius(self.rims)

    @property
    def roughness(self) -> Array:
        """See `rims.roughness`, (n_states,)."""
        return roughness(self.rims)

    def lost(self, twin: "Rim") -> float:
        """When the rim was `LOST` times as rough as its twin's, or the run failed; inf where neither happens.

        The twin is the same run under `reference-normal`.  Between steps the ratio is taken as exponential.
        """
        count = min(len(self.times), len(twin.times))
        rough, due = self.roughness[:count], LOST * np.maximum(twin.roughness[:count], SMOOTH)
        ratio = np.log(np.maximum(rough, SMOOTH) / due)
        beyond = np.flatnonzero(ratio > 0)
        if not beyond.size:
            return np.inf if self.outcome == Ending.COMPLETED else float(self.times[-1])
        after = int(beyond[0])
        return float(np.interp(0.0, ratio[after - 1 : after + 1], self.times[after - 1 : after + 1]))

    def change_to(self, finer: "Rim") -> Array:
        """Distance (n_states,) to the next finer mesh's rim at this one's times; nan where it has failed."""
        shared = finer.rims[::2][: len(self.times)]
        apart = np.full(len(self.times), np.nan)
        apart[: len(shared)] = distance(shared, self.rims[: len(shared)])
        return apart


def scene_of(course: Course) -> Scene:
    """Return the scene with the course's closure, without output times and without what it expects."""
    left_out = dict.fromkeys(("time.outputs", "expect", "as_published"))
    read = {"name": f"{course.scene}--{course.closure}", "model.closure": str(course.closure)}
    return load_scene(course.scene).varied(read | left_out, course.file)


def follow(course: Course, folder: Path) -> Rim:
    """Run a course and keep its rim; leave its scene, which the course's command names."""
    scene, file = scene_of(course), folder / course.file
    file.parent.mkdir(exist_ok=True)
    replace_file(file, scene.text.encode())
    solver = bind(scene, course.numerics)
    rims = Rims(solver)
    with np.errstate(all="ignore"):  # what overflows in a run ends as its Outcome
        outcome = integrate(solver, course.dt, scene.output_times, rims)
    return Rim(course, np.array(rims.times), np.array(rims.rims), str(outcome.ending), outcome.message)
