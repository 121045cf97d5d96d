"""Rows of the audit: the discrete scheme, (B.17) to (B.25), Algorithm 7.1; what its solver makes of Fig. 10.

A body on which only its own stresses act cannot move its centroid by itself; whether Fig. 10's cell can
depends on how the singular, inconsistent system of (2.1f) is closed (each closure takes up the rim's net
load), or on what a solver makes of it.  The article solves (B.23a) by GMRES.  Here its scheme
is run with exactly that: natural conditions (2.1f), no gauge, and GMRES started from the last displacement
and stopped after some restarts, since no iteration can meet a tolerance that the inconsistent part of the
load exceeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from actin_xcheck.core.contract import Mechanics, Move
from actin_xcheck.core.mesh import INTERIOR_POINTS, Mesh, disk, locate
from actin_xcheck.core.model import Array, Closure, Model, Rheology
from actin_xcheck.core.observables import area, centroid
from actin_xcheck.core.parameters import DimensionalParameters
from actin_xcheck.report.exhibits import Line, Plot, Sheet
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.runs.numerics import Numerics, step_count
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit import RowAnswer, answer, examines
from actin_xcheck.studies.audit.sample import ROUND_OFF, Step, relative, second_step
from actin_xcheck.theory.errata import REALISTIC_CELL

_SCENE = "fig06-mode-11"
"""Fig. 10's cell."""

_REFINE = 3
_DT = 4 * 1.0228e-2
"""Four of the article's steps: the motion sought is of order 1, and the mesh is coarse."""

_BASIS = 30
"""Krylov vectors between restarts."""


@examines("eqB.17")
def _nodal_basis() -> RowAnswer:
    """Values of all basis functions at all nodes, from the barycentric coordinates of the nodes."""
    mesh = second_step().mesh
    count = mesh.xi.shape[1]
    cells, weights = locate(mesh, mesh.xi)
    values = np.zeros((count, count))
    np.add.at(values, (mesh.triangles[:, cells], np.arange(count)), weights)
    difference = float(np.abs(values - np.eye(count)).max())
    return answer(difference < ROUND_OFF, count=count, difference=difference)


@examines("eqB.18")
def _expansion() -> RowAnswer:
    """a_h as the implementation hands it to the force balance, at the points of its quadrature."""
    step = second_step()
    corners = step.solver.corners(step.new)
    sums = step.after.at_points(step.new.a)
    difference = relative(INTERIOR_POINTS @ corners - sums, sums)
    linear = 2 + 3 * step.new.x[0] - step.new.x[1]
    exact = relative(step.after.divergence(np.array([linear, linear])) - 2, np.array(2.0))
    return answer(max(difference, exact) < ROUND_OFF, difference=difference, exact=exact)


@examines("eqB.19")
def _transport_property() -> RowAnswer:
    """Barycentric coordinates of particles carried by the P1 velocity, before and after a step."""
    step = second_step()
    start, end = (x[:, step.mesh.triangles] for x in (step.old.x, step.new.x))
    velocity = (end - start) / step.dt
    weights = np.array([0.2, 0.3, 0.5])
    arrived = np.einsum("dcn,c->dn", start + step.dt * velocity, weights)
    sides = np.array([end[:, 1] - end[:, 0], end[:, 2] - end[:, 0]])  # (side, direction, cell)
    there = np.linalg.solve(sides.transpose(2, 1, 0), (arrived - end[:, 0]).T[:, :, None])[:, :, 0]
    drift = float(np.abs(there - weights[1:]).max())
    moved = float(np.abs(end - start).max())
    return answer(drift < ROUND_OFF < moved, moved=moved, drift=drift)


def _by_component(step: Step, matrix: sp.csr_matrix) -> Array:
    """The implementation's interleaved matrix with all u before all v."""
    count = step.old.x.shape[1]
    order = np.concatenate([2 * np.arange(count), 2 * np.arange(count) + 1])
    return np.asarray(matrix.toarray()[np.ix_(order, order)])


def _implemented(step: Step) -> tuple[Array, Array]:
    """A and B of the implementation on the old configuration, by component."""
    corners = step.old.a[step.mesh.triangles]
    at_rest, ahead = (step.balance.assemble(step.old.x, corners, dt).matrix for dt in (0.0, 1.0))
    return _by_component(step, at_rest), _by_component(step, ahead - at_rest)


