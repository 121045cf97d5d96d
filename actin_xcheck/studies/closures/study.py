"""What the two readings of the moving rim do to ripples, and what mesh refinement makes of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.report.exhibits import Chapter
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures.charts import EXAGGERATED, on_meshes, on_ripples, outlines
from actin_xcheck.studies.closures.findings import Ladder, ladders, on_growth, on_refinement, reason
from actin_xcheck.studies.closures.growth import BASE, Ripples, Spectrum, measure
from actin_xcheck.studies.closures.refinement import LOST, Course, Rim, follow
from actin_xcheck.studies.closures.rims import ROUGH
from actin_xcheck.studies.study import Report, Study, Table, Task
from actin_xcheck.theory.ripples import contrast

READINGS = (Closure.CURRENT_NORMAL, Closure.REFERENCE_NORMAL)

ROUGH_SCENE, ARTICLES = "rough-swelling", "fig14-four-fronts"
"""A rim with kinks that doubles its radius, and the article's own cell, whose rim advances by 7 %."""

METHODS = ("fem-p1-paper", "fem-p2-imex3", "fem-p4-imex4", "fv-coupled")

ON_ARTICLES = "fem-p2-imex3"
"""The method that shows what the closures do to the article's cell."""

LEVELS = range(4)
"""32 to 256 rim nodes: refine 3 to 6 for P1 and the finite volumes, 2 to 5 for P2, 1 to 4 for P4."""

RIPPLED = 2
"""The level on which all methods' ripples are measured: 128 rim nodes."""


def plan(methods: Sequence[str]) -> list[Ripples | Course]:
    """What a report asks for: ripples of both readings and ways, P2's on three meshes; refinement."""
    asked: list[Ripples | Course] = []
    for method in methods:
        refine = Course(ROUGH_SCENE, method, Closure.CURRENT_NORMAL, RIPPLED).refine
        whole = Ripples(method, refine, Closure.CURRENT_NORMAL)
        finer = [replace(whole, refine=refine + by) for by in (-1, 1)] if method == ON_ARTICLES else []
        asked += [whole, *finer, replace(whole, advancing=False)]
        asked.append(replace(whole, closure=Closure.REFERENCE_NORMAL))
    scenes = [(ROUGH_SCENE, method) for method in methods]
    scenes += [(ARTICLES, method) for method in methods if method == ON_ARTICLES]
    return asked + [
        Course(scene, method, closure, level)
        for scene, method in scenes
        for closure in READINGS
        for level in LEVELS
    ]


@dataclass(frozen=True)
class Ripple:
    """How one ripple of wave number m grew: its amplitude goes like R^gamma, measured and by theory.

    Where its run failed `measured` is nan and `message` says why.
    """

    method: str
    closure: Closure
    advancing: bool
    refine: int
    nodes: int
    m: int
    measured: float
    predicted: float
    message: str


def _ripples(spectra: Sequence[Spectrum]) -> list[Ripple]:
    return [
        Ripple(
            method=one.asked.method,
            closure=one.asked.closure,
            advancing=one.asked.advancing,
            refine=one.asked.refine,
            nodes=one.nodes,
            m=int(m),
            measured=float(measured),
            predicted=float(predicted),
            message=message,
        )
        for one in spectra
        for m, measured, predicted, message in zip(
            one.modes, one.measured, one.predicted, one.messages, strict=True
        )
    ]


@dataclass(frozen=True, eq=False)
class Followed:
    """A run under one reading: what was run, how it ended, and its rim (n, 2, nodes) at `times` (n,).

    `lost` is when its rim was lost, see `Rim.lost`; inf where it was not.
    """

    scene: str
    method: str
    closure: Closure
    nodes: int
    refine: int
    steps: int
    outcome: str
    message: str
    t: float
    radius: float
    roughness: float
    lost: float
    command: str
    times: Array
    rims: Array


def closures(asked: Sequence[Ripples | Course]) -> Study:
    """Measure ripples and follow rims on finer and finer meshes, see `plan`."""
    answers = yield [
        Task(measure, one, one.seconds)
        if isinstance(one, Ripples)
        else Task(follow, one, one.seconds, (one.file,))
        for one in asked
    ]
    spectra = [one for one in answers if isinstance(one, Spectrum)]
    rims = [one for one in answers if isinstance(one, Rim)]
    found = ladders(rims)
    return Report(
        "Closures of the moving rim",
        _lead(),
        {
            "ripples": Table(
                "Ripples", _ripples(spectra), "The amplitude goes like the radius to this power."
            ),
            "runs": Table("Runs", _rows(found), "Commands are for this page's folder.", SHOWN),
        },
        findings=(reason(rims), *on_growth(spectra), *on_refinement(rims)),
        chapters=(
            Chapter("outlines", "Outlines", _OUTLINES, outlines(found)),
            Chapter("growth", "Growth by wave number", _GROWTH, on_ripples(spectra)),
            Chapter("refinement", "Mesh refinement", _REFINEMENT, on_meshes(found)),
        ),
    )


SHOWN = (
    *("scene", "method", "closure", "nodes", "refine", "steps", "outcome", "message", "t", "radius"),
    *("roughness", "lost", "command"),
)


def _rows(found: Sequence[Ladder]) -> list[Followed]:
    return [
        Followed(
            scene=rim.course.scene,
            method=rim.course.method,
            closure=rim.course.closure,
            nodes=rim.nodes,
            refine=rim.course.refine,
            steps=rim.course.steps,
            outcome=rim.outcome,
            message=rim.message,
            t=float(rim.times[-1]),
            radius=float(rim.radius[-1]),
            roughness=float(rim.roughness[-1]),
            lost=float(lost),
            command=rim.course.command,
            times=rim.times,
            rims=rim.rims,
        )
        for ladder in found
        for rim, lost in zip(ladder.rims, ladder.lost, strict=True)
    ]


def _lead() -> str:
    kappa = contrast(load_scene(BASE).parameters)
    return (
        "The article says that the rim moves along its normal, and can be read two ways: the normal of the "
        "rim as it is (current-normal), or as it was at first (reference-normal). By the first, v·τ = 0 on a "
        "ripple h of wave number k drags the rim along its slope by −V ∂h/∂x; the network answers with "
        f"v·n = κ V |k| h, κ = (μ₁/2)/(μ₁ + μ₂) = {kappa:.3f}. Where the rim advances ripples grow, the "
        "shorter the faster and without bound: no solution depends continuously on its data, and there is "
        "nothing for a finer mesh to converge to. Where it retracts they are damped."
    )


_OUTLINES = (
    "The last rim of each run that stands, in its own mean radius, its departures from the circle drawn "
    f"{EXAGGERATED:g} times. Dotted: the rim at t = 0. On a cell that swells uniformly the right outline is "
    "that, for good. Finer meshes to the right."
)

_GROWTH = (
    "A disk that swells uniformly (a tension on the rim alone, nothing inside) has ripples that are known in "
    "closed form for every m: the amplitude goes like R^γ, γ = κ(m² − 1)/(m − κ) with current-normal, which "
    "tends to κm, and γ = 1 with reference-normal. Each ripple is a run of its own, beside a twin without "
    "one, of amplitude 10⁻⁵ and over so short a time that the concentration does not answer."
)

_REFINEMENT = (
    "The same scene with both closures on meshes of the same number of rim nodes, Δt ~ h. Roughness is the "
    f"root mean square of ripples with m ≥ {ROUGH}. A rim counts as lost once it is {LOST:g} times as rough "
    "as with reference-normal on the same mesh, or its run fails."
)
