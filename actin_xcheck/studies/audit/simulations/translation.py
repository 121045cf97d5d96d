"""What translates the cell of Fig. 10: suspects for a motion that the equations do not contain.

A body on which only its own stresses act cannot move its centroid by itself; whether this cell can depends on
how the singular, inconsistent system of (2.1f) is closed (each closure takes up the rim's net load), or on
what a solver makes of it.  The article solves (B.23a) by GMRES.  Here its scheme is run with exactly that:
natural conditions (2.1f), no gauge, and GMRES started from the last displacement and stopped after some
restarts, since no iteration can meet a tolerance that the inconsistent part of the load exceeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse.linalg as spl

from actin_xcheck.core.contract import Mechanics, Move, State
from actin_xcheck.core.mesh import Mesh, disk
from actin_xcheck.core.model import Array, Closure, Model, Rheology
from actin_xcheck.core.observables import area, centroid
from actin_xcheck.report.exhibits import Line, Plot, Sheet
from actin_xcheck.runs.march import integrate
from actin_xcheck.runs.method import FORCE_BALANCE, METHODS, load
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.simulations.patterns import VISIBLE

_SCENE = "fig06-mode-11"
_REFINE = 3
_DT = 4 * 1.0228e-2
"""Four of the article's steps: the motion sought is of order 1, and the mesh is coarse."""

_BASIS = 30
"""Krylov vectors between restarts."""


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
    """An observer that keeps times, centroids and areas."""

    mesh: Mesh
    t: list[float]
    x: list[float]
    area: list[float]

    def record(self, dt: float, state: State) -> None:
        self.t.append(state.t)
        self.x.append(float(centroid(state.x, self.mesh.triangles)[0]))
        self.area.append(area(state.x, self.mesh.triangles))

    def frame(self, state: State) -> None:
        """Every state is kept already."""


def _course(model: Model, mechanics_of: Any, mesh: Mesh) -> _Course:
    """Run Fig. 10's scene under a model with whatever moves its nodes."""
    scene = load_scene(_SCENE)
    problem = replace(resolve(scene), model=model)
    mechanics: Mechanics = mechanics_of(model, mesh)
    solver = load(METHODS["fem-p1-paper"].solver)(problem, mesh, mechanics)
    course = _Course(mesh, [], [], [])
    integrate(solver, _DT, scene.output_times, course)
    return course


def _drifts(model: Model, mesh: Mesh, restarts: Sequence[int], noise: float = 0.0) -> list[float]:
    """Mean velocity along x that one solve of the singular system leaves, after each number of restarts."""
    corners = resolve(load_scene(_SCENE)).a0(mesh.xi)[mesh.triangles]
    system = load(FORCE_BALANCE)(model, mesh).assemble(mesh.xi, corners, _DT)
    disturbed = system.load * (1 + noise * np.random.default_rng(0).normal(size=system.load.size))
    solve = partial(spl.gmres, system.matrix, disturbed, rtol=1e-8, restart=_BASIS)
    return [float(solve(maxiter=n)[0][0::2].mean()) for n in restarts]


def _suspects() -> Finding:
    own = load_scene(_SCENE).physics
    mesh = disk(_REFINE, own.parameters.l0)
    viscous = replace(own, rheology=Rheology.VISCOUS)
    free = replace(viscous, closure=Closure.TRACTION_FREE)
    against = free.varied(p=-own.parameters.p)
    dimensional = free.varied(psi=72.0)

    def krylov(restarts: int) -> Any:
        return lambda model, mesh: UnprojectedKrylov(model, mesh, restarts)

    balance = load(FORCE_BALANCE)
    courses = {
        "reference-normal": _course(viscous, balance, mesh),
        "current-normal": _course(replace(viscous, closure=Closure.CURRENT_NORMAL), balance, mesh),
        "traction-free, gauged": _course(free, balance, mesh),
        "gauged, rim projected on its normal afterwards": _course(free, ProjectedAfterwards, mesh),
        "gauged, p = -0.26": _course(against, balance, mesh),
        "gauged, ψ = 72 (the dimensional value)": _course(dimensional, balance, mesh),
        **{f"no gauge, GMRES stopped after {n} × {_BASIS}": _course(free, krylov(n), mesh) for n in (1, 4)},
    }
    shifts = {name: course.x[-1] for name, course in courses.items()}
    lawful = max(abs(shift) for name, shift in shifts.items() if "GMRES" not in name)
    few, stray = (shifts[f"no gauge, GMRES stopped after {n} × {_BASIS}"] for n in (1, 4))
    counts = (1, 2, 3, 4, 10)
    plain, disturbed = (_drifts(free, mesh, counts, noise) for noise in (0.0, 1e-14))
    rows = [("what moves the nodes", "centroid's x at t = 3.365", "farthest |x| on the way", "area change")]
    rows += [
        (
            name,
            f"{course.x[-1]:+.4f}",
            f"{max(map(abs, course.x)):.4f}",
            f"{course.area[-1] / course.area[0] - 1:+.4f}",
        )
        for name, course in courses.items()
    ]
    lines = tuple(Line(name, np.array(c.t), np.array(c.x)) for name, c in courses.items())
    one_solve = [("restarts", "mean v_x", "with the load disturbed by 1e-14")]
    one_solve += [(str(n), f"{v:.4g}", f"{w:.4g}") for n, v, w in zip(counts, plain, disturbed, strict=True)]
    changed = abs(disturbed[-1] / plain[-1] - 1)
    translates = lawful > VISIBLE
    return Finding(
        Judgement.IN_KIND if translates else Judgement.NOT_REPRODUCED,
        f"Every closure, sign and parameter tried keeps the centroid within {lawful:.4f} of where it was. "
        f"GMRES on the singular system without a gauge carries it by {few:+.4f} (one cycle of {_BASIS}) or "
        f"{stray:+.4f} (four). In one solve the mean v_x is "
        + ", ".join(f"{v:.3g} ({n})" for n, v in zip(counts, plain, strict=True))
        + f" by number of restarts; disturbing the load by 1e-14 changes the last by {changed:.0%}.",
        "The equations do not translate this cell. The article's solver can: nothing resists a rigid motion, "
        "and each of the first restarts adds about the same of it, towards high actin. Once the rest of the "
        "residual has converged the iteration amplifies round-off, so that distance and direction of a drift "
        "like Fig. 10's are those of the stopping rule, not of the model.",
        (
            Sheet("suspects", "Suspects", f"{mesh.xi.shape[1]} nodes, Δt = {_DT:g}, viscous", tuple(rows)),
            Sheet("drift", "One unprojected solve", f"GMRES({_BASIS}), tolerance 1e-8", tuple(one_solve)),
            Plot("centroid", "Centroid's x", "", "t", lines),
        ),
        {f"centroid x, {name}": shift for name, shift in shifts.items()},
    )


TRANSLATION = Row(
    "s5.3.1-translation",
    _suspects,
)
