import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import jnp_zeros, jvp

from actin_xcheck.core.model import Array, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.theory.dispersion import (
    Mode,
    Version,
    coefficients,
    count_below,
    growth_rates,
    isolated_modes,
    k2_crit,
    leading_growth_rate,
    modes_below,
    printed_3_7,
    sigma_prime,
    table_6,
    wall_eigenfield,
    wavenumber,
)
from actin_xcheck.theory.errata import TABLE_4_PRINTED, TABLE_6_PRINTED, errata
from actin_xcheck.theory.growth import amplitude_at_rest
from tests.lab import linear_model


def viscous(model: Model) -> Model:
    return replace(model, rheology=Rheology.VISCOUS)


quantity = st.floats(0.01, 10.0)
models = st.builds(
    Model,
    st.builds(
        Parameters,
        psi=st.floats(-100.0, 1e4),
        p=st.floats(-3.0, 5.0),
        d=quantity,
        a_sat=st.floats(0.2, 5.0),
        mu1=quantity,
        mu2=quantity,
        nu=st.floats(0.0, 0.45),
    ),
    delta=st.sampled_from([Delta.NONE, Delta.FULL]),
    reaction=st.booleans(),
)
squares = st.floats(1e-3, 1e4)
modes = st.builds(Mode, st.integers(0, 8), st.integers(1, 6))
patient = settings(deadline=None)  # cores are shared


@pytest.fixture(scope="module")
def disk() -> tuple[Array, Array]:
    """Points (2, n) and weights (n,) of a quadrature exact for smooth functions on the unit disk."""
    radial, weights = np.polynomial.legendre.leggauss(40)
    r, theta = np.meshgrid((radial + 1) / 2, np.arange(64) * 2 * np.pi / 64, indexing="ij")
    weight = np.broadcast_to((weights / 2)[:, None] * 2 * np.pi / 64, r.shape) * r
    return np.stack([r * np.cos(theta), r * np.sin(theta)]).reshape(2, -1), weight.ravel()


# modes


def test_table_6_differs_from_print_in_three_truncated_entries() -> None:
    printed, exact = np.array(TABLE_6_PRINTED), table_6()
    wrong = {(m, n + 1) for n, m in np.argwhere(np.round(exact, 5) != printed)}
    assert wrong == {(0, 2), (0, 3), (0, 4)}
    assert np.abs(exact - printed).max() < 1e-5
    assert exact[1, 0] == pytest.approx(3.83170597, abs=1e-8)


@pytest.mark.parametrize(("m", "n"), [(-1, 1), (0, 0), (2, -3)])
def test_modes_that_do_not_exist_are_refused(m: int, n: int) -> None:
    with pytest.raises(ValueError, match="m starts at 0 and n at 1"):
        Mode(m, n)


@patient
@given(modes)
def test_wavenumbers_are_zeros_of_the_derivative(mode: Mode) -> None:
    assert abs(jvp(mode.m, mode.k)) < 1e-13
    assert mode.k < Mode(mode.m, mode.n + 1).k


@pytest.mark.parametrize(("m", "n"), [(0, 1), (0, 2), (1, 1), (2, 3), (5, 2)])
def test_norm_is_the_integral_of_w_squared(disk: tuple[Array, Array], m: int, n: int) -> None:
    x, weight = disk
    mode = Mode(m, n)
    assert weight @ mode.value(x) ** 2 == pytest.approx(mode.norm2, rel=1e-12)


@pytest.mark.parametrize(("m", "n"), [(0, 2), (1, 1), (2, 3), (5, 2)])
def test_modes_solve_the_neumann_problem(disk: tuple[Array, Array], m: int, n: int) -> None:
    x, weight = disk
    mode = Mode(m, n)
    dirichlet = weight @ (mode.gradient(x) ** 2).sum(axis=0)
    assert dirichlet == pytest.approx(mode.k**2 * mode.norm2, rel=1e-12)
    theta = np.linspace(0, 2 * np.pi, 17)
    rim = np.stack([np.cos(theta), np.sin(theta)])
    assert np.abs((rim * mode.gradient(rim)).sum(axis=0)).max() < 1e-13


