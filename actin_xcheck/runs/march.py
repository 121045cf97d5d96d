"""The one time loop, what is kept of a run while it lasts, and the checkpoints that it can go on from.

Steps land on every output time; a failed step ends the run as a value.
"""

import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Generic

import numpy as np

from actin_xcheck.core import observables
from actin_xcheck.core.contract import S, Solver, State
from actin_xcheck.core.errors import COMPLETED, Ending, Outcome, UserError, brief
from actin_xcheck.core.files import unfinished
from actin_xcheck.core.mesh import INTERIOR_POINTS, Mesh, quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.runs.numerics import Numerics, equal_steps
from actin_xcheck.runs.store import Attributes, Run, RunWriter, read_run
from actin_xcheck.scene.resolve import mode_field, probe_points, turn_matrix
from actin_xcheck.scene.scene import Scene


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
    steps : how many led there.
    outcome : `completed`, unless the run has ended before its time: then how and where.
    """

    def __init__(
        self, solver: Solver[S], numerics: Numerics, times: Sequence[float], begin: Moment[S] | None = None
    ) -> None:
        self._solver, self._dt, self._times, self._begin = solver, numerics.dt, times, begin
        self.state, self.steps = solver.init() if begin is None else begin.state, 0
        self._controller: Controller | None = None
        if numerics.rtol is not None:
            pace = (begin.pace if begin else None) or (first_step(self.state, numerics.dt), NONE)
            self._controller = Controller(numerics.rtol, numerics.method.order_dt, numerics.dt, pace)
        with np.errstate(all="ignore"):
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
            equal = (end - start) / equal_steps(start, end, self._dt)
            while self.state.t < end and self.outcome.ok:
                if self._controller is None:
                    new, self.outcome = checked_step(self._solver, self.state, equal)
                else:
                    new, self.outcome = self._controller.step(self._solver, self.state, end)
                if not self.outcome.ok:
                    return
                if abs(new.t - end) < 1e-9 * (end - start):
                    new = replace(new, t=end)
                dt, self.state, self.steps = new.t - self.state.t, new, self.steps + 1
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
    pace : the first step to be tried and `NONE`, or the pace of the controller that this one takes over from.
    """

    def __init__(self, tolerance: float, order: float, largest: float, pace: tuple[float, float]) -> None:
        self.tolerance, self.order, self.largest = tolerance, order, largest
        self.dt, self.before = pace

    @property
    def pace(self) -> tuple[float, float]:
        """All it remembers: the step to be tried next and the error of the last one, over the tolerance."""
        return self.dt, self.before

    def step(self, solver: Solver[S], state: S, end: float) -> tuple[S, Outcome]:
        """One step that meets the tolerance and does not pass `end`; tries again with smaller ones.

        A step that fails is tried again too, for the failure may be the step's; at `SMALLEST` of the time
        that has passed it is the state's, and its Outcome stands.  From the second one on, errors that miss
        it say themselves with which order they fall.
        """
        falls, goal = self.order, self.tolerance
        tried = missed = math.inf
        while True:
            left = end - state.t
            # the last two steps before an output time share what is left
            dt = left if self.dt >= left * (1 - 1e-9) else min(self.dt, left / 2)
            new, outcome = checked_step(solver, state, dt)
            error = max(new.local_error / goal, 1e-10) if outcome.ok else np.inf
            if error <= 1:
                grown = dt * self._growth(error)
                # a step cut short by an output time says nothing against the one before it
                self.dt = min(self.largest, max(grown, self.dt) if dt < self.dt else grown)
                self.before = error
                return new, outcome
            if dt < SMALLEST * max(state.t, 1e-3):
                if not outcome.ok:
                    return state, outcome
                message = f"a step of {dt:.2g} at t = {state.t:.6g} still misses the tolerance {goal:g}"
                return state, Outcome(Ending.STEP_TOO_SMALL, message)
            if error < missed < math.inf:  # where data are rough, errors fall less than a method's
                falls = min(max(math.log(missed / error) / math.log(tried / dt), 1.0), self.order)
            tried, missed = dt, error
            self.dt = dt * (0.25 if not outcome.ok else min(max(0.9 * error ** (-1 / falls), 0.1), 0.9))

    def _growth(self, error: float) -> float:
        """Of the step after one of this error, over the tolerance; by that error alone after the first."""
        if self.before == NONE:
            return min(0.9 * error ** (-1 / self.order), FIRST_GROWTH)
        # a step far below the tolerance says that steps are too short, not that errors grow
        factor = 0.9 * error ** (-0.7 / self.order) * max(self.before, LEAST_BEFORE) ** (0.4 / self.order)
        return min(max(factor, 0.2), 5.0)


