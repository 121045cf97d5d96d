"""What is run and measured: scenes and methods on distorted meshes, worse and worse, on two mesh widths."""

import time
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.contract import Solver
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import make_folder
from actin_xcheck.core.linear import FACTORISATIONS, ITERATIONS, SOLVES, WORK
from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Array, Delta
from actin_xcheck.runs.method import Method, find_method
from actin_xcheck.runs.numerics import Numerics, command, seconds_of
from actin_xcheck.runs.run import bind, solver_for
from actin_xcheck.scene.outline import (
    aspects,
    flattened,
    largest_angle,
    off_ring,
    perturbed,
    stretched,
    without_layers,
    write_mesh,
)
from actin_xcheck.scene.resolve import probe_points, resolve
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.stored import AskedRun, LastState, last_state, leave_scene


@dataclass(frozen=True)
class Family:
    """A way to make a mesh worse.

    Attributes
    ----------
    key, title, note : what it is called, in the file and on the page, and what is done.
    severity : what its numbers mean.
    severities : from none to the worst.
    distort : of a refinement, l0 and a severity the mesh.
    """

    key: str
    title: str
    note: str
    severity: str
    severities: tuple[float, ...]
    distort: Callable[[int, float, float], Mesh]

    @property
    def none(self) -> float:
        """The severity that changes nothing."""
        return self.severities[0]


def _perturbed(refine: int, l0: float, amount: float) -> Mesh:
    return perturbed(disk(refine, l0), amount, l0, seed=refine)


def _stretched(refine: int, l0: float, closer: float) -> Mesh:
    return stretched(disk(refine, l0), closer)


def _flattened(refine: int, l0: float, times: float) -> Mesh:
    return flattened(disk(refine, l0), 1 / times, l0, seed=refine)


FAMILIES = {
    family.key: family
    for family in (
        Family(
            "perturbed",
            "Perturbed at random",
            "Inner nodes are moved in random directions, by a part of the shortest side at each.",
            "part of the shortest side",
            (0.0, 0.1, 0.2, 0.3, 0.5),
            _perturbed,
        ),
        Family(
            "stretched",
            "Needles",
            "Half of the rays are drawn together about the y axis; the others share the room that leaves, so "
            "that their cells become twice as wide.",
            "rays closer by a factor",
            (1.0, 4.0, 20.0, 90.0),
            _stretched,
        ),
        Family(
            "slivers",
            "Slivers",
            "About a tenth of the inner nodes are moved towards the middle of a side across, so that one "
            "cell at each is flattened to an angle near 180 degrees.",
            "cells flatter by a factor",
            (1.0, 10.0, 100.0, 1000.0),
            _flattened,
        ),
        Family(
            "off-ring",
            "A ring that no sides follow",
            "The layer that should lie on the ring |xi| = l0, where delta jumps, lies outside of it.",
            "offset in widths of a layer",
            (0.0, 0.1, 0.2, 0.3),
            off_ring,
        ),
    )
}

UNDISTORTED = "undistorted"
"""The family of the disk's own mesh, taken as if its origin were unknown."""

LEVELS = (3, 4), (2, 3)
"""The two refinements, of P1, as which finite volumes count, and of elements of higher order."""

STEPS = {1: 64, 2: 32, 3: 24, 4: 24, 5: 24}
"""Equal steps on the coarser mesh, by the order in time: errors in space lead.  On the finer one there are
twice as many, four times by methods of first order."""


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes
    ----------
    scene : its TOML.
    method : by name.
    family, severity : the mesh, see `FAMILIES`, or `UNDISTORTED`.
    refine, steps : its width and the equal steps to the scene's end.
    """

    scene: str
    method: str
    family: str
    severity: float
    refine: int
    steps: int

    @property
    def name(self) -> str:
        """That of its scene."""
        return str(tomllib.loads(self.scene)["name"])

    @property
    def scene_file(self) -> str:
        """Where its scene lies in the report's folder: commands are for there, not for where a user was."""
        return f"scenes/{self.name}.toml"

    @property
    def mesh_file(self) -> str:
        """Where its mesh lies in the report's folder: two scenes may have rings of other radii."""
        return f"meshes/{self.name}/{self.family}-{self.severity:g}-refine-{self.refine}.vtu"

    @property
    def seconds(self) -> float:
        """About what it takes."""
        return seconds_of(find_method(self.method), self.refine, self.steps)

    def mesh(self, l0: float) -> Mesh:
        """Make its mesh."""
        if self.family == UNDISTORTED:
            return without_layers(disk(self.refine, l0))
        return FAMILIES[self.family].distort(self.refine, l0, self.severity)

    def command(self, scene: Scene) -> str:
        """The command that makes the run again, in the report's folder."""
        dt = scene.time.end / self.steps
        where = {"mesh": self.mesh_file, "out": "run.vtkhdf"}
        return command("run", self.scene_file, method=self.method, dt=dt, **where)


