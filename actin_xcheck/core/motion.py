"""Motions that are not the force balance; and where its systems were factorised, to solve those after."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from actin_xcheck.core.contract import NOTHING, Motion, Move
from actin_xcheck.core.errors import Outcome
from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array


class _GivenMotion(ABC):
    """A motion that answers to no load: nothing is carried, and nothing is to be put back."""

    @abstractmethod
    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """Of the nodes, (2, N)."""

    def carried(self, u0: Callable[[Array], Array]) -> Array:
        """Nothing."""
        return NOTHING

    def flow(self, t: float, x: Array, corners: Array, carried: Array = NOTHING) -> Move:
        """The velocity as a Move."""
        return Move(x, self.velocity(t, x, corners))

    def settle(self, x: Array) -> Array:
        """Nothing to put back."""
        return x


@dataclass(frozen=True)
class PrescribedMotion(_GivenMotion):
    """Nodes from xi (2, N) follow x(xi, t): positions are evaluated, so that no error of motion enters."""

    xi: Array
    motion: Motion

    def start(self, x: Array) -> Array:
        """Positions at t = 0, (2, N); a prescribed motion overrides initial displacements."""
        return self.motion(self.xi, 0.0)

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> Move:
        """Move the nodes to their prescribed positions at t + dt."""
        new = self.motion(self.xi, t + dt)
        return Move(new, (new - x) / dt)

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """The prescribed velocity (2, N)."""
        return self.motion.velocity(self.xi, t)


@dataclass(frozen=True)
class RecordedMotion(_GivenMotion):
    """The node paths of a finished run, replayed step by step.

    Attributes
    ----------
    times, moves : the state at t = 0 and the move of every step, with the time each one ends at.
    outcome : how the recorded run ended; a step beyond its end fails with it.
    """

    times: Array
    moves: tuple[Move, ...]
    outcome: Outcome

    def start(self, x: Array) -> Array:
        """Positions at t = 0, (2, N)."""
        return self.moves[0].x

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> Move:
        """Return the recorded move that ends at t + dt.

        Raises
        ------
        ValueError : no recorded step ends there.
        """
        index = int(np.argmin(np.abs(self.times - (t + dt))))
        if abs(self.times[index] - (t + dt)) > 1e-9 * max(1.0, t + dt):
            if not self.outcome.ok and t + dt > self.times[-1]:
                return Move(x, np.zeros_like(x), self.outcome)
            raise ValueError(f"no recorded step ends at t = {t + dt:.9g}")
        return self.moves[index]

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """Recorded velocity (2, N) of the step that ended at t."""
        return self.moves[int(np.argmin(np.abs(self.times - t)))].v


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