NONE = 0.0
"""In place of the last step's error: there has been none."""

FIRST_GROWTH, LEAST_BEFORE = 100.0, 0.1
"""The most that a step is longer than the first; the least that the last error counts for."""


def first_step(state: State, largest: float) -> float:
    """A hundredth of the time in which the fastest node would go as far as the radius, or the network turns
    over, which is 1: a step whose error then says how long the next one is (Hairer, Norsett and Wanner,
    Solving Ordinary Differential Equations I, section II.4).
    """
    return min(largest, 0.01 / max(float(np.abs(state.v).max(initial=0.0)), 1.0))


SMALLEST = 1e-9
"""Of the time that has passed: smaller steps are not tried."""


def checked_step(solver: Solver[S], state: S, dt: float) -> tuple[S, Outcome]:
    """One step; a rejected one returns the state it started from, and what overflows is one."""
    with np.errstate(all="ignore"):
        new, outcome = solver.step(state, dt)
    if outcome.ok and not np.isfinite(new.a).all():
        outcome = Outcome(Ending.NON_FINITE, f"the concentration is not finite at t = {new.t:.6g}")
    if outcome.ok and new.a.min() < 0:
        message = f"the concentration falls to {new.a.min():.3g} at t = {new.t:.6g}"
        outcome = Outcome(Ending.NEGATIVE_CONCENTRATION, message)
    return (new if outcome.ok else state), outcome


Progress = Callable[[int, int], None]
"""Called with how many of how many parts of a run's time are done."""

PARTS = 1000
"""Of a run's time, for its progress: steps are of different lengths."""


class Amplitude:
    """Amplitude of a mode in the difference to the unperturbed run, over the reference disk.

    int (a - a_unperturbed) w dxi / int w^2 dxi, w being the concentration of the mode's eigenfield at t = 0
    in the scene's frame: w_mn itself for `irrotational-wall`.

    Parameters
    ----------
    scene : names the mode.
    mesh : the run's reference mesh.
    twin : corner values (3, n_cells) of the unperturbed run after each step; None where it is a = 1.
    """

    def __init__(self, scene: Scene, mesh: Mesh, twin: list[Array] | None = None) -> None:
        assert scene.mode is not None
        field, points = mode_field(scene, *scene.mode), quadrature_points(mesh.xi, mesh.triangles)
        w = field.a(turn_matrix(scene).T @ points.reshape(2, -1)).reshape(points.shape[1:])
        weights = w * signed_areas(mesh.xi, mesh.triangles) / 3
        self.functional = INTERIOR_POINTS.T @ weights / (w * weights).sum()
        self.twin = twin

    def __call__(self, step: int, corners: Array) -> float:
        """Amplitude of the state after `step` steps; nan where the twin has failed before."""
        if self.twin is not None and step >= len(self.twin):
            return float("nan")
        unperturbed = 1.0 if self.twin is None else self.twin[step]
        return float((self.functional * (corners - unperturbed)).sum())


