"""The linear regime against theory (its rates), itself (exact in time) and the full model (its estimate)."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from actin_xcheck.core.contract import Problem
from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.theory.dispersion import active_slope, stiffness
from actin_xcheck.theory.eigenfields import eigenfield, growth_rate
from actin_xcheck.theory.exact import DiskModes
from fem.force_balance import ForceBalance
from fem.imex import FemImex
from fem.linearised import AngularMode
from fem.modal import Modal
from fem.radial import Radial, Ray
from tests.lab import after, numbers_at

MESH, RAY = disk(2, 0.8), Ray.on(0.8, 3, 10)
POINTS = np.array([[0, 0], [0.4, 0], [0.8, 0], [1, 0], [0, 1], [0.5, 0.5], [-0.3, 0.6], [0.1, -0.9]]).T
RESTS = [(270.0, 0.0, Delta.NONE), (200.0, 0.26, Delta.FULL)]
SCENES = [
    "mode-0-cell",
    "mode-1-cell",
    "mode-1-free-cell",
    "mode-1-full-cell",
    "mode-1-viscous-cell",
    "mode-2-cell",
    "mode-11-wall",
]


def at_rest(psi, p, delta, rheology=Rheology.VISCOELASTIC, closure=Closure.REFERENCE_NORMAL):
    return Model(Parameters(psi, p), rheology, closure, delta)


def lopsided(model, amplitude):
    """Many angular numbers, smooth, flat at the rim, displaced."""

    def a0(xi):
        r2 = (xi**2).sum(axis=0)
        hill = np.exp(-3 * ((xi[0] - 0.2) ** 2 + (xi[1] + 0.1) ** 2))
        return 1 + amplitude * (1 - r2) ** 3 * (hill + xi[0] * xi[1])

    def u0(xi):
        return 0.2 * amplitude * (1 - (xi**2).sum(axis=0)) ** 2 * np.array([1 + xi[1], xi[0] ** 2])

    return Problem(model, a0, u0)


numbers = partial(numbers_at, POINTS)


def whole_cell(problem):
    return FemImex(problem, MESH, ForceBalance(problem.model, MESH, 4), 4, 4)


@pytest.mark.parametrize(
    ("rest", "rheology"),
    [
        (RESTS[0], Rheology.VISCOUS),
        (RESTS[1], Rheology.VISCOELASTIC),
        pytest.param(RESTS[1], Rheology.VISCOUS, marks=pytest.mark.slow),
        pytest.param(RESTS[0], Rheology.VISCOELASTIC, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("closure", Closure)
def test_rates_are_those_of_theory(rest, rheology, closure):
    """The exact modes are eigenvalues to 1e-8, and beside them nothing grows."""
    model = at_rest(*rest, rheology, closure)
    for m in range(5):
        found = np.linalg.eigvals(AngularMode(model, RAY, m).generator)
        if closure is Closure.IRROTATIONAL_WALL:
            exact = np.array([growth_rate(model, m, n) for n in range(2 if m == 0 else 1, 4)])
        else:
            exact = DiskModes(model, m).rates(-0.05 if rheology is Rheology.VISCOELASTIC else -20.0)
        off = [np.abs(found - rate).min() / max(1, abs(rate)) for rate in exact]
        assert max(off, default=0.0) < 1e-8
        if closure is not Closure.IRROTATIONAL_WALL:
            assert (found.real > 1e-7).sum() == (exact.real > 1e-7).sum()


def test_a_wrong_gauge_is_seen():
    """A free cell whose m = 1 load is balanced by something else has other rates."""

    class Unbalanced(AngularMode):
        @property
        def rigid(self):
            honest = super().rigid
            return (
                None
                if honest is None
                else honest * (1 + self.ray.nodes.repeat(2).reshape(2, -1, order="F").ravel())
            )

    model = at_rest(*RESTS[0], closure=Closure.TRACTION_FREE)
    exact = DiskModes(model, 1).rates(-0.05)[0]
    good, bad = (np.linalg.eigvals(kind(model, RAY, 1).generator) for kind in (AngularMode, Unbalanced))
    assert np.abs(good - exact).min() < 1e-8
    assert np.abs(bad - exact).min() > 1e-2


@pytest.mark.parametrize("rest", RESTS)
def test_slopes_are_those_of_the_linear_theory(rest):
    model = at_rest(*rest)
    of_a, of_dilation = model.slopes()
    assert of_a == pytest.approx(active_slope(model), rel=1e-14)
    assert 1 + model.parameters.nu_prime + of_dilation == pytest.approx(stiffness(model), rel=1e-14)


@pytest.mark.parametrize("closure", Closure)
def test_the_linear_balance_of_total_actin_is_kept(closure):
    """d/dt int (A + phi) = -int A, whatever the closure; test functions of m = 0 sum to one."""
    mode = AngularMode(at_rest(*RESTS[1], closure=closure), RAY, 0)
    area, count = RAY.weights * RAY.points, RAY.nodes.size
    dilation = np.hstack([RAY.slopes + RAY.values / RAY.points[:, None], 0 * RAY.values])
    of_a, of_phi = area @ RAY.values, area @ dilation
    total = np.concatenate([of_a, of_phi]) @ mode.expansion @ mode.generator
    assert total == pytest.approx(-np.append(of_a, np.zeros(2 * count)) @ mode.expansion, abs=1e-10)


@pytest.mark.parametrize("name", [*SCENES, "mode-2-free-cell", "mode-31-wall-270"])
def test_eigenmodes_grow_as_they_should(name):
    """Concentration and position after the scene's time, against the exact field: no error of time."""
    scene = load_scene(name)
    solver = Modal(resolve(scene), MESH, 4, 3, 10)
    mode, t = eigenfield(scene.physics, *scene.mode), scene.time.end
    amplitude, end = scene.initial.eigenmode.amplitude, after(solver, t)
    a, x = solver.probes(POINTS)(end)
    exact_a, exact_u = (amplitude * part(POINTS, t) for part in (mode.a, mode.u))
    assert set(solver.numbers) == {0, scene.mode[0]}
    tolerance = 1e-8 * max(np.abs(exact_a).max(), np.abs(exact_u).max()) + 1e-15
    assert a == pytest.approx(1 + exact_a, abs=tolerance)
    assert x == pytest.approx((POINTS + exact_u).T, abs=tolerance)


