"""What a scene comes to: its numbers at the end by every code, how sure they are, and whether they agree."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from actin_xcheck.scene.scene import Scene
from actin_xcheck.verdicts.judge import WELL, KnownTo
from actin_xcheck.verdicts.triangulate import Corner, Levels, corners_of, in_digits, times_of

QUANTITIES = ("area", "total_actin", "centroid", "polarity", "probe_a", "probe_x", "growth_rate")

WHOLE = ("area", "total_actin")
"""What is said of a scene in a sentence."""


@dataclass(frozen=True)
class FinalValue:
    """A number of a scene at the last output time that all its runs have reached.

    Attributes
    ----------
    scene, methods, quantity : what was computed, and by what.
    words : the quantity, its place and time for a reader.
    corners : a number and its uncertainty by each method, and by theory where that knows it.
    """

    scene: str
    methods: tuple[str, ...]
    quantity: str
    words: str
    corners: tuple[Corner, ...]

    @property
    def codes(self) -> tuple[Corner, ...]:
        """The corners that were computed."""
        return self.corners[: len(self.methods)]

    @property
    def theory(self) -> Corner | None:
        """The corner that was not, where there is one."""
        return next(iter(self.corners[len(self.methods) :]), None)

    @property
    def size(self) -> float:
        """What errors are relative to: of integrals the number itself, of others nothing smaller than 1."""
        size = abs(self.corners[-1].value)
        return size if self.is_one else max(size, 1.0)

    @property
    def is_one(self) -> bool:
        """Whether it is one number of the whole cell, not one of many that have an uncertainty in common."""
        return self.quantity in (*WHOLE, "growth_rate")

    @property
    def place(self) -> str:
        """The quantity and its place, without the time."""
        return self.words.partition(" at t = ")[0]

    @property
    def believe(self) -> str:
        """How many digits to believe, in words."""
        return f"{self.digits or 'no'} digit{'s'[: self.digits != 1]}"

    @property
    def apart(self) -> float:
        """The largest relative distance of two codes; nan with one."""
        return float(np.ptp([code.value for code in self.codes])) / self.size if self.methods[1:] else np.nan

    @property
    def off(self) -> float:
        """The largest relative distance of a code to theory; nan without theory."""
        theory = self.theory
        return max(abs(code.value - theory.value) for code in self.codes) / self.size if theory else np.nan

    @property
    def unsure(self) -> float:
        """The largest relative uncertainty; nan where a code has none."""
        return float(np.max([code.uncertainty for code in self.codes])) / self.size

    @property
    def digits(self) -> int:
        """How many digits to believe: those in which codes and theory agree and, without it, all are sure."""
        errors = [error for error in (self.apart, self.off) if not np.isnan(error)]
        if self.theory is None:
            errors.append(self.unsure)
        worst = max(errors, default=np.nan)  # theory, and a run that gave no number
        return 0 if np.isnan(worst) else int(np.clip(-np.log10(max(worst, 1e-12)), 0, 12))

    @property
    def stated(self) -> dict[str, Any]:
        """The same as plain values, see `cli.output.ScenesValue`."""
        names = [*self.methods, *(one.name for one in self.corners[len(self.methods) :])]
        return {
            "scene": self.scene,
            "quantity": self.quantity,
            "words": self.words,
            "by": {
                name: {
                    "value": one.value,
                    "uncertainty": one.uncertainty,
                    "observed_order": one.order,
                }
                for name, one in zip(names, self.corners, strict=True)
            },
            "codes_agree_to_percent": 100 * self.apart,
            "theory_to_percent": 100 * self.off,
            "digits": self.digits,
        }

    @property
    def sentence(self) -> str:
        """The number, how well the codes agree on it, and with theory."""
        best = min(self.codes, key=lambda code: np.inf if np.isnan(code.uncertainty) else code.uncertainty)
        known = "with an uncertainty that is not known"
        if best.uncertainty >= 0:
            known = f"({percent(best.uncertainty / self.size)}{f', {best.name}' if self.methods[1:] else ''})"
        said = [f"{self.place} {in_digits(best, best.uncertainty)} {known}"]
        if not np.isnan(self.apart):
            beyond = self.apart * self.size > sum(code.uncertainty for code in self.codes)
            said.append(f"the codes {'part by' if beyond else 'agree to'} {percent(self.apart)}")
        if self.theory and not np.isnan(self.off):
            said.append(f"{self.theory.name} to {percent(self.off)}")
        return ", ".join(said)


def final_values(scene: Scene, levels: Sequence[Levels]) -> list[FinalValue]:
    """Return the numbers of a scene at the last output time that all its runs have reached; none without one.

    Parameters
    ----------
    scene : what was run.
    levels : of each method, in the order of `FinalValue.methods`.
    """
    times, _ = times_of(scene, levels)
    methods = tuple(one.method.name for one in levels)
    return [
        FinalValue(scene.name, methods, quantity, words, corners)
        for quantity in QUANTITIES
        for words, corners in corners_of(scene, levels, quantity, times[-1:])
    ]


@dataclass(frozen=True)
class Apart:
    """A number by a code, or by theory, less that of another code at an output time.

    Attributes
    ----------
    scene, quantity, time : of what, and when.
    name, origin : the method, or what theory is called, and the method whose number is taken away.
    value, uncertainty : the difference, and the sum of both uncertainties (nan where one has none).
    """

    scene: str
    quantity: str
    time: float
    name: str
    origin: str
    value: float
    uncertainty: float


def apart(scene: Scene, levels: Sequence[Levels]) -> list[Apart]:
    """How far the integrals by each code, and by theory, are from those by the first one, time by time."""
    origin, *others = (one.method.name for one in levels)
    found = []
    for quantity in WHOLE:
        for t in times_of(scene, levels)[0]:
            for _, (first, *rest) in corners_of(scene, levels, quantity, [t]):
                names = [*others, *(one.name for one in rest[len(others) :])]
                found += [
                    Apart(
                        scene=scene.name,
                        quantity=quantity,
                        time=t,
                        name=name,
                        origin=origin,
                        value=one.value - first.value,
                        uncertainty=one.uncertainty + first.uncertainty,
                    )
                    for name, one in zip(names, rest, strict=True)
                ]
    return found


def known_badly(known: Sequence[KnownTo], values: Sequence[FinalValue]) -> str:
    """What must be said beside a score: of which scenes with values integrals are known to worse than 1 %."""
    found = []
    for one in known:
        badly = {name.replace("_", " "): error for name, error in one.errors.items() if not error <= WELL}
        for value in values:
            name, theory = value.quantity.replace("_", " "), value.theory
            exact = theory is not None and theory.uncertainty == 0  # else what the runs say of themselves
            error = value.off if exact else value.unsure
            if value.scene == one.scene and value.is_one and error > max(WELL, badly.get(name, 0.0)):
                badly[name] = error
        if badly and any(value.scene == one.scene for value in values):
            said = (f"{name} {_to(error)}" for name, error in badly.items())
            found.append(f"{one.scene} ({', '.join(said)})")
    return f"known to worse than 1 %: {', '.join(found)}" if found else ""


def _to(error: float) -> str:
    return "not known" if np.isnan(error) else f"to {percent(error)}"


def in_a_sentence(values: Sequence[FinalValue]) -> str:
    """What a scene comes to, and how many digits to believe; empty without any.

    Of a mode that is the rate at which it grows, of other scenes the integrals over the cell.
    """
    whole = [value for value in values if value.quantity == "growth_rate"]
    whole = whole or [value for value in values if value.quantity in WHOLE]
    if not whole:
        return ""
    least = min(whole, key=lambda value: value.digits)
    return f"{whole[0].scene}: {'; '.join(value.sentence for value in whole)}: believe {least.believe}"


def percent(share: float) -> str:
    """A relative error for a reader."""
    return "round-off" if share < 1e-10 else f"{100 * share:.2g} %"
