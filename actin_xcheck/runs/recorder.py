"""What is kept of a run while it lasts: rows, frames, and checkpoints that it can go on from."""

import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from actin_xcheck.core import observables
from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.core.files import unfinished
from actin_xcheck.core.mesh import INTERIOR_POINTS, Mesh, quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.core.outcome import COMPLETED, Ending, Outcome
from actin_xcheck.runs.march import Moment
from actin_xcheck.runs.store import Attributes, Run, RunWriter, read_run
from actin_xcheck.scene.resolve import mode_field, turn_matrix
from actin_xcheck.scene.scene import Scene

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
    ) -> None:
        self.solver, self.writer = solver, writer
        self.amplitude, self.progress, self.step = amplitude, progress, writer.rows
        self.end = scene.output_times[-1]
        points = np.array(scene.probes.points, dtype=float).reshape(-1, 2).T
        self.probes = solver.probes(turn_matrix(scene) @ points)
        self.gauged = scene.physics.closure is Closure.TRACTION_FREE

    def record(self, moment: Moment) -> None:
        """Write one row of the time series, and a frame at an output time."""
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
            "polarity": observables.polarity(measured.rim),
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
        if moment.is_output:
            self.frame(state)

    def frame(self, state: State) -> None:
        """Write a frame."""
        self.writer.frame(state.t, self.solver.frame(state))


REST = 50.0
"""Time from one checkpoint to the next, over what the one took to write: together they cost a run 2 %."""


class Keeper:
    """Writes a run's checkpoints: where it begins, then seldom enough to cost little, and where it stops.

    Parameters
    ----------
    solver, writer : of the run.
    began : when it would have begun had it never been interrupted, by `time.perf_counter`.
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
