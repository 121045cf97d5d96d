"""The ray against the whole cell, exact solutions and theory: spectral in R, of the pair's order in dt."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.special import jv

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology
from actin_xcheck.theory.dispersion import wavenumber
from actin_xcheck.theory.eigenfields import eigenfield
from fem.force_balance import ForceBalance
from fem.imex import FemImex
from fem.radial import Radial, Ray
from tests.lab import after, film_of, local_orders, numbers_at

MESH = disk(3, 0.8)
POINTS = np.array([[0, 0], [0.4, 0], [0, 0.8], [0.5, -0.75], [-0.6, 0.8]]).T
EXPANSION = Model(Parameters(70.366, 0.433))
CONTRACTION = Model(Parameters(70.366, -0.433), rheology=Rheology.VISCOUS)
BOTH = pytest.mark.parametrize("model", [EXPANSION, CONTRACTION], ids=["expansion", "contraction"])


def bump(height):
    """1 + height cos(pi r^2): flat at the rim."""
    return lambda xi: 1 + height * np.cos(np.pi * (xi**2).sum(axis=0))


GROWING = Motion(lambda xi, t: xi * np.exp(t / 2), lambda xi, t: xi * np.exp(t / 2) / 2)


def ring(model, height=1e-3, **more):
    return Problem(model, bump(height), np.zeros_like, **more)


numbers = partial(numbers_at, POINTS)


def whole_cell(problem, refine):
    mesh = disk(refine, problem.model.parameters.l0)
    return FemImex(problem, mesh, ForceBalance(problem.model, mesh, 4), 4, 4)


@BOTH
@pytest.mark.parametrize("time", [0.0361, 0.518])
def test_convergence_is_spectral(model, time):
    """Figs 16 and 17, early and late: down to round-off within a few degrees."""
    truth = Radial(ring(model), MESH, 6, 14, 4)
    exact = numbers(truth, after(truth, time, 30))
    errors = []
    for degree in (4, 6, 8, 10, 12):
        solver = Radial(ring(model), MESH, 3, degree, 4)
        errors.append(np.abs(numbers(solver, after(solver, time, 30)) - exact).max())
    assert all(fine < 0.1 * coarse + 3e-12 for coarse, fine in pairwise(errors))
    assert errors[2] < 1e-9
    assert errors[-1] < 3e-12


@pytest.mark.parametrize(
    ("model", "closure"),
    [
        (CONTRACTION, Closure.REFERENCE_NORMAL),
        (EXPANSION, Closure.TRACTION_FREE),
        (EXPANSION, Closure.IRROTATIONAL_WALL),
    ],
)
def test_the_whole_cell_agrees_to_its_own_error(model, closure):
    problem = ring(replace(model, closure=closure))
    ray, cell = Radial(problem, MESH, 5, 10, 4), whole_cell(problem, 2)
    one, other = after(ray, 0.0361, 6), after(cell, 0.0361, 6)
    assert numbers(ray, one) == pytest.approx(numbers(cell, other), abs=3e-7)
    assert one.local_error == pytest.approx(other.local_error, rel=1.5)


@pytest.mark.slow
@BOTH
def test_the_whole_cell_converges_to_the_ray(model):
    problem = ring(model)
    ray = Radial(problem, MESH, 5, 10, 4)
    exact = numbers(ray, after(ray, 0.518, 24))
    errors = []
    for refine in (2, 3):
        cell = whole_cell(problem, refine)
        errors.append(np.abs(numbers(cell, after(cell, 0.518, 24)) - exact).max())
    assert errors[0] < 1e-6
    assert errors[1] < min(5e-8, errors[0] / 8)


def test_a_wrong_delta_on_the_rim_is_seen():
    problem = ring(EXPANSION)
    good, bad = (Radial(problem, MESH, 3, 8, 4) for _ in range(2))
    bad.delta[-1] = 0.0
    one, other = (numbers(solver, after(solver, 0.0361, 6)) for solver in (good, bad))
    assert np.abs(one - other).max() > 1e-4


def test_every_closure_of_a_free_rim_is_the_same():
    free = [closure for closure in Closure if closure is not Closure.IRROTATIONAL_WALL]
    ends = []
    for closure in free:
        solver = Radial(ring(replace(EXPANSION, closure=closure)), MESH, 3, 8, 4)
        ends.append(after(solver, 0.1, 5))
    assert all(np.array_equal(end.x, ends[0].x) for end in ends)
    wall = Radial(ring(replace(EXPANSION, closure=Closure.IRROTATIONAL_WALL)), MESH, 3, 8, 4)
    end = after(wall, 0.1, 5)
    assert end.x[0, -1] == 1.0
    assert np.abs(end.v[0, 1:-1]).min() > 0


@pytest.mark.parametrize("order", [2, 3, 4])
def test_order_in_dt(order):
    """From a state the equations have made; pointwise order 4 falls to 3 where n.grad a = 0 is met."""
    model = Model(Parameters(270.0, 0.26), rheology=Rheology.VISCOUS)
    solver = Radial(ring(model, 0.1), MESH, 5, 10, order)
    made = after(solver, 0.02, 64)
    ends = [after(solver, 0.06, steps, made) for steps in (8, 16, 32, 64)]
    areas = np.abs(np.diff([solver.measure(end).area for end in ends]))
    places = [np.abs(b.x - a.x).max() for a, b in pairwise(ends)]
    assert local_orders(areas) == pytest.approx(order, abs=0.2)
    assert local_orders(places) == pytest.approx(order, abs=0.2)
    errors = [end.local_error for end in ends]
    assert local_orders(errors)[-1] > min(order, 3) - 0.35


@BOTH
@pytest.mark.parametrize("order", [2, 3, 4])
def test_actin_is_conserved_to_round_off_and_errors_follow_the_tolerance(model, order):
    problem, truth = ring(model, 0.1), None
    truth = Radial(problem, MESH, 3, 10, 4)
    exact, ends = after(truth, 0.2, 80), []
    for rtol in (1e-4, 1e-7):
        solver = Radial(problem, MESH, 3, 10, order)
        film, outcome = film_of(solver, 1.0, (0.1, 0.2), rtol, order)
        assert outcome.ok
        assert film.residual < 1e-14
        ends.append(np.abs(film.last.x - exact.x).max())
    assert ends[1] < 50e-7
    assert ends[1] < ends[0] / 5


def growing(radii, t):
    """The shipped `growing-disk` with J_0 for J_2 cos 2 theta; radii (n,) at time t."""
    k, rho = wavenumber(0, 2), np.exp(t / 2)
    decay = 0.2 * np.exp(-t - 0.4 * k**2 * (1 - np.exp(-t)))
    return (np.exp(-t) * np.cosh(t) * np.exp(t) + decay * jv(0, k * radii / rho)) / rho**2


def test_a_growing_disk_is_exact():
    model = Model(Parameters(0, 0), delta=Delta.NONE)
    problem = Problem(model, lambda xi: growing(np.hypot(*xi), 0.0), np.zeros_like, GROWING)
    solver = Radial(problem, MESH, 3, 10, 4)
    end = after(solver, 0.5, 100)
    assert end.a == pytest.approx(growing(end.x[0], 0.5), abs=3e-10)
    assert solver.measure(end).jacobian_min == pytest.approx(np.exp(0.5), abs=1e-7)


def test_a_bessel_mode_decays_and_nothing_moves():
    k, model = wavenumber(0, 3), Model(Parameters(0, 0), delta=Delta.NONE)
    solver = Radial(
        Problem(model, lambda xi: 1 + 0.1 * jv(0, k * np.hypot(*xi)), np.zeros_like), MESH, 3, 10, 4
    )
    end = after(solver, 0.1, 100)
    exact = 1 + 0.1 * np.exp(-0.1 * (1 + 0.4 * k**2)) * jv(0, k * solver.ray.nodes)
    assert end.a == pytest.approx(exact, abs=2e-10)
    assert np.abs(end.v).max() < 1e-14


def test_a_source_makes_what_it_should():
    """a = 1 + exp(-t) cos(pi q), q = (r/rho)^2, on a disk that grows like rho = exp(t/2)."""

    def exact(x, t):
        return 1 + np.exp(-t) * np.cos(np.pi * (x**2).sum(axis=0) * np.exp(-t))

    def source(x, xi, t):
        q, rho2, d = (x**2).sum(axis=0) * np.exp(-t), np.exp(t), 0.4
        cos, sin = np.cos(np.pi * q), np.sin(np.pi * q)
        laplacian = -4 * np.pi / rho2 * (sin + np.pi * q * cos)
        # r a_r/2 and a's own change of q cancel
        return np.exp(-t) * (-cos - d * laplacian) + exact(x, t) - (1 - exact(x, t))

    model = Model(Parameters(0, 0), delta=Delta.NONE)
    problem = Problem(model, lambda xi: exact(xi, 0.0), np.zeros_like, GROWING, source)
    solver = Radial(problem, MESH, 3, 10, 4)
    end = after(solver, 0.3, 60)
    assert end.a == pytest.approx(exact(end.x, 0.3), abs=1e-8)
    assert abs(end.balance_residual) < 1e-14


@pytest.mark.parametrize("rheology", Rheology)
@pytest.mark.parametrize(("closure", "n"), [(Closure.TRACTION_FREE, 1), (Closure.IRROTATIONAL_WALL, 2)])
def test_axisymmetric_modes_grow_at_their_exact_rates(rheology, closure, n):
    """Half the difference of runs with opposite amplitudes has no quadratic terms."""
    model = Model(Parameters(270.0, 0.26), rheology, closure, Delta.FULL)
    mode, ends = eigenfield(model, 0, n), []
    for amplitude in (1e-5, -1e-5):
        problem = Problem(
            model,
            lambda xi, size=amplitude: 1 + size * mode.a(xi),
            lambda xi, size=amplitude: size * mode.u(xi),
        )
        solver = Radial(problem, MESH, 3, 10, 4)
        ends.append(after(solver, 0.1, 200).a)
    w = mode.a(np.array([solver.ray.nodes, np.zeros_like(solver.ray.nodes)]))
    grown = w @ (ends[0] - ends[1]) / (2e-5 * w @ w)
    assert np.log(grown) / 0.1 == pytest.approx(mode.rate.real, abs=2e-8)


def test_a_model_that_breaks_down_says_where_and_when():
    solver = Radial(ring(Model(Parameters(270.0, 0.433)), 0.1), MESH, 5, 10, 4)
    film, outcome = film_of(solver, 1.0, (0.2,), 1e-6, 4)
    assert outcome.ending is Ending.SINGULAR_DILATION
    assert "R = 0.00" in outcome.message
    assert 0.09 < film.last.t < 0.1


def test_a_ring_that_turns_over_is_named():
    def velocity(xi, t):
        return -xi * np.exp(-30 * ((xi**2).sum(axis=0) - 0.25) ** 2)

    folding = Motion(lambda xi, t: xi + t * velocity(xi, t), velocity)
    solver = Radial(ring(EXPANSION, motion=folding), MESH, 3, 10, 4)
    film, outcome = film_of(solver, 0.01, (1.0,))
    assert outcome.ending is Ending.TANGLED
    radii = np.linspace(0, 1, 2001)
    place = np.array([folding(np.array([[r], [0.0]]), film.last.t + 0.01)[0, 0] for r in radii])
    named = float(outcome.message.split("R = ")[1].split(" ")[0])
    assert abs(named - radii[np.argmin(np.diff(place))]) < 0.05
    assert solver.check(film.last).ok


def test_initial_displacements_are_taken_along_the_ray():
    problem = Problem(EXPANSION, bump(0.0), lambda xi: 0.1 * xi * (1 - (xi**2).sum(axis=0)))
    solver = Radial(problem, MESH, 3, 8, 4)
    r = solver.ray.nodes
    assert solver.init().x[0] == pytest.approx(r + 0.1 * r * (1 - r**2), abs=1e-15)
    assert solver.measure(solver.init()).jacobian_min == pytest.approx((1 - 0.2) * 1.0, abs=1e-12)


def test_pictures_and_probes_are_the_rays_own():
    solver = Radial(ring(EXPANSION, 0.1), MESH, 3, 10, 4)
    state = after(solver, 0.1, 10)
    frame, measured = solver.frame(state), solver.measure(state)
    assert frame.x.shape == solver.grid.xi.shape
    a, x = solver.probes(solver.grid.xi)(state)
    assert frame.a == pytest.approx(a, abs=1e-13)
    assert frame.x == pytest.approx(x.T, abs=1e-13)
    assert solver.corners(state) == pytest.approx(frame.a[MESH.triangles], abs=1e-13)
    assert np.hypot(*measured.rim) == pytest.approx(np.sqrt(measured.area / np.pi), abs=1e-14)
    assert frame.a.min() < frame.a_cells.min() < frame.a_cells.max() < frame.a.max()
    assert np.hypot(*frame.v).max() > 1e-3
    # at the start a material point is at its place
    a, x = solver.probes(POINTS)(solver.init())
    assert x == pytest.approx(POINTS.T, abs=1e-14)
    assert a == pytest.approx(bump(0.1)(POINTS), abs=1e-9)


@pytest.mark.parametrize("elements", [1, 2, 3, 4, 5])
def test_elements_meet_on_the_ring_and_cover_the_ray(elements):
    ray = Ray.on(0.8, elements, 6)
    assert {0.0, 0.8, 1.0} <= set(ray.ends.tolist())
    assert len(ray.ends) == max(elements, 2) + 1
    assert ray.weights @ (ray.values @ ray.nodes**5) == pytest.approx(1 / 6, abs=1e-14)
    assert ray.slopes @ ray.nodes**6 == pytest.approx(6 * ray.points**5, abs=1e-11)
    assert np.abs(ray.slopes.sum(axis=1)).max() < 1e-13