@examines("eqB.20")
def _block_system() -> RowAnswer:
    step = second_step()
    (A, B), count = _implemented(step), step.old.x.shape[1]
    viscosity, elasticity = step.viscosity(), step.elasticity()
    one, other = relative(A - viscosity, viscosity), relative(B - elasticity, elasticity)
    mixed = A[:count, count:]
    swapped = relative(mixed - viscosity[:count, count:].T, mixed)
    return answer(max(one, other) < 1e-10 < swapped, one=one, other=other, swapped=swapped)


@examines("eqB.21")
def _semi_discrete() -> RowAnswer:
    step = second_step()
    rates = step.viscosity() @ step.velocity()
    residual = rates + step.elasticity() @ step.displacements()[0] - step.force()
    free, held = relative(step.free(residual), step.force()), relative(step.held(residual), step.force())
    return answer(free < ROUND_OFF < held, free=free, held=held)


@examines("remarkB.3")
def _symmetric() -> RowAnswer:
    step = second_step()
    A, B = _implemented(step)
    count = step.old.x.shape[1]
    whole = max(relative(matrix - matrix.T, matrix) for matrix in (A, B))
    block = relative(A[:count, count:] - A[:count, count:].T, A[:count, count:])
    least = float(np.linalg.eigvalsh(A).min() / np.abs(A).max())
    return answer(
        whole > 1e-6,
        corrected=whole < ROUND_OFF < block and least > -ROUND_OFF,
        whole=whole,
        block=block,
        least=least,
    )


@examines("eqB.22")
def _transport_matrices() -> RowAnswer:
    """(B.22) at the start of a step too short for diffusion between neighbours to relax within it."""

    def residual(dt: float) -> float:
        step = second_step(dt=dt)
        rate = (step.after.mass() @ step.new.a - step.before.mass() @ step.old.a) / dt
        grid, d = step.before, step.model.parameters.d
        rest = grid.load() - (d * grid.stiffness() + grid.mass()) @ step.old.a
        return relative(rate - rest, grid.load())

    coarse, fine = residual(2e-5), residual(1e-5)
    return answer(fine < 0.01 and abs(coarse / fine - 2) < 0.1, coarse=coarse, fine=fine)


@examines("eqB.23a")
def _force_step() -> RowAnswer:
    step = second_step()
    A, B, F = step.viscosity(), step.elasticity(), step.force()
    old, new = step.displacements()
    explicit = (A + step.dt * B) @ new - A @ old - step.dt * F
    free = relative(step.free(explicit), step.dt * F)
    purely = relative(step.free(A @ new - A @ old - step.dt * (F - B @ old)), step.dt * F)
    return answer(free < ROUND_OFF < purely, free=free, purely=purely)


@examines("eqB.23b")
def _transport_step() -> RowAnswer:
    step = second_step()
    before, after = step.before, step.after
    dt, d = step.dt, step.model.parameters.d
    right = before.mass() @ step.old.a
    left = ((1 + dt) * after.mass() + dt * d * after.stiffness()) @ step.new.a
    printed = relative(left - right - dt * before.load(), before.load())
    on_new = relative(left - right - dt * after.load(), before.load())
    return answer(printed < ROUND_OFF < on_new, printed=printed, on_new=on_new)


@examines("eqB.24")
def _mesh_velocity() -> RowAnswer:
    """(B.24) exactly, and its first order as a derivative: against the velocities at the step's two ends."""

    def lag(dt: float) -> float:
        step = second_step(dt=dt)
        taken = (step.new.x - step.old.x).ravel() / dt
        return relative(taken - step.velocity(), taken)

    step = second_step()
    exact = relative((step.new.x - step.old.x) / step.dt - step.new.v, step.new.v)
    coarse, fine = lag(1e-2), lag(5e-3)
    return answer(exact < 1e-10 and abs(coarse / fine - 2) < 0.1, exact=exact, coarse=coarse, fine=fine)


@examines("eqB.25")
def _mesh_motion() -> RowAnswer:
    step = second_step()
    old, new = step.displacements()
    moved = (step.new.x - step.old.x).ravel()
    increment = relative(moved - (new - old), moved)
    whole = relative(moved - new, moved)
    return answer(increment < ROUND_OFF < whole, increment=increment, whole=whole)


@examines("remarkB.4")
def _other_displacement() -> RowAnswer:
    """How far the two readings of the displacement move the cell apart in two steps."""
    kept, restarted = second_step(), second_step(Rheology.VISCOUS)
    apart = relative(kept.new.x - restarted.new.x, kept.new.x - kept.mesh.xi)
    return answer(apart > 1e-3, apart=apart)


