"""The linear regime: every angular mode of a small perturbation of a = 1, u = 0 carried exactly in time.

Initial data are taken apart into angular harmonics on the ray, A e^{i m theta} and so forth with complex
A, U, Z (the real parts of A e^{i m theta}, U e^{i m theta} and -i Z e^{i m theta} are meant), and each is
multiplied by exp(L_m t): a step of any length is exact.  The rows of L_m sum to the linear balance of total
actin.  What is neglected is quadratic in the perturbation; `Modal.neglected` estimates it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Generic

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core.contract import (
    Frame,
    Grid,
    Memento,
    Probes,
    Problem,
    S,
    Solver,
    State,
    recalled,
    remembered,
)
from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array, Closure
from actin_xcheck.core.observables import Measures
from fem.linearised import AngularMode
from fem.radial import FrameMesh, Ray

ComplexArray = NDArray[np.complex128]

ROUND_OFF = 1e-15
"""Harmonics this small are what rounding leaves of a0 about 1."""

LOOKS = 8
"""How often the amplitude is looked at within a step."""


@dataclass(frozen=True)
class ModalState(State):
    """A `State` with x, a and v at the solver's points of the disk, and the harmonics they come from.

    Attributes
    ----------
    harmonics : A, U, Z at the ray's nodes, a row for each angular number, (n_modes, 3 N).
    fed : what was left out at the start and what quadratic terms have fed into the modes since, estimated.
    """

    harmonics: ComplexArray = field(default_factory=lambda: np.zeros((0, 0), dtype=complex))
    fed: float = 0.0


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads harmonics at points of the disk.

    Attributes
    ----------
    xi, theta : the points (2, k) and their angles (k,).
    basis : of the ray at their radii, (k, N).
    waves : e^{i m theta}, (n_modes, k).
    """

    xi: Array
    theta: Array
    basis: Array
    waves: ComplexArray

    def scalar(self, harmonics: ComplexArray) -> Array:
        """Values (k,) of harmonics (n_modes, N)."""
        return np.asarray(((harmonics @ self.basis.T) * self.waves).real.sum(axis=0))

    def concentration(self, harmonics: ComplexArray) -> Array:
        """a (k,) of harmonics of A, U and Z."""
        return 1 + self.scalar(np.split(harmonics, 3, axis=1)[0])

    def vector(self, harmonics: ComplexArray) -> Array:
        """Cartesian components (2, k) of harmonics (n_modes, 2 N) of U and Z."""
        along, across = np.split(harmonics, 2, axis=1)
        return _turned(self.theta, self.scalar(along), self.scalar(-1j * across))


