"""The one time loop: steps that land on every output time; a failed step ends the run as a value."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Generic

import numpy as np

from actin_xcheck.core.contract import S, Solver
from actin_xcheck.core.outcome import COMPLETED, Ending, Outcome
from actin_xcheck.runs.numerics import Numerics


def step_count(dt: float, output_times: Sequence[float]) -> int:
    """Number of equal steps of at most dt that a `March` takes."""
    return sum(_steps(start, end, dt) for start, end in pairwise((0.0, *output_times)))


def _steps(start: float, end: float, dt: float) -> int:
    return max(1, ceil((end - start) / dt * (1 - 1e-9)))


@dataclass(frozen=True)
class Moment(Generic[S]):
    """A run between two steps: all that follows is a function of its state and pace, to the last bit.

    Attributes
    ----------
    state : where the run is.
    pace : of an adaptive run, the step that would be tried next and the error of the last one.
    dt : the step that led here, 0 at the start.
    is_output : whether this is the start or an output time.
    """

    state: S
    pace: tuple[float, float] | None = None
    dt: float = 0.0
    is_output: bool = False


class March(Generic[S]):
    """A run, moment by moment: its start, then what every step leads to, through the output times.

    Parameters
    ----------
    solver : a method bound to its problem.
    numerics : its dt is the largest step; with a tolerance, steps are chosen by their error.
    times : the output times, increasing, positive; the last one is the end.
    begin : a moment of a run with the same arguments; what comes after it is what came after it there.

    Attributes
    ----------
    state : the last one that stands.
    outcome : `completed`, unless the run has ended before its time: then how and where.
    """

    def __init__(
        self, solver: Solver[S], numerics: Numerics, times: Sequence[float], begin: Moment[S] | None = None
    ) -> None:
        self._solver, self._dt, self._times, self._begin = solver, numerics.dt, times, begin
        self._controller: Controller | None = None
        if numerics.rtol is not None:
            pace = begin.pace if begin else None
            self._controller = Controller(numerics.rtol, numerics.method.order_dt, numerics.dt, pace)
        self.state = solver.init() if begin is None else begin.state
        self.outcome = solver.check(self.state) if self.state.t == 0 else COMPLETED

    @property
    def goes_on(self) -> bool:
        """Whether a step is to follow."""
        return self.outcome.ok and self.state.t < self._times[-1]

    @property
    def is_cut_short(self) -> bool:
        """Whether it has failed between two output times, so that its last state is worth a picture."""
        return not self.outcome.ok and self.state.t not in (0.0, *self._times)

    def __iter__(self) -> Iterator[Moment[S]]:
        """Go through the moments; those after one that is begun with, which has been seen."""
        if self._begin is None:
            yield self._moment(0.0, True)
        for start, end in pairwise((0.0, *self._times)):
            equal = (end - start) / _steps(start, end, self._dt)
            while self.state.t < end and self.outcome.ok:
                if self._controller is None:
                    new, self.outcome = checked_step(self._solver, self.state, equal)
                else:
                    new, self.outcome = self._controller.step(self._solver, self.state, end)
                if not self.outcome.ok:
                    return
                if abs(new.t - end) < 1e-9 * (end - start):
                    new = replace(new, t=end)
                dt, self.state = new.t - self.state.t, new
                yield self._moment(dt, new.t >= end)

    def _moment(self, dt: float, is_output: bool) -> Moment[S]:
        return Moment(self.state, self._controller.pace if self._controller else None, dt, is_output)


class Controller:
    """Chooses steps by their error: proportional and integral control (Soderlind, ACM TOMS 29, 2003).

    Parameters
    ----------
    tolerance : largest local error a step may make, relative, in the sense of `State.local_error`.
    order : of the method; a step's error estimate falls like its power.
    largest : the largest step.
    pace : of the controller that this one takes over from.
    """

    def __init__(
        self, tolerance: float, order: float, largest: float, pace: tuple[float, float] | None = None
    ) -> None:
        self.tolerance, self.order, self.largest = tolerance, order, largest
        self.dt, self.before = pace or (min(largest, 1e-3), 1.0)

    @property
    def pace(self) -> tuple[float, float]:
        """All it remembers: the step to be tried next and the error of the last one, over the tolerance."""
        return self.dt, self.before

    def step(self, solver: Solver[S], state: S, end: float) -> tuple[S, Outcome]:
        """One step that meets the tolerance and does not pass `end`; tries again with smaller ones.

        A step that fails is tried again too, for the failure may be the step's; at `SMALLEST` of the time
        that has passed it is the state's, and its Outcome stands.
        """
        order, goal = self.order, self.tolerance
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


def checked_step(solver: Solver[S], state: S, dt: float) -> tuple[S, Outcome]:
    """One step; a rejected one returns the state it started from."""
    new, outcome = solver.step(state, dt)
    if outcome.ok and not np.isfinite(new.a).all():
        outcome = Outcome(Ending.NON_FINITE, f"the concentration is not finite at t = {new.t:.6g}")
    if outcome.ok and new.a.min() < 0:
        message = f"the concentration falls to {new.a.min():.3g} at t = {new.t:.6g}"
        outcome = Outcome(Ending.NEGATIVE_CONCENTRATION, message)
    return (new if outcome.ok else state), outcome
