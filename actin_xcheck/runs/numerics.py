"""Everything numerical about a run as one value: as it is asked for, as it is carried out, as it is typed."""

from dataclasses import dataclass

from actin_xcheck.core.choices import Fidelity
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.runs.commands import command
from actin_xcheck.runs.fidelity import FULL, Reduction, reduced
from actin_xcheck.runs.method import METHODS, Method, find_method
from actin_xcheck.scene.scene import Scene

DEFAULT_REFINE = 5
"""2113 nodes."""

DEFAULT_STEPS = 100

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
    """

    method: str
    refine: int | None = None
    dt: float | None = None
    rtol: float | None = None
    fidelity: Fidelity = Fidelity.AUTO
    mesh: Mesh | None = None
    remesh: bool = False

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