class Modal:
    """Linear modes of the disk at rest.

    Parameters
    ----------
    problem : near the steady state a = 1, u = 0, with neither motion nor source.
    mesh : of the disk, for pictures only.
    angular : the largest angular number.
    elements, degree : of the ray.

    Attributes
    ----------
    numbers : the angular numbers that are there.
    left_out : what of the initial a - 1 and u is in none of them, at most.
    """

    def __init__(self, problem: Problem, mesh: Mesh, angular: int, elements: int, degree: int) -> None:
        self.problem, self.mesh = problem, mesh
        self.ray = Ray.on(problem.model.parameters.l0, elements, degree)
        self._theta = 2 * np.pi * np.arange(4 * angular + 8) / (4 * angular + 8)
        given = self._given()
        harmonics = _analysed(given, angular)
        there = np.abs(harmonics).max(axis=1) > ROUND_OFF
        harmonics[~there] = 0
        there[0] = True
        self.numbers, self._initial = np.flatnonzero(there), harmonics[there]
        self._waves = np.exp(1j * np.outer(self.numbers, self._theta))
        self._modes = [AngularMode(problem.model, self.ray, m) for m in self.numbers.tolist()]
        a, along, across = np.split(self._initial, 3, axis=1)
        here = np.eye(self.ray.nodes.size)
        kept = [self._on_disk(here, part) for part in (a, along, -1j * across)]
        self.left_out = float(np.abs(given - np.array(kept)).max())

    def init(self) -> ModalState:
        """The initial data's harmonics."""
        return self._state(0.0, self._initial, self.left_out)

    def step(self, state: ModalState, dt: float) -> tuple[ModalState, Outcome]:
        """Exact for any dt, up to what is neglected."""
        harmonics, fed, part = state.harmonics, state.fed, dt / LOOKS
        size, grown = self._mean_square(harmonics), np.exp(part * self._fastest)
        feed = self.problem.model.feeding()
        for _ in range(LOOKS):
            pairs = zip(self._modes, harmonics, strict=True)
            harmonics = np.array([mode.carried(values, part) for mode, values in pairs])
            before, size = size, self._mean_square(harmonics)
            fed = float(grown * (fed + part * feed * max(before, size)))
        t = state.t + dt
        if not np.isfinite(fed):
            return state, Outcome(Ending.NON_FINITE, f"the modes are not finite at t = {t:.6g}")
        return self._state(t, harmonics, fed), COMPLETED

    def amplitude(self, state: ModalState) -> float:
        """The larger of |a - 1| and of the entries of grad u, over the disk."""
        return float(np.abs(self._perturbation(state.harmonics)).max())

    def neglected(self, state: ModalState) -> float:
        """Estimate the error in a (of 1) and in positions (of the radius) that quadratic terms would make up.

        What is neglected at an instant, like a = 1/J for uniform stretch, is at most about `AT_ONCE` times
        the amplitude squared.  What it has fed into the modes, e(t), obeys e' = g e + c s, e(0) = left_out,
        with g the fastest growth that two of the modes together can excite, s the mean of |a - 1|^2 +
        |grad u|^2 and c the rate of `Model.feeding`.  Full runs differ by a fourth to a hundredth of the
        estimate.
        """
        return AT_ONCE * self.amplitude(state) ** 2 + state.fed

    def handed_over(self, state: ModalState) -> Problem:
        """The problem that starts from a state: another solver goes on from its time as from t = 0."""
        harmonics, count = state.harmonics, self.ray.nodes.size
        return replace(
            self.problem,
            a0=lambda xi: self._reader(xi).concentration(harmonics),
            u0=lambda xi: self._reader(xi).vector(harmonics[:, count:]),
        )

    @property
    def grid(self) -> Grid:
        """Quadratic cells on the mesh."""
        return self._canvas.grid

    def frame(self, state: ModalState) -> Frame:
        """The modes at the nodes of the grid."""
        reader, h = self._on_grid, state.harmonics
        x = reader.xi + reader.vector(h[:, self.ray.nodes.size :])
        return self._canvas.frame(x, reader.vector(self._flow(h)), reader.concentration(h))

    def corners(self, state: ModalState) -> Array:
        """Values (3, n_cells) at the corners of the mesh."""
        return self._on_mesh.concentration(state.harmonics)[self.mesh.triangles]

    def check(self, state: ModalState) -> Outcome:
        """The orientation of the displaced disk at its points."""
        smallest = self._jacobian(state.harmonics).min()
        if smallest > 0:
            return COMPLETED
        message = f"det dx/dxi falls to {smallest:.3g} at t = {state.t:.6g}: no small perturbation"
        return Outcome(Ending.TANGLED, message)

    def measure(self, state: ModalState) -> Measures:
        """Integrals over the displaced cell, whose errors are those of the fields themselves."""
        jacobian = self._jacobian(state.harmonics)
        angle = 2 * np.pi / self._theta.size
        dx = jacobian * (angle * self.ray.weights * self.ray.points)[:, None]
        area, x = float(dx.sum()), state.x.reshape(2, *dx.shape)
        total = float((state.a.reshape(dx.shape) * dx).sum())
        return Measures(area, total, (x * dx).sum(axis=(1, 2)) / area, x[:, -1], float(jacobian.min()))

    def probes(self, points: Array) -> Probes[ModalState]:
        """The modes at material points (2, k)."""
        reader, count = self._reader(points), self.ray.nodes.size

        def read(state: ModalState) -> tuple[Array, Array]:
            h = state.harmonics
            return reader.concentration(h), (reader.xi + reader.vector(h[:, count:])).T

        return read

    def memento(self, state: ModalState) -> Memento:
        """The state and its harmonics."""
        return {**remembered(state), "harmonics": state.harmonics, "fed": np.asarray(state.fed)}

    def restored(self, memento: Memento) -> ModalState:
        """The state again."""
        return ModalState(**recalled(memento), harmonics=memento["harmonics"], fed=float(memento["fed"]))

    def _state(self, t: float, harmonics: ComplexArray, fed: float) -> ModalState:
        a, along, across = np.split(harmonics, 3, axis=1)
        basis, radii = self.ray.values, self.ray.points[:, None]
        theta = np.broadcast_to(self._theta, (radii.size, self._theta.size))
        x = _turned(theta, radii + self._on_disk(basis, along), self._on_disk(basis, -1j * across))
        flow = np.split(self._flow(harmonics), 2, axis=1)
        v = _turned(theta, self._on_disk(basis, flow[0]), self._on_disk(basis, -1j * flow[1]))
        return ModalState(
            t, x.reshape(2, -1), 1 + self._on_disk(basis, a).ravel(), v.reshape(2, -1),
            net_force=self._net_force(harmonics), harmonics=harmonics, fed=fed,
        )  # fmt: skip

    def _flow(self, harmonics: ComplexArray) -> ComplexArray:
        """Velocities' harmonics (n_modes, 2 N)."""
        return np.array([mode.flow @ values for mode, values in zip(self._modes, harmonics, strict=True)])

    def _net_force(self, harmonics: ComplexArray) -> tuple[float, float]:
        """The load on the whole cell that the gauge of `traction-free` carries; there is no torque."""
        if self.problem.model.closure is not Closure.TRACTION_FREE or 1 not in self.numbers:
            return 0.0, 0.0
        place = int(np.searchsorted(self.numbers, 1))
        rigid = self._modes[place].rigid
        assert rigid is not None
        net = np.pi * (rigid @ self._modes[place].load @ harmonics[place])
        return float(net.real), float(-net.imag)

    def _on_disk(self, table: Array, harmonics: ComplexArray) -> Array:
        """Values (q, n_theta) of harmonics (n_modes, N) under a table (q, N) of the ray, on all angles."""
        return np.asarray(((table @ harmonics.T) @ self._waves).real)

    def _gradient(self, harmonics: ComplexArray) -> Array:
        """grad u in polar components at the points of the disk, (2, 2, Q, n_theta)."""
        _, along, across = np.split(harmonics, 3, axis=1)
        slopes, over_r = self.ray.slopes, self.ray.values / self.ray.points[:, None]
        m = self.numbers[:, None]
        radial = self._on_disk(slopes, along), self._on_disk(over_r, 1j * (m * along + across))
        angular = self._on_disk(slopes, -1j * across), self._on_disk(over_r, m * across + along)
        return np.array([radial, angular])

    def _jacobian(self, harmonics: ComplexArray) -> Array:
        """det dx/dxi at the points of the disk, (Q, n_theta)."""
        (rr, rt), (tr, tt) = self._gradient(harmonics)
        return (1 + rr) * (1 + tt) - rt * tr

    def _perturbation(self, harmonics: ComplexArray) -> Array:
        """a - 1 and the entries of grad u at the points of the disk, (5, Q, n_theta)."""
        a = self._on_disk(self.ray.values, np.split(harmonics, 3, axis=1)[0])
        return np.array([a, *self._gradient(harmonics).reshape(4, *a.shape)])

    def _mean_square(self, harmonics: ComplexArray) -> float:
        """Mean of |a - 1|^2 + |grad u|^2 over the disk."""
        around = (self._perturbation(harmonics) ** 2).sum(axis=0).mean(axis=1)
        return float(2 * (self.ray.weights * self.ray.points) @ around)

    @cached_property
    def _fastest(self) -> float:
        """The fastest growth rate of all modes that two of those present can excite, or 0."""
        known = dict(zip(self.numbers.tolist(), self._modes, strict=True))
        pairs = product(known, known)
        excited = {abs(m + sign * n) for m, n in pairs for sign in (1, -1)} | set(known)
        modes = (known.get(m) or AngularMode(self.problem.model, self.ray, m) for m in excited)
        return max(0.0, *(float(np.linalg.eigvals(mode.generator).real.max()) for mode in modes))

    def _given(self) -> Array:
        """Initial a - 1, u_r and u_theta at the ray's nodes and all angles, (3, N, n_theta)."""
        radii, theta = np.meshgrid(self.ray.nodes, self._theta, indexing="ij")
        outward = np.array([np.cos(theta), np.sin(theta)])
        points = (radii * outward).reshape(2, -1)
        a = self.problem.a0(points).reshape(radii.shape)
        x, y = self.problem.u0(points).reshape(outward.shape)
        along, across = outward[0] * x + outward[1] * y, outward[0] * y - outward[1] * x
        if self.problem.model.closure is Closure.IRROTATIONAL_WALL:
            along[-1] = 0.0
        return np.array([a - 1, along, across])

    def _reader(self, xi: Array) -> _Reader:
        theta = np.arctan2(xi[1], xi[0])
        basis = self.ray.at(np.hypot(*xi))[0]
        return _Reader(xi, theta, basis, np.exp(1j * np.outer(self.numbers, theta)))

    @cached_property
    def _canvas(self) -> FrameMesh:
        return FrameMesh(self.mesh, self.problem.model.parameters.l0)

    @cached_property
    def _on_grid(self) -> _Reader:
        return self._reader(self.grid.xi)

    @cached_property
    def _on_mesh(self) -> _Reader:
        return self._reader(self.mesh.xi)


