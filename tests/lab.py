"""What the tests share: a run in memory and the orders read off a sequence of errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from actin_xcheck.core.contract import Solver, State
from actin_xcheck.core.errors import Outcome, UserError
from actin_xcheck.core.mesh import INTERIOR_POINTS, quadrature_points, signed_areas
from actin_xcheck.core.model import Array, Model
from actin_xcheck.core.parameters import Delta, Parameters
from actin_xcheck.runs.march import March
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import Scene, parse_scene

FEM, FV = "fem-p1-paper", "fv-coupled"


@dataclass
class Film:
    """Every state of a run, and those at its output times."""

    solver: Solver
    states: list[State] = field(default_factory=list)
    frames: list[State] = field(default_factory=list)

    @property
    def last(self) -> State:
        return self.states[-1]

    @property
    def residual(self) -> float:
        """Largest balance residual of the run."""
        return max(abs(state.balance_residual) for state in self.states)


def film_of(
    solver: Solver,
    dt: float,
    times: Sequence[float],
    rtol: float | None = None,
    order: float = 1,
) -> tuple[Film, Outcome]:
    """Run a solver and keep everything; with `rtol`, in steps chosen by errors that fall with this order."""
    numerics = Numerics(replace(METHODS[FEM], order_dt=order), 0, dt, rtol)
    film, march = Film(solver), March(solver, numerics, times)
    for moment in march:
        film.states.append(moment.state)
        if moment.is_output:
            film.frames.append(moment.state)
    return film, march.outcome


def play(scene: Scene, method: str, refine: int, dt: float, times: Sequence[float] | None = None) -> Film:
    """Run a scene in memory; it must complete."""
    film, outcome = film_of(
        bind(scene, Numerics(METHODS[method], refine, dt)), dt, times or scene.output_times
    )
    assert outcome.ok, outcome
    return film


def error_against(film: Film, exact: Callable[[Array, Array], Array]) -> float:
    """Relative L2 error of the last state; of the field for finite elements, of cell averages otherwise."""
    mesh, x = film.solver.mesh, film.last.x
    truth = exact(quadrature_points(x, mesh.triangles), quadrature_points(mesh.xi, mesh.triangles))
    corners, areas = film.solver.corners(film.last), signed_areas(x, mesh.triangles)
    if film.last.a.size == mesh.xi.shape[1]:
        return float(
            np.sqrt((((INTERIOR_POINTS @ corners - truth) ** 2) @ areas).sum() / (truth**2 @ areas).sum())
        )
    mean = truth.mean(axis=0)
    return float(np.sqrt(areas @ (corners.mean(axis=0) - mean) ** 2 / (areas @ mean**2)))


def local_orders(errors: Sequence[float], ratio: float = 2.0) -> Array:
    """Orders between successive levels whose step shrinks by `ratio`."""
    e = np.asarray(errors)
    return np.log(e[:-1] / e[1:]) / np.log(ratio)


def scene_of(parameters: str = "psi = 0.0\np = 0.0", a: str = "1", end: float = 0.1, more: str = "") -> Scene:
    """A small scene from a few lines of TOML."""
    return parse_scene(
        f'name = "test"\n[parameters]\n{parameters}\n[initial]\na = "{a}"\n[time]\nend = {end}\n{more}',
        "test.toml",
    )


def refusal(work: Callable[..., object], *given: object) -> str:
    """The sentence in which something is refused; empty where it is taken.  Any other exception passes."""
    try:
        work(*given)
    except (UserError, ValueError) as error:
        return str(error)
    return ""


def quiet(label, done, total):
    """A Report that says nothing."""


def linear_model(psi: float, p: float = 0.0, delta: Delta = Delta.NONE, **parameters: float) -> Model:
    """A model by the numbers that linear theory depends on."""
    return Model(Parameters(psi=psi, p=p, **parameters), delta=delta)


def after(solver: Solver, time: float, steps: int = 1, state: State | None = None) -> State:
    """The state that steps of one length lead to, from the first one or another; none fails."""
    state = state or solver.init()
    for _ in range(steps):
        state, outcome = solver.step(state, time / steps)
        assert outcome.ok, outcome
    return state


def numbers_at(points: Array, solver: Solver, state: State) -> Array:
    """Area, total actin and what probes read: concentrations and positions."""
    measured, (a, x) = solver.measure(state), solver.probes(points)(state)
    return np.concatenate([[measured.area, measured.total_actin], a, x.ravel()])
