"""What is kept of a run here: the rim after every step, and how rough it is."""

from dataclasses import dataclass, field

import numpy as np

from actin_xcheck.core import lagrange
from actin_xcheck.core.contract import Grid, Solver, State
from actin_xcheck.core.mesh import Indices, Mesh
from actin_xcheck.core.model import Array

ROUGH = 12
"""Ripples of this wave number and beyond are roughness; the four fronts and their first harmonics are not."""


def rim_of(grid: Grid) -> Indices:
    """Nodes of the grid on the rim, counter-clockwise from angle 0 on: equispaced, so that meshes nest."""
    triangles = np.swapaxes(grid.cells[lagrange.pieces(grid.order)], 1, 2).reshape(3, -1)
    nodes = Mesh(np.empty((2, 0)), triangles, h=np.nan).rim_nodes
    x, y = grid.xi[:, nodes]
    return np.roll(nodes, -int(np.argmin(np.abs(np.arctan2(y, x)))))


@dataclass
class Rims:
    """An observer that keeps the rim (2, n) of every state."""

    solver: Solver
    times: list[float] = field(default_factory=list)
    rims: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._nodes = rim_of(self.solver.grid)

    def record(self, dt: float, state: State) -> None:
        """Keep the rim."""
        self.times.append(state.t)
        self.rims.append(self.solver.frame(state).x[:, self._nodes])

    def frame(self, state: State) -> None:
        """Output times mean nothing here."""


def mean_radius(rim: Array) -> Array:
    """Mean distance from the origin of rims (..., 2, n): (...)."""
    return np.asarray(np.hypot(rim[..., 0, :], rim[..., 1, :]).mean(axis=-1))


def spectrum_of(rim: Array) -> Array:
    """Amplitudes (..., n // 2 + 1) of the radii of rims (..., 2, n) by wave number, m = 0 being the mean."""
    radii = np.hypot(rim[..., 0, :], rim[..., 1, :])
    amplitudes = np.abs(np.fft.rfft(radii, axis=-1)) * 2 / radii.shape[-1]
    amplitudes[..., [0, -1]] /= 2
    return np.asarray(amplitudes)


def roughness(rim: Array) -> Array:
    """Root mean square of the ripples m >= `ROUGH` of rims (..., 2, n), in mean radii: (...)."""
    amplitudes = spectrum_of(rim)
    return np.asarray(np.sqrt((amplitudes[..., ROUGH:] ** 2).sum(axis=-1) / 2) / amplitudes[..., 0])


def distance(fine: Array, coarse: Array) -> Array:
    """Rms distance, in mean radii, of the points that rims (..., 2, n) and (..., 2, n/2) share."""
    apart = fine[..., ::2] - coarse
    return np.asarray(np.sqrt((apart**2).sum(axis=-2).mean(axis=-1)) / mean_radius(coarse))
