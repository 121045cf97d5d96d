"""Growth rates: read off amplitudes and extrapolated; of runs, against the wall's theory and the cell's."""

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest
from scipy.optimize import brentq

from actin_xcheck.core.model import Array
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import amplitude_of, bind, run
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.scene.shelf import shipped_scenes
from actin_xcheck.theory.dispersion import Mode, growth_rates, leading_growth_rate
from actin_xcheck.theory.eigenfields import growth_rate
from actin_xcheck.theory.exact import threshold
from actin_xcheck.theory.growth import amplitude_at_rest, extrapolate, fit_growth
from actin_xcheck.verdicts.judge import judge
from tests.lab import FEM, FV, film_of, linear_model, scene_of


@pytest.mark.parametrize("psi", [30.0, 45.0, 62.4, 270.0])
@pytest.mark.parametrize("sampling", [lambda s: s, lambda s: s**1.3, lambda s: s + 0.03 * np.sin(9 * s)])
def test_two_exponentials_return_both_rates(psi: float, sampling: Callable[[Array], Array]) -> None:
    """psi = 30 and 45 give conjugate pairs; only the first sampling is uniform."""
    model, mode = linear_model(psi), Mode(1, 1)
    t = sampling(np.linspace(0, 1, 120)) * (0.4 if psi > 100 else 2)
    rates = growth_rates(model, mode.k**2)
    fit = fit_growth(t, 1e-6 * amplitude_at_rest(model, mode, t), (0.0, t[-1]), exponentials=2)
    assert np.abs(np.array(fit.rates) - rates).max() < 1e-8
    assert fit.rate == fit.rates[0]
    assert fit.residual < 1e-12
    assert sum(fit.amplitudes) == pytest.approx(1e-6, rel=1e-8)


def test_two_exponentials_survive_noise() -> None:
    model, mode, t = linear_model(62.4), Mode(1, 1), np.linspace(0, 2, 200)
    noise = 1 + 1e-6 * np.random.default_rng(0).standard_normal(t.size)
    fit = fit_growth(t, amplitude_at_rest(model, mode, t) * noise, (0.0, 2.0), exponentials=2)
    assert fit.rate == pytest.approx(1.51013, rel=1e-4)
    assert 3e-7 < fit.residual < 3e-6


def test_one_exponential_is_read_off_the_window_only() -> None:
    t = np.linspace(0, 3, 31)
    amplitude = np.where(t < 1, 1.0, -2e-6 * np.exp(1.7 * t))
    fit = fit_growth(t, amplitude, (1.0, 3.0))
    assert fit.rates == pytest.approx([1.7], rel=1e-12)
    assert fit.amplitudes == pytest.approx([-2e-6], rel=1e-12)
    assert fit.residual < 1e-13


def test_one_exponential_mistakes_a_run_from_rest() -> None:
    model, mode, t = linear_model(62.4), Mode(1, 1), np.linspace(0, 1, 50)
    amplitude = amplitude_at_rest(model, mode, t)
    assert fit_growth(t, amplitude, (0.0, 1.0)).rate.real > 1.1 * 1.51013


@pytest.mark.parametrize(
    ("amplitude", "exponentials", "message"),
    [
        (lambda t: np.cos(5 * t), 1, "changes sign"),
        (lambda t: np.exp(1.5 * t), 2, "only one exponential stands out"),
        (lambda t: np.exp(1.5 * t) * (1 + 1e-9 * np.cos(1e4 * t)), 2, "only one exponential stands out"),
        (lambda t: np.where(t < 0.9, np.nan, 1.0), 2, "need 6"),
    ],
)
def test_fits_that_mean_nothing_are_refused(
    amplitude: Callable[[Array], Array], exponentials: Literal[1, 2], message: str
) -> None:
    t = np.linspace(0, 2, 41)
    window = (1.8, 2.0) if "need" in message else (0.0, 2.0)
    with pytest.raises(ValueError, match=message):
        fit_growth(t, amplitude(t), window, exponentials)


