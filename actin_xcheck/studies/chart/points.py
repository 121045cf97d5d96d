"""Points of a chart: one method, one mesh, one time step or tolerance; and which of them are tried.

Along a ladder h is halved and errors in space and in time fall together: dt ~ h^(order_h/order_dt) for equal
steps, local errors ~ h^order_h for chosen ones.  Beside each such point stand one of larger and one of
smaller steps, for no rule knows where a scene has its errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from actin_xcheck.runs.fidelity import Fidelity, Reduction
from actin_xcheck.runs.march import step_count
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.scene.scene import Scene

REFINES = {True: (2, 3, 4, 5, 6), False: (1, 2, 3, 4, 5)}
"""Meshes by whether the method is of order 2 or less; those of higher order are finer on the same cells."""

COARSEST_STEPS = 4
"""Equal steps on the mesh of refine 2, where h = 1/4."""

COARSEST_TOLERANCE = 1e-2
"""Of a step, times h^order_h."""

BESIDE = {True: (0.25, 1.0, 4.0), False: (10.0, 1.0, 0.1)}
"""Factors of the number of equal steps, or of the tolerance."""

ARTICLE = "fem-p1-paper"
"""The scheme whose own mesh and step a scene may state."""

REFERENCE = {
    False: (("fem-p4-imex4", 3, 1e-7), ("fem-p4-imex4", 4, 1e-8)),
    True: (("fem-p4-imex4", 2, 1e-6), ("fem-p4-imex4", 3, 1e-7)),
}
"""Method, refine and tolerance of the run that others are held against, after the one that tells its error,
by whether the chart is a quick one."""


@dataclass(frozen=True)
class Point:
    """One run of a chart.

    Attributes
    ----------
    method, refine : what is run, on a mesh of 2**refine layers.
    dt : the largest step.
    rtol : largest local error of a step, or None for equal steps.
    fidelity : how much of the model is solved.
    """

    method: Method
    refine: int
    dt: float
    rtol: float | None = None
    fidelity: Fidelity = Fidelity.FULL

    @property
    def key(self) -> str:
        """A name of its own in the file of a chart."""
        steps = f"dt-{self.dt:.6g}" if self.rtol is None else f"rtol-{self.rtol:g}"
        return f"{self.method.name}--{self.fidelity}--{self.refine}--{steps}"

    @property
    def numerics(self) -> str:
        """Mesh and steps in words, and how much is solved where that is not all."""
        steps = f"dt {self.dt:.3g}" if self.rtol is None else f"rtol {self.rtol:g}"
        part = "" if self.fidelity is Fidelity.FULL else f", {self.fidelity}"
        return f"refine {self.refine}, {steps}{part}"

    def cost(self, output_times: Sequence[float]) -> float:
        """About how much work it is, in any unit that all points of one method share: cells x steps."""
        if self.rtol is None:
            return 4.0**self.refine * step_count(self.dt, output_times)
        return 4.0**self.refine * self.rtol ** (-1 / self.method.order_dt)

    def command(self, scene: Scene) -> str:
        """The command that makes this run again."""
        numerics = Numerics(self.method, self.refine, self.dt, self.rtol, Reduction(self.fidelity))
        return numerics.command(scene.origin, f"{self.key}.vtkhdf")


def ladder(scene: Scene, method: Method, quick: bool = False) -> list[Point]:
    """Return the points of a method, from little work to much.

    Parameters
    ----------
    scene, method : what is charted.
    quick : without the points beside the ladder.
    """
    order = method.order_h or 2  # an exhibit that stalls takes the steps of the method it would be
    factors = (1.0,) if quick else BESIDE[not method.adaptive]
    points = []
    for refine in REFINES[order <= 2]:
        for factor in factors:
            if method.adaptive:
                rtol = float(f"{factor * COARSEST_TOLERANCE * 2.0 ** (-order * refine):.0e}")
                points.append(Point(method, refine, scene.time.end, rtol))
            else:
                steps = factor * COARSEST_STEPS * 2 ** (order / method.order_dt * (refine - 2))
                points.append(Point(method, refine, scene.time.end / max(round(steps), 1)))
    return sorted(points, key=lambda point: point.cost(scene.output_times))


def published(scene: Scene, method: Method) -> list[Point]:
    """The article's scheme on the mesh and with the step that the scene says were used; or nothing."""
    stated = scene.as_published
    if method.name != ARTICLE or stated.refine is None or stated.dt is None:
        return []
    return [Point(method, stated.refine, stated.dt)]


def reference_points(scene: Scene, quick: bool) -> list[Point]:
    """The runs of `REFERENCE`, coarse and fine."""
    return [Point(METHODS[name], refine, scene.time.end, rtol) for name, refine, rtol in REFERENCE[quick]]
