"""Points of a chart: one method, one mesh, one time step or tolerance; and which of them are tried.

Along a ladder h is halved and errors in space and in time fall together: dt ~ h^(order_h/order_dt) for equal
steps, local errors ~ h^order_h for chosen ones.  Beside each such point stand one of larger and one of
smaller steps, for no rule knows where a scene has its errors.
"""

from dataclasses import dataclass

from actin_xcheck.runs.cost import run_seconds
from actin_xcheck.runs.method import METHODS, Method
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.scene.scene import Scene

COARSEST_STEPS = 4
"""Equal steps on the mesh of refine 2, where h = 1/4."""

COARSEST_TOLERANCE = 1e-2
"""Of a step, times h^order_h."""

ARTICLE = "fem-p1-paper"
"""The scheme whose own mesh and step a scene may state."""


@dataclass(frozen=True)
class Plan:
    """How much is charted.

    Attributes
    ----------
    budget : processor seconds for the runs of one method; the first run is made in any case.
    reference : method, refine and tolerance of the run that others are held against, after those of the one
        that tells its error.
    refines : meshes of methods of order 2 or less, and of those of higher order, which are finer on the same
        cells.
    steps_beside, tolerances_beside : factors of the number of equal steps, and of the tolerance.
    published : whether the article's scheme is run with its own mesh and step too.
    """

    budget: float
    reference: tuple[tuple[str, int, float], tuple[str, int, float]]
    refines: tuple[tuple[int, ...], tuple[int, ...]] = ((2, 3, 4, 5, 6), (1, 2, 3, 4, 5))
    steps_beside: tuple[float, ...] = (0.25, 1.0, 4.0)
    tolerances_beside: tuple[float, ...] = (10.0, 1.0, 0.1)
    published: bool = True


WHOLE = Plan(32.0, (("fem-p4-imex4", 3, 1e-7), ("fem-p4-imex4", 4, 1e-8)))
QUICK = Plan(
    8.0,
    (("fem-p4-imex4", 2, 1e-6), ("fem-p4-imex4", 3, 1e-7)),
    steps_beside=(1.0,),
    tolerances_beside=(1.0,),
    published=False,
)


def command_of(point: Numerics, scene: Scene) -> str:
    """The command that makes a point's run again."""
    steps = f"dt-{point.dt:.6g}" if point.rtol is None else f"rtol-{point.rtol:g}"
    file = f"{point.method.name}--{point.reduction.fidelity}--{point.refine}--{steps}.vtkhdf"
    return point.command(scene.origin, file)


def ladder(scene: Scene, method: Method, plan: Plan = WHOLE) -> list[Numerics]:
    """Return the points of a method, from little work to much."""
    order = method.order_h or 2  # an exhibit that stalls takes the steps of the method it would be
    points = []
    for refine in plan.refines[order > 2]:
        for factor in plan.tolerances_beside if method.adaptive else plan.steps_beside:
            if method.adaptive:
                rtol = float(f"{factor * COARSEST_TOLERANCE * 2.0 ** (-order * refine):.0e}")
                points.append(Numerics(method, refine, scene.time.end, rtol))
            else:
                steps = factor * COARSEST_STEPS * 2 ** (order / method.order_dt * (refine - 2))
                points.append(Numerics(method, refine, scene.time.end / max(round(steps), 1)))
    return sorted(points, key=lambda point: run_seconds(point, scene.output_times))


def published(scene: Scene, method: Method, plan: Plan = WHOLE) -> list[Numerics]:
    """The article's scheme on the mesh and with the step that the scene says were used; or nothing."""
    stated = scene.as_published
    if not plan.published or method.name != ARTICLE or stated.refine is None or stated.dt is None:
        return []
    return [Numerics(method, stated.refine, stated.dt)]


def reference_points(scene: Scene, plan: Plan) -> list[Numerics]:
    """The runs that others are held against, coarse and fine."""
    return [Numerics(METHODS[name], refine, scene.time.end, rtol) for name, refine, rtol in plan.reference]