def test_extrapolation_finds_every_term_of_a_product_grid() -> None:
    h, dt = (grid.ravel() for grid in np.meshgrid([1 / 8, 1 / 16, 1 / 32], [0.1, 0.05, 0.025]))
    found = extrapolate(h, dt, 1.5 + 2 * h**2 - 3 * dt + 0.5 * dt**2 + 7 * h**4 + 5 * h**2 * dt)
    assert found.limit == pytest.approx(1.5, rel=1e-13)
    terms = {"h^2": 2, "dt": -3, "dt^2": 0.5, "h^4": 7, "h^2 dt": 5}
    assert found.coefficients == pytest.approx(terms, rel=1e-8)
    assert found.residual < 1e-13


@pytest.mark.parametrize(
    ("h", "dt", "terms"),
    [
        ([0.1, 0.05], [0.01, 0.01], ["h^2"]),
        ([0.1, 0.1, 0.1], [0.02, 0.01, 0.005], ["dt", "dt^2"]),
        ([0.1, 0.05, 0.1], [0.02, 0.02, 0.01], ["h^2", "dt"]),
        ([0.1, 0.05, 0.025], [0.1**2, 0.05**2, 0.025**2], ["h^2", "dt^2"]),
        ([0.1, 0.1], [0.01, 0.01], []),
    ],
)
def test_extrapolation_keeps_the_terms_the_data_can_tell(
    h: list[float], dt: list[float], terms: list[str]
) -> None:
    found = extrapolate(h, dt, np.full(len(h), 2.0))
    assert list(found.coefficients) == terms
    assert found.limit == pytest.approx(2.0, rel=1e-12)


def test_extrapolation_takes_complex_rates_and_shows_what_it_cannot_follow() -> None:
    h, dt = (grid.ravel() for grid in np.meshgrid([0.4, 0.2, 0.1, 0.05], [0.04, 0.02, 0.01]))
    rate = 1.5 + 0.5j + h**2 * (1 - 2j) + 3j * dt
    assert extrapolate(h, dt, rate).limit == pytest.approx(1.5 + 0.5j, rel=1e-12)
    assert extrapolate(h, dt, rate + h).residual > 1e-3
    with pytest.raises(ValueError, match="one length"):
        extrapolate(h, dt[:2], rate)


OWN = "fv"
WALL_MODES = [
    ("mode-11-wall", 1.5101),
    ("mode-11-wall-270", 16.3038),
    ("mode-21-wall-270", 13.8903),
    ("mode-02-wall-270", 11.7009),
    ("mode-31-wall-270", 10.4783),
]


def amplitudes(scene, method, refine, dt):
    solver = bind(scene, Numerics(METHODS[method], refine, dt))
    film, outcome = film_of(solver, dt, scene.output_times)
    assert outcome.ok
    measure = amplitude_of(scene, Numerics(METHODS[method], refine, dt), solver)
    values = [measure(step, solver.corners(state)) for step, state in enumerate(film.states)]
    return np.array([state.t for state in film.states]), np.array(values)


def measured_rate(scene, method, refine, dt):
    time, amplitude = amplitudes(scene, method, refine, dt)
    exponentials = 2 if growth_rate(scene.physics, *scene.mode).imag else 1
    return fit_growth(time, amplitude, scene.expect.growth_rate.window, exponentials).rate


def limit_of(scene, method, levels):
    """The rate at h = dt = 0 from runs at (refine, steps); a pair through its mean and product."""
    end = scene.time.end
    rates = np.array([measured_rate(scene, method, refine, end / steps) for refine, steps in levels])
    h, dt = [2.0**-refine for refine, _ in levels], [end / steps for _, steps in levels]
    mean = extrapolate(h, dt, rates.real).limit.real
    if not rates.imag.any():
        return mean
    return mean + 1j * np.sqrt(extrapolate(h, dt, np.abs(rates) ** 2).limit.real - mean**2)