@examines("algorithm7.1")
def _algorithm() -> RowAnswer:
    force, transport = _force_step(), _transport_step()
    steps = step_count(1.0228e-3, [0.1636])
    ordered = force.holds and transport.holds
    return answer(
        ordered and steps == 0,
        corrected=ordered and steps == 160,
        force=force.values["free"],
        transport=transport.values["printed"],
        steps=steps,
    )


@examines("sB.7-displacement")
def _displacement_is_velocity() -> RowAnswer:
    """Powers of (cm, s) of U and of beta."""
    off = np.array([1, 0]) - np.array([1, -1])
    left = off - np.array([0, 1])
    return answer(
        not off.any(), corrected=not left.any(), off=off, powers=f"{off.tolist()}", left=f"{left.tolist()}"
    )


@examines("s6-scaling")
def _realistic_scaling() -> RowAnswer:
    units = DimensionalParameters(psi=6.9e4, p=800.0, E=4000.0, D_a=1.6e-10, k_a=66.0, L=1e-3)
    par = units.non_dimensional()
    by_hand = {
        "psi": 6.9e4 * 1.3 / 4000,
        "p": 800 * 1.3 / 4000,
        "d": 1.6e-10 / 66 / 1e-6,
        "mu1": 96.15 * 66 * 1.3 / 4000,
        "mu2": 250 * 66 * 1.3 / 4000,
    }
    groups = {name: getattr(par, name) for name in by_hand}
    worst = max(abs(groups[name] / value - 1) for name, value in by_hand.items())
    same = REALISTIC_CELL.parameters == par
    return answer(worst < 1e-12 and same and units.L == 10e-4, groups=groups, radius=10e-4)


class UnprojectedKrylov:
    """(B.23a) with natural conditions on the whole rim, solved by GMRES with rigid motions left in.

    Parameters
    ----------
    model : closure `traction-free`, for its free rim; its gauge is not applied.
    mesh : the reference mesh.
    restarts : Krylov spaces after which the iteration is stopped.
    """

    def __init__(self, model: Model, mesh: Mesh, restarts: int) -> None:
        self.balance = load(FORCE_BALANCE)(model, mesh)
        self.restarts = restarts

    def start(self, x: Array) -> Array:
        """Leave the nodes where they are."""
        return x

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """Velocities by one step of vanishing length."""
        return self._solved(x, corners, 0.0)

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> Move:
        """One step; the residual is whatever the load's inconsistent part leaves."""
        v = self._solved(x, corners, dt)
        return Move(x + dt * v, v)

    def _solved(self, x: Array, corners: Array, dt: float) -> Array:
        system = self.balance.assemble(x, corners, dt)
        v, _ = spl.gmres(system.matrix, system.load, rtol=1e-8, restart=_BASIS, maxiter=self.restarts)
        return np.asarray(v.reshape(-1, 2).T)


class ProjectedAfterwards:
    """The gauged traction-free solve, whose rim is then moved along its initial normal only (B.7)."""

    def __init__(self, model: Model, mesh: Mesh) -> None:
        self.mesh = mesh
        self.balance = load(FORCE_BALANCE)(model, mesh)

    def start(self, x: Array) -> Array:
        """Leave the nodes where they are."""
        return x

    def velocity(self, t: float, x: Array, corners: Array) -> Array:
        """The velocities, projected."""
        return self._projected(self.balance.velocity(t, x, corners))

    def advance(self, t: float, dt: float, x: Array, corners: Array) -> Move:
        """One step, projected."""
        move = self.balance.advance(t, dt, x, corners)
        v = self._projected(move.v)
        return replace(move, x=x + dt * v, v=v)

    def _projected(self, v: Array) -> Array:
        rim = self.mesh.rim_nodes
        normal = self.mesh.xi[:, rim] / np.hypot(*self.mesh.xi[:, rim])
        projected = v.copy()
        projected[:, rim] = (v[:, rim] * normal).sum(axis=0) * normal
        return projected


@dataclass
class _Course:
    """Times, centroids along x and areas of a run."""

    t: list[float]
    x: list[float]
    area: list[float]