@pytest.mark.parametrize(("m", "n"), [(0, 1), (0, 3), (1, 2), (2, 1), (4, 2)])
def test_gradient_is_that_of_the_value_at_the_origin_too(m: int, n: int) -> None:
    mode, step = Mode(m, n), 1e-5
    x = np.array([[0.0, 0.3, -0.7, 0.0], [0.0, 0.2, 0.1, -0.9]])
    for i, shift in enumerate(step * np.eye(2)[:, :, None]):
        difference = (mode.value(x + shift) - mode.value(x - shift)) / (2 * step)
        assert mode.gradient(x)[i] == pytest.approx(difference, abs=1e-8)


@pytest.mark.parametrize("k", [0.5, 1.9, 3.9, 11.0, 40.0])
def test_count_below_agrees_with_listed_zeros(k: float) -> None:
    listed = [int((jnp_zeros(m, 20) < k).sum()) for m in range(math.ceil(k))]
    assert count_below(k).tolist() == listed
    assert len(modes_below(k)) == sum(listed) + 1


def test_count_steps_at_a_zero() -> None:
    for mode in (Mode(0, 2), Mode(1, 1), Mode(7, 3), Mode(30, 1)):
        below, above = (count_below(mode.k * (1 + e))[mode.m] for e in (-1e-9, 1e-9))
        assert above == below + 1 == mode.n - (mode.m == 0)


# dispersion relation


@pytest.mark.parametrize(
    ("psi", "m", "n", "rate"),
    [
        (62.4, 1, 1, 1.5101),
        (270, 1, 1, 16.3038),
        (270, 2, 1, 13.8903),
        (270, 0, 2, 11.7009),
        (270, 3, 1, 10.4783),
    ],
)
def test_rates_of_the_wall_modes(psi: float, m: int, n: int, rate: float) -> None:
    assert leading_growth_rate(linear_model(psi), m, n) == pytest.approx(rate, abs=5e-5)


def test_both_roots_of_w11_at_the_articles_bifurcation() -> None:
    rates = growth_rates(linear_model(62.4), wavenumber(1, 1) ** 2)
    assert rates == pytest.approx([1.51013018, 0.30335651], abs=5e-9)


@patient
@given(models, squares, st.sampled_from(Version))
def test_roots_satisfy_the_polynomial_to_round_off(model: Model, k2: float, version: Version) -> None:
    rates = growth_rates(model, k2, version)
    (b, c), mu = coefficients(model, k2, version), model.parameters.mu
    scale = mu * np.abs(rates) ** 2 + np.abs(b * rates) + np.abs(c)
    assert np.all(np.abs(mu * rates**2 + b * rates + c) <= 1e-14 * scale)
    assert rates[0].real >= rates[1].real
    assert rates[0].imag == -rates[1].imag >= 0
    assert np.prod(rates).real == pytest.approx(c / mu, rel=1e-13)


@patient
@given(models, st.lists(squares, min_size=1, max_size=5))
def test_rates_of_many_wavenumbers_are_those_of_each(model: Model, k2: list[float]) -> None:
    together = growth_rates(model, k2)
    assert together.shape == (2, len(k2))
    for i, one in enumerate(k2):  # a double root is known to the square root of round-off
        assert together[:, i] == pytest.approx(growth_rates(model, one), rel=1e-6)


@patient
@given(models, squares)
def test_corrected_rates_linearise_the_models_own_stress(model: Model, k2: float) -> None:
    one, delta, h = np.array(1.0), np.array(float(model.delta is Delta.FULL)), 1e-6
    f = model.active_stress
    in_a = (f(one + h, 0 * one, delta) - f(one - h, 0 * one, delta)) / (2 * h)
    in_phi = (f(one, 0 * one + h, delta) - f(one, 0 * one - h, delta)) / (2 * h)
    par, decay = model.parameters, model.reaction_rate() + model.parameters.d * k2
    stiff = 1 + par.nu_prime + in_phi
    b, c = coefficients(model, k2)
    scale = par.mu * decay + abs(par.psi) + abs(par.p) + 10
    assert b == pytest.approx(par.mu * decay + stiff - in_a, abs=1e-7 * scale)
    assert c == pytest.approx(decay * stiff, abs=1e-7 * decay * scale)