@pytest.mark.parametrize(("name", "rate"), WALL_MODES)
def test_theory_gives_the_published_rates(name, rate):
    scene = load_scene(name)
    assert leading_growth_rate(scene.physics, *scene.mode).real == pytest.approx(rate, abs=6e-5)


OWN_LEVELS = [(3, 20), (4, 20), (5, 20), (4, 10), (4, 40)]
"""Meshes and steps of volumes of second order in time, which take few."""

OWN_LEVELS_OF_PAIRS = [(3, 40), (4, 40), (5, 40), (6, 40), (3, 80), (4, 80), (5, 80), (4, 160)]


GRID_OF_PAIRS = [(5, 80), (5, 160), (4, 80), (4, 160), (4, 320), (6, 80)]
GRID = [*GRID_OF_PAIRS[:-1], (3, 80), (3, 160)]


def by_each(names, every_push):
    """Some scenes by both codes; at night all, also by volumes to which the elements lend their balance."""
    quick = {(name, method) for name in every_push for method in (FEM, OWN)}
    cases = [(name, method) for name in names for method in (FEM, OWN, FV)]
    return [case if case in quick else pytest.param(*case, marks=pytest.mark.nightly) for case in cases]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), by_each(dict(WALL_MODES), ("mode-11-wall", "mode-21-wall-270")))
def test_extrapolated_rates_of_both_codes_are_the_predicted_ones(name, method):
    """Extrapolated in h^2 and in dt, dt^2 from five runs each: within 0.2 %."""
    scene = load_scene(name)
    levels = OWN_LEVELS if method == OWN else [(3, 80), (4, 80), (5, 80), (4, 160), (4, 320)]
    limit = limit_of(scene, method, levels)
    assert limit / leading_growth_rate(scene.physics, *scene.mode).real == pytest.approx(1, abs=0.002)