def _course(mesh: Mesh, model: Model, mechanics_of: Any) -> _Course:
    """Run Fig. 10's scene under a model with whatever moves its nodes."""
    scene = load_scene(_SCENE)
    problem = replace(resolve(scene), model=model)
    mechanics: Mechanics = mechanics_of(model, mesh)
    solver = load(METHODS["fem-p1-paper"].solver)(problem, mesh, mechanics)
    march = March(solver, Numerics(METHODS["fem-p1-paper"], _REFINE, _DT), scene.output_times)
    states = [moment.state for moment in march]
    return _Course(
        t=[state.t for state in states],
        x=[float(centroid(state.x, mesh.triangles)[0]) for state in states],
        area=[area(state.x, mesh.triangles) for state in states],
    )


def _courses(mesh: Mesh, viscous: Model, free: Model) -> dict[str, _Course]:
    """The cell under every suspect: closures, signs, parameters, and a solver that is stopped."""
    against = free.varied(p=-free.parameters.p)
    dimensional = free.varied(psi=72.0)
    balance, course = load(FORCE_BALANCE), partial(_course, mesh)
    return {
        "reference-normal": course(viscous, balance),
        "current-normal": course(replace(viscous, closure=Closure.CURRENT_NORMAL), balance),
        "traction-free, gauged": course(free, balance),
        "gauged, rim projected on its normal afterwards": course(free, ProjectedAfterwards),
        "gauged, p = -0.26": course(against, balance),
        "gauged, ψ = 72 (the dimensional value)": course(dimensional, balance),
        **{_stopped(n): course(free, partial(UnprojectedKrylov, restarts=n)) for n in (1, 4)},
    }


def _stopped(restarts: int) -> str:
    return f"no gauge, GMRES stopped after {restarts} × {_BASIS}"


def _drifts(model: Model, mesh: Mesh, restarts: Sequence[int], noise: float = 0.0) -> list[float]:
    """Mean velocity along x that one solve of the singular system leaves, after each number of restarts."""
    corners = resolve(load_scene(_SCENE)).a0(mesh.xi)[mesh.triangles]
    system = load(FORCE_BALANCE)(model, mesh).assemble(mesh.xi, corners, _DT)
    disturbed = system.load * (1 + noise * np.random.default_rng(0).normal(size=system.load.size))
    solve = partial(spl.gmres, system.matrix, disturbed, rtol=1e-8, restart=_BASIS)
    return [float(solve(maxiter=n)[0][0::2].mean()) for n in restarts]


@examines("s5.3.1-translation")
def _suspects() -> RowAnswer:
    own = load_scene(_SCENE).physics
    mesh, viscous = disk(_REFINE, own.parameters.l0), replace(own, rheology=Rheology.VISCOUS)
    free = replace(viscous, closure=Closure.TRACTION_FREE)
    courses = _courses(mesh, viscous, free)
    shifts = {name: course.x[-1] for name, course in courses.items()}
    lawful = max(abs(shift) for name, shift in shifts.items() if "GMRES" not in name)
    counts = (1, 2, 3, 4, 10)
    plain, disturbed = (_drifts(free, mesh, counts, noise) for noise in (0.0, 1e-14))
    rows = [("what moves the nodes", "centroid's x at t = 3.365", "farthest |x| on the way", "area change")]
    for name, course in courses.items():
        grown = course.area[-1] / course.area[0] - 1
        rows.append((name, f"{course.x[-1]:+.4f}", f"{max(map(abs, course.x)):.4f}", f"{grown:+.4f}"))
    one_solve = [("restarts", "mean v_x", "with the load disturbed by 1e-14")]
    one_solve += [(str(n), f"{v:.4g}", f"{w:.4g}") for n, v, w in zip(counts, plain, disturbed, strict=True)]
    lines = tuple(Line(name, np.array(c.t), np.array(c.x)) for name, c in courses.items())
    return answer(
        lawful > 0.05,  # one would see it
        exhibits=(
            Sheet("suspects", "Suspects", f"{mesh.xi.shape[1]} nodes, Δt = {_DT:g}, viscous", tuple(rows)),
            Sheet("drift", "One unprojected solve", f"GMRES({_BASIS}), tolerance 1e-8", tuple(one_solve)),
            Plot("centroid", "Centroid's x", "", "t", lines),
        ),
        lawful=lawful,
        few=shifts[_stopped(1)],
        stray=shifts[_stopped(4)],
        drifts=dict(zip(counts, plain, strict=True)),
        changed=abs(disturbed[-1] / plain[-1] - 1),
        shifts=shifts,
    )
