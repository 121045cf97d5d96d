"""The one time loop: fixed steps that land on every output time, a failed step ends the run as a value."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import Protocol

import numpy as np

from actin_xcheck.geometry import orientation
from actin_xcheck.result import Ending, Outcome
from actin_xcheck.solver import Solver, State


class Observer(Protocol):
    """Who watches a run; the loop knows nothing of stores and screens."""

    def record(self, dt: float, state: State) -> None:
        """See every state, the initial one with dt = 0."""
        ...

    def frame(self, state: State) -> None:
        """See the initial state and the state at each output time."""
        ...


def step_count(dt: float, output_times: Sequence[float]) -> int:
    """Number of steps `integrate` takes."""
    return sum(_steps(start, end, dt) for start, end in pairwise((0.0, *output_times)))


def _steps(start: float, end: float, dt: float) -> int:
    return max(1, ceil((end - start) / dt * (1 - 1e-9)))


def integrate(solver: Solver, dt: float, output_times: Sequence[float], observer: Observer) -> Outcome:
    """Run from t = 0 through the output times in equal steps of at most dt between them.

    Parameters
    ----------
    solver : a method bound to its problem.
    dt : the largest step.
    output_times : increasing, positive; the last one is the end.
    observer : sees every state and every output.

    Returns
    -------
    The Outcome: `completed`, or how and where the run ended before its time.
    """
    state = solver.init()
    outcome = orientation(solver.mesh, 0.0, state.x)
    observer.record(0.0, state)
    observer.frame(state)
    for start, end in pairwise((0.0, *output_times)):
        steps = _steps(start, end, dt)
        for k in range(steps):
            if outcome.ok:
                state, outcome = _checked_step(solver, state, (end - start) / steps)
            if not outcome.ok:
                if state.t > start:  # the last state that stands is worth a picture
                    observer.frame(state)
                return outcome
            if k == steps - 1:
                state = replace(state, t=end)
            observer.record((end - start) / steps, state)
        observer.frame(state)
    return outcome


def _checked_step(solver: Solver, state: State, dt: float) -> tuple[State, Outcome]:
    """One step; a rejected one returns the state it started from."""
    new, outcome = solver.step(state, dt)
    if outcome.ok and not np.isfinite(new.a).all():
        outcome = Outcome(Ending.NON_FINITE, f"the concentration is not finite at t = {new.t:.6g}")
    if outcome.ok and new.a.min() < 0:
        message = f"the concentration falls to {new.a.min():.3g} at t = {new.t:.6g}"
        outcome = Outcome(Ending.NEGATIVE_CONCENTRATION, message)
    return (new if outcome.ok else state), outcome
