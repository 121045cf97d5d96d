"""Observed orders from both sides: no method converges slower, or faster, than it declares."""

import numpy as np
import pytest
import sympy

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Delta, Model
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.method import METHODS, load
from actin_xcheck.scene.expression import coordinates
from actin_xcheck.scene.resolve import in_scene_frame
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import shipped_scenes
from tests.lab import FEM, FV, error_against, film_of, local_orders, play

END = 0.25


def exact_error(name, method, refine, dt):
    scene = load_scene(name)
    film = play(scene, method, refine, dt, [END])
    return error_against(film, lambda x, xi: in_scene_frame(scene, scene.expect.exact.a, x, xi, END))


@pytest.mark.parametrize("name", [name for name in shipped_scenes() if load_scene(name).expect.exact])
def test_exact_solutions_solve_the_transport_equation(name):
    """a_t - d Delta a + div(a v) = 1 - a + s with n.grad a = 0 on the rim, and dx/dt = v."""
    scene = load_scene(name)
    x, y, t, x0, y0 = sympy.symbols("x y t x0 y0", real=True)
    names = {"x": x, "y": y, "t": t, "x0": x0, "y0": y0, "J": sympy.besselj}
    names |= {"r": sympy.sqrt(x**2 + y**2), "theta": sympy.atan2(y, x)}

    def read(expression):
        return sympy.sympify(str(expression), locals=names)

    squared = x**2 + y**2
    back = (x, y)  # where a point came from, for solutions stated in x0, y0
    if name == "manufactured-moving":
        back = ((x - t * y / (1 - t / 2)) / (1 + t), y / (1 - t / 2))
    velocity = {
        "static-decay": (sympy.Integer(0), sympy.Integer(0)),
        "growing-disk": (x / 2, y / 2),
        "growing-waves": (x / 2, y / 2),
        "stirred": ((1 - squared) * x / 2 - 2 * squared * y, (1 - squared) * y / 2 + 2 * squared * x),
        "stirred-static": (sympy.Integer(0), sympy.Integer(0)),
        "manufactured-static": (sympy.Integer(0), sympy.Integer(0)),
        "manufactured-moving": (back[0] + back[1], -back[1] / 2),
    }[name]
    path = (read(scene.motion.x), read(scene.motion.y)) if scene.motion else (x0, y0)
    follow = dict(zip((x0, y0), back, strict=True))
    a = read(scene.expect.exact.a).subs(follow)
    source = read(scene.source_term).subs(follow) if scene.source_term else 0
    d = scene.parameters.d
    residual = a.diff(t) - d * (a.diff(x, 2) + a.diff(y, 2)) - (1 - a) - source
    residual += (a * velocity[0]).diff(x) + (a * velocity[1]).diff(y)
    flux = x * a.diff(x) + y * a.diff(y)

    for radius, angle, time in (0.3, 0.7, 0.1), (0.8, 2.5, 0.3), (1.0, -1.2, 0.5):
        start = {x0: radius * np.cos(angle), y0: radius * np.sin(angle), t: time}
        here = {x: path[0].subs(start).evalf(), y: path[1].subs(start).evalf(), t: time}
        for component, v in zip(path, velocity, strict=True):
            assert abs(component.diff(t).subs(start) - v.subs(here)).evalf() < 1e-13
        assert abs(residual.subs(here).evalf()) < 1e-12
        if radius == 1:
            assert abs(flux.subs(here).evalf()) < 1e-12
    begin = {"x0": 0.3, "y0": -0.4}
    if scene.motion:
        assert scene.motion.x(**begin, t=0) == pytest.approx(0.3, abs=1e-15)
        assert scene.motion.y(**begin, t=0) == pytest.approx(-0.4, abs=1e-15)
    at = coordinates(np.array([0.3, -0.4]))
    assert scene.expect.exact.a(**at, **begin, t=0) == pytest.approx(scene.initial.a(**at), abs=1e-15)


@pytest.mark.parametrize("method", [FEM, FV])
@pytest.mark.parametrize("name", ["static-decay", "growing-disk", "stirred"])
def test_second_order_in_h_with_dt_tied_to_its_square(name, method):
    """Static, uniformly growing and non-uniformly stirred meshes, against exact solutions."""
    errors = [exact_error(name, method, refine, 16 * END / 4**refine) for refine in (3, 4, 5)]
    assert np.abs(local_orders(errors) - METHODS[method].order_h).max() < 0.15, errors


@pytest.mark.parametrize("method", [FEM, FV])
def test_first_order_in_dt(method):
    """On one mesh, by differences: the spatial error drops out."""
    errors = np.array([exact_error("growing-disk", method, 4, END / n) for n in (10, 20, 40, 80)])
    assert np.abs(local_orders(-np.diff(errors)) - METHODS[method].order_dt).max() < 0.15, errors


@pytest.mark.parametrize("name", ["static-decay", "stirred"])
def test_fipys_own_diffusion_stalls_on_triangles(name):
    """What `fv-tpfa` is kept for: refining does not help, while the cross flux does."""
    stalled = [exact_error(name, "fv-tpfa", refine, 8 * END / 4**refine) for refine in (3, 4)]
    good = exact_error(name, FV, 4, 8 * END / 4**4)
    assert local_orders(stalled)[0] < 0.5
    assert stalled[-1] > 5 * good


def steady_state_error(target, refine):
    """Error of the steady a = 2 + (1 - g)^2 on a stretched and sheared disk held still, after a long time."""
    mesh = disk(refine, 0.8)
    stretch = np.array([[1.6, 0.5], [0.0, 0.7]])
    x = stretch @ mesh.xi
    # on the ellipse g = |S^-1 x|^2 = 1 a function of g whose derivative vanishes at g = 1 has no flux
    inverse = np.linalg.inv(stretch)
    metric = inverse.T @ inverse

    def exact(place):
        g = np.einsum("i...,ij,j...->...", place, metric, place)
        return 2 + (1 - g) ** 2

    def source(place, xi, t):
        g = np.einsum("i...,ij,j...->...", place, metric, place)
        slope = 2 * np.tensordot(metric, place, 1)
        laplacian = 2 * (slope**2).sum(axis=0) - 2 * (1 - g) * 2 * np.trace(metric)
        return exact(place) - 1 - 0.4 * laplacian

    problem = Problem(
        Model(Parameters(0.0, 0.0), delta=Delta.NONE),
        lambda xi: exact(stretch @ xi),
        np.zeros_like,
        None,
        source,
    )
    still = PrescribedMotion(mesh.xi, Motion(lambda xi, t: stretch @ xi, lambda xi, t: np.zeros_like(xi)))
    film, outcome = film_of(load(METHODS[target].solver)(problem, mesh, still), 2.0, [40.0])
    assert outcome.ok
    assert np.array_equal(film.last.x, x)
    return error_against(film, lambda place, xi: exact(place))


@pytest.mark.parametrize("method", [FEM, FV, "fv-order2"])
def test_second_order_on_a_stretched_and_sheared_mesh(method):
    errors = [steady_state_error(method, refine) for refine in (3, 4, 5)]
    assert np.abs(local_orders(errors) - 2).max() < 0.15, errors


def test_fipys_own_diffusion_is_inconsistent_on_a_stretched_mesh():
    errors = [steady_state_error("fv-tpfa", refine) for refine in (3, 4, 5)]
    assert np.all(local_orders(errors) < 0.5), errors
    assert errors[-1] > 0.01
