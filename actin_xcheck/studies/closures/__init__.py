"""What the two readings of the moving rim do to ripples, and what mesh refinement makes of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from actin_xcheck.core.errors import Ending
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.report.exhibits import Chapter, Line, Outline, Outlines, Plot
from actin_xcheck.runs.records import gathered
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures.findings import JUDGED, Ladder, ladders, on_growth, on_refinement, reason
from actin_xcheck.studies.closures.measure import (
    BASE,
    LOST,
    ROUGH,
    Course,
    Rim,
    RippleGrowth,
    Ripples,
    follow,
    mean_radius,
    measure,
)
from actin_xcheck.studies.study import Report, Study, Table, Task
from actin_xcheck.theory.dispersion import contrast, ripple_exponent

EXAGGERATED = 3.0
"""How many times the departure of an outline from the circle is drawn."""

_SPACING = "distance of rim nodes, in radii"


def on_ripples(spectra: Sequence[RippleGrowth]) -> tuple[Plot, ...]:
    """Charts of measured rates against theory's."""
    current = [one for one in spectra if one.asked.closure is Closure.CURRENT_NORMAL]
    by_method: dict[str, list[RippleGrowth]] = {}
    for one in current:
        if one.asked.advancing:
            by_method.setdefault(one.asked.method, []).append(one)
    exact = "Dotted: the exact rate on the disk, κ(m² − 1)/(m − κ), and the half-plane's κm"
    main = [group[0] for group in by_method.values()]
    plots = [_rates("advancing", "Growth, advancing rim, current-normal", f"Rate over V/R. {exact}.", main)]
    for method, group in by_method.items():
        if len(group) > 1:
            note = f"Rate over V/R on several meshes. {exact}."
            group.sort(key=lambda one: one.nodes)
            plots.append(_rates(f"meshes-{method}", f"The mesh's cut-off, {method}", note, group))
    retracting = [one for one in current if not one.asked.advancing]
    note = "Rate over |V|/R, V < 0: what grows on an advancing rim is damped here by as much."
    plots.append(_rates("retracting", "Damping, retracting rim, current-normal", note, retracting))
    steady = [one for one in spectra if one.asked.closure is Closure.REFERENCE_NORMAL]
    note = "Rate over V/R: 1 for every ripple and method, which is to keep its shape. Dotted: current-normal."
    plots.append(_rates("steady", "Growth, advancing rim, reference-normal", note, steady))
    return tuple(plot for plot in plots if plot.lines)


def _rates(key: str, title: str, note: str, spectra: Sequence[RippleGrowth]) -> Plot:
    """Rates over |V|/R of spectra that go the same way, beside those of theory with `current-normal`.

    A ripple whose run failed is a gap.
    """
    spectra = [one for one in spectra if one.known.any()]
    if not spectra:
        return Plot(key, title, note, "", ())
    way, parameters = 1.0 if spectra[0].asked.advancing else -1.0, load_scene(BASE).parameters
    m = np.arange(1.0, max(float(one.modes.max()) for one in spectra) + 1)
    exact = [way * ripple_exponent(Closure.CURRENT_NORMAL, parameters, int(one)) for one in m]
    lines = (
        *(
            Line(f"{one.asked.method}, {one.nodes} rim nodes", one.modes, way * one.measured)
            for one in spectra
        ),
        Line("exact, on the disk", m, np.array(exact), guide=True),
        Line("κm, half-plane", m, np.asarray(way * contrast(parameters) * m), guide=True),
    )
    return Plot(key, title, note, "wave number m", lines)


def on_meshes(found: Sequence[Ladder]) -> tuple[Plot, ...]:
    """Charts of what finer meshes do, scene by scene."""
    every = []
    for scene in dict.fromkeys(one.scene for one in found):
        ours = [one for one in found if one.scene == scene]
        current = [one for one in ours if one.closure is Closure.CURRENT_NORMAL]
        plots = [
            _changes(scene, closure, [one for one in ours if one.closure is closure])
            for closure in (Closure.CURRENT_NORMAL, Closure.REFERENCE_NORMAL)
        ]
        if any(np.isfinite(one.lost).any() for one in current):
            plots.append(_lost(scene, current))
        plots += [_rough(one) for one in current]
        every += plots
    return tuple(every)


