"""Runs that are watched at the rim, step by step: ripples one by one, and a rough rim on finer meshes.

Meshes are counted by the nodes of their rim, of which P_k has k a cell; the time step goes with them, dt ~ h,
so that the coarser run's times are the finer one's too.  Steps are equal: no step control puts off the end of
a rim that is lost.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2
from pathlib import Path

import numpy as np

from actin_xcheck.core import lagrange
from actin_xcheck.core.contract import Grid, Solver, State
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import find_method
from actin_xcheck.runs.numerics import Numerics, run_seconds, seconds_of
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import Scene, load_scene
from actin_xcheck.studies.stored import leave_scene
from actin_xcheck.theory.dispersion import ripple_exponent

ROUGH = 12
"""Ripples of this wave number and beyond are roughness; the four fronts and their first harmonics are not."""


def rim_of(grid: Grid) -> Indices:
    """Nodes of the grid on the rim, counter-clockwise from angle 0 on: equispaced, so that meshes nest."""
    triangles = np.swapaxes(grid.cells[lagrange.pieces(grid.order)], 1, 2).reshape(3, -1)
    nodes = Mesh(np.empty((2, 0)), triangles, h=np.nan).rim_nodes
    x, y = grid.xi[:, nodes]
    return np.roll(nodes, -int(np.argmin(np.abs(np.arctan2(y, x)))))


def rims_of(solver: Solver, states: Sequence[State]) -> Array:
    """The rims (n_states, 2, n) of the states of a run."""
    nodes = rim_of(solver.grid)
    return np.array([solver.frame(state).x[:, nodes] for state in states])


def mean_radius(rim: Array) -> Array:
    """Mean distance from the origin of rims (..., 2, n): (...)."""
    return np.asarray(np.hypot(rim[..., 0, :], rim[..., 1, :]).mean(axis=-1))


def spectrum_of(rim: Array) -> Array:
    """Amplitudes (..., n // 2 + 1) of the radii of rims (..., 2, n) by wave number, m = 0 being the mean."""
    radii = np.hypot(rim[..., 0, :], rim[..., 1, :])
    amplitudes = np.abs(np.fft.rfft(radii, axis=-1)) * 2 / radii.shape[-1]
    amplitudes[..., [0, -1]] /= 2
    return np.asarray(amplitudes)


def roughness(rim: Array) -> Array:
    """Root mean square of the ripples m >= `ROUGH` of rims (..., 2, n), in mean radii: (...)."""
    amplitudes = spectrum_of(rim)
    return np.asarray(np.sqrt((amplitudes[..., ROUGH:] ** 2).sum(axis=-1) / 2) / amplitudes[..., 0])


def distance(fine: Array, coarse: Array) -> Array:
    """Rms distance, in mean radii, of the points that rims (..., 2, n) and (..., 2, n/2) share."""
    apart = fine[..., ::2] - coarse
    return np.asarray(np.sqrt((apart**2).sum(axis=-2).mean(axis=-1)) / mean_radius(coarse))


BASE = "swelling-disk"

AMPLITUDE = 1e-5
"""Of a ripple: first order to 1e-6 for the largest m, and 1e11 times round-off."""

STEPS, DT = 2, 1e-3
"""So short a time that concentration, which theory leaves out, has none to answer: R changes by 1e-4."""

MODES = (2, 3, 4, 6, 8, 12, 16, 20, 24, 32, 40, 48)
"""Wave numbers; those a rim has nodes for are measured."""


@dataclass(frozen=True)
class Ripples:
    """A measurement that is asked for: every ripple of one method on one mesh.

    Attributes
    ----------
    method, refine : numerics.
    closure : the reading of the rim.
    advancing : whether the rim advances; it retracts where p has the other sign.
    modes : wave numbers.
    """

    method: str
    refine: int
    closure: Closure
    advancing: bool = True
    modes: tuple[int, ...] = MODES

    @property
    def seconds(self) -> float:
        """About what it takes."""
        return (1 + len(self.modes)) * seconds_of(find_method(self.method), self.refine, STEPS)


@dataclass(frozen=True, eq=False)
class RippleGrowth:
    """What was measured.

    Attributes
    ----------
    asked : what was asked for.
    nodes : of the rim.
    speed : of the rim, mean over the time.
    modes : wave numbers (n,), each below half the nodes.
    measured, predicted : gamma (n,): the amplitude goes like R^gamma; measured is nan where the run failed.
    messages : why, of each mode; empty where it did not.
    """

    asked: Ripples
    nodes: int
    speed: float
    modes: Array
    measured: Array
    predicted: Array
    messages: tuple[str, ...]

    @property
    def known(self) -> Array:
        """Which rates were measured, (n,) of truth values."""
        return np.isfinite(self.measured)


def rippled(closure: Closure, advancing: bool, m: int) -> Scene:
    """Return the swelling (or shrinking) disk, its rim displaced by a ripple; m = 0 is the disk itself."""
    base, ripple = load_scene(BASE), f"{AMPLITUDE}*r**{m}*cos({m}*theta)"
    changes = {
        "name": f"{BASE}-{m}",
        "model.closure": str(closure),
        "parameters.p": base.parameters.p * (1 if advancing else -1),
        "time": {"end": STEPS * DT},
    }
    if m:
        changes["initial.u"] = [f"{ripple}*cos(theta)", f"{ripple}*sin(theta)"]
    return base.varied(changes, f"{BASE}-{m}")


def measure(asked: Ripples, folder: Path = Path()) -> RippleGrowth:
    """Run every ripple beside the disk without one and read off how its amplitude grew."""
    bare, trouble = _rims(asked, 0)
    nodes = bare.shape[-1]
    modes = [m for m in asked.modes if m < nodes / 2]
    radius = mean_radius(bare)
    angles = 2 * np.pi * np.arange(nodes) / nodes
    measured, messages = [], []
    for m in modes:
        rim, message = (bare, f"without a ripple: {trouble}") if trouble else _rims(asked, m)
        messages.append(message)
        if message:
            measured.append(np.nan)
            continue
        ripple = np.hypot(*rim.swapaxes(0, 1)) - np.hypot(*bare.swapaxes(0, 1))
        amplitude = ripple @ np.cos(m * angles) * 2 / nodes
        measured.append(np.log(np.abs(amplitude[-1] / amplitude[0])) / np.log(radius[-1] / radius[0]))
    parameters = load_scene(BASE).parameters
    return RippleGrowth(
        asked=asked,
        nodes=nodes,
        speed=np.nan if trouble else float((radius[-1] - radius[0]) / (STEPS * DT)),
        modes=np.array(modes),
        measured=np.array(measured),
        predicted=np.array([ripple_exponent(asked.closure, parameters, m) for m in modes]),
        messages=tuple(messages),
    )


def _rims(asked: Ripples, m: int) -> tuple[Array, str]:
    """The rim (n_states, 2, n) of a run with the ripple m, and why the run failed; empty where it did not."""
    scene = rippled(asked.closure, asked.advancing, m)
    numerics = Numerics(find_method(asked.method), asked.refine, DT)
    solver = bind(scene, numerics)
    march = March(solver, numerics, scene.output_times)
    rims, ended = rims_of(solver, [moment.state for moment in march]), march.outcome
    return rims, "" if ended.ok else f"{ended.ending.replace('_', ' ')}, {ended.message}"


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
        return run_seconds(self.numerics, [load_scene(self.scene).time.end])

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
        """See `roughness`, (n_states,)."""
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
    scene = scene_of(course)
    leave_scene(folder, course.file, scene.text)
    solver = bind(scene, course.numerics)
    march = March(solver, course.numerics, scene.output_times)
    states = [moment.state for moment in march]
    rims = rims_of(solver, states)
    times, ended = np.array([state.t for state in states]), march.outcome
    return Rim(course, times, rims, str(ended.ending), ended.message)