class Recorder:
    """Measures every state, hands rows and frames to the store and tells how far the run is."""

    def __init__(
        self,
        scene: Scene,
        solver: Solver,
        writer: RunWriter,
        amplitude: Amplitude | None,
        progress: Progress,
        passing: bool = False,
        pictures: int = 0,
    ) -> None:
        self.solver, self.writer, self.passing, self.pictures = solver, writer, passing, pictures
        self.amplitude, self.progress, self.step = amplitude, progress, writer.rows
        self.end = scene.output_times[-1]
        self.probes = solver.probes(probe_points(scene))
        self.gauged = scene.physics.closure is Closure.TRACTION_FREE

    def record(self, moment: Moment) -> None:
        """Write one row of the time series, and a frame at an output time and where one is due."""
        state = moment.state
        probe_a, probe_x = self.probes(state)
        measured = self.solver.measure(state)
        row = {
            "time": state.t,
            "dt": moment.dt,
            "area": measured.area,
            "total_actin": measured.total_actin,
            "balance_residual": state.balance_residual,
            "local_error": state.local_error,
            "centroid": measured.centroid,
            "polarity": np.nan if self.passing else observables.polarity(measured.rim),
            "a_min": state.a.min(),
            "a_max": state.a.max(),
            "jacobian_min": measured.jacobian_min,
            "probe_a": probe_a,
            "probe_x": probe_x,
        }
        if self.gauged:
            known = 1.0 if self.step else np.nan  # loads are those of a step: none has ended at t = 0
            row |= {"net_force": known * np.array(state.net_force), "net_torque": known * state.net_torque}
        if self.amplitude is not None:
            row["mode_amplitude"] = self.amplitude(self.step, self.solver.corners(state))
        if (remeshings := getattr(state, "remeshings", None)) is not None:
            row["remeshings"] = remeshings
        self.writer.record(row)
        self.progress(round(PARTS * state.t / self.end), PARTS)
        self.step += 1
        before, now = (int(self.pictures * t / self.end + 1e-9) for t in (state.t - moment.dt, state.t))
        if moment.is_output or now > before:
            self.frame(state)

    def frame(self, state: State) -> None:
        """Write a frame, if anybody will see it."""
        if not self.passing:
            self.writer.frame(state.t, self.solver.frame(state))


REST = 50.0
"""Time from one checkpoint to the next, over what the one took to write: together they cost a run 2 %."""


class Keeper:
    """Writes a run's checkpoints: where it begins, then seldom enough to cost little, and where it stops.

    Parameters
    ----------
    solver, writer : of the run.
    began : when it would have begun had it never been interrupted, by `time.perf_counter`; a time that does
        not come for one that keeps nothing.
    stop : says whether it has to stop.
    """

    def __init__(
        self, solver: Solver, writer: RunWriter, began: float, stop: Callable[[], int] = lambda: 0
    ) -> None:
        self._solver, self._writer, self._began, self._stop = solver, writer, began, stop
        self._due = began

    def __call__(self, moment: Moment) -> Outcome:
        """Write a checkpoint if one is due; `interrupted` if the run has to stop there."""
        now, asked = time.perf_counter(), self._stop()
        here = Outcome(Ending.INTERRUPTED, f"at t = {moment.state.t:.6g}; run with --resume goes on")
        if asked or now >= self._due:
            arrays = {**self._solver.memento(moment.state), "pace": np.array(moment.pace or ())}
            self._writer.checkpoint(arrays, here, now - self._began)
            written = time.perf_counter()
            self._due = written + REST * (written - now)
        return here if asked else COMPLETED


def earlier(path: Path, attributes: Attributes) -> Run | None:
    """Return what there is of the run that `path` is for: interrupted, or finished; None without either.

    Raises
    ------
    UserError : what is there is not whole, or another run; the sentence says what differs.
    """
    file = next((one for one in (unfinished(path), path) if one.exists()), None)
    if file is None:
        return None
    run = read_run(file)
    for name, value in attributes.items():
        stored = run.attributes.get(name)
        if name == "versions":
            stored, value = _unlike(str(stored), str(value))
        if name != "command" and stored != value and not (stored != stored and value != value):  # nan
            raise UserError(
                f"--resume: {file} holds another run, its {name} is {_shown(stored)}, not {_shown(value)}; "
                "valid: the same run, or --force to begin again"
            )
    return run


def _unlike(stored: str, now: str) -> tuple[str, str]:
    """The versions that differ, as they were and are; an update of the system changes no bit."""
    try:
        old, new = json.loads(stored), json.loads(now)
        names = sorted(name for name in {*old, *new} - {"platform"} if old.get(name) != new.get(name))
        was, is_now = (", ".join(f"{name} {one.get(name)}" for name in names) for one in (old, new))
    except (ValueError, TypeError, AttributeError):  # a damaged attribute
        return stored, now
    return was, is_now


def taken_up(solver: Solver, writer: RunWriter) -> Moment:
    """Return the checkpoint that an interrupted run goes on from; UserError where it is not the solver's."""
    try:
        arrays = writer.last_checkpoint()
        pace = tuple(arrays["pace"].tolist())
        return Moment(solver.restored(arrays), pace or None)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        reason = str(error).strip("'\"")
        raise UserError(
            f"--resume: the checkpoint is not whole ({reason}); valid: --force to begin again"
        ) from error


def _shown(value: object) -> str:
    """A value in a mistake's line."""
    return brief(f"{value:g}" if isinstance(value, float) else str(value))