@patient
@given(squares, quantity, st.booleans())
def test_without_active_stress_elasticity_and_decay_are_apart(k2: float, d: float, reaction: bool) -> None:
    model = replace(linear_model(0.0, d=d), reaction=reaction)
    elastic = -(1 + model.parameters.nu_prime) / model.parameters.mu
    expected = sorted([elastic, -(model.reaction_rate() + d * k2)], reverse=True)
    # near the double root a rate is a square root of round-off
    assert growth_rates(model, k2) == pytest.approx(expected, rel=1e-12, abs=1e-7)


@patient
@given(models, squares)
def test_viscous_rate_is_the_initial_slope_of_the_viscoelastic_cell_at_rest(model: Model, k2: float) -> None:
    par, delta = model.parameters, float(model.delta is Delta.FULL)
    rates = growth_rates(viscous(model), k2)
    assert rates.shape == (1,)
    slope = sigma_prime(par) + par.p * delta / np.pi
    expected = slope / par.mu - model.reaction_rate() - par.d * k2
    scale = abs(slope) / par.mu + 1 + par.d * k2
    assert rates[0] == pytest.approx(expected, abs=1e-13 * scale)


def test_versions_differ_by_the_slope_and_value_of_arctan() -> None:
    model, k2 = linear_model(62.4, 0.26, Delta.FULL), wavenumber(1, 1) ** 2
    par = model.parameters
    b, c = coefficients(model, k2)
    b_printed, c_printed = coefficients(model, k2, Version.AS_PRINTED)
    assert b_printed - b == pytest.approx(par.p * (0.5 - 1 / np.pi), rel=1e-12)
    assert c_printed - c == pytest.approx((1 + par.d * k2) * par.p / 2, rel=1e-12)
    inner = replace(model, delta=Delta.NONE)
    assert coefficients(inner, k2) == coefficients(inner, k2, Version.AS_PRINTED)


def test_printed_3_7_has_k2_twice() -> None:
    model, k2 = linear_model(62.4, 0.26, Delta.FULL), np.array([1.0, wavenumber(1, 1) ** 2])
    printed, roots = printed_3_7(model, k2), growth_rates(model, k2, Version.AS_PRINTED)
    (b, c), mu = coefficients(model, k2, Version.AS_PRINTED), model.parameters.mu
    root = np.sqrt((b**2 - 4 * mu * k2 * c).astype(complex))
    assert printed == pytest.approx(np.stack([-b + root, -b - root]) / (2 * mu * k2), rel=1e-12)
    assert printed[:, 0] == pytest.approx(roots[:, 0], rel=1e-12)
    assert printed[0, 1].imag > 0 == roots[0, 1].imag
    with pytest.raises(ValueError, match="k\\^2 must be positive"):
        printed_3_7(model, 0.0)


def test_sigma_prime_vanishes_at_half_and_is_proportional_to_psi() -> None:
    assert sigma_prime(Parameters(psi=10.0, p=0.0, a_sat=0.5)) == 0
    assert sigma_prime(Parameters(psi=10.0, p=0.0, a_sat=0.4)) < 0
    assert sigma_prime(Parameters(psi=1.0, p=0.0)) == pytest.approx(0.62941, abs=5e-6)


@patient
@given(models.filter(lambda model: model.parameters.d >= 0.1), st.sampled_from(Version))
def test_b_changes_sign_at_k2_crit(model: Model, version: Version) -> None:
    crit = k2_crit(model, version)
    par = model.parameters
    scale = abs(par.psi) + 100 + par.mu * par.d * abs(crit)
    assert abs(coefficients(model, crit, version)[0]) <= 1e-12 * scale
    assert coefficients(model, crit + 1, version)[0] > 0