def families_of(scene: Scene) -> tuple[Family, ...]:
    """Those that say something of a scene: without a jump at the ring it may lie anywhere."""
    ring = scene.physics.delta is Delta.RING
    return tuple(family for family in FAMILIES.values() if ring or family.key != "off-ring")


def cases_of(scene: Scene, method: Method, family: Family, severity: float) -> tuple[Case, Case]:
    """The runs of a method on one distortion: on the coarser and on the finer mesh."""
    key, number = (UNDISTORTED, 0.0) if severity == family.none else (family.key, severity)
    order = round(method.order_dt)
    coarse, fine = LEVELS[method.space > 1]
    steps = STEPS[order], STEPS[order] * (4 if order == 1 else 2)
    return (
        Case(scene.text, method.name, key, number, coarse, steps[0]),
        Case(scene.text, method.name, key, number, fine, steps[1]),
    )


def check(scene: Scene, methods: Sequence[Method]) -> None:
    """UserError where a scene or a method cannot be held on a mesh of its own."""
    if scene.domain.rotation:
        raise UserError(f"{scene.origin}: domain.rotation: distorted meshes are not turned; valid: 0")
    for method in methods:
        if method.driven_by is not None:
            raise UserError(
                f"--method: {method.name} follows another run's nodes; valid: one that moves its own"
            )


@dataclass(frozen=True)
class CaseAnswer:
    """What a run says, and how it got there.

    Attributes
    ----------
    said : in its last state, of the points of `read_at`.
    cells : of the mesh.
    aspect, angle : of its worst cells, see `distortion`; degrees.
    solves, factorisations, iterations : of linear systems; iterations are those of Krylov methods.
    """

    said: LastState
    cells: int
    aspect: float
    angle: float
    solves: int
    factorisations: int
    iterations: int


def answer_of(case: Case, folder: Path) -> CaseAnswer:
    """Run a case in equal steps, and leave its scene and mesh, which the case's command names."""
    scene, method = parse_scene(case.scene, case.scene_file), find_method(case.method)
    mesh, file = case.mesh(scene.parameters.l0), folder / case.mesh_file
    leave_scene(folder, case.scene_file, case.scene)
    make_folder(file.parent)
    write_mesh(file, mesh)
    numerics = Numerics(method, case.refine, scene.time.end / case.steps, mesh=mesh)
    solver = solver_for(resolve(scene), method, mesh)
    WORK.clear()
    said = _said(scene, solver, numerics)
    return CaseAnswer(
        said=said,
        cells=mesh.triangles.shape[1],
        aspect=float(aspects(mesh.xi, mesh.triangles).max()),
        angle=largest_angle(mesh.xi, mesh.triangles),
        solves=WORK[SOLVES],
        factorisations=WORK[FACTORISATIONS],
        iterations=WORK[ITERATIONS],
    )


def converged(asked: AskedRun, folder: Path) -> LastState:
    """A run on the disk's own mesh that others are held against."""
    return _said(asked.scene, bind(asked.scene, asked.numerics), asked.numerics)


def _said(scene: Scene, solver: Solver, numerics: Numerics) -> LastState:
    began, probes = time.perf_counter(), solver.probes(read_at(scene))
    return last_state(solver, numerics, scene.output_times, probes, began)


def read_at(scene: Scene) -> Array:
    """Where runs are compared, (2, n): at the scene's probes, then at the points of `cloud`."""
    return np.hstack([probe_points(scene), cloud(scene.parameters.l0)])


def cloud(l0: float) -> Array:
    """Material points (2, 217), spread evenly over the disk within the ring and over what is beyond."""
    middles = [(np.arange(n) + 0.5) / n for n in (5, 2)]
    radii = np.concatenate([l0 * np.sqrt(middles[0]), np.sqrt(l0**2 + (1 - l0**2) * middles[1])])
    theta = 2 * np.pi * (np.arange(31) + 0.5) / 31  # odd: no mirror line of a scene is seen twice
    return np.array([np.outer(radii, np.cos(theta)), np.outer(radii, np.sin(theta))]).reshape(2, -1)