CELL_MODES = [name for name in shipped_scenes() if name.startswith("mode") and name.endswith("cell")]
OF_EVERY_KIND = ("mode-0-cell", "mode-1-free-cell", "mode-1-viscous-cell", "mode-2-cell")
"""Both rheologies, gauged or not, real rates and a pair."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), by_each(CELL_MODES, OF_EVERY_KIND))
def test_extrapolated_rates_of_the_moving_cell_are_the_exact_ones(name, method):
    """Within 0.2 % where the rate is real and 0.5 % for a conjugate pair, growth and frequency together."""
    scene = load_scene(name)
    exact = growth_rate(scene.physics, *scene.mode)
    if method == OWN:
        levels = OWN_LEVELS_OF_PAIRS if exact.imag else OWN_LEVELS
    else:
        levels = GRID_OF_PAIRS if exact.imag else GRID
    assert abs(limit_of(scene, method, levels) - exact) < (0.005 if exact.imag else 0.002) * abs(exact)


@pytest.mark.slow
@pytest.mark.parametrize("method", [FEM, OWN])
def test_laws_of_ones_own_grow_at_their_exact_rates(method):
    """Saturating contractility and a logarithmic pressure with polymerisation: within 0.2 % by both codes."""
    laws = {
        "contractility": "psi*a**2/(half + a**2)",
        "pressure": "p*(1 + delta*tanh(a)) - stiff*log(1 + phi)",
    }
    scene = load_scene("mode-1-cell").varied(
        {f"laws.{law}": text for law, text in laws.items()}
        | {"laws.parameters": {"half": 0.7, "stiff": 1.3}, "parameters.p": 2.0, "model.delta": "full"}
    )
    exact = growth_rate(scene.physics, *scene.mode)
    assert exact.imag == 0
    assert limit_of(scene, method, OWN_LEVELS if method == OWN else GRID) == pytest.approx(
        exact.real, rel=0.002
    )


def threshold_of(scene, refine, steps, near):
    """The psi at which the mode neither grows nor decays in short runs by volumes, by bisection."""
    end = 2.2 / threshold(scene.physics, scene.mode[0]).omega
    short = scene.varied({"time.end": end, "expect.growth_rate.window": [0.0, end]}, "test.toml")

    def growth(psi):
        there = short.varied({"parameters.psi": psi}, "test.toml")
        return measured_rate(there, OWN, refine, end / steps).real

    return brentq(growth, 0.98 * near, 1.15 * near, rtol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "meshes"),
    [
        ("mode-11-wall", (3, 4)),
        ("mode-1-cell", (3, 4)),
        pytest.param("mode-21-wall-270", (3, 4), marks=pytest.mark.nightly),
        pytest.param("mode-2-cell", (4, 5), marks=pytest.mark.nightly),  # coarser, its error's sign differs
    ],
)
def test_modes_grow_by_volumes_beyond_the_predicted_thresholds(name, meshes):
    """Of the wall and of the moving cell, extrapolated in h^2 from two meshes: within 0.5 %."""
    scene = load_scene(name)
    exact = threshold(scene.physics, scene.mode[0]).psi
    coarse, fine = (threshold_of(scene, refine, 40, exact) for refine in meshes)
    assert (4 * fine - coarse) / 3 == pytest.approx(exact, rel=0.005)


def test_a_start_at_rest_excites_both_roots():
    """u(0) = 0 at psi = 62.4: two exponentials, 1.5101 and 0.3034, and one alone would mislead."""
    scene = scene_of(
        "psi = 62.4\np = 0.0",
        a="1 + 1e-6*J(1, 1.8411837813406593*r)*cos(theta)",
        end=2.0,
        more='[model]\nclosure = "irrotational-wall"\ndelta = "none"\n'
        "[expect.growth_rate]\nm = 1\nn = 1\nwindow = [0.0, 2.0]\nbound = { h2 = 10.0, dt = 10.0 }\n",
    )
    time, amplitude = amplitudes(scene, FEM, 4, 0.01)
    fit = fit_growth(time, amplitude, (0.0, 2.0), 2)
    fast, slow = (rate.real for rate in fit.rates)
    predicted = growth_rates(scene.physics, Mode(1, 1).k ** 2).real
    assert fast == pytest.approx(predicted[0], rel=0.05)
    assert slow == pytest.approx(predicted[1], rel=0.3)
    assert fit.residual < 1e-4


@pytest.mark.parametrize("amplitude", ["1e-6", "1e-9"])
def test_growth_is_linear_in_the_amplitude(amplitude):
    """Two amplitudes, one rate: the perturbation is inside the linear regime and above round-off."""
    text = load_scene("mode-11-wall").text.replace("1e-6", amplitude)
    scene = parse_scene(text, "test.toml")
    reference = measured_rate(load_scene("mode-11-wall"), FEM, 3, 0.02)
    assert measured_rate(scene, FEM, 3, 0.02) == pytest.approx(reference, rel=1e-5)


def test_the_unperturbed_run_is_subtracted_where_it_moves():
    """Where a != 1 to begin with, the twin's motion must not count as growth."""
    text = load_scene("mode-11-wall").text.replace('a = "1"', 'a = "1 + 0.1*x + 0.1*r**2"')
    scene = parse_scene(text.replace("end = 1.0", "end = 0.05").replace("[0, 1.0]", "[0, 0.05]"), "test.toml")
    _, amplitude = amplitudes(scene, FEM, 3, 0.005)
    assert amplitude[0] == pytest.approx(1e-6, rel=0.02)
    assert np.abs(amplitude).max() < 1e-5


def test_a_rate_that_cannot_be_fitted_is_a_failed_claim_with_its_reason(tmp_path):
    scene = load_scene("mode-11-wall")
    run(scene, Numerics(METHODS[FEM], 2, 1.0), tmp_path / "run.vtkhdf")  # one step: nothing to fit
    claims = judge(scene, {FEM: read_run(tmp_path / "run.vtkhdf")})
    failed = [claim for claim in claims if not claim.holds]
    assert len(failed) == 1
    assert "samples" in failed[0].note
