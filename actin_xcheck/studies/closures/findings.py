"""What ripples and rims say: how far they are from theory, what refinement does, and the default's reason."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from actin_xcheck.core.model import Array, Closure
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures.measure import BASE, Rim, RippleGrowth
from actin_xcheck.theory.dispersion import advance_per_fold, ripple_exponent

JUDGED = 0.4
"""Of the time: when most rims of `current-normal` still stand, and meshes are compared."""

RESOLVED = 16
"""Rim nodes a wave from which on a ripple counts as resolved."""


@dataclass(frozen=True)
class Ladder:
    """One scene, method and closure on finer and finer meshes, beside their twins by `reference-normal`."""

    rims: tuple[Rim, ...]
    twins: tuple[Rim, ...]

    @property
    def scene(self) -> str:
        """Its name."""
        return self.rims[0].course.scene

    @property
    def method(self) -> str:
        """Its name."""
        return self.rims[0].course.method

    @property
    def closure(self) -> Closure:
        """The reading of the rim."""
        return self.rims[0].course.closure

    @cached_property
    def spacing(self) -> Array:
        """Distance (n_levels,) of rim nodes at first, in radii."""
        return 2 * np.pi / np.array([rim.nodes for rim in self.rims])

    @cached_property
    def lost(self) -> Array:
        """When each rim was lost, (n_levels,); inf where it was not."""
        return np.array([rim.lost(twin) for rim, twin in zip(self.rims, self.twins, strict=True)])

    def changes(self, part: float) -> Array:
        """Distance (n_levels - 1,) of each rim to the next finer one's when a part of the time is over."""
        found = []
        for coarse, fine in zip(self.rims, self.rims[1:], strict=False):
            state = round(part * coarse.course.steps)
            apart = coarse.change_to(fine)
            found.append(apart[state] if state < len(apart) else np.nan)
        return np.array(found)


def ladders(rims: Sequence[Rim]) -> list[Ladder]:
    """Put the runs that differ by their mesh together, in the order of the report."""
    known = {rim.course: rim for rim in rims}
    together: dict[tuple[str, str, Closure], list[Rim]] = {}
    for rim in rims:
        together.setdefault((rim.course.scene, rim.course.method, rim.course.closure), []).append(rim)
    found = []
    for group in together.values():
        group.sort(key=lambda rim: rim.course.level)
        twins = [known[replace(rim.course, closure=Closure.REFERENCE_NORMAL)] for rim in group]
        found.append(Ladder(tuple(group), tuple(twins)))
    return found


def departure(spectrum: RippleGrowth, nodes_a_wave: float = RESOLVED) -> float:
    """Largest departure |gamma - theory|/theory of ripples with so many rim nodes a wave; nan for none."""
    resolved = spectrum.modes * nodes_a_wave <= spectrum.nodes
    apart = np.abs(spectrum.measured / spectrum.predicted - 1)[np.logical_and(resolved, spectrum.known)]
    return float(apart.max()) if apart.size else float("nan")


def reason(rims: Sequence[Rim]) -> str:
    """One sentence that says why the default closure is what it is."""
    folds = advance_per_fold(load_scene(BASE).parameters)
    found = ladders(rims)
    lost = max(
        (one for one in found if one.closure is Closure.CURRENT_NORMAL),
        key=lambda one: float(np.isfinite(one.lost).sum()),
    )
    kept = next(one for one in found if one.rims == lost.twins)
    course = lost.rims[0].course
    at = course.dt * course.steps * JUDGED
    well, ill = (_falls(one.changes(JUDGED)) for one in (kept, lost))
    return (
        f"The default is {Closure.REFERENCE_NORMAL} because its runs converge: on {lost.scene}, with "
        f"{lost.method}, the rim moves by {well} from mesh to mesh at t = {at:.3g}, where with "
        f"{Closure.CURRENT_NORMAL} it moves by {ill} and {_times(lost)}; for there a ripple grows by e "
        f"when the rim has advanced by {folds:.3g} of its wavelengths, and finer meshes hold shorter ones."
    )


def on_growth(spectra: Sequence[RippleGrowth]) -> list[str]:
    """How ripples grow, one sentence a spectrum of `current-normal` and one for all of `reference-normal`.

    And one for every spectrum of which runs failed.
    """
    said = []
    for one in spectra:
        if one.asked.closure is Closure.CURRENT_NORMAL and one.known.any():
            most, least = int(np.nanargmax(one.measured)), int(np.nanargmin(one.measured))
            apart = departure(one)
            near = f"to {100 * apart:.2g} %" if np.isfinite(apart) else "is known of none"
            words = (
                f"{_about(one)}: γ = κ(m² − 1)/(m − κ) {near} where a wave has {RESOLVED} nodes or more; "
                f"the mesh cuts it off at m = {one.modes[most]:g}, γ = {one.measured[most]:.3g}"
            )
            if one.measured[least] < 0:
                words += (
                    f", and what it does not resolve goes the other way, "
                    f"γ = {one.measured[least]:.3g} at m = {one.modes[least]:g}"
                )
            said.append(words)
    steady = [one.measured[one.known] - 1 for one in spectra if one.asked.closure is Closure.REFERENCE_NORMAL]
    if any(one.size for one in steady):
        apart = float(np.abs(np.concatenate(steady)).max())
        said.append(
            f"{Closure.REFERENCE_NORMAL}: every ripple of every method keeps its shape, |γ − 1| ≤ {apart:.1g}"
        )
    for one in spectra:
        failed = [f"m = {m:g}: {why}" for m, why in zip(one.modes, one.messages, strict=True) if why]
        if failed:
            said.append(f"{_about(one)}, {one.asked.closure}: not measured at {'; '.join(failed)}")
    return said


def _about(one: RippleGrowth) -> str:
    """A spectrum's numerics in words."""
    way = "advancing" if one.asked.advancing else "retracting"
    return f"{one.asked.method}, {one.nodes} rim nodes, {way}"


def on_refinement(rims: Sequence[Rim]) -> list[str]:
    """What finer meshes do with `current-normal`, one sentence a scene and method."""
    return [
        f"{ladder.scene}, {ladder.method}: with {ladder.closure} {_times(ladder)}{_due(ladder)}"
        for ladder in ladders(rims)
        if ladder.closure is Closure.CURRENT_NORMAL
    ]


def _due(ladder: Ladder) -> str:
    """What theory says of the shortest resolved ripple, had the cell swollen uniformly as its twin grew."""
    twin = ladder.twins[-1]
    grown, m = float(twin.radius[-1] / twin.radius[0]), twin.nodes // RESOLVED
    gamma = ripple_exponent(ladder.closure, load_scene(ladder.scene).parameters, m)
    return f"; the radius grows {grown:.3g} times, by which m = {m} grows {grown**gamma:.3g} times in theory"


def _falls(changes: Array) -> str:
    return ", ".join("–" if np.isnan(one) else f"{one:.1e}" for one in changes)


def _times(ladder: Ladder) -> str:
    """When rims were lost, by their nodes."""
    both = list(zip(ladder.rims, ladder.lost.tolist(), strict=True))
    kept = [str(rim.nodes) for rim, when in both if np.isinf(when)]
    gone = [f"{rim.nodes} nodes at t = {when:.3g}" for rim, when in both if np.isfinite(when)]
    words = [f"rims of {', '.join(kept)} nodes stand"] if kept else []
    return ", ".join([*words, *([f"rims are lost with {', '.join(gone)}"] if gone else [])])
