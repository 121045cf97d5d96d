"""The exact modes of the moving cell: published values, limits, completeness, and the FEM's own spectrum."""

import json
from dataclasses import replace
from itertools import count, takewhile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import jv

from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology
from actin_xcheck.studies import theory
from actin_xcheck.studies.theory import discrete_rates, discrete_threshold
from actin_xcheck.theory.dispersion import Mode, Version, active_slope, growth_rates
from actin_xcheck.theory.exact import DiskModes, threshold

STRONG = Model(Parameters(270.0, 0.0), delta=Delta.NONE)
CLOSURES = [Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE, Closure.IRROTATIONAL_WALL]


def close(found, expected, tolerance):
    """Two sets of complex numbers, order apart."""
    expected = list(expected)
    assert len(found) == len(expected), (found, expected)
    for rate in found:
        nearest = min(expected, key=lambda other: abs(other - rate))
        assert abs(nearest - rate) < tolerance * (1 + abs(rate)), (rate, nearest)
        expected.remove(nearest)


@pytest.mark.parametrize(
    ("m", "leading"),
    [(0, 11.7008769), (1, 7.1918836), (2, 1.4798239 + 0.5246569j), (2, 1.4798239 - 0.5246569j)],
)
def test_values_confirmed_by_a_radial_eigenvalue_computation(m, leading):
    rates = DiskModes(STRONG, m).rates(-0.05)
    assert np.abs(rates - leading).min() < 1e-7
    assert rates[0].real == pytest.approx(leading.real, abs=1e-7)


@pytest.mark.parametrize("m", range(7))
@pytest.mark.parametrize("psi", [62.4, 270.0, 1300.0])
def test_the_wall_has_the_rates_of_the_dispersion_relation(psi, m):
    model = Model(Parameters(psi, 0.26), closure=Closure.IRROTATIONAL_WALL, delta=Delta.FULL)
    modes = (Mode(m, n) for n in (count(2) if m == 0 else count(1)))
    expected = [
        rate
        for mode in takewhile(lambda mode: mode.k < 60, modes)
        for rate in growth_rates(model, mode.k**2)
        if rate.real > -0.05
    ]
    close(DiskModes(model, m).rates(-0.05), expected, 1e-10)


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("m", range(4))
def test_without_active_stress_actin_just_decays(closure, m):
    model = Model(Parameters(0.0, 0.0), Rheology.VISCOUS, closure, Delta.NONE)
    modes = [Mode(m, n) for n in range(1, 6)]
    expected = [-1 - 0.4 * mode.k**2 for mode in modes if -1 - 0.4 * mode.k**2 > -30]
    close(DiskModes(model, m).rates(-30.0), expected, 1e-9)


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("m", range(4))
def test_viscous_is_the_limit_of_vanishing_elasticity(closure, m):
    viscous = Model(Parameters(200.0, 0.0), Rheology.VISCOUS, closure, Delta.NONE)
    scale = 1e6
    p = viscous.parameters
    soft = replace(p, psi=scale * p.psi, mu1=scale * p.mu1, mu2=scale * p.mu2)
    rates = DiskModes(Model(soft, Rheology.VISCOELASTIC, closure, Delta.NONE), m).rates(0.5)
    close(rates, DiskModes(viscous, m).rates(0.5), 1e-5)


def test_a_list_that_could_not_be_complete_is_refused():
    model = Model(Parameters(270.0, 0.26), delta=Delta.NONE)
    with pytest.raises(ValueError, match=r"-\(1 \+ nu' - p_e\)/mu = -0\.165556"):
        DiskModes(model, 1).rates(-0.18)
    assert DiskModes(model, 1).rates(-0.1).size >= 2
    unstable = Model(Parameters(38.24, 1.646), delta=Delta.FULL)
    with pytest.raises(ValueError, match="must lie right of"):
        DiskModes(unstable, 1).rates(0.0)


@settings(max_examples=40, deadline=None)
@given(
    psi=st.floats(0, 400),
    p=st.floats(-1, 1),
    d=st.floats(0.05, 2),
    mu1=st.floats(0.5, 5),
    mu2=st.floats(0.5, 10),
    nu=st.floats(0.0, 0.45),
    delta=st.sampled_from([Delta.NONE, Delta.FULL]),
    closure=st.sampled_from(CLOSURES),
    rheology=st.sampled_from(list(Rheology)),
    m=st.integers(0, 6),
)
def test_any_rates_are_zeros_in_pairs_and_as_many_as_counted(
    psi, p, d, mu1, mu2, nu, delta, closure, rheology, m
):
    modes = DiskModes(Model(Parameters(psi, p, d, 1.4, mu1, mu2, nu), rheology, closure, delta), m)
    if any(point >= 0 for point in modes.boundary_points().values()):
        return
    rates = modes.rates(0.0)
    assert len(rates) == modes.count(0.0)
    close(np.conj(rates), rates, 1e-10)
    for rate in rates:
        around = modes.determinant(rate + 0.01 * (1 + abs(rate)) * np.exp(2j * np.pi * np.arange(8) / 8), jv)
        assert abs(modes.determinant(rate, jv)) < 1e-9 * np.abs(around).max()


