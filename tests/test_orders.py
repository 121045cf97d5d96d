"""Observed orders from both sides: no method converges slower, or faster, than it declares."""

import numpy as np
import pytest

from actin_xcheck.core.contract import Motion, Problem
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Delta, Model
from actin_xcheck.core.motion import PrescribedMotion
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.runs.method import METHODS, load
from actin_xcheck.scene.resolve import in_scene_frame
from actin_xcheck.scene.scene import load_scene
from tests.lab import FEM, FV, error_against, film_of, local_orders, play

END = 0.25


def exact_error(name, method, refine, dt):
    scene = load_scene(name)
    film = play(scene, method, refine, dt, [END])
    return error_against(film, lambda x, xi: in_scene_frame(scene, scene.expect.exact.a, x, xi, END))


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
