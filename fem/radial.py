"""The whole non-linear model on one ray, for axisymmetric data: spectral elements that move, in R and t.

With r(R, t) the place of the ring of points that started at R, u = r - R, eps = diag(v', v/r) and primes for
d/dr, (B.16) becomes, for all w with w = 0 at the centre,

    int (mu1 (v' w' + v w/r^2) + mu2 (v' + v/r)(w' + w/r)) dx
        = -int f (w' + w/r) + (u' w' + u w/r^2) + nu' phi (w' + w/r) dx + [2 pi r f w] at the rim,

with dx = 2 pi r dr and phi = u' + u/r; transport is (B.22) as it stands.  Every closure of a free rim gives
this one system: no rim point leaves its ray, and no net load is left for a gauge.  `irrotational-wall` is
v = 0 at the rim, where neither swirl nor friction remains.  Time is that of `imex.py`: an additive pair, the
motion explicit and diffusion implicit, total actin conserved to round-off by P = M a.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss, legvander
from scipy.linalg.lapack import dposv

from actin_xcheck.core.contract import Frame, Grid, Memento, Probes, Problem, State, recalled, remembered
from actin_xcheck.core.errors import COMPLETED, Ending, Outcome
from actin_xcheck.core.linear import TOLERANCE
from actin_xcheck.core.mesh import Mesh
from actin_xcheck.core.model import Array, Closure, Rheology
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.observables import Measures
from fem.fields import Lattice, cell_means
from fem.space import Space
from fem.tableaux import TABLEAUX

MORE_POINTS = 3
"""Gauss points of an element beyond its degree: products of the fields are no polynomials."""


@dataclass(frozen=True, eq=False)
class Ray:
    """Continuous polynomials in the material radius R, element by element, on 0 <= R <= 1.

    They meet on the ring, where the active stress jumps, and are equally wide on either side of it.

    Attributes
    ----------
    ends : where elements meet, 0 and 1 included, (n_elements + 1,).
    degree : of the polynomials, at least 1.
    """

    ends: Array
    degree: int

    @classmethod
    def on(cls, ring: float, elements: int, degree: int) -> "Ray":
        """Put half of the elements, at least one, on either side of R = `ring`: the outer ones are narrow."""
        outside = max(elements // 2, 1)
        inside = max(elements - outside, 1)
        inner, outer = np.linspace(0, ring, inside + 1), np.linspace(ring, 1, outside + 1)
        return cls(np.concatenate([inner, outer[1:]]), degree)

    @cached_property
    def nodes(self) -> Array:
        """Material radii of the nodes, (N,)."""
        local = self._placed(self._lobatto)
        return np.append(local[:, :-1].ravel(), 1.0)

    @cached_property
    def points(self) -> Array:
        """Material radii of the Gauss points and, as the last one, of the rim, (Q,)."""
        return np.append(self._placed(self._gauss[0]).ravel(), 1.0)

    @cached_property
    def weights(self) -> Array:
        """Their weights, (Q,): integrals over R; the rim has none."""
        return np.append(np.outer(np.diff(self.ends) / 2, self._gauss[1]).ravel(), 0.0)

    @cached_property
    def values(self) -> Array:
        """Basis functions at these points, (Q, N)."""
        return self.at(self.points)[0]

    @cached_property
    def slopes(self) -> Array:
        """Their derivatives in R, (Q, N)."""
        return self.at(self.points)[1]

    @cached_property
    def centre_slopes(self) -> Array:
        """Their derivatives in R at the centre, (N,)."""
        return self.at(np.zeros(1))[1][0]

    def at(self, radii: Array) -> tuple[Array, Array]:
        """Basis functions and their derivatives in R at material radii (k,), (k, N) each."""
        count = len(self.ends) - 1
        element = np.clip(np.searchsorted(self.ends, radii) - 1, 0, count - 1)
        width = np.diff(self.ends)[element]
        place = 2 * (radii - self.ends[element]) / width - 1
        to_modes = np.linalg.inv(legvander(self._lobatto, self.degree))
        derived = np.array([Legendre.basis(j).deriv()(place) for j in range(self.degree + 1)]).T
        rows = np.arange(len(radii))[:, None]
        columns = element[:, None] * self.degree + np.arange(self.degree + 1)
        values, slopes = np.zeros((2, len(radii), count * self.degree + 1))
        values[rows, columns] = legvander(place, self.degree) @ to_modes
        slopes[rows, columns] = derived @ to_modes * (2 / width)[:, None]
        # a constant has no slope, to the last digit: conservation rests on it
        return values, slopes - slopes.sum(axis=1, keepdims=True) * values

    @cached_property
    def _lobatto(self) -> Array:
        inner = np.sort(np.real(Legendre.basis(self.degree).deriv().roots()))
        return np.concatenate([[-1.0], inner, [1.0]])

    @cached_property
    def _gauss(self) -> tuple[Array, Array]:
        points, weights = leggauss(self.degree + MORE_POINTS)
        return points, weights

    def _placed(self, local: Array) -> Array:
        """Points of the reference element [-1, 1], (k,), in every element, (n_elements, k)."""
        start, width = self.ends[:-1, None], np.diff(self.ends)[:, None]
        return start + width * (1 + local) / 2


class FrameMesh:
    """What frames of fields known everywhere are drawn on: quadratic curved cells.

    Parameters
    ----------
    mesh : of the disk.
    ring : radius from which its layers are circles.
    """

    def __init__(self, mesh: Mesh, ring: float) -> None:
        self._space = Space.on(mesh, 2, ring)
        self.grid = Lattice(self._space, mesh.triangles).grid

    def frame(self, x: Array, v: Array, a: Array) -> Frame:
        """Positions, velocities (2, n) and concentrations (n,) at the grid's nodes, with the cells' means."""
        return Frame(x, v, a, cell_means(self._space, x, a))


AROUND = 2 * np.pi * np.arange(16) / 16
"""Angles of the points that stand for the rim."""


@dataclass(frozen=True, eq=False)
class _Shape:
    """A configuration: r and dr/dR at the ray's points (Q,), dx (Q,), mass and stiffness (N, N)."""

    r: Array
    slope: Array
    dx: Array
    mass: Array
    stiffness: Array