AT_ONCE = 2.0
"""Neglected at an instant, per amplitude squared."""


def _analysed(given: Array, angular: int) -> ComplexArray:
    """Harmonics (angular + 1, 3 N) of A, U and Z of values (3, N, n_theta)."""
    count = given.shape[-1]
    harmonics = 2 * np.fft.rfft(given, axis=-1)[..., : angular + 1] / count
    harmonics[..., 0] /= 2
    harmonics[2] *= 1j
    return np.moveaxis(harmonics, -1, 0).reshape(angular + 1, -1)


def _turned(theta: Array, along: Array, across: Array) -> Array:
    """Cartesian components of a vector given along and across the rays at angles theta."""
    cos, sin = np.cos(theta), np.sin(theta)
    return np.array([cos * along - sin * across, sin * along + cos * across])


class HandOver(Generic[S]):
    """A small perturbation as modes, handed over to a solver of the whole model when it has grown.

    Parameters
    ----------
    modal : carries the modes, and shows them on the mesh of the whole model.
    later : solves that.
    whole : binds the solver of the whole model to a problem; it goes on from any of the modes' states.
    bound : largest error that the modes may make, see `Modal.neglected`.
    """

    def __init__(
        self, modal: Modal, later: Solver[S], whole: Callable[[Problem], Solver[S]], bound: float
    ) -> None:
        self.modal, self.later, self.whole, self.bound = modal, later, whole, bound
        self.mesh, self.grid = later.mesh, later.grid

    def init(self) -> ModalState | S:
        """The modes of the initial data, or these themselves where they are too large."""
        start = self.modal.init()
        return replace(start, local_error=0.0) if self._small(start) else self.later.init()

    def step(self, state: ModalState | S, dt: float) -> tuple[ModalState | S, Outcome]:
        """A step of the modes as long as it ends within the bound, else one of the whole model."""
        if isinstance(state, ModalState):
            new, outcome = self.modal.step(state, dt)
            if outcome.ok and self._small(new):
                return replace(new, local_error=0.0), outcome  # exact in time
            return self.later.step(self._handed_over(state), dt)
        return self.later.step(state, dt)

    def check(self, state: ModalState | S) -> Outcome:
        """By whoever made the state, as all that follows."""
        return self._of(state).check(state)

    def corners(self, state: ModalState | S) -> Array:
        """Corner values (3, n_cells)."""
        return self._of(state).corners(state)

    def measure(self, state: ModalState | S) -> Measures:
        """Area, total actin, centroid and rim."""
        return self._of(state).measure(state)

    def frame(self, state: ModalState | S) -> Frame:
        """On the whole model's grid."""
        return self.later.frame(self._handed_over(state) if isinstance(state, ModalState) else state)

    def probes(self, points: Array) -> Probes[ModalState | S]:
        """Material points (2, k)."""
        modal, later = self.modal.probes(points), self.later.probes(points)
        return lambda state: modal(state) if isinstance(state, ModalState) else later(state)

    def memento(self, state: ModalState | S) -> Memento:
        """As whoever made the state keeps it."""
        return self._of(state).memento(state)

    def restored(self, memento: Memento) -> ModalState | S:
        """By whoever made it: modes have harmonics."""
        return (self.modal if "harmonics" in memento else self.later).restored(memento)

    def _small(self, state: ModalState) -> bool:
        return self.modal.neglected(state) <= self.bound

    def _of(self, state: ModalState | S) -> Solver:
        return self.modal if isinstance(state, ModalState) else self.later

    def _handed_over(self, state: ModalState) -> S:
        """The whole model's state at the time of the modes'."""
        return replace(self.whole(self.modal.handed_over(state)).init(), t=state.t)
