"""Curved elements with additive Runge-Kutta pairs: orders from both sides, conservation, step control."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from actin_xcheck.core.errors import COMPLETED
from actin_xcheck.runs import march
from actin_xcheck.runs.march import checked_step
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import bind
from actin_xcheck.scene.scene import load_scene
from fem.tableaux import TABLEAUX
from tests.lab import after, film_of, local_orders, play, scene_of

IMEX = [name for name in METHODS if "imex" in name]
QUICK, LONG = IMEX[:5], [pytest.param(name, marks=pytest.mark.slow) for name in IMEX[5:]]
EVERY = pytest.mark.parametrize("method", [*QUICK, *LONG])
SLOW_ABOVE_P2 = pytest.mark.parametrize(
    "method", [*IMEX[:2], *(pytest.param(name, marks=pytest.mark.slow) for name in IMEX[2:])]
)
SMOOTH = "1 + 0.1*cos(pi*r**2)*(1 + 0.5*(r**2 - r**4/2)*cos(2*theta))"  # n.grad a = 0 on the rim
MOVING = scene_of("psi = 270.0\np = 0.26", a=SMOOTH, end=0.08, more='[model]\ndelta = "ring"\n')


STEPS = {4: (4, 8, 16, 32), 5: (2, 4, 8, 16)}
"""Of a test of order, where finer ones would be in round-off, or show the order of the stages."""


def changes(values):
    """Largest differences of successive levels."""
    return [np.abs(fine - coarse).max() for coarse, fine in pairwise(values)]


@pytest.mark.parametrize("pair", TABLEAUX.values(), ids=lambda pair: f"order {pair.order}")
def test_the_pairs_meet_their_order_conditions_coupling_included(pair):
    """Every tree with up to `order` nodes, each edge by either half (Kennedy and Carpenter, table 2)."""
    b, c, halves = pair.b, pair.c, (pair.explicit, pair.implicit)
    assert all(np.allclose(half.sum(axis=1), c, atol=1e-13) for half in halves)
    trees = {1: [(b.sum(), 1)], 2: [(b @ c, 1 / 2)]}
    trees[3] = [(b @ c**2, 1 / 3), *((b @ A @ c, 1 / 6) for A in halves)]
    trees[4] = [
        (b @ c**3, 1 / 4),
        *((b * c @ A @ c, 1 / 8) for A in halves),
        *((b @ A @ c**2, 1 / 12) for A in halves),
        *((b @ A @ B @ c, 1 / 24) for A in halves for B in halves),
    ]
    trees[5] = [
        (b @ c**4, 1 / 5),
        *((b * c**2 @ A @ c, 1 / 10) for A in halves),
        *((b * (A @ c) @ B @ c, 1 / 20) for A in halves for B in halves),
        *((b * c @ A @ c**2, 1 / 15) for A in halves),
        *((b @ A @ c**3, 1 / 20) for A in halves),
        *((b * c @ A @ B @ c, 1 / 30) for A in halves for B in halves),
        *((b @ A @ (c * (B @ c)), 1 / 40) for A in halves for B in halves),
        *((b @ A @ B @ c**2, 1 / 60) for A in halves for B in halves),
        *((b @ A @ B @ C @ c, 1 / 120) for A in halves for B in halves for C in halves),
    ]
    for order in range(1, pair.order + 1):
        assert all(abs(value - exact) < 1e-13 for value, exact in trees[order])
    assert pair.order == 5 or any(abs(value - exact) > 1e-4 for value, exact in trees[pair.order + 1])
    assert np.allclose(pair.implicit[-1], b, atol=1e-15)  # stiffly accurate
    assert pair.b_embedded.sum() == pytest.approx(1, abs=1e-13)


@pytest.mark.slow
@EVERY
def test_order_in_dt_of_the_coupled_moving_cell(method):
    """Differences of successive levels on a fixed mesh, ring and all, from a state the equations have made.

    Started from data that miss n.grad a_t = 0, the steps of order 4 fall at 3 to 3.7 first.  Pointwise they
    do so still: on a moving rim a pair whose stages are of order 2 loses order where n.grad a = 0 is met.
    Positions, which take a's part in the mean, fall at 4.3 by steps of order 5.
    """
    order, solver = METHODS[method].order_dt, bind(MOVING, Numerics(METHODS[method], 2, 1.0))
    made = after(solver, 0.02, 64)
    ends = [after(solver, 0.06, n, made) for n in STEPS.get(order, (8, 16, 32, 64))]
    areas = [np.array([solver.measure(end).area]) for end in ends]
    assert local_orders(changes(areas))[-1] == pytest.approx(order, abs=0.2)
    assert local_orders(changes([end.x for end in ends]))[-1] > order - (0.4 if order < 5 else 0.8)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "levels"), [("fem-p2-imex3", (2, 3, 4)), ("fem-p3-imex4", (1, 2, 3))])
def test_order_in_h_of_the_viscous_moving_cell(method, levels):
    """Area and total actin against a finer run; `viscous` needs no trace of div u and has the full order."""
    scene = scene_of(
        "psi = 270.0\np = 0.26\nl0 = 0.75",
        a=SMOOTH,
        end=0.04,
        more='[model]\nrheology = "viscous"\n',
    )
    dt = scene.time.end / 16
    truth = play(scene, "fem-p4-imex4", 3, dt)
    exact = truth.solver.measure(truth.last)
    runs = [play(scene, method, refine, dt) for refine in levels]
    found = [run.solver.measure(run.last) for run in runs]
    order = METHODS[method].order_h
    for quantity in ("area", "total_actin"):
        errors = [abs(getattr(one, quantity) - getattr(exact, quantity)) for one in found]
        assert errors[-1] < 1e-4
        assert local_orders(errors)[-1] > order - 0.35


@EVERY
def test_every_stage_conserves_actin_whatever_the_steps(method):
    solver = bind(MOVING, Numerics(METHODS[method], 2, 1.0))
    film, outcome = film_of(solver, 1.0, (MOVING.time.end,), 1e-4, METHODS[method].order_dt)
    assert outcome.ok
    assert len({round(s.t, 12) for s in film.states}) == len(film.states) > 4
    assert film.residual < 1e-13


@SLOW_ABOVE_P2
def test_a_smaller_tolerance_gives_a_smaller_error(method):
    order = METHODS[method].order_dt
    truth = play(MOVING, method, 2, MOVING.time.end / (200 if order < 4 else 60)).last

    def error(rtol):
        solver = bind(MOVING, Numerics(METHODS[method], 2, 1.0))
        film, outcome = film_of(solver, 1.0, (MOVING.time.end,), rtol, order)
        assert outcome.ok
        return np.abs(film.last.x - truth.x).max()

    coarse, fine = error(1e-3), error(1e-6)
    assert fine < coarse / 5
    assert fine < 50 * 1e-6


@EVERY
def test_a_uniform_cell_without_reaction_stays_uniform_under_shear(method):
    scene = scene_of(
        a="1",
        end=0.1,
        more='[model]\nreaction = false\n[motion]\nx = "x0 + 0.5*t*y0"\ny = "y0 - 0.3*t*x0*y0"\n',
    )
    film = play(scene, method, 2, 0.02)
    jacobian = film.solver.measure(film.last).area / film.solver.measure(film.states[0]).area
    assert film.solver.measure(film.last).total_actin == pytest.approx(
        film.solver.measure(film.states[0]).total_actin, rel=1e-12
    )
    assert jacobian == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("method", ["fem-p2-imex3", "fem-p4-imex4"])
def test_probes_are_where_the_points_are(method):
    """At the start a material point is at its place and reads the initial field there, rim included."""
    scene = scene_of(a="1 + 0.3*sin(x + 2*y)", end=0.1)
    solver = bind(scene, Numerics(METHODS[method], 3, 0.1))
    points = np.array([[0, 0], [0.4, 0.1], [0.8, 0], [1, 0], [np.cos(1), np.sin(1)], [-0.3, 0.77]]).T
    a, x = solver.probes(points)(solver.init())
    assert np.abs(x.T - points).max() < (1e-12 if "p4" in method else 1e-4)
    assert a == pytest.approx(
        1 + 0.3 * np.sin(points[0] + 2 * points[1]), abs=2e-3 if "p2" in method else 1e-5
    )


def test_a_wrong_weight_is_seen(monkeypatch):
    """The order test above fails with a pair that is consistent but not of its order."""
    good = TABLEAUX[3]
    monkeypatch.setitem(TABLEAUX, 3, replace(good, b=good.b_embedded))
    ends = [play(MOVING, "fem-p2-imex3", 2, MOVING.time.end / n).last.x for n in (8, 16, 32, 64)]
    assert local_orders(changes(ends))[-1] < 2.6


def test_film_and_outcome_of_an_adaptive_run_land_on_the_outputs():
    scene = load_scene("fig14-four-fronts")
    solver = bind(scene, Numerics(METHODS["fem-p2-imex3"], 2, 1.0))
    film, outcome = film_of(solver, 1.0, scene.output_times, 1e-3, 3)
    assert outcome.ok
    assert [frame.t for frame in film.frames] == [0.0, *scene.output_times]
    assert film_of(solver, 0.02, (0.02,))[1].ok


@pytest.mark.parametrize(("order", "steps"), [(1, 4), (2, 3), (5, 2)])
def test_errors_that_miss_the_tolerance_say_with_which_order_they_fall(order, steps, monkeypatch):
    """Of a rough start they fall like dt: a fifth power of them would be tried a dozen times."""
    tried = []

    def missing(solver, state, dt):
        tried.append(dt)
        return SimpleNamespace(local_error=dt**order), COMPLETED

    monkeypatch.setattr(march, "checked_step", missing)
    controller = march.Controller(1e-2, 5, 1.0, (1.0, march.NONE))
    controller.step(None, SimpleNamespace(t=0.0), 1.0)
    assert len(tried) == steps
    assert 1e-3 < tried[-1] ** order <= 1e-2


@pytest.mark.parametrize("pace", [1e-3, 1.0, 1e3])
def test_the_second_step_is_as_long_as_the_tolerance_allows_whatever_the_scene_takes(pace, monkeypatch):
    swelling = load_scene("rough-swelling")
    scene = swelling.varied({"parameters.p": 2 * pace, "time.end": 2 / pace, "expect": None})
    numerics, tried = Numerics(METHODS["fem-p2-imex3"], 1, scene.time.end, rtol=1e-7), []

    def counted(solver, state, dt):
        tried.append(dt)
        return checked_step(solver, state, dt)

    monkeypatch.setattr(march, "checked_step", counted)
    steps = march.March(bind(scene, numerics), numerics, scene.output_times)
    errors = [moment.state.local_error for moment in steps][1:]
    assert steps.outcome.ok
    assert max(errors[1:3]) > 0.1 * 1e-7
    assert len(tried) <= len(errors) + 2