@patient
@given(st.floats(0.0, 400.0), st.floats(-3.0, 1.1), st.sampled_from([Delta.NONE, Delta.FULL]))
def test_modes_that_grow_are_those_with_negative_b(psi: float, p: float, delta: Delta) -> None:
    for model in (linear_model(psi, p, delta), viscous(linear_model(psi, p, delta))):
        candidates = [mode for mode in modes_below(12.0) if mode.k > 0]
        growing = [mode for mode in candidates if growth_rates(model, mode.k**2)[0].real > 0]
        assert [mode for mode in isolated_modes(model) if mode.k > 0] == growing


def test_infinitely_many_isolated_modes_are_an_error() -> None:
    with pytest.raises(ValueError, match="infinitely many"):
        isolated_modes(linear_model(62.4, d=0.0))
    assert isolated_modes(linear_model(1.0, d=0.0)) == ()


@pytest.mark.parametrize("delta", [Delta.RING, Delta.MEMBRANE])
def test_delta_that_varies_is_refused_where_it_matters(delta: Delta) -> None:
    with pytest.raises(ValueError, match=f"'{delta}' varies in space"):
        leading_growth_rate(linear_model(62.4, 0.26, delta), 1, 1)
    assert leading_growth_rate(linear_model(62.4, 0.0, delta), 1, 1).real == pytest.approx(1.51013, abs=5e-6)


# eigenfields


@pytest.mark.parametrize("rheology", Rheology)
@pytest.mark.parametrize("psi", [30.0, 62.4, 270.0])
@pytest.mark.parametrize(("m", "n"), [(0, 2), (1, 1), (3, 1)])
def test_eigenfields_solve_the_linearised_equations(rheology: Rheology, psi: float, m: int, n: int) -> None:
    """div u = -k^2 (u's factor) w, so both equations are relations between amplitudes at a point."""
    model = replace(linear_model(psi, 0.26, Delta.FULL), rheology=rheology)
    par, field = model.parameters, wall_eigenfield(model, Mode(m, n))
    x, k2, t, h = np.array([[0.3], [0.2]]), field.mode.k**2, 0.4, 1e-5
    w, grad = field.mode.value(x)[0], field.mode.gradient(x)[0, 0]
    a, u, v = field.a(x, t)[0] / w, field.u(x, t)[0, 0] / grad, field.v(x, t)[0, 0] / grad
    a_t = (field.a(x, t + h) - field.a(x, t - h))[0] / (2 * h * w)
    u_t = (field.u(x, t + h) - field.u(x, t - h))[0, 0] / (2 * h * grad)
    assert u_t == pytest.approx(v, rel=1e-8)
    assert a_t + (1 + par.d * k2) * a - k2 * v == pytest.approx(0, abs=1e-8 * abs(k2 * v))
    elastic = 0.0 if rheology is Rheology.VISCOUS else 1 + par.nu_prime - 1.5 * par.p
    slope = sigma_prime(par) + par.p / np.pi
    assert -k2 * (par.mu * v + elastic * u) + slope * a == pytest.approx(0, abs=1e-10 * abs(slope * a))


def test_uniform_mode_relaxes_without_displacement() -> None:
    x = np.array([[0.0, 0.5], [0.0, 0.5]])
    field = wall_eigenfield(linear_model(270.0), Mode(0, 1))
    assert field.rate == -1
    assert not field.u(x).any()
    assert field.a(x, 1.0) == pytest.approx(math.exp(-1))
    assert leading_growth_rate(replace(linear_model(270.0), reaction=False), 0, 1) == 0


def test_marginal_mode_without_concentration_has_no_eigenfield() -> None:
    with pytest.raises(ValueError, match="leading rate of w1,1 is 0"):
        wall_eigenfield(linear_model(1.0, 1.75), Mode(1, 1))


# amplitudes and fits