def _changes(scene: str, closure: Closure, group: Sequence[Ladder]) -> Plot:
    course = group[0].rims[0].course
    at = course.dt * course.steps * JUDGED
    lines = tuple(Line(one.method, one.spacing[:-1], one.changes(JUDGED)) for one in group)
    note = f"Rms distance, in radii, from the next finer mesh's rim at t = {at:.3g}. A gap: one has failed."
    title = f"Refinement, {scene}, {closure}"
    return Plot(f"{scene}-{closure}", title, note, _SPACING, lines, log=True)


def _lost(scene: str, group: Sequence[Ladder]) -> Plot:
    lines = []
    for one in group:
        gone = np.isfinite(one.lost)
        if gone.any():
            lines.append(Line(one.method, one.spacing[gone], one.lost[gone]))
    note = f"When the rim was {LOST:g} times as rough as with reference-normal, or the run failed."
    return Plot(f"{scene}-lost", f"When rims are lost, {scene}", note, _SPACING, tuple(lines), log=True)


def _rough(ladder: Ladder) -> Plot:
    """How rough the rims of one ladder are, by time; the finest twin's beside them."""

    def level(rim: Rim) -> Array:
        with np.errstate(divide="ignore"):  # a round rim has no roughness
            values = np.log10(rim.roughness)
        return np.where(values > -8, values, np.nan)

    lines = [Line(f"{rim.nodes} rim nodes", rim.times, level(rim)) for rim in ladder.rims]
    twin = ladder.twins[-1]
    lines.append(Line("reference-normal, finest", twin.times, level(twin), guide=True))
    note = f"log₁₀ of the rms of ripples m ≥ {ROUGH}, in radii. A line ends where the run does."
    key = f"{ladder.scene}-{ladder.method}-rough"
    return Plot(key, f"Roughness, {ladder.scene}, {ladder.method}", note, "t", tuple(lines))


def outlines(found: Sequence[Ladder]) -> tuple[Outlines, ...]:
    """The last rim of every run, a row a closure and a column a mesh, for each scene and method."""
    return tuple(
        Outlines(
            f"{one.scene}-{one.method}-{one.closure}",
            f"{one.scene}, {one.method}: {one.closure}",
            "",
            tuple(map(_outline, one.rims)),
        )
        for one in sorted(found, key=lambda one: (one.scene, one.method))
    )


def _outline(rim: Rim) -> Outline:
    """The last rim that stands, and the first one, which a cell that keeps its shape still has."""
    failed = rim.outcome != Ending.COMPLETED
    ending = f": {rim.outcome.replace('_', ' ')}" if failed else ""
    title = f"{rim.nodes} rim nodes, t = {rim.times[-1]:.3g}{ending}"
    return Outline(title, _exaggerated(rim.rims[-1]), _exaggerated(rim.rims[0]), failed)


def _exaggerated(rim: Array) -> Array:
    """A rim (2, n) in its own mean radii, its departures from the circle `EXAGGERATED` times as large."""
    radii, angles = np.hypot(*rim), np.arctan2(rim[1], rim[0])
    drawn = np.clip(1 + EXAGGERATED * (radii / mean_radius(rim) - 1), 0, 2)
    return np.asarray(drawn * np.array([np.cos(angles), np.sin(angles)]))


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


def _ripples(spectra: Sequence[RippleGrowth]) -> list[Ripple]:
    return [
        gathered(
            Ripple,
            one.asked,
            one,
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
    spectra = [one for one in answers if isinstance(one, RippleGrowth)]
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
        gathered(
            Followed,
            rim.course,
            rim,
            t=float(rim.times[-1]),
            radius=float(rim.radius[-1]),
            roughness=float(rim.roughness[-1]),
            lost=float(lost),
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