_NOWHERE = _Shape(*(np.zeros(0) for _ in range(5)))


@dataclass(frozen=True)
class RadialState(State):
    """A `State` on the ray: x = (r, 0), a and v at its nodes, its configuration and P = M a, (N,)."""

    shape: _Shape = _NOWHERE
    content: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class _Stage:
    """What a stage adds to the step: velocities (N,), G (N,), and the gain of total actin it stands for."""

    v: Array
    rate: Array
    gain: float


class Radial:
    """An axisymmetric cell on one ray.

    Parameters
    ----------
    problem : with data that do not depend on the angle; they are read on the ray (R, 0).
    mesh : of the disk, for pictures only.
    elements, degree : of the ray.
    time : order of the pair, 2 to 4.
    """

    def __init__(self, problem: Problem, mesh: Mesh, elements: int, degree: int, time: int) -> None:
        self.problem, self.mesh, self.tableau = problem, mesh, TABLEAUX[time]
        self.ray = ray = Ray.on(problem.model.parameters.l0, elements, degree)
        self.delta = problem.model.delta_on_cells(_on_ray(ray.points))
        self.delta[-1] = problem.model.delta_on_rim()
        moving = ray.nodes.size - (problem.model.closure is Closure.IRROTATIONAL_WALL)
        self._free = slice(1, moving)
        self._around = 2 * np.pi * ray.weights
        self._nothing = np.zeros_like(ray.points)
        hoop = (ray.slopes.T * self._around) @ ray.values
        self._hoop = hoop + hoop.T
        motion = problem.motion
        self._motion = None if motion is None else PrescribedMotion(_on_ray(ray.nodes), motion)

    def init(self) -> RadialState:
        """Interpolate the initial data at the nodes."""
        xi = _on_ray(self.ray.nodes)
        x = xi + self.problem.u0(xi) if self._motion is None else self._motion.start(xi)
        r, a = x[0], self.problem.a0(xi)
        r[0] = 0.0
        if self.problem.model.closure is Closure.IRROTATIONAL_WALL and self._motion is None:
            r[-1] = 1.0
        shape = self._shape(r)
        v, _ = self._velocity(0.0, r, shape, a)
        return RadialState(0.0, _on_ray(r), a, _on_ray(v), shape=shape, content=shape.mass @ a)

    @property
    def grid(self) -> Grid:
        """Quadratic cells on the mesh."""
        return self._canvas.grid

    def frame(self, state: RadialState) -> Frame:
        """The ray's polynomials at the nodes of the grid."""
        outward, rows = self._lifted
        x, v = (outward * (rows @ field) for field in (state.x[0], state.v[0]))
        return self._canvas.frame(x, v, rows @ state.a)

    def corners(self, state: RadialState) -> Array:
        """Values (3, n_cells) at the corners of the mesh."""
        return (self._on_mesh @ state.a)[self.mesh.triangles]

    def measure(self, state: RadialState) -> Measures:
        """Integrals over the round cell, exact for its polynomials."""
        rim, shape = state.x[0, -1], state.shape
        points = rim * np.array([np.cos(AROUND), np.sin(AROUND)])
        # r dr/R dR is (dr/dR)^2 at the centre
        centre = self.ray.centre_slopes @ state.x[0]
        jacobian = np.append(shape.r * shape.slope / self.ray.points, centre**2).min()
        return Measures(np.pi * rim**2, float(state.content.sum()), np.zeros(2), points, float(jacobian))

    def probes(self, points: Array) -> Probes[RadialState]:
        """The polynomials at material points (2, k), turned to where the points are."""
        outward, rows = self._lift(points)
        # the centre is at 0, not at -0
        return lambda state: (rows @ state.a, (outward * (rows @ state.x[0])).T + 0.0)

    def step(self, state: RadialState, dt: float) -> tuple[RadialState, Outcome]:
        """One step of the pair; its embedded solution gives `local_error`."""
        pair, k = self.tableau, self.problem.model.reaction_rate()
        v, outcome = self._velocity(state.t, state.x[0], state.shape, state.a)
        gain, total = self._gain(state.t, state.shape), k * state.content
        rate = gain - total - self.problem.model.parameters.d * (state.shape.stiffness @ state.a)
        velocities, rates, gained = [v], [rate], pair.b[0] * (gain - total).sum()
        for i in range(1, len(pair.c)):
            if not outcome.ok:
                return state, outcome
            t, implicit = state.t + pair.c[i] * dt, dt * pair.gamma
            r = state.x[0] + dt * (pair.explicit[i, :i] @ velocities)
            content = state.content + dt * (pair.implicit[i, :i] @ rates)
            shape = self._shape(r)
            if not (outcome := self._orientation(t, shape)).ok:
                return state, outcome
            gain = self._gain(t, shape)
            left = (1 + implicit * k) * shape.mass
            left += implicit * self.problem.model.parameters.d * shape.stiffness
            a, outcome = _solved(left, content + implicit * gain)
            if not outcome.ok:
                return state, outcome
            new = shape.mass @ a
            gained += pair.b[i] * (gain.sum() - k * new.sum())
            v, outcome = self._velocity(t, r, shape, a)
            velocities.append(v)
            rates.append((new - content) / implicit)
        if not outcome.ok:
            return state, outcome
        return self._combined(state, dt, np.array(velocities), np.array(rates), gained)

    def check(self, state: RadialState) -> Outcome:
        """Whether every ring lies outside of those that started inside of it."""
        return self._orientation(state.t, state.shape)

    def memento(self, state: RadialState) -> Memento:
        """The state and P; the configuration follows from the positions."""
        return {**remembered(state), "content": state.content}

    def restored(self, memento: Memento) -> RadialState:
        """The state again."""
        known = recalled(memento)
        return RadialState(**known, shape=self._shape(known["x"][0]), content=memento["content"])

    def _combined(
        self, old: RadialState, dt: float, velocities: Array, rates: Array, gained: float
    ) -> tuple[RadialState, Outcome]:
        pair, t = self.tableau, old.t + dt
        wrong = pair.b - pair.b_embedded
        r = old.x[0] + dt * (pair.b @ velocities)
        content, difference = old.content + dt * (pair.b @ rates), wrong @ rates
        shape = self._shape(r)
        if not (outcome := self._orientation(t, shape)).ok:
            return old, outcome
        solved, outcome = _solved(shape.mass, np.array([content, difference]).T)
        a = solved[:, 0]
        content = shape.mass @ a
        total = content.sum()
        moved = dt * np.abs(wrong @ velocities).max()
        spread = dt * np.sqrt(abs(difference @ solved[:, 1]) / (a @ content))
        residual = (total - old.content.sum() - dt * gained) / total
        new = RadialState(
            t, _on_ray(r), a, _on_ray(velocities[-1]), residual,
            local_error=float(max(moved, spread)), shape=shape, content=content,
        )  # fmt: skip
        return new, outcome

    def _shape(self, r: Array) -> _Shape:
        """The configuration with nodes at r (N,)."""
        ray, around = self.ray, self._around
        place, slope = ray.values @ r, ray.slopes @ r
        dx = around * place * slope
        mass = (ray.values.T * dx) @ ray.values
        stiffness = (ray.slopes.T * (around * place / slope)) @ ray.slopes
        return _Shape(place, slope, dx, mass, stiffness)

    def _velocity(self, t: float, r: Array, shape: _Shape, a: Array) -> tuple[Array, Outcome]:
        """Velocities (N,) of the nodes: the force balance, or what is prescribed."""
        if self._motion is not None:
            return self._motion.velocity(t, _on_ray(r), a)[0], COMPLETED
        model, ray, around = self.problem.model, self.ray, self._around
        (mu1, mu2), (one, nu_prime) = model.viscous_moduli(), model.elastic_moduli()
        if model.rheology is Rheology.VISCOELASTIC:
            along, across = 1 - 1 / shape.slope, 1 - ray.points / shape.r
        else:
            along, across = self._nothing, self._nothing
        dilation = along + across
        if not (outcome := model.dilated(t, dilation, self._place)).ok:
            return np.zeros_like(r), outcome
        f = model.active_stress(ray.values @ a, dilation, self.delta)
        stress = f + nu_prime * dilation
        load = -((around * shape.r * (stress + one * along)) @ ray.slopes)
        load -= (around * shape.slope * (stress + one * across)) @ ray.values
        load[-1] += 2 * np.pi * r[-1] * f[-1]
        matrix = shape.stiffness + (ray.values.T * (around * shape.slope / shape.r)) @ ray.values
        matrix *= mu1 + mu2
        matrix += mu2 * self._hoop
        v, free = np.zeros_like(r), self._free
        v[free], outcome = _solved(matrix[free, free], load[free])
        return v, outcome

    def _gain(self, t: float, shape: _Shape) -> Array:
        """k H + S: what polymerisation and the source add, (N,)."""
        density = self.problem.model.reaction_rate() * shape.dx
        if self.problem.source is not None:
            where, origin = _on_ray(shape.r), _on_ray(self.ray.points)
            density = density + self.problem.source(where, origin, t) * shape.dx
        return density @ self.ray.values

    def _orientation(self, t: float, shape: _Shape) -> Outcome:
        """`tangled` names the ring that has turned over, by where it started."""
        jacobian = shape.r * shape.slope
        if jacobian.min() > 0:
            return COMPLETED
        if not np.isfinite(jacobian).all():
            return Outcome(Ending.NON_FINITE, f"node positions are not finite at t = {t:.6g}")
        where = self.ray.points[np.argmin(jacobian / self.ray.points)]
        message = f"the ring that started at R = {where:.3f} has turned over at t = {t:.6g}"
        return Outcome(Ending.TANGLED, message)

    def _place(self, point: int) -> str:
        return f"on the ring that started at R = {self.ray.points[point]:.3f}"

    @cached_property
    def _on_mesh(self) -> Array:
        """The ray's basis at the radii of the mesh's nodes, (n, N)."""
        return self._lift(self.mesh.xi)[1]

    @cached_property
    def _canvas(self) -> FrameMesh:
        return FrameMesh(self.mesh, self.problem.model.parameters.l0)

    @cached_property
    def _lifted(self) -> tuple[Array, Array]:
        """Unit vectors (2, n) towards the grid's nodes and the ray's basis at their radii, (n, N)."""
        return self._lift(self.grid.xi)

    def _lift(self, points: Array) -> tuple[Array, Array]:
        """The same for material points (2, k)."""
        radii = np.hypot(*points)
        return points / np.where(radii > 0, radii, 1.0), self.ray.at(radii)[0]


def _on_ray(radii: Array) -> Array:
    """Points (radius, 0), (2, k)."""
    return np.array([radii, np.zeros_like(radii)])


def _solved(matrix: Array, rhs: Array) -> tuple[Array, Outcome]:
    """Solve a positive definite system (n, n) for right-hand sides (n,) or (n, k)."""
    _, solution, info = dposv(matrix, rhs)
    if info == 0:
        left = float(np.linalg.norm(rhs - matrix @ solution))
        if left <= TOLERANCE * float(np.linalg.norm(rhs)):
            return solution, COMPLETED
        return solution, Outcome(Ending.NOT_CONVERGED, f"a solve on the ray left a residual of {left:.1e}")
    message = f"a matrix of {len(matrix)} unknowns on the ray is not positive definite (row {info})"
    return np.full_like(rhs, np.nan), Outcome(Ending.NOT_CONVERGED, message)