@pytest.mark.parametrize("psi", [0.0, 30.0, 62.4, 270.0])
def test_amplitude_at_rest_solves_its_initial_value_problem(psi: float) -> None:
    model, mode, h = linear_model(psi, 0.26, Delta.FULL), Mode(1, 1), 1e-4
    t = np.array([0.0, 0.3, 1.0])
    before, now, after = (amplitude_at_rest(model, mode, t + shift) for shift in (-h, 0.0, h))
    (b, c), par = coefficients(model, mode.k**2), model.parameters
    first, second = (after - before) / (2 * h), (after - 2 * now + before) / h**2
    residual = par.mu * second + b * first + c * now
    assert np.abs(residual).max() <= 1e-5 * par.mu * max(1.0, np.abs(second).max())
    assert now[0] == pytest.approx(1, rel=1e-14)
    assert first[0] == pytest.approx(
        (sigma_prime(par) + par.p / np.pi) / par.mu - 1 - par.d * mode.k**2, rel=1e-5
    )


def test_amplitude_at_rest_passes_a_double_root_smoothly() -> None:
    mode = Mode(1, 1)
    par = Parameters(psi=1.0, p=0.0)
    decay, stiff = 1 + par.d * mode.k**2, 1 + par.nu_prime
    double = (np.sqrt(par.mu * decay) + np.sqrt(stiff)) ** 2 / sigma_prime(par)
    t = np.linspace(0, 2, 5)
    near = [amplitude_at_rest(linear_model(double * (1 + e)), mode, t) for e in (-1e-6, 0.0, 1e-6)]
    assert near[1] == pytest.approx((near[0] + near[2]) / 2, rel=1e-9)


def test_viscous_and_uniform_amplitudes_are_one_exponential() -> None:
    t = np.linspace(0, 1, 4)
    model = viscous(linear_model(62.4))
    rate = growth_rates(model, wavenumber(1, 1) ** 2)[0].real
    assert amplitude_at_rest(model, Mode(1, 1), t) == pytest.approx(np.exp(rate * t), rel=1e-13)
    assert amplitude_at_rest(linear_model(62.4), Mode(0, 1), t) == pytest.approx(np.exp(-t), rel=1e-13)


# errata


def test_table_4_is_wrong_in_three_rows_whatever_delta() -> None:
    crit = {131.869: (20.1416, 20.1876), 174.767: (27.6417, 27.6877), 317.758: (52.6417, 52.6877)}
    added = {131.869: {Mode(3, 1)}, 317.758: {Mode(0, 3)}}
    removed = {174.767: {Mode(4, 1)}}
    for row in TABLE_4_PRINTED:
        assert row.psi_dimensional == pytest.approx(row.psi * 1.5 / 1.3, abs=1e-3)
        expected = (set(row.modes) | added.get(row.psi, set())) - removed.get(row.psi, set())
        for i, delta in enumerate((Delta.NONE, Delta.FULL)):
            for version in Version:
                assert set(isolated_modes(row.model(delta), version)) == expected
            if row.psi in crit:
                assert k2_crit(row.model(delta), Version.AS_PRINTED) == pytest.approx(
                    crit[row.psi][i], abs=5e-5
                )
    named = [erratum.where for erratum in errata() if erratum.number == 3]
    assert named == [f"Table 4, ψ = {psi}" for psi in crit]


def test_errata_cover_all_eight_causes_in_order_and_carry_computed_numbers() -> None:
    numbers = [erratum.number for erratum in errata()]
    assert numbers == sorted(numbers)
    assert set(numbers) == set(range(1, 9))
    assert all(erratum.printed != erratum.corrected and erratum.reason.endswith(".") for erratum in errata())
    text = {n: " ".join(f"{e.corrected} {e.reason}" for e in errata() if e.number == n) for n in set(numbers)}
    assert "1.6503 and 0.2157" in text[1]
    assert "1.1667" in text[1]
    assert "17.68" in text[4]
    assert "0.1493" in text[5]
    assert "36322 wavenumbers, 72474 modes" in text[6]
    assert "k_crit = 537.5" in text[6]
    assert "1.5101" in text[8]
