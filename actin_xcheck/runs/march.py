"""The one time loop: steps that land on every output time; a failed step ends the run as a value."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Protocol

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.outcome import COMPLETED, Ending, Outcome


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


@dataclass(frozen=True)
class Tolerance:
    """What an adaptive run is asked for.

    Attributes
    ----------
    relative : largest local error a step may make, in the sense of `State.local_error`.
    order : of the method; a step's error estimate falls like its power.
    """

    relative: float
    order: float


@dataclass(frozen=True)
class Checkpoint:
    """A run between two steps: all that follows is a function of this, to the last bit.

    Attributes
    ----------
    state : where the run is; the observer has seen it.
    pace : of an adaptive run, the step that would be tried next and the error of the last one.
    """

    state: State
    pace: tuple[float, float] | None = None


Keep = Callable[[Checkpoint], Outcome]
"""Told of every moment at which a run could be interrupted; an Outcome that is not ok ends it there."""


def integrate(
    solver: Solver,
    dt: float,
    output_times: Sequence[float],
    observer: Observer,
    tolerance: Tolerance | None = None,
    begin: Checkpoint | None = None,
    keep: Keep = lambda checkpoint: COMPLETED,
) -> Outcome:
    """Run from t = 0, or from a checkpoint, through the output times.

    Parameters
    ----------
    solver : a method bound to its problem.
    dt : the largest step.
    output_times : increasing, positive; the last one is the end.
    observer : sees every state and every output.
    tolerance : None for equal steps between the output times; else steps are chosen by their error.
    begin : a checkpoint of a run with the same arguments; what comes after it is what came after it there.
    keep : told before every step.

    Returns
    -------
    The Outcome: `completed`, or how and where the run ended before its time.
    """
    state = solver.init() if begin is None else begin.state
    outcome = solver.check(state) if state.t == 0 else COMPLETED
    if begin is None:
        observer.record(0.0, state)
        observer.frame(state)
    controller = None if tolerance is None else Controller(tolerance, dt, begin.pace if begin else None)
    for start, end in pairwise((0.0, *output_times)):
        if state.t >= end:
            continue
        steps = _steps(start, end, dt)
        while state.t < end:
            if outcome.ok:
                kept = keep(Checkpoint(state, None if controller is None else controller.pace))
                if not kept.ok:
                    return kept
            if outcome.ok and controller is not None:
                new, outcome = controller.step(solver, state, end)
            elif outcome.ok:
                new, outcome = checked_step(solver, state, (end - start) / steps)
            if not outcome.ok:
                if state.t > start:  # the last state that stands is worth a picture
                    observer.frame(state)
                return outcome
            if abs(new.t - end) < 1e-9 * (end - start):
                new = replace(new, t=end)
            observer.record(new.t - state.t, new)
            state = new
        observer.frame(state)
    return outcome


class Controller:
    """Chooses steps by their error: proportional and integral control (Soderlind, ACM TOMS 29, 2003).

    Parameters
    ----------
    tolerance : what is asked for.
    largest : the largest step.
    pace : of the controller that this one takes over from.
    """

    def __init__(self, tolerance: Tolerance, largest: float, pace: tuple[float, float] | None = None) -> None:
        self.tolerance, self.largest = tolerance, largest
        self.dt, self.before = pace or (min(largest, 1e-3), 1.0)

    @property
    def pace(self) -> tuple[float, float]:
        """All it remembers: the step to be tried next and the error of the last one, over the tolerance."""
        return self.dt, self.before

    def step(self, solver: Solver, state: State, end: float) -> tuple[State, Outcome]:
        """One step that meets the tolerance and does not pass `end`; tries again with smaller ones.

        A step that fails is tried again too, for the failure may be the step's; at `SMALLEST` of the time
        that has passed it is the state's, and its Outcome stands.
        """
        order, goal = self.tolerance.order, self.tolerance.relative
        while True:
            left = end - state.t
            # the last two steps before an output time share what is left
            dt = left if self.dt >= left * (1 - 1e-9) else min(self.dt, left / 2)
            new, outcome = checked_step(solver, state, dt)
            error = max(new.local_error / goal, 1e-10) if outcome.ok else np.inf
            if error <= 1:
                factor = 0.9 * error ** (-0.7 / order) * self.before ** (0.4 / order)
                grown = dt * min(max(factor, 0.2), 5.0)
                # a step cut short by an output time says nothing against the one before it
                self.dt = min(self.largest, max(grown, self.dt) if dt < self.dt else grown)
                self.before = error
                return new, outcome
            if dt < SMALLEST * max(state.t, 1e-3):
                if not outcome.ok:
                    return state, outcome
                message = f"a step of {dt:.2g} at t = {state.t:.6g} still misses the tolerance {goal:g}"
                return state, Outcome(Ending.STEP_TOO_SMALL, message)
            self.dt = dt * (0.25 if not outcome.ok else min(max(0.9 * error ** (-1 / order), 0.1), 0.9))


SMALLEST = 1e-9
"""Of the time that has passed: smaller steps are not tried."""


def checked_step(solver: Solver, state: State, dt: float) -> tuple[State, Outcome]:
    """One step; a rejected one returns the state it started from."""
    new, outcome = solver.step(state, dt)
    if outcome.ok and not np.isfinite(new.a).all():
        outcome = Outcome(Ending.NON_FINITE, f"the concentration is not finite at t = {new.t:.6g}")
    if outcome.ok and new.a.min() < 0:
        message = f"the concentration falls to {new.a.min():.3g} at t = {new.t:.6g}"
        outcome = Outcome(Ending.NEGATIVE_CONCENTRATION, message)
    return (new if outcome.ok else state), outcome
