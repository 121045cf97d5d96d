"""The contract of floor 3: what a problem is, what a solver does, who moves the nodes.

A scene (physics) and a method (numerics) are resolved above into a `Problem` on a `Mesh`; solvers see plain
arrays and callables only.  Every solver describes its concentration by *corner values*: the values, at the
three corners of each triangle, of a piecewise linear (possibly discontinuous) field, shape (3, n_cells).
Cell means, total actin, probes and loads all follow from them, so both codes are measured with one ruler.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from actin_xcheck.core import observables
from actin_xcheck.core.errors import COMPLETED, Outcome
from actin_xcheck.core.mesh import Indices, Mesh, locate, orientation
from actin_xcheck.core.model import Array, Model
from actin_xcheck.core.observables import Measures

Source = Callable[[Array, Array, float], Array]
"""Source term s(x, xi, t), per area and time: shape of x[0]."""


NOTHING: Array = np.zeros(0)
"""What a Mechanics carries beside the nodes' positions, where it carries nothing."""
NOTHING.setflags(write=False)


@dataclass(frozen=True)
class Motion:
    """A prescribed motion: positions x(xi, t) and their rates, both (2, n), of material points xi (2, n)."""

    position: Callable[[Array, float], Array]
    velocity: Callable[[Array, float], Array]

    def __call__(self, xi: Array, t: float) -> Array:
        """Return the positions."""
        return self.position(xi, t)


@dataclass(frozen=True)
class Problem:
    """A scene resolved into callables on the reference disk (non-dimensional).

    Attributes
    ----------
    model : constitutive laws and switches.
    a0 : initial concentration at material points xi (2, n) -> (n,).
    u0 : initial displacement at material points, (2, n) -> (2, n).
    motion : prescribed motion, or None where the force balance moves the cell.
    source : source term of the transport equation, or None.
    """

    model: Model
    a0: Callable[[Array], Array]
    u0: Callable[[Array], Array]
    motion: Motion | None = None
    source: Source | None = None


@dataclass(frozen=True)
class Move:
    """What a Mechanics returns: new node positions (2, N), node velocities (2, N) and how it went.

    `net_force` (2,) and `net_torque` (about the centroid) are the total loads that the closure's gauge
    carries; zero for closures without one.  `carried` is the rate of what the Mechanics carries.
    """

    x: Array
    v: Array
    outcome: Outcome = COMPLETED
    net_force: tuple[float, float] = (0.0, 0.0)
    net_torque: float = 0.0
    carried: Array = field(default_factory=lambda: NOTHING)


class Mechanics(Protocol):
    """Who moves the nodes: the force balance, a prescribed motion or a recorded one."""

    def start(self, x: Array) -> Array:
        """Return the positions at t = 0 for nodes displaced to x (2, N) by the initial data."""
        ...

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> Move:
        """Move the nodes from x at t to t + dt, loaded by the concentration's corner values (3, n_cells)."""
        ...

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """Return the instantaneous node velocities (2, N) at time t."""
        ...

    def carried(self, u0: Callable[[Array], Array]) -> Array:
        """What it carries beside positions, of any shape, at t = 0; empty where there is nothing.

        `u0` is the initial displacement of material points, (2, n) -> (2, n).
        """
        ...

    def flow(self, t: float, x: Array, corners: Array, carried: Array = NOTHING) -> Move:
        """Return the velocity with its Outcome, its loads and the rate of what is carried; x stays."""
        ...

    def settle(self, x: Array) -> Array:
        """Put nodes that should be on a wall, and are not, back onto it."""
        ...


@dataclass(frozen=True)
class State:
    """A moment of a run; immutable.  The displacement is u = x - xi (paragraph below (2.5)).

    Attributes
    ----------
    t : time.
    x : node positions, (2, N).
    a : the method's own unknowns (nodal for P1, cell averages for finite volumes).
    v : node velocities over the last step, (2, N).
    balance_residual : the scheme's own discrete conservation law, relative to total actin.
    net_force, net_torque : loads carried by the gauge of `traction-free` over the last step.
    local_error : the method's own estimate of the error the last step made, relative: the largest of that
        in positions (radii), in a (L2) and in what is carried; nan for a method without one.
    carried : what a Mechanics carries beside positions.
    """

    t: float
    x: Array
    a: Array
    v: Array
    balance_residual: float = 0.0
    net_force: tuple[float, float] = (0.0, 0.0)
    net_torque: float = 0.0
    local_error: float = float("nan")
    carried: Array = field(default_factory=lambda: NOTHING)


S = TypeVar("S", bound=State)
"""What a method keeps of a moment."""

Memento = Mapping[str, NDArray[Any]]
"""A state as contiguous arrays by name: all that the steps after it depend on, and nothing that follows."""


