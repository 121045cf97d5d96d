"""What a run is reckoned to take, held against processor seconds that were measured."""

from dataclasses import replace

import pytest

from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.runs.fidelity import Reduction
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics, Wanted, chosen_steps, run_seconds, seconds_of, steps_of
from actin_xcheck.scene.scene import load_scene


@pytest.mark.parametrize(
    ("method", "refine", "milliseconds"),
    [
        ("fem-p1-paper", 3, 3.9),
        ("fem-p1-paper", 5, 13.2),
        ("fem-p1-imex2", 5, 24.3),
        ("fem-p2-imex3", 4, 48.6),
        ("fem-p4-imex4", 1, 23.1),
        ("fem-p4-imex4", 2, 58.8),
        ("fem-p8-imex5", 2, 61.0),
        ("fv-coupled", 3, 9.9),
        ("fv-coupled", 4, 13.0),
        ("fv-order2", 3, 17.1),
        ("fv-order2", 5, 38.0),
    ],
)
def test_a_step_takes_what_it_took_to_a_factor_of_two(method, refine, milliseconds):
    step = seconds_of(METHODS[method], refine, 101) - seconds_of(METHODS[method], refine, 1)
    assert milliseconds / 2 < 10 * step < 2 * milliseconds


@pytest.mark.parametrize(
    ("method", "rtol", "steps"),
    [
        ("fem-p1-imex2", 1e-3, 12),
        ("fem-p1-imex2", 1e-7, 425),
        ("fem-p2-imex3", 1e-5, 24),
        ("fem-p2-imex3", 1e-7, 83),
        ("fem-p4-imex4", 1e-7, 40),
        ("fv-order2", 1e-5, 56),
    ],
)
def test_a_tolerance_takes_as_many_steps_as_it_took_to_a_factor_of_two(method, rtol, steps):
    assert steps / 2 < chosen_steps(METHODS[method], rtol) < 2 * steps


@pytest.mark.parametrize(("method", "rtol"), [("fem-p3-imex4", 1e-5), ("fv-order2", 1e-5), ("fv", 1e-3)])
def test_a_tolerance_that_is_easily_met_takes_as_many_steps_as_the_largest_one_makes(method, rtol):
    """On Fig. 14, published with a step, the first two took 161, not the 13 and 47 of the tolerance."""
    scene = load_scene("fig14-four-fronts")
    asked = Wanted(method, refine=2, rtol=rtol).on(scene)
    assert steps_of(asked, scene.output_times) == 161
    free = replace(asked, dt=scene.time.end)
    assert steps_of(free, scene.output_times) == chosen_steps(METHODS[method], rtol) < 100
    strict = replace(asked, rtol=1e-9, method=METHODS["fv"])
    assert steps_of(strict, scene.output_times) == chosen_steps(METHODS["fv"], 1e-9) > 1000


def test_less_is_cheaper_and_a_driver_costs_too():
    whole = Numerics(METHODS["fem-p1-paper"], 5, 0.01)
    parts = [replace(whole, reduction=Reduction(one)) for one in (Fidelity.SECTOR, Fidelity.RADIAL)]
    seconds = [run_seconds(one, [0.5, 1.0]) for one in (whole, *parts)]
    assert seconds == sorted(seconds, reverse=True)
    coupled, driven = (seconds_of(METHODS[name], 4, 50) for name in ("fv-coupled", "fv-driven"))
    assert driven == pytest.approx(coupled + seconds_of(METHODS["fem-p1-paper"], 4, 50))
