"""Growth rates read off amplitudes, and their extrapolation."""

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest

from actin_xcheck.core.model import Array
from actin_xcheck.theory.dispersion import Mode, growth_rates
from actin_xcheck.theory.growth import amplitude_at_rest, extrapolate, fit_growth
from tests.lab import linear_model


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
