"""Observers of a run: what is measured on every state, and what another run needs to know of one."""

from collections.abc import Callable

import numpy as np

from actin_xcheck.core import observables
from actin_xcheck.core.contract import Move, Solver, State
from actin_xcheck.core.mesh import INTERIOR_POINTS, Mesh, quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.runs.store import RunWriter
from actin_xcheck.scene.resolve import mode_field, turn_matrix
from actin_xcheck.scene.scene import Scene

Progress = Callable[[int, int], None]
"""Called with how many of how many parts of a run's time are done."""

PARTS = 1000
"""Of a run's time, for its progress: steps are of different lengths."""


class Paths:
    """Keeps the node paths of a run, to drive another one."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.moves: list[Move] = []

    def record(self, dt: float, state: State) -> None:
        """Keep where the nodes are and how they got there."""
        self.times.append(state.t)
        self.moves.append(Move(state.x, state.v, net_force=state.net_force, net_torque=state.net_torque))

    def frame(self, state: State) -> None:
        """Output times mean nothing here."""


class Corners:
    """Keeps the corner values of every state: the unperturbed twin of a growing run."""

    def __init__(self, solver: Solver) -> None:
        self.solver = solver
        self.values: list[Array] = []

    def record(self, dt: float, state: State) -> None:
        """Keep the concentration."""
        self.values.append(self.solver.corners(state))

    def frame(self, state: State) -> None:
        """Output times mean nothing here."""


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
        self.last: State | None = None

    def record(self, dt: float, state: State) -> None:
        """Write one row of the time series."""
        probe_a, probe_x = self.probes(state)
        measured = self.solver.measure(state)
        row = {
            "time": state.t,
            "dt": dt,
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
        self.last = state
        self.writer.record(row)
        self.progress(round(PARTS * state.t / self.end), PARTS)
        self.step += 1

    def frame(self, state: State) -> None:
        """Write one output time."""
        self.writer.frame(state.t, self.solver.frame(state))
