"""What a scene comes to: its numbers at the end by every code, how sure they are, and whether they agree."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.triangulate import Corner, Levels, corners_of, names_of, reaches

QUANTITIES = ("area", "total_actin", "centroid", "polarity", "probe_a", "probe_x", "growth_rate")

WHOLE = ("area", "total_actin")
"""What is said of a scene in a sentence."""

@dataclass(frozen=True)
class FinalValue:
    """A number of a scene at its end.

    Attributes
    ----------
    scene, quantity : of what.
    words : the quantity and its place for a reader.
    time : the last output time that every code has reached.
    methods : what computed it, finite elements first.
    corners : a number and its uncertainty by each method, and by theory where that knows it.
    """

    scene: str
    quantity: str
    words: str
    time: float
    methods: tuple[str, ...]
    corners: tuple[Corner, ...]

    @property
    def codes(self) -> tuple[Corner, ...]:
        """The corners that were computed."""
        return self.corners[: len(self.methods)]

    @property
    def theory(self) -> Corner | None:
        """The corner that was not, where there is one."""
        return self.corners[len(self.methods)] if len(self.corners) > len(self.methods) else None

    @property
    def known_to(self) -> float:
        """Relative: the largest distance to theory where that knows the number, else uncertainty; may be nan."""
        size = abs(self.corners[-1].value)
        if self.theory:
            theory = self.theory
            errors = [abs(code.value - theory.value) + theory.uncertainty for code in self.codes]
        else:
            errors = [code.uncertainty for code in self.codes]
        return float(max(errors)) / size if size and np.isfinite(errors).all() else np.nan

    @property
    def apart(self) -> float:
        """Relative: the largest distance between two codes; nan with one."""
        values = [code.value for code in self.codes]
        size = abs(self.corners[-1].value)
        return float(np.ptp(values)) / size if len(values) > 1 and size else np.nan

    @property
    def digits(self) -> int:
        """How many significant digits there are to believe."""
        worst = np.fmax(self.known_to, self.apart)
        return int(np.clip(np.floor(-np.log10(worst)), 0, 12)) if worst > 0 else 12 if worst == 0 else 0

    @property
    def sentence(self) -> str:
        """Value, how well the codes agree, and with what."""
        best = min(self.codes, key=lambda code: np.inf if np.isnan(code.uncertainty) else code.uncertainty)
        said = [f"{self.words} {in_digits(best)}"]
        if len(self.codes) > 1:
            allowed = sum(code.uncertainty for code in self.codes)
            beyond = self.apart * abs(self.corners[-1].value) > allowed
            said.append(
                f"the codes differ by {percent(self.apart)}, more than they state"
                if beyond
                else f"the codes agree to {percent(self.apart)}"
            )
        if self.theory:
            said.append(f"with {self.theory.name} to {percent(self.known_to)}")
        return ", ".join(said)


def final_values(scene: Scene, levels: Sequence[Levels]) -> list[FinalValue]:
    """Return the numbers of a scene at the last output time that all its runs have reached; none without one.

    Parameters
    ----------
    scene : what was run.
    levels : of each method, in the order of `FinalValue.methods`.
    """
    times = [t for t in scene.output_times if all(reaches(one.runs[0], t) for one in levels)]
    return [value for quantity in QUANTITIES for value in _of(scene, levels, quantity, times[-1])] if times else []


def _of(scene: Scene, levels: Sequence[Levels], quantity: str, t: float) -> Iterator[FinalValue]:
    names = names_of(scene, quantity)
    if not names or (quantity == "growth_rate" and t < scene.output_times[-1]):
        return
    for words, corners in zip(names, corners_of(scene, levels, quantity, t), strict=True):
        methods = tuple(one.method.name for one in levels)
        yield FinalValue(scene.name, quantity, words, t, methods, corners)


def in_a_sentence(values: Sequence[FinalValue]) -> str:
    """What a scene's integrals come to, and how many digits of them to believe; empty without any."""
    whole = [value for value in values if value.quantity in WHOLE]
    if not whole:
        return ""
    digits = min(value.digits for value in whole)
    believed = f"believe {digits} digit{'s' * (digits != 1)}" if digits else "believe none of it"
    return f"{whole[0].scene} at t = {whole[0].time:.4g}: {'; '.join(one.sentence for one in whole)}: {believed}"


def percent(share: float) -> str:
    """A relative error for a reader."""
    return "an unknown part" if np.isnan(share) else f"{100 * share:.2g} %"


def in_digits(corner: Corner) -> str:
    """A value to two digits of its uncertainty, or to six without one."""
    if np.isnan(corner.uncertainty):
        return f"{corner.value:.6g}"
    digits = 12 if not corner.uncertainty else int(np.clip(1 - np.floor(np.log10(corner.uncertainty)), 0, 12))
    said = f"{corner.value:.{digits}f}"
    return f"{said} ± {corner.uncertainty:.{digits}f}" if 0.5 * 10**-digits < corner.uncertainty else said