@pytest.mark.slow
def test_the_moving_cell_is_stable_where_the_article_has_its_bifurcation():
    """psi = 62.4 is unstable for the wall and stable for the cell, whose threshold is 101 (m = 0)."""
    cell = Model(Parameters(0.0, 0.26), delta=Delta.NONE)
    wall = replace(cell, closure=Closure.IRROTATIONAL_WALL)
    assert threshold(wall, 1).psi == pytest.approx(36.0557067, rel=1e-8)
    found = [threshold(cell, m) for m in (0, 1)]
    assert [one.psi for one in found] == pytest.approx([100.6419082, 158.5665207], rel=1e-8)
    assert found[0].omega == pytest.approx(1.06669, rel=1e-5)
    unstable = Model(Parameters(0.0, 1.646), delta=Delta.FULL)
    none = threshold(unstable, 1)
    assert none.psi is None
    assert "infinitely many" in none.reason


def test_predict_prints_what_the_library_finds(command):
    arguments = ("--p", 0, "--closure", "reference-normal", "--delta", "none", "--json")
    done = command("predict modes --psi 270 --m 0:2 --above -0.05", *arguments)
    found = json.loads(done.stdout)
    assert found["complete"] is True
    assert [mode["m"] for mode in found["modes"]] == [0, 0, 1, 1, 1, 2, 2]
    assert found["modes"][5]["im"] == pytest.approx(0.5246569, abs=1e-7)
    done = command("predict threshold --m 0:0", *arguments)
    assert json.loads(done.stdout)["thresholds"][0]["psi"] == pytest.approx(101.0549929, rel=1e-8)


PRESSED = Model(Parameters(240.0, 0.26), delta=Delta.FULL)
CELLS = {
    "m=0": (STRONG, 0),
    "m=1": (STRONG, 1),
    "m=2 pair": (STRONG, 2),
    "m=3 pair": (replace(STRONG, parameters=Parameters(300.0, 0.0)), 3),
    "m=4": (replace(STRONG, parameters=Parameters(500.0, 0.0)), 4),
    "pressure": (PRESSED, 1),
    "pressure, pair": (PRESSED, 2),
    "viscous": (replace(PRESSED, rheology=Rheology.VISCOUS), 2),
    "traction-free, gauged": (replace(PRESSED, closure=Closure.TRACTION_FREE), 1),
    "traction-free, pair": (
        Model(Parameters(200.0, 0.26), closure=Closure.TRACTION_FREE, delta=Delta.FULL),
        2,
    ),
    "wall": (replace(PRESSED, closure=Closure.IRROTATIONAL_WALL), 1),
}


def limit_of(found):
    """Richardson's, from two meshes."""
    return found.rates[1] + (found.rates[1] - found.rates[0]) / 3


@pytest.mark.parametrize("name", CELLS)
def test_discrete_rates_converge_at_second_order(name):
    """Every closure, both rheologies, with and without pressure; angular number and all."""
    model, m = CELLS[name]
    found = discrete_rates(model, m, (5, 6) if m == 4 else (4, 5))
    assert found.orders[0] == pytest.approx(2, abs=0.2)
    if not found.exact.imag:
        assert limit_of(found).real == pytest.approx(found.exact.real, rel=5e-3)


def test_the_linearisation_as_printed_would_be_noticed(monkeypatch):
    """(2/pi) p delta in place of (p/pi) delta: the limit is wrong by far more than the mesh's error."""
    right = discrete_rates(PRESSED, 1, (4, 5))
    monkeypatch.setattr(theory, "active_slope", lambda model: active_slope(model, Version.AS_PRINTED))
    wrong = discrete_rates(PRESSED, 1, (4, 5))
    assert abs(limit_of(wrong) - right.exact) > 5 * abs(limit_of(right) - right.exact)


@pytest.mark.slow
@pytest.mark.parametrize("closure", [Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE])
@pytest.mark.parametrize("m", [0, 1, *(pytest.param(m, marks=pytest.mark.nightly) for m in (2, 3, 4))])
def test_discrete_thresholds_are_the_exact_ones_within_a_percent(closure, m):
    model = Model(Parameters(0.0, 0.26), closure=closure, delta=Delta.NONE)
    coarse, fine = (discrete_threshold(model, m, refine) for refine in ((3, 4) if m < 2 else (4, 5)))
    assert fine + (fine - coarse) / 3 == pytest.approx(threshold(model, m).psi, rel=0.01)
    assert np.log2((coarse - threshold(model, m).psi) / (fine - threshold(model, m).psi)) > 1.5
