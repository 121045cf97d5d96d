"""What the runs come to, in sentences: what breaks, and what holds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from actin_xcheck.runs.method import Method
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.distort.cases import Family
from actin_xcheck.studies.distort.record import Row

LOST = 0.5
"""An order that falls by more is lost."""

GROWN = 10.0
"""An error, or counted work, that grows by more is no matter of a constant."""


@dataclass(frozen=True)
class Pair:
    """A method on one distortion: its runs on the coarser and on the finer mesh, beside the undistorted ones.

    Attributes
    ----------
    severity : of the distortion.
    coarse, fine : the runs on it.
    plain_coarse, plain_fine : those on the disk's own mesh.
    """

    severity: float
    coarse: Row
    fine: Row
    plain_coarse: Row
    plain_fine: Row

    @property
    def failed(self) -> Row | None:
        """The run that did not complete, if there is one."""
        return next((row for row in (self.coarse, self.fine) if not row.completed), None)

    @property
    def order(self) -> float:
        """Observed order of the concentration in h; nan where an error is not known."""
        return _order(self.coarse, self.fine)

    @property
    def plain_order(self) -> float:
        """The same on the disk's own mesh."""
        return _order(self.plain_coarse, self.plain_fine)

    @property
    def growth(self) -> float:
        """How many times larger the error of the concentration is than undistorted, on the finer mesh.

        Errors that are not known count as what is known: it may be more, where the undistorted one is not.
        """
        return _at_most(self.fine) / _at_most(self.plain_fine)

    @property
    def work(self) -> float:
        """How many times more iterations a solve takes than undistorted, on the finer mesh."""
        return self.fine.iterations_a_solve / self.plain_fine.iterations_a_solve


Pairs = dict[str, list[Pair]]
"""By the names of methods, from no distortion to the worst."""


def sentence_of(scene: Scene, family: Family, methods: Sequence[Method], pairs: Pairs) -> str:
    """What a family of distortions does to a scene's runs."""
    broken: list[str] = []
    held: list[str] = []
    for method in methods:
        found = _broken(pairs[method.name])
        (broken if found else held).append(f"{method.name} ({found or _held(pairs[method.name])})")
    every = [pair.fine for of_method in pairs.values() for pair in of_method]
    about = f"{family.title}, {scene.name}"
    if family.key != "off-ring":
        aspect, angle = max(row.aspect for row in every), max(row.angle for row in every)
        about += f", aspects up to {aspect:.0f}, angles up to {angle:.1f} degrees"
    parts = [f"breaks {'; '.join(broken)}"] if broken else []
    parts += [f"{'the others hold' if broken else 'all methods hold'}: {'; '.join(held)}"] if held else []
    return f"{about}: {'. '.join(parts)}."


def _broken(pairs: Sequence[Pair]) -> str:
    """What is lost at the worst, in words; empty where nothing is."""
    for pair in pairs[1:]:
        if row := pair.failed:
            return f"at {pair.severity:g}, refine {row.refine}: {row.ending.replace('_', ' ')}, {row.message}"
    worst = max(pairs, key=lambda pair: pair.growth)
    loss = worst.plain_order - worst.order
    if worst.growth > GROWN or (worst.growth > 2 and loss > LOST):
        before = f" instead of {worst.plain_order:.1f}" if math.isfinite(worst.plain_order) else ""
        return f"at {worst.severity:g} error ×{worst.growth:.3g}, of order {worst.order:.1f}{before}"
    return ""


def _held(pairs: Sequence[Pair]) -> str:
    """How far the worst distortion is from none."""
    worst = max(pairs, key=lambda pair: pair.growth)
    work = max(pair.work for pair in pairs)
    orders = [pair.order for pair in pairs if math.isfinite(pair.order)]
    order = f", order at least {min(orders):.1f}" if orders else ""
    return f"error ×{worst.growth:.2g}{order}, iterations ×{work:.2g}"


def _at_most(row: Row) -> float:
    return max(row.a_error, row.uncertainty)


def _order(coarse: Row, fine: Row) -> float:
    known = min(coarse.a_error, fine.a_error) > max(coarse.uncertainty, fine.uncertainty)
    return math.log2(coarse.a_error / fine.a_error) / (fine.refine - coarse.refine) if known else math.nan
