"""What a report on closures draws: outlines, growth by wave number, what finer meshes do."""

from collections.abc import Sequence

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.core.outcome import Ending
from actin_xcheck.report.exhibits import Line, Outline, Outlines, Plot
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures.findings import JUDGED, Ladder
from actin_xcheck.studies.closures.growth import BASE, Spectrum
from actin_xcheck.studies.closures.refinement import LOST, Rim
from actin_xcheck.studies.closures.rims import ROUGH, mean_radius
from actin_xcheck.theory.ripples import contrast, ripple_exponent

EXAGGERATED = 3.0
"""How many times the departure of an outline from the circle is drawn."""

_SPACING = "distance of rim nodes, in radii"


def on_ripples(spectra: Sequence[Spectrum]) -> tuple[Plot, ...]:
    """Charts of measured rates against theory's."""
    current = [one for one in spectra if one.asked.closure is Closure.CURRENT_NORMAL]
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
    steady = [one for one in spectra if one.asked.closure is Closure.REFERENCE_NORMAL]
    note = "Rate over V/R: 1 for every ripple and method, which is to keep its shape. Dotted: current-normal."
    plots.append(_rates("steady", "Growth, advancing rim, reference-normal", note, steady))
    return tuple(plot for plot in plots if plot.lines)


def _rates(key: str, title: str, note: str, spectra: Sequence[Spectrum]) -> Plot:
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
