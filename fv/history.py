"""Velocities at the places in the steps before, from which those of the next step are guessed.

An iteration that begins near its solution is short.  What the first stage of each step found is smooth in
time, and so is what another one found beyond the stage before it: stages differ by more than their times.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from actin_xcheck.core.model import Array

KEPT = 3
"""Steps: the guess is a parabola."""


@dataclass(frozen=True, eq=False)
class History:
    """The last steps, the latest one last.

    Attributes
    ----------
    times : of each step's stages, (n, stages).
    found : velocities at the places, (n, stages, 2 n_places).
    """

    times: Array
    found: Array

    @classmethod
    def none(cls) -> Self:
        """Before the first step."""
        return cls(np.zeros((0, 0)), np.zeros((0, 0, 0)))

    def guess(self, times: list[float], found: list[Array]) -> Array | None:
        """Velocities (2 n_places,) of a step's next stage, or None where nothing is known.

        Parameters
        ----------
        times : of its stages so far, and of the next one.
        found : of its stages so far.
        """
        stage = len(found)
        if not len(self.times):
            return found[-1] if found else None
        if not stage:
            return self._weights(times[0]) @ self.found[:, 0]
        since, before = times[-1] - times[-2], self.times[:, stage] - self.times[:, stage - 1]
        weights = self._weights(times[0]) * since / before
        return found[-1] + weights @ (self.found[:, stage] - self.found[:, stage - 1])

    def extended(self, times: list[float], found: list[Array]) -> "History":
        """With one more step, if there is something of it."""
        if not found:
            return self
        if not len(self.times):
            return History(np.array([times]), np.array([found]))
        return History(
            np.concatenate([self.times, [times]])[-KEPT:], np.concatenate([self.found, [found]])[-KEPT:]
        )

    def _weights(self, t: float) -> Array:
        """Of the steps in what a polynomial through their beginnings has at t, (n,)."""
        began = self.times[:, 0]
        apart = began[:, None] - began + np.eye(began.size)
        return np.prod(np.where(np.eye(began.size), 1.0, t - began) / apart, axis=1)
