"""Conservation to round-off, in both codes, on every kind of motion."""

from dataclasses import replace

import numpy as np
import pytest

from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene
from tests.lab import FEM, FV, play, scene_of

SHEAR_AND_ROTATION = """
[model]
reaction = false
[motion]
x = "cos(3*t)*(x0 + 0.8*sin(2*t)*y0) - sin(3*t)*y0"
y = "sin(3*t)*(x0 + 0.8*sin(2*t)*y0) + cos(3*t)*y0"
"""


@pytest.mark.parametrize("method", [FEM, FV, "fv-order2", "fv-driven", "fv-tpfa"])
def test_uniform_actin_survives_exact_shear_and_rotation(method):
    """Area-preserving affine motion, positions prescribed, no reaction: a = 1.7 must stay 1.7."""
    film = play(scene_of(a="1.7", end=1.0, more=SHEAR_AND_ROTATION), method, 3, 0.05)
    assert max(np.abs(state.a / 1.7 - 1).max() for state in film.states) < 1e-12


@pytest.mark.parametrize("method", [FEM, FV])
@pytest.mark.parametrize("name", ["stirred", "growing-disk", "fig14-four-fronts", "mode-11-wall"])
def test_total_actin_obeys_the_balance_at_every_step(name, method):
    film = play(load_scene(name), method, 4, load_scene(name).time.end / 40)
    assert film.residual < 1e-12
    assert len(film.states) > 40


@pytest.mark.parametrize("rtol", [None, 1e-3])
def test_the_steps_that_a_run_states_add_up_to_its_time(rtol, tmp_path):
    run(load_scene("stirred"), Numerics(METHODS["fem-p1-imex2"], 1, 0.1, rtol), tmp_path / "run.vtkhdf")
    series = read_run(tmp_path / "run.vtkhdf").series
    assert np.cumsum(series["dt"]) == pytest.approx(series["time"], abs=1e-12)
    assert len(series["dt"]) > 3


@pytest.mark.parametrize("method", [FEM, FV, "fv-order2"])
def test_the_balance_sees_a_lost_millionth(method):
    """The residual measures: spoil one value by 1e-6 and the next step must show it."""
    film = play(load_scene("static-decay"), method, 3, 0.05)
    state = film.states[-2]
    spoiled = state.a.copy()
    spoiled[spoiled.size // 2] *= 1 + 1e-6
    wrong = {
        FEM: {"mass": 1.000001 * state.mass} if method == FEM else {},
        FV: {"a": spoiled, "corner_values": film.solver.corners(state)},
        "fv-order2": {"a": spoiled},
    }
    new, _ = film.solver.step(replace(state, **wrong[method]), 0.05)
    assert abs(new.balance_residual) > 1e-10
