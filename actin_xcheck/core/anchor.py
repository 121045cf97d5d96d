"""Configurations in which systems were factorised, to precondition those of the steps that follow."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array

Made = TypeVar("Made")

WEAR = 0.2
"""Square of the strain that wears an anchor out, over the strain of a step.

Iterations grow by some 400 per unit of strain, and a factorisation costs some 40: with steps of strain s, one
every sqrt(2 40/(400 s)) steps is best.
"""

SAMPLE = 1024
"""Cells that suffice to measure strain."""


class Anchor:
    """Positions x (2, N) and what was factorised there.

    A state names its anchor, so that a step is a function of the state alone; the factors follow from the
    anchor's positions and are made when first asked for.
    """

    def __init__(self, x: Array) -> None:
        self.x = x
        self._made: dict[float | str, Any] = {}

    def factor(self, name: float | str, make: Callable[[], Made]) -> Made:
        """Return what was made under a name, or make it."""
        if name not in self._made:
            self._made[name] = make()
        found: Made = self._made[name]
        return found

    def worn(self, cells: Indices, old: Array, new: Array, solves: int = 1) -> bool:
        """Whether a new anchor is cheaper than iterations, after a step from old to new positions (2, N).

        Parameters
        ----------
        cells : corners of the cells, (3, n).
        old, new : positions before and after the step, (2, N).
        solves : force balances in a step.
        """
        sample = cells[:, :: max(1, cells.shape[1] // SAMPLE)]
        return _strain(sample, self.x, new) ** 2 > WEAR / solves * _strain(sample, old, new)


def _strain(cells: Indices, before: Array, after: Array) -> float:
    """Standard deviation of the stretch of the cells' sides; uniform growth leaves stiffness as it is."""
    lengths = []
    for x in (before, after):
        corners = x[:, cells]
        lengths.append(np.hypot(*(corners - np.roll(corners, 1, axis=1))))
    stretch = lengths[1] / lengths[0]
    return float(stretch.std() / stretch.mean())
