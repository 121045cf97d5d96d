"""The contract of floor 3: what a problem is, what a solver does, who moves the nodes.

A scene (physics) and a method (numerics) are resolved above into a `Problem` on a `Mesh`; solvers see plain
arrays and callables only.  Every solver describes its concentration by *corner values*: the values, at the
three corners of each triangle, of a piecewise linear (possibly discontinuous) field, shape (3, n_cells).
Cell means, total actin, probes and loads all follow from them, so both codes are measured with one ruler.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from actin_xcheck import observables
from actin_xcheck.geometry import Mesh, locate
from actin_xcheck.model import Array, Model
from actin_xcheck.observables import Measures
from actin_xcheck.result import COMPLETED, Outcome

Motion = Callable[[Array, float], Array]
"""Prescribed positions x(xi, t): (2, n) at time t for material points xi (2, n)."""

Source = Callable[[Array, Array, float], Array]
"""Source term s(x, xi, t), per area and time: shape of x[0]."""


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
    carries; zero for closures without one.
    """

    x: Array
    v: Array
    outcome: Outcome = COMPLETED
    net_force: tuple[float, float] = (0.0, 0.0)
    net_torque: float = 0.0


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

    def flow(self, t: float, x: Array, corners: Array) -> Move:
        """Return the same with its Outcome and loads; the nodes stay at x."""
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
    local_error : the method's own estimate of the error the last step made, relative: the larger of that in
        positions (radii) and in a (L2); nan for a method without one.
    """

    t: float
    x: Array
    a: Array
    v: Array
    balance_residual: float = 0.0
    net_force: tuple[float, float] = (0.0, 0.0)
    net_torque: float = 0.0
    local_error: float = float("nan")


Probes = Callable[[State], tuple[Array, Array]]
"""Concentrations (k,) and positions (k, 2) of material points in a state."""


class Solver(Protocol):
    """A method bound to a problem and a mesh: explicit `init`, pure `step`."""

    mesh: Mesh

    def init(self) -> State:
        """Return the state at t = 0."""
        ...

    def step(self, state: State, dt: float) -> tuple[State, Outcome]:
        """Return the state at t + dt and how the step went; a rejected step is simply dropped."""
        ...

    def corners(self, state: State) -> Array:
        """Corner values (3, n_cells) of the concentration."""
        ...

    def measure(self, state: State) -> Measures:
        """Area, total actin, centroid and rim of a state, by the method's own integrals."""
        ...

    def probes(self, points: Array) -> Probes:
        """Return what reads concentration and position of material points (2, k) off a state."""
        ...


class Polygonal(ABC):
    """What a method measures whose cells are straight triangles and whose concentration is linear in each."""

    mesh: Mesh

    @abstractmethod
    def corners(self, state: State) -> Array:
        """Corner values (3, n_cells) of the concentration."""

    def measure(self, state: State) -> Measures:
        """Integrals over the polygon."""
        triangles, x = self.mesh.triangles, state.x
        total = observables.total_actin(x, triangles, self.corners(state))
        rim = x[:, self.mesh.rim_nodes]
        return Measures(observables.area(x, triangles), total, observables.centroid(x, triangles), rim)

    def probes(self, points: Array) -> Probes:
        """Linear interpolation in the triangles that hold the points (2, k)."""
        cells, weights = locate(self.mesh, points)
        triangles = self.mesh.triangles
        return lambda state: observables.probe(triangles, cells, weights, self.corners(state), state.x)
