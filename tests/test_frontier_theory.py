"""Frontiers: what linear theory says of steps and meshes, against what the codes do."""

import re

import numpy as np
import pytest

from actin_xcheck.runs.march import Amplitude
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies.frontier import limits
from actin_xcheck.studies.frontier.limits import model_at
from actin_xcheck.theory.dispersion import Mode, wall_eigenfield, wavenumber
from tests.lab import FEM, film_of

FIG14, WALL = load_scene("fig14-four-fronts"), load_scene("mode-11-wall-270")


@pytest.mark.parametrize("name", [FEM, "fem-p1-imex2", "fem-p2-imex3", "fem-p4-imex4", "fv-order2"])
def test_amplification_is_exact_to_the_order_of_the_scheme(name):
    """One step's R less e^(lambda dt) is of order p + 1: seen from both sides."""
    method, model, k2 = METHODS[name], WALL.physics, wavenumber(1, 1) ** 2
    pair, rate = limits.pair_of(method), limits.leading_rate(WALL.physics, k2)
    dt = np.array([2.0, 1.0]) * (5e-3 if method.order_dt > 2 else 5e-4)
    errors = [abs(limits.amplification(pair, model, k2, one) - np.exp(rate * one)) for one in dt.tolist()]
    assert np.log2(errors[0] / errors[1]) - 1 == pytest.approx(method.order_dt, abs=0.15)


@pytest.mark.parametrize("name", [FEM, "fem-p2-imex3", "fv-coupled", "fv-order2"])
def test_the_codes_amplify_a_mode_as_theory_says(name):
    """Three long steps from the exact mode: the scheme's matrix, not e^(lambda t)."""
    method, dt, steps = METHODS[name], 0.06, 3
    end = dt * steps
    text = WALL.text.split("[expect")[0]
    scene = parse_scene(re.sub(r"end = .*", f"end = {end}", re.sub(r"outputs = .*", "", text)), "wall.toml")
    field = wall_eigenfield(scene.physics, Mode(1, 1))
    phi = -(field.factor * field.mode.k**2).real
    matrix = limits.step_matrix(limits.pair_of(method), scene.physics, field.mode.k**2, dt)
    expected = np.linalg.matrix_power(matrix, steps) @ [phi, 1 + phi]
    solver = bind(scene, Numerics(method, 4 if method.space == 1 else 3, dt))
    amplitude, (film, outcome) = Amplitude(scene, solver.mesh), film_of(solver, dt, scene.output_times)
    assert outcome.ok
    first, last = (solver.corners(state) for state in (film.states[0], film.last))
    found = amplitude(steps, last) / amplitude(0, first)
    assert found == pytest.approx(expected[1] - expected[0], rel=0.02)
    if method.order_dt == 1:
        assert found < 0.7 * np.exp(field.rate.real * end)  # so that only the scheme's own factor fits


def test_the_first_order_scheme_never_blows_up_and_explicit_motion_has_a_limit():
    model = model_at(FIG14, 270.0, 0.26)
    assert limits.explicit_limit(None, model) == np.inf
    for k2 in (3.39, 30.0, 300.0):
        factor = [abs(limits.amplification(None, model, k2, dt)) for dt in (3e-3, 3e-2, 0.3, 1.0)]
        assert max(factor) <= max(1, np.exp(limits.leading_rate(model, k2).real))
    pair = limits.pair_of(METHODS["fem-p4-imex4"])
    limit = limits.explicit_limit(pair, model)
    assert 0.1 < limit < 10
    assert abs(limits.amplification(pair, model, 1e8, 0.9 * limit)) <= 1 + 1e-6
    assert abs(limits.amplification(pair, model, 1e8, 1.2 * limit)) > 1


def test_steps_within_the_limit_of_theory_grow_a_mode_right():
    model, k2 = model_at(FIG14, 318.067, 0.26), wavenumber(1, 1) ** 2
    for name, most in ((FEM, 1e-3), ("fem-p1-imex2", 0.04), ("fem-p4-imex4", 0.1)):
        pair = limits.pair_of(METHODS[name])
        dt = limits.largest_accurate_step(pair, model, 0.1636, 0.01)
        assert most / 5 < dt < most
        assert limits.growth_error(pair, model, k2, dt, 0.1636) == pytest.approx(0.01, rel=1e-6)


def test_waves_to_resolve_are_those_that_grow():
    model = model_at(FIG14, 318.067, 0.26)
    h = limits.resolvable_h(model, 1)
    k2 = (np.pi / h) ** 2
    assert limits.leading_rate(model, 1.01 * k2).real < 0 < limits.leading_rate(model, 0.99 * k2).real
    assert limits.resolvable_h(model, 4) == pytest.approx(4 * h)
    assert limits.resolvable_h(model_at(FIG14, 10.0, 0.26), 1) == np.inf