def remembered(state: State) -> dict[str, NDArray[Any]]:
    """Return what every state holds, for a memento."""
    return {one.name: np.asarray(getattr(state, one.name)) for one in fields(State)}


def recalled(memento: Memento) -> dict[str, Any]:
    """Return the fields of `State` from a memento; KeyError where one is missing."""
    held = {one.name: memento[one.name] for one in fields(State)}
    numbers = {name: value.tolist() for name, value in held.items() if name not in ("x", "a", "v", "carried")}
    return {**held, **numbers, "net_force": tuple(numbers["net_force"])}


@dataclass(frozen=True, eq=False)
class Grid:
    """What frames are stored on; it never changes in a run.

    Attributes
    ----------
    xi : material positions of the nodes, (2, N).
    cells : nodes of each cell in the order of `lagrange.nodes`, vertices counter-clockwise,
        (n_local, n_cells).
    order : k, that of the fields and of the cells' sides; n_local = (k + 1)(k + 2)/2.
    """

    xi: Array
    cells: Indices
    order: int


@dataclass(frozen=True, eq=False)
class Frame:
    """A state on its grid: what is stored of it.

    Attributes
    ----------
    x, v : node positions and velocities, (2, N).
    a : concentration at the nodes, (N,).
    a_cells : its means over the cells, curved as they are, (n_cells,).
    """

    x: Array
    v: Array
    a: Array
    a_cells: Array


Probes = Callable[[S], tuple[Array, Array]]
"""Concentrations (k,) and positions (k, 2) of material points in a state."""


class Solver(Protocol[S]):
    """A method bound to a problem and a mesh: explicit `init`, pure `step`."""

    @property
    def mesh(self) -> Mesh:
        """The reference mesh of the whole cell; corner values belong to its triangles."""
        ...

    @property
    def grid(self) -> Grid:
        """What frames are stored on."""
        ...

    def init(self) -> S:
        """Return the state at t = 0."""
        ...

    def step(self, state: S, dt: float) -> tuple[S, Outcome]:
        """Return the state at t + dt and how the step went; a rejected step is simply dropped."""
        ...

    def check(self, state: S) -> Outcome:
        """Whether the configuration of a state is valid: no cell has turned over."""
        ...

    def corners(self, state: S) -> Array:
        """Corner values (3, n_cells) of the concentration."""
        ...

    def measure(self, state: S) -> Measures:
        """Area, total actin, centroid and rim of a state, by the method's own integrals."""
        ...

    def frame(self, state: S) -> Frame:
        """The state on the grid."""
        ...

    def probes(self, points: Array) -> Probes[S]:
        """Return what reads concentration and position of material points (2, k) off a state."""
        ...

    def memento(self, state: S) -> Memento:
        """The state to be kept: what `restored` makes it from again."""
        ...

    def restored(self, memento: Memento) -> S:
        """Return the state; a step from it gives the bits that one from the original gives.

        Raises KeyError where the memento lacks something.
        """
        ...


class Polygonal(ABC, Generic[S]):
    """What a method measures whose cells are straight triangles and whose concentration is linear in each."""

    mesh: Mesh

    @abstractmethod
    def corners(self, state: S) -> Array:
        """Corner values (3, n_cells) of the concentration."""

    @cached_property
    def grid(self) -> Grid:
        """The mesh itself."""
        return Grid(self.mesh.xi, self.mesh.triangles, 1)

    def frame(self, state: S) -> Frame:
        """Nodal values are means of the corners that meet there."""
        return straight_frame(self.mesh, state, self.corners(state))

    def check(self, state: S) -> Outcome:
        """The orientation of every triangle."""
        return orientation(self.mesh, state.t, state.x)

    def measure(self, state: S) -> Measures:
        """Integrals over the polygon."""
        triangles, x = self.mesh.triangles, state.x
        total = observables.total_actin(x, triangles, self.corners(state))
        rim = x[:, self.mesh.rim_nodes]
        size, centre = observables.area(x, triangles), observables.centroid(x, triangles)
        return Measures(size, total, centre, rim, observables.jacobian_min(self.mesh, x))

    def probes(self, points: Array) -> Probes[S]:
        """Linear interpolation in the triangles that hold the points (2, k)."""
        cells, weights = locate(self.mesh, points)
        triangles = self.mesh.triangles
        return lambda state: observables.probe(triangles, cells, weights, self.corners(state), state.x)


def straight_frame(mesh: Mesh, state: State, corners: Array) -> Frame:
    """A state on straight triangles, from the corner values (3, n_cells) of its concentration."""
    count = mesh.xi.shape[1]
    meeting = np.bincount(mesh.triangles.ravel(), minlength=count)
    nodal = np.bincount(mesh.triangles.ravel(), corners.ravel(), count) / meeting
    return Frame(state.x, state.v, nodal, corners.mean(axis=0))
