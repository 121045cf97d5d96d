"""The exact eigenfields solve the linearised equations, point by point, and meet the rim's conditions."""

from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.theory.dispersion import Mode, active_slope, stiffness, wall_eigenfield
from actin_xcheck.theory.eigenfields import cell_eigenfield, eigenfield, growth_rate
from actin_xcheck.theory.exact import DiskModes

RNG = np.random.default_rng(0)
RADII, ANGLES = np.sqrt(RNG.uniform(0.04, 0.8, 12)), RNG.uniform(0, 2 * np.pi, 12)
INSIDE = np.array([RADII * np.cos(ANGLES), RADII * np.sin(ANGLES)])
RIM = np.array([np.cos(ANGLES), np.sin(ANGLES)])
STEP = 1e-4

CELLS = [
    (Closure.REFERENCE_NORMAL, Rheology.VISCOELASTIC, 240.0, Delta.FULL),
    (Closure.REFERENCE_NORMAL, Rheology.VISCOUS, 240.0, Delta.NONE),
    (Closure.TRACTION_FREE, Rheology.VISCOELASTIC, 200.0, Delta.FULL),
    (Closure.TRACTION_FREE, Rheology.VISCOUS, 250.0, Delta.FULL),
]
MODES = [(0, 1), (1, 1), (2, 1)]


def model_of(closure, rheology, psi, delta):
    return Model(Parameters(psi, 0.26), rheology, closure, delta)


def slope(f, x):
    """Central differences: the derivative index first, then f's own shape."""
    steps = STEP * np.eye(2)
    return np.array([(f(x + e[:, None]) - f(x - e[:, None])) / (2 * STEP) for e in steps])


def stress_parts(model, field, t=0.0):
    """sigma_v + sigma_e and the isotropic rest f' a - p_e phi, as functions of points."""
    p = model.parameters
    elastic = model.rheology is Rheology.VISCOELASTIC

    def network(x):
        total = np.zeros((2, 2, x.shape[1]))
        for moduli, w in ((model.viscous_moduli(), field.v), (model.elastic_moduli(), field.u)):
            if w == field.v or elastic:
                g = slope(lambda y, w=w: w(y, t), x)
                total += moduli[0] * (g + g.swapaxes(0, 1)) / 2 + moduli[1] * np.einsum(
                    "iin,jk->jkn", g, np.eye(2)
                )
        return total

    def rest(x):
        phi = np.einsum("iin->n", slope(lambda y: field.u(y, t), x))
        pressure = (1 + p.nu_prime - stiffness(model)) * phi if elastic else 0.0
        return active_slope(model) * field.a(x, t) - pressure

    return network, rest


@pytest.mark.parametrize("t", [0.0, 0.3])
@pytest.mark.parametrize(("m", "n"), MODES)
@pytest.mark.parametrize("cell", CELLS)
def test_an_eigenfield_solves_force_balance_and_transport(cell, m, n, t):
    model = model_of(*cell)
    field = eigenfield(model, m, n)
    d = model.parameters.d
    a, v = field.a(INSIDE, t), slope(lambda x: field.v(x, t), INSIDE)
    laplacian = np.einsum("iin->n", slope(lambda x: slope(lambda y: field.a(y, t), x), INSIDE))
    rate = (field.a(INSIDE, t + STEP) - field.a(INSIDE, t - STEP)) / (2 * STEP)
    scale = np.abs(field.a(RIM, t)).max() * (1 + abs(field.rate))
    assert np.abs(rate + a - d * laplacian + np.einsum("iin->n", v)).max() < 1e-5 * scale
    velocity = (field.u(INSIDE, t + STEP) - field.u(INSIDE, t - STEP)) / (2 * STEP)
    assert np.abs(velocity - field.v(INSIDE, t)).max() < 1e-5 * scale
    network, rest = stress_parts(model, field, t)
    force = np.einsum("iijn->jn", slope(network, INSIDE)) + slope(rest, INSIDE)
    size = np.abs(slope(rest, INSIDE)).max()
    if m == 1 and model.closure is Closure.TRACTION_FREE:  # the gauge's uniform force
        force = force - force.mean(axis=1, keepdims=True)
    assert np.abs(force).max() < 1e-4 * size


@pytest.mark.parametrize(("m", "n"), MODES)
@pytest.mark.parametrize("cell", CELLS)
def test_an_eigenfield_meets_the_conditions_on_the_rim(cell, m, n):
    model = model_of(*cell)
    field = eigenfield(model, m, n)
    tangent = np.array([-RIM[1], RIM[0]])
    assert np.abs(np.einsum("in,in->n", RIM, slope(field.a, RIM))).max() < 1e-6
    network, _ = stress_parts(model, field)
    traction = np.einsum("ijn,jn->in", network(RIM), RIM)
    size = np.abs(network(RIM)).max()
    assert np.abs(np.einsum("in,in->n", RIM, traction)).max() < 1e-6 * size
    if model.closure is Closure.TRACTION_FREE:
        assert np.abs(np.einsum("in,in->n", tangent, traction)).max() < 1e-6 * size
    else:
        along = np.einsum("in,in->n", tangent, field.u(RIM))
        assert np.abs(along).max() < 1e-10 * np.abs(field.u(RIM)).max()


def test_a_free_cell_does_not_translate_in_the_mean():
    """Area-weighted mean of u: Gauss in radius, uniform in angle."""
    field = eigenfield(model_of(*CELLS[2]), 1, 1)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    r, theta = np.meshgrid((nodes + 1) / 2, np.arange(16) * np.pi / 8, indexing="ij")
    u = field.u(np.array([(r * np.cos(theta)).ravel(), (r * np.sin(theta)).ravel()])).reshape(2, *r.shape)
    mean = np.einsum("irt,rt->i", u, weights[:, None] * r)
    assert np.abs(mean).max() < 1e-12 * np.abs(u).max()


def test_largest_concentration_is_one_and_pairs_are_counted_once():
    model = Model(Parameters(270.0, 0.0), delta=Delta.NONE)
    r = np.linspace(0, 1, 201)
    for m in range(3):
        field = eigenfield(model, m, 1)
        assert np.abs(field.a(np.array([r, 0 * r]))).max() <= 1 + 1e-12
        assert field.rate == growth_rate(model, m, 1)
    assert growth_rate(model, 2, 1) == pytest.approx(1.4798239 + 0.5246569j, abs=1e-7)
    assert growth_rate(model, 1, 2).real == pytest.approx(0.28189268, abs=1e-8)


def test_the_wall_keeps_the_numbers_and_fields_of_the_article():
    model = Model(Parameters(62.4, 0.0), closure=Closure.IRROTATIONAL_WALL, delta=Delta.NONE)
    assert eigenfield(model, 1, 1) == wall_eigenfield(model, Mode(1, 1))
    assert growth_rate(model, 1, 1).real == pytest.approx(1.51013, abs=5e-6)


def test_what_is_no_rate_has_no_field():
    model = Model(Parameters(270.0, 0.0), delta=Delta.NONE)
    with pytest.raises(ValueError, match="no growth rate of m = 1"):
        cell_eigenfield(DiskModes(model, 1), 7.0)
    with pytest.raises(ValueError, match=r"no mode \(3, 40\)"):
        growth_rate(model, 3, 40)
    unstable = replace(model, parameters=Parameters(38.24, 1.9))
    with pytest.raises(ValueError, match="right of"):
        eigenfield(unstable, 1, 1)