@pytest.mark.parametrize("name", ["mode-1-free-cell", pytest.param("mode-11-wall", marks=pytest.mark.slow)])
def test_shipped_scenes_agree_with_the_whole_cell(name):
    problem, time = resolve(load_scene(name)), load_scene(name).time.end
    modal, cell = Modal(problem, MESH, 4, 3, 10), whole_cell(problem)
    one, other = after(modal, time), after(cell, time, 10)
    difference = np.abs(numbers(modal, one) - numbers(cell, other)).max()
    assert difference < modal.neglected(one) + 1e-9  # the finite elements' own error
    assert modal.amplitude(one) > 1e-6
    assert one.net_force == pytest.approx(other.net_force, rel=1e-3, abs=1e-9)  # the last stage's


@pytest.mark.parametrize(
    ("rheology", "closure", "rest"),
    [
        pytest.param(
            *(Rheology.VISCOELASTIC, Closure.REFERENCE_NORMAL, (120.0, 0.26, Delta.FULL)),
            marks=pytest.mark.slow,
        ),
        (Rheology.VISCOUS, Closure.TRACTION_FREE, (120.0, 0.26, Delta.NONE)),
    ],
)
def test_what_is_neglected_is_quadratic_and_below_its_estimate(rheology, closure, rest):
    differences = []
    for amplitude in (1e-2, 1e-3):
        problem = lopsided(at_rest(*rest, rheology, closure), amplitude)
        modal, cell = Modal(problem, MESH, 12, 3, 10), whole_cell(problem)
        one, other = after(modal, 0.2), after(cell, 0.2, 5)
        assert modal.left_out < 1e-11
        differences.append(np.abs(numbers(modal, one) - numbers(cell, other)).max())
        assert differences[-1] < 0.5 * modal.neglected(one)
        assert differences[-1] > 1e-3 * modal.neglected(one)
    assert np.log10(differences[0] / differences[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_every_mode_is_left_at_second_order(name):
    """The shipped modes with amplitudes 1e-2 and 1e-3 for the first part of their time."""
    scene = load_scene(name)
    small, time = resolve(scene), min(scene.time.end, 0.2)
    differences = []
    for amplitude in (1e-2, 1e-3):
        size = amplitude / scene.initial.eigenmode.amplitude
        problem = replace(
            small,
            a0=lambda xi, size=size: 1 + size * (small.a0(xi) - 1),
            u0=lambda xi, size=size: size * small.u0(xi),
        )
        modal, cell = Modal(problem, MESH, 4, 3, 10), whole_cell(problem)
        one, other = after(modal, time), after(cell, time, 16)
        differences.append(np.abs(numbers(modal, one) - numbers(cell, other)).max())
        assert differences[-1] < modal.neglected(one)
    assert np.log10(differences[0] / differences[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("rheology", Rheology)
def test_axisymmetric_modes_are_those_of_the_ray(rheology):
    """Half the difference of opposite runs of the non-linear ray is linear up to third order."""
    model = at_rest(150.0, 0.3, Delta.FULL, rheology, Closure.TRACTION_FREE)

    def problem(amplitude):
        return Problem(
            model,
            lambda xi: 1 + amplitude * np.cos(np.pi * (xi**2).sum(axis=0)),
            lambda xi: 0.3 * amplitude * xi * (xi**2).sum(axis=0),
        )

    ends = []
    for amplitude in (1e-4, -1e-4):
        ray = Radial(problem(amplitude), MESH, 3, 10, 4)
        ends.append(np.concatenate([part.ravel() for part in ray.probes(POINTS)(after(ray, 0.2, 60))]))
    modal = Modal(problem(1e-4), MESH, 2, 3, 10)
    a, x = modal.probes(POINTS)(after(modal, 0.2))
    linear = np.concatenate([a - 1, (x - POINTS.T).ravel()])
    assert linear == pytest.approx((ends[0] - ends[1]) / 2, abs=2e-9)


def test_a_step_of_any_length_is_exact():
    modal = Modal(lopsided(at_rest(*RESTS[1], closure=Closure.TRACTION_FREE), 1e-3), MESH, 8, 3, 10)
    one, many = after(modal, 0.15), after(modal, 0.15, 5)
    assert one.harmonics == pytest.approx(many.harmonics, abs=1e-12)
    assert modal.neglected(one) == pytest.approx(modal.neglected(many), rel=0.3)
    v = (after(modal, 1e-6, state=one).x - after(modal, -1e-6, state=one).x) / 2e-6
    assert one.v == pytest.approx(v, abs=1e-8)


def test_turned_data_give_turned_cells():
    angle, model = 0.7, at_rest(*RESTS[1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    straight = lopsided(model, 1e-3)
    turned = Problem(model, lambda xi: straight.a0(turn.T @ xi), lambda xi: turn @ straight.u0(turn.T @ xi))
    one, other = Modal(straight, MESH, 12, 3, 10), Modal(turned, MESH, 12, 3, 10)
    a, x = one.probes(POINTS)(after(one, 0.1))
    b, y = other.probes(turn @ POINTS)(after(other, 0.1))
    assert b == pytest.approx(a, abs=1e-11)
    assert y == pytest.approx(x @ turn.T, abs=1e-11)


def test_what_no_harmonic_holds_is_said_and_counted():
    model = at_rest(*RESTS[0])
    problem = Problem(
        model, lambda xi: 1 + 1e-4 * xi[0] ** 3, np.zeros_like
    )  # cos 3 theta has a fourth of it
    modal = Modal(problem, MESH, 2, 3, 10)
    assert modal.left_out == pytest.approx(0.25e-4, rel=1e-10)
    assert modal.neglected(modal.init()) > modal.left_out
    assert Modal(problem, MESH, 3, 3, 10).left_out < 1e-15


def test_initial_data_are_found_again():
    problem = lopsided(at_rest(*RESTS[1]), 1e-3)
    modal = Modal(problem, MESH, 16, 3, 12)
    state, frame = modal.init(), modal.frame(modal.init())
    a, x = modal.probes(POINTS)(state)
    assert a == pytest.approx(problem.a0(POINTS), abs=1e-12)
    assert x == pytest.approx((POINTS + problem.u0(POINTS)).T, abs=1e-12)
    assert frame.a == pytest.approx(problem.a0(modal.grid.xi), abs=1e-12)
    assert frame.x == pytest.approx(modal.grid.xi + problem.u0(modal.grid.xi), abs=1e-12)
    assert modal.corners(state) == pytest.approx(problem.a0(MESH.xi)[MESH.triangles], abs=1e-12)
    assert modal.check(state).ok


def test_integrals_are_those_of_the_displaced_disk():
    """x = 1.2 xi + (0.1, 0) moves the centroid and scales the area, whatever the size of the displacement."""
    model = at_rest(0.0, 0.0, Delta.NONE, Rheology.VISCOUS)
    offset = np.array([[0.1], [0.0]])
    modal = Modal(Problem(model, lambda xi: 1 + 0.3 * xi[0], lambda xi: 0.2 * xi + offset), MESH, 2, 2, 4)
    measured = modal.measure(modal.init())
    assert measured.area == pytest.approx(1.44 * np.pi, rel=1e-13)
    assert measured.total_actin == pytest.approx(1.44 * np.pi, rel=1e-13)
    assert measured.centroid == pytest.approx([0.1, 0.0], abs=1e-13)
    assert measured.jacobian_min == pytest.approx(1.44, rel=1e-12)
    assert np.hypot(*(measured.rim - offset)) == pytest.approx(1.2, rel=1e-13)
    assert modal.amplitude(modal.init()) == pytest.approx(0.3, rel=1e-13)


def test_another_solver_goes_on_from_a_state():
    problem = lopsided(at_rest(*RESTS[0]), 1e-4)
    modal = Modal(problem, MESH, 12, 3, 10)
    half = after(modal, 0.05)
    on = Modal(modal.handed_over(half), MESH, 12, 3, 10)
    assert numbers(on, after(on, 0.05)) == pytest.approx(numbers(modal, after(modal, 0.1)), abs=1e-12)
    cell = whole_cell(modal.handed_over(half))
    assert numbers(cell, cell.init()) == pytest.approx(numbers(modal, half), abs=1e-7)


def test_a_perturbation_that_turns_the_disk_over_is_tangled():
    modal = Modal(lopsided(at_rest(*RESTS[0]), 1.0), MESH, 12, 3, 10)
    outcome = modal.check(after(modal, 0.3))
    assert outcome.ending is Ending.TANGLED
    assert "t = 0.3" in outcome.message
