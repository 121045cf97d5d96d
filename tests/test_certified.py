"""Lists as theorems: against values of 40 digits, the bounds, and what they must refuse."""

import json
from dataclasses import replace

import mpmath
import numpy as np
import pytest

from actin_xcheck.core.model import Closure, Delta, Model, Rheology
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.theory import certified
from actin_xcheck.theory.certified import beyond, crossing, proved, region
from actin_xcheck.theory.exact import DiskModes

WALL, CELL = Closure.IRROTATIONAL_WALL, Closure.REFERENCE_NORMAL


def at(psi, closure=CELL, rheology=Rheology.VISCOELASTIC, p=0.0):
    return Model(Parameters(psi, p), rheology, closure, Delta.NONE)


def independent(m, psi, near):
    """A rate of the moving cell, p = 0, by the fields themselves: no determinant of ours, 40 digits.

    a(r) is a power series that obeys Lap a = (q a + rho H r^m/K)/d, and u is integrated from phi and omega.
    """
    mp = mpmath.mp.clone()
    mp.dps = 40
    par = Parameters(psi, 0.0)
    one = 1 / mp.mpf(par.a_sat)
    f = mp.mpf(psi) * (2 - one) * mp.exp(-one)
    nu = mp.mpf(par.nu) / (1 - 2 * mp.mpf(par.nu))
    d, mu1, mu2 = map(mp.mpf, (par.d, par.mu1, par.mu2))

    def fields(z, alpha, eta, c):
        """a', u_t, s1 u_r' + s2 phi at the rim, of power series r^(m + 2 j)."""
        s1, s2 = mu1 * z + 1, mu2 * z + nu
        K = s1 + s2
        a, u, w = [alpha], [], []
        for j in range(1, 60):
            source = (z + 1 - z * f / K) * a[j - 1] + (z * eta / K if j == 1 else 0)
            a.append(source / d / ((m + 2 * j) ** 2 - m**2))
        h = [eta, *[0] * 59]
        phi = [(x - f * y) / K for x, y in zip(h, a, strict=True)]
        omega = [2 * x / s1 for x in h]
        for j in range(60):  # (u_r + u_t) and (u_r - u_t) from phi + omega and phi - omega
            n = m + 2 * j + 1
            more, less = (phi[j] + omega[j]) / (n + m + 1), (phi[j] - omega[j]) / (n + 1 - m)
            u.append((more + less) / 2)
            w.append((more - less) / 2)
        slope = sum((m + 2 * j) * x for j, x in enumerate(a))
        along = sum((m + 2 * j + 1) * x for j, x in enumerate(u)) + c * (m - 1)
        return slope, sum(w) - c, s1 * along + s2 * sum(phi)

    def determinant(z):
        columns = [fields(z, *unit) for unit in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        return mp.det(mp.matrix(columns))

    return complex(mp.findroot(determinant, (mp.mpc(near), mp.mpc(near) + mp.mpf("1e-6")), solver="secant"))


@pytest.mark.slow
def test_the_list_of_the_strong_cell_is_proved_and_is_that_of_forty_digits():
    found, none_from = proved(at(270.0), range(3), 0.0)
    assert [one.m for one in found] == [0, 0, 1, 1, 2, 2]
    assert none_from == 11
    for one in found:
        assert one.radius < 1e-13 * abs(one.rate)
        if one.m:  # m = 0 is the dispersion relation's
            assert abs(independent(one.m, 270.0, one.rate) - one.rate) < 2e-15 * abs(one.rate) + one.radius


@pytest.mark.parametrize(
    ("model", "counts"),
    [
        (at(62.4, WALL), [0, 2, 0, 0]),
        (at(270.0, WALL, Rheology.VISCOUS, 0.26), [1, 2, 1, 1, 1, 1, 0]),
        (at(62.4), [0] * 6),
        pytest.param(at(240.0, p=0.26), [2, 2, 2, 0, 0, 0, 0, 0, 0, 0], marks=pytest.mark.slow),
        pytest.param(at(270.0), [2, 2, 2, *[0] * 8], marks=pytest.mark.slow),
        pytest.param(at(270.0, CELL, Rheology.VISCOUS), [1, 1, 1, *[0] * 8], marks=pytest.mark.slow),
    ],
)
def test_all_angular_numbers_at_once(model, counts):
    found, none_from = proved(model, None, 0.0)
    assert [sum(one.m == m for one in found) for m in range(none_from)] == counts
    for m in range(none_from, none_from + 5):
        assert DiskModes(model, m).count(0.0) == 0


@pytest.mark.parametrize("p", [0.0, 0.26, 1.0])
@pytest.mark.parametrize("rheology", Rheology)
@pytest.mark.parametrize("m", [1, 2, 4])
def test_modes_obey_the_estimate(m, rheology, p):
    """Every mode right of it lies in the region, and the region is no thousand times as wide as they are."""
    model = at(400.0, CELL, rheology, p)
    rates = DiskModes(model, m).rates(0.0)
    where = region(model, m, 0.0)
    assert len(rates)
    assert not where.empty
    assert rates.real.max() < where.right < 1e3 * rates.real.max()
    assert np.abs(rates.imag).max() < where.top


def test_left_of_zero_the_even_expansion_is_in_the_list():
    """-(1/2 + nu')/(mu1/2 + mu2) whatever psi: the estimate does not see it."""
    found, _ = proved(at(0.0), range(1), -0.17)
    assert [one.rate.real for one in found] == pytest.approx([-1.25 / 7.75], rel=1e-14)


def test_more_diffusion_leaves_fewer_angular_numbers():
    bounds = [
        beyond(replace(at(270.0), parameters=Parameters(270.0, 0.0, d=d)), 0.0) for d in (0.1, 0.4, 1.6)
    ]
    assert bounds == sorted(bounds, reverse=True)
    assert len(set(bounds)) == 3


def test_a_list_that_lacks_a_mode_is_no_theorem(monkeypatch):
    rates = DiskModes.rates
    monkeypatch.setattr(certified.DiskModes, "rates", lambda self, above: rates(self, above)[1:])
    with pytest.raises(ArithmeticError, match="m = 1: 2 modes are there, 1 were found"):
        proved(at(62.4, WALL), range(1, 2), 0.0)
    monkeypatch.setattr(certified.DiskModes, "rates", lambda self, above: rates(self, above)[[0, 0]])
    with pytest.raises(ArithmeticError, match="2 modes are there"):
        proved(at(62.4, WALL), range(1, 2), 0.0)


def test_a_mode_on_the_contour_is_an_error():
    """-(1/2 + nu')/(mu1/2 + mu2) = -1/8 exactly."""
    model = replace(at(0.0), parameters=Parameters(0.0, 0.0, mu1=2.0, mu2=3.0, nu=0.0))
    with pytest.raises(ArithmeticError, match="m = 0: a mode may lie on the contour"):
        proved(model, range(1), -0.125)
    assert [one.rate for one in proved(model, range(1), -0.1250000001)[0]] == [-0.125]


def test_what_is_not_derived_is_refused():
    with pytest.raises(ValueError, match="'traction-free': its modes are counted in floating point only"):
        proved(at(270.0, Closure.TRACTION_FREE), range(1), 0.0)
    with pytest.raises(ValueError, match="must lie right of where rates accumulate"):
        proved(at(270.0, p=2.0), range(1), 0.0)
    with pytest.raises(ValueError, match="infinitely many modes"):
        proved(replace(at(270.0), parameters=Parameters(270.0, 0.0, d=0.0)), range(1), 0.0)


@pytest.mark.parametrize(("m", "psi"), [(0, 100.64190804861), (1, 36.05570670253)])
def test_thresholds_of_the_wall_are_enclosed(m, psi):
    model = at(1.0, WALL, p=0.26)
    low, high = crossing(model, m, psi)
    assert low < psi < high < low * (1 + 3e-9)
    with pytest.raises(ArithmeticError, match="modes grow at psi"):
        crossing(model, m, psi * (1 + 1e-7))


def test_the_command_says_what_is_proved(command):
    said = command("predict modes --psi 62.4 --p 0 --closure irrotational-wall --m 1 --certify").stdout
    assert "proved: this list is complete; no m from 4 on has a rate above 0" in said
    assert "1.51013018041" in said
    answer = json.loads(
        command("predict threshold --p 0.26 --closure irrotational-wall --m 1 --certify --json").stdout
    )
    low, high = answer["thresholds"][0]["between"]
    assert low < answer["thresholds"][0]["psi"] < high
