"""Motions that are not the force balance: prescribed by a formula, or recorded from another run."""

from dataclasses import dataclass

import numpy as np

from actin_xcheck.core.contract import Motion, Move
from actin_xcheck.core.model import Array
from actin_xcheck.core.outcome import Outcome


@dataclass(frozen=True)
class PrescribedMotion:
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

    def flow(self, t: float, x: Array, corners: Array) -> Move:
        """The velocity as a Move."""
        return Move(x, self.velocity(t, x, corners))

    def settle(self, x: Array) -> Array:
        """Nothing to put back."""
        return x


@dataclass(frozen=True)
class RecordedMotion:
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

    def flow(self, t: float, x: Array, corners: Array) -> Move:
        """The recorded velocity as a Move."""
        return Move(x, self.velocity(t, x, corners))

    def settle(self, x: Array) -> Array:
        """Nothing to put back."""
        return x
