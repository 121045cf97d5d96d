"""The page of a closures report, from `closures.h5` alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.exhibits import Line, Plot
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures.findings import JUDGED, Ladder, ladders, on_growth, on_refinement, reason
from actin_xcheck.studies.closures.growth import BASE, Spectrum
from actin_xcheck.studies.closures.record import FILE_NAME, Closures, read_closures
from actin_xcheck.studies.closures.refinement import LOST, Rim
from actin_xcheck.studies.closures.rims import ROUGH, mean_radius
from actin_xcheck.theory.ripples import contrast, ripple_exponent

EXAGGERATED = 3.0
"""How many times the departure of an outline from the circle is drawn."""

_SPACING = "distance of rim nodes, in radii"
_HALF = 50.0  # of an outline's drawing
_PARAMETERS = load_scene(BASE).parameters


@dataclass(frozen=True)
class _Outline:
    """A rim as it was last, beside what it should be: polygons in the units of a drawing of 100 x 100."""

    title: str
    points: str
    due: str
    note: str
    failed: bool


@dataclass(frozen=True)
class _Gallery:
    """All rims of one scene and method: a row a closure, a column a mesh."""

    title: str
    rows: tuple[tuple[Closure, tuple[_Outline, ...]], ...]


def write_closures_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/closures.h5` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    stored = read_closures(folder / FILE_NAME)
    found = ladders(stored.rims)
    html = environment(folder).get_template("closures.html")
    text = html.render(
        attributes={name: value for name, value in stored.attributes.items() if name != "scene"},
        reason=reason(stored),
        on_growth=on_growth(stored),
        on_refinement=on_refinement(stored),
        galleries=_galleries(found),
        exaggerated=EXAGGERATED,
        growth=_growth(stored),
        refinement=_refinement(found),
        ladders=found,
        rough=ROUGH,
        lost_factor=LOST,
        kappa=contrast(_PARAMETERS),
        file=stored.path,
    )
    return put_page(folder, text)


def _growth(stored: Closures) -> list[Drawing]:
    """Charts of measured rates against theory's."""
    current = [one for one in stored.spectra if one.asked.closure is Closure.CURRENT_NORMAL]
    by_method: dict[str, list[Spectrum]] = {}
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
    steady = [one for one in stored.spectra if one.asked.closure is Closure.REFERENCE_NORMAL]
    note = "Rate over V/R: 1 for every ripple and method, which is to keep its shape. Dotted: current-normal."
    plots.append(_rates("steady", "Growth, advancing rim, reference-normal", note, steady))
    return [draw(plot, "/ripples/*/measured", f"g{i}") for i, plot in enumerate(plots) if plot.lines]


def _rates(key: str, title: str, note: str, spectra: Sequence[Spectrum]) -> Plot:
    """Rates over |V|/R of spectra that go the same way, beside those of theory with `current-normal`."""
    if not spectra:
        return Plot(key, title, note, "", ())
    way = 1.0 if spectra[0].asked.advancing else -1.0
    m = np.arange(1.0, max(float(one.modes.max()) for one in spectra) + 1)
    exact = [way * ripple_exponent(Closure.CURRENT_NORMAL, _PARAMETERS, int(one)) for one in m]
    lines = (
        *(
            Line(f"{one.asked.method}, {one.nodes} rim nodes", one.modes, way * one.measured)
            for one in spectra
        ),
        Line("exact, on the disk", m, np.array(exact), guide=True),
        Line("κm, half-plane", m, np.asarray(way * contrast(_PARAMETERS) * m), guide=True),
    )
    return Plot(key, title, note, "wave number m", lines)


def _refinement(found: Sequence[Ladder]) -> list[Drawing]:
    """Charts of what finer meshes do, scene by scene."""
    drawings = []
    for i, scene in enumerate(dict.fromkeys(one.scene for one in found)):
        ours = [one for one in found if one.scene == scene]
        current = [one for one in ours if one.closure is Closure.CURRENT_NORMAL]
        plots = [
            _changes(scene, closure, [one for one in ours if one.closure is closure])
            for closure in (Closure.CURRENT_NORMAL, Closure.REFERENCE_NORMAL)
        ]
        if any(np.isfinite(one.lost).any() for one in current):
            plots.append(_lost(scene, current))
        plots += [_rough(one) for one in current]
        drawings += [draw(plot, "/runs/*/rims", f"r{i}-{j}") for j, plot in enumerate(plots)]
    return drawings


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


def _galleries(found: Sequence[Ladder]) -> list[_Gallery]:
    together: dict[tuple[str, str], list[Ladder]] = {}
    for one in found:
        together.setdefault((one.scene, one.method), []).append(one)
    return [
        _Gallery(
            f"{scene}, {method}",
            tuple((one.closure, tuple(map(_outline, one.rims))) for one in group),
        )
        for (scene, method), group in together.items()
    ]


def _outline(rim: Rim) -> _Outline:
    """The last rim that stands; dotted the first one, which a cell that keeps its shape still has."""
    failed = rim.outcome != Ending.COMPLETED
    when = f"t = {rim.times[-1]:.3g}"
    title = f"{rim.nodes} rim nodes, {when}" + (f": {rim.outcome.replace('_', ' ')}" if failed else "")
    return _Outline(title, _polygon(rim.rims[-1]), _polygon(rim.rims[0]), rim.message or "completed", failed)


def _polygon(rim: Array) -> str:
    """Points of a rim (2, n) in its own mean radii, departures from the circle drawn larger."""
    radii, angles = np.hypot(*rim), np.arctan2(rim[1], rim[0])
    drawn = np.clip(1 + EXAGGERATED * (radii / mean_radius(rim) - 1), 0, 2)
    scale = 0.6 * _HALF
    x, y = _HALF + scale * drawn * np.cos(angles), _HALF - scale * drawn * np.sin(angles)
    return " ".join(f"{a:.2f},{b:.2f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
