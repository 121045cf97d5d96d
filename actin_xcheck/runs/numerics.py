"""Everything numerical about a run as one value: as it is asked for, as it is carried out, as it is typed."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil

from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs.fidelity import FULL, Reduction, reduced
from actin_xcheck.runs.method import METHODS, Method, find_method
from actin_xcheck.scene.scene import Scene

DEFAULT_REFINE = 5
"""2113 nodes."""

DEFAULT_STEPS = 100

CHOSEN = "fem"
"""In place of a method's name: whichever of the elements' reaches an accuracy."""

MOST_STEPS = 1e7
"""A run of more would not end."""


@dataclass(frozen=True)
class Numerics:
    """How a scene is run.

    Attributes
    ----------
    method : what integrates it.
    refine : the mesh has 2**refine layers; a mesh of the user's has its cells divided as often.
    dt : the largest time step.
    rtol : largest local error of a step, for an adaptive method; None for equal steps.
    reduction : how much of the model is solved, see `fidelity.reduced`.
    mesh : the user's, instead of the disk: it stands in its place as it lies, and nothing is reduced then.
    remesh : whether the whole disk's mesh is replaced when it is about to fold, for methods that
        `run.remeshes` knows.
    """

    method: Method
    refine: int
    dt: float
    rtol: float | None = None
    reduction: Reduction = FULL
    mesh: Mesh | None = None
    remesh: bool = False

    @property
    def words(self) -> str:
        """Mesh and steps in words, and how much is solved where that is not all."""
        steps = f"dt {self.dt:.3g}" if self.rtol is None else f"rtol {self.rtol:g}"
        part = "" if self.reduction.fidelity is Fidelity.FULL else f", {self.reduction.fidelity}"
        return f"refine {self.refine}, {steps}{part}"

    def command(self, scene: str, out: str) -> str:
        """The command that runs a scene (its name or file) like this, into the file `out`."""
        return command(
            "run",
            scene,
            method=self.method.name,
            refine=self.refine or None,
            dt=self.dt,
            rtol=self.rtol,
            fidelity=self.reduction.fidelity,
            mesh=None if self.mesh is None else self.mesh.origin,
            remesh=self.remesh,
            out=out,
        )


@dataclass(frozen=True)
class Wanted:
    """Numerics as a user asks for them, see `Numerics`; what is None suits the scene.

    Attributes
    ----------
    method : its name.
    fidelity : how much of the model is solved; auto is the smallest model that is exact for the scene.
    accuracy : largest error of area, total actin and probes, for `accuracy.deliver`, which chooses the rest
        among the elements: the method is "fem" then.  UserError where it is no error, or more is chosen.
    """

    method: str
    refine: int | None = None
    dt: float | None = None
    rtol: float | None = None
    fidelity: Fidelity = Fidelity.AUTO
    mesh: Mesh | None = None
    remesh: bool = False
    accuracy: float | None = None

    def __post_init__(self) -> None:
        if self.accuracy is None:
            return
        if not 0 < self.accuracy < 1:
            raise UserError(f"--accuracy: {self.accuracy:g} is no error; valid: a number between 0 and 1")
        if self.method != CHOSEN:
            raise UserError(
                f"--accuracy: not with --method {self.method}; valid: --method {CHOSEN}, which then chooses"
            )
        chosen = {"--refine": self.refine, "--dt": self.dt, "--rtol": self.rtol}
        if given := [name for name, value in chosen.items() if value is not None]:
            raise UserError(f"--accuracy: chooses {', '.join(given)} itself; valid: without")

    def on(self, scene: Scene) -> Numerics:
        """Return the numerics for a scene: as asked, else as published, else 2113 nodes and 100 steps.

        Raises UserError where the method is none or takes equal steps only, or the run would not end.
        """
        method = find_method(self.method)
        if self.rtol is not None and not method.adaptive:
            adaptive = ", ".join(name for name, known in METHODS.items() if known.adaptive)
            raise UserError(
                f"--rtol: {method.name} takes equal steps; valid with {adaptive}, or --dt instead"
            )
        refine, dt = suited(scene, self.refine, self.dt)
        if self.mesh is not None or self.remesh:
            reduction = FULL
        else:
            reduction = reduced(scene, method, self.fidelity, self.rtol)
        if self.mesh is not None:
            refine = self.refine or 0
        return Numerics(method, refine, dt, self.rtol, reduction, self.mesh, self.remesh)


def suited(scene: Scene, refine: int | None = None, dt: float | None = None) -> tuple[int, float]:
    """Mesh refinement and time step: as given, else as published, else 2113 nodes and 100 steps."""
    published = scene.as_published
    dt = dt or published.dt or scene.time.end / DEFAULT_STEPS
    if scene.time.end / dt > MOST_STEPS:
        raise UserError(
            f"{scene.origin}: steps of {dt:g} up to {scene.time.end:g}; valid: {MOST_STEPS:g} steps"
        )
    return refine or published.refine or DEFAULT_REFINE, dt


def typed(words: Sequence[str]) -> str:
    """Return words as a shell takes them, with the program in front."""
    return "python -m actin_xcheck " + shlex.join(words)


def command(name: str, *what: str, **options: object) -> str:
    """Return the command that makes something again.

    Parameters
    ----------
    name, what : the command and what it is given without an option, as scenes.
    options : by name.  None, False and nan leave one out, True is one without a value, a tuple stands for one
        with each of its values; numbers are written to the last digit, so that the same bits come out.
    """
    words = [name, *what]
    for option, given in options.items():
        for value in given if isinstance(given, tuple) else (given,):
            if value is None or value is False or value != value:
                continue
            words.append(f"--{option}")
            if value is not True:
                # a float of numpy says its type in its repr
                words.append(repr(float(value)) if isinstance(value, float) else str(value))
    return typed(words)


KERNEL = 0.055
"""Seconds that the reference kernel takes on the machine of which seconds are these."""

STAGE = {"fem": (2.2e-3, 1e-5), "fv": (7e-3, 1.5e-5)}
"""Seconds of a stage of a step, by the code of a method: on any mesh, and for each cell of a quarter of the
disk; those of another package are taken to be as those of the finite elements."""

SET_UP = 0.02, 1e-4
"""Seconds of what comes before the steps, on any mesh and for each of these cells."""

FIRST, LATER = 3, 0.035
"""Steps of chosen size: those with which every run begins; and the rest over order^2 rtol^(-1/order)."""


def seconds_of(method: Method, refine: int, steps: float) -> float:
    """Seconds of so many steps on a mesh of 2**refine layers, set-up included, on one core."""
    cells = 4.0**refine
    fixed, per_cell = STAGE.get(method.family, STAGE["fem"])
    step = max(method.order_dt, 1) * (
        fixed + per_cell * cells * method.space ** (3 if method.space < 5 else 2)
    )
    alone = SET_UP[0] + SET_UP[1] * cells * method.space**2 + steps * step
    driver = seconds_of(find_method(method.driven_by), refine, steps) if method.driven_by else 0.0
    return alone + driver


def steps_of(numerics: Numerics, output_times: Sequence[float]) -> float:
    """Steps that a run takes: about, where their size is chosen, and none of them is larger than dt."""
    least = step_count(numerics.dt, output_times)
    return least if numerics.rtol is None else max(least, chosen_steps(numerics.method, numerics.rtol))


def chosen_steps(method: Method, rtol: float) -> float:
    """Steps of which each makes a local error of at most rtol, about."""
    order = method.order_dt
    return FIRST + LATER * order**2 * rtol ** (-1 / order)


def run_seconds(numerics: Numerics, output_times: Sequence[float]) -> float:
    """Seconds of a run on one core: half a cell takes half as long, a ray or a few modes next to nothing."""
    steps, reduction = steps_of(numerics, output_times), numerics.reduction
    if reduction.fidelity is Fidelity.SECTOR:
        return seconds_of(numerics.method, numerics.refine, steps) / 2
    if reduction.fidelity is not Fidelity.FULL:
        return seconds_of(replace(numerics.method, driven_by=None), 0, steps)
    return seconds_of(numerics.method, numerics.refine, steps)


def step_count(dt: float, output_times: Sequence[float]) -> int:
    """Number of equal steps of at most dt that a `March` takes."""
    return sum(equal_steps(start, end, dt) for start, end in pairwise((0.0, *output_times)))


def equal_steps(start: float, end: float, dt: float) -> int:
    """Number of equal steps of at most dt from one time to another."""
    return max(1, ceil((end - start) / dt * (1 - 1e-9)))
