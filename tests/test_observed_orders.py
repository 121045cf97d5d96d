"""Observed orders: what a sequence of errors says, and what it does not."""

import numpy as np
import pytest

from actin_xcheck.verdicts.orders import Verdict, local_orders, observe

H = 2.0 ** -np.arange(1, 6)


def test_a_pure_power_passes_with_a_narrow_interval():
    found = observe(H, 3 * H**2, 2)
    assert found.verdict is Verdict.PASS
    assert found.local == pytest.approx([2] * 4)
    assert found.low == pytest.approx(found.slope) == found.high == pytest.approx(2)


@pytest.mark.parametrize("declared", [1, 1.5, 2.5, 3])
def test_another_order_than_the_declared_one_fails(declared):
    assert observe(H, 3 * H**2, declared).verdict is Verdict.FAIL


def test_a_functional_may_converge_faster_than_declared_but_not_more_slowly():
    assert observe(H, 3 * H**4, 2, at_least=True).verdict is Verdict.PASS
    assert observe(H, 3 * H**1.5, 2, at_least=True).verdict is Verdict.FAIL


@pytest.mark.parametrize(
    ("c", "verdict"),
    [(0.3, Verdict.PASS), (-0.3, Verdict.PASS), (1e3, Verdict.FAIL), (15, Verdict.NOT_YET_ASYMPTOTIC)],
)
def test_a_higher_order_term_is_told_from_a_wrong_order(c, verdict):
    """h^2 + c h^3: orders fall towards 2 from 3, half of the distance a level once h^2 leads."""
    assert observe(H, H**2 * np.abs(1 + c * H), 2).verdict is verdict


def test_a_number_whose_error_changes_its_sign_shows_no_order_yet():
    """h^2 - 6 h^3: with its sign it is not settled, without it would have to be called a failure."""
    errors = H**2 * (1 - 6 * H)
    found = observe(H, errors, 2)
    assert (found.verdict, "changes its sign" in found.reason) == (Verdict.NOT_YET_ASYMPTOTIC, True)
    assert found.local == observe(H, np.abs(errors), 2).local
    assert observe(H, -(H**2), 2).verdict is Verdict.PASS
    assert observe(H, -(H**1.5), 2).verdict is Verdict.FAIL


@pytest.mark.parametrize(
    "errors",
    [
        [1e-3, -1e-3, 1e-3, -1e-3, 1e-3],
        [1e-3, -2e-3, 4e-3, -8e-3, 16e-3],
        [1e-2, 2e-4, -4e-4, -2e-4, -1e-4],  # settled at 1
        [1e-1, 1e-2, 1e-3, 1e-13, 1e-1],  # in round-off for one level only
    ],
)
def test_a_sign_excuses_nothing_that_does_not_converge(errors):
    assert observe(H[:5], errors, 2).verdict is Verdict.FAIL


def test_half_an_order_above_the_leading_term_is_approached_too():
    errors = H**2 * (1 - H**0.5)
    assert observe(H, errors, 2).verdict is Verdict.NOT_YET_ASYMPTOTIC


def test_orders_that_settle_elsewhere_fail_although_they_came_from_far():
    errors = H**1.5 * (1 - 0.6 * H)
    assert observe(H, errors, 2).verdict is Verdict.FAIL


def test_a_stalling_method_fails():
    assert observe(H, H**2 + 0.01, 2).verdict is Verdict.FAIL


def test_a_floor_is_told_from_an_order():
    found = observe(H, 1e-11 * H**4 + 1e-15, 4)
    assert found.verdict is Verdict.IN_ROUND_OFF
    assert np.isnan(found.local).all()
    above = observe(H, 5e-7 * H**4 + 1e-13 * np.array([1, 1, 1, -1, 1]), 4)
    assert above.verdict is Verdict.PASS  # four levels stand above 1e-12, and they show the order
    found = observe(H, np.zeros(5), 2)
    assert found.verdict is Verdict.IN_ROUND_OFF
    assert np.isnan(found.slope)


def test_noise_fails():
    random = np.random.default_rng(3)
    errors = 10.0 ** random.uniform(-3, -2, (200, 5))
    passed = [observe(H, one, 2).verdict is Verdict.PASS for one in errors]
    assert np.mean(passed) < 0.02


def test_a_level_without_a_number_fails_and_is_left_out_of_the_fit():
    errors = 3 * H**2
    errors[0] = np.nan
    found = observe(H, errors, 2)
    assert found.verdict is Verdict.FAIL
    assert "1 of 5" in found.reason
    assert found.slope == pytest.approx(2)
    assert observe(H, errors, None).verdict is Verdict.MEASURED


def test_the_interval_is_that_of_the_students_t():
    """Five errors with a known scatter, against the closed form."""
    scatter = np.exp(np.array([0.02, -0.03, 0.01, 0.03, -0.03]))
    found = observe(H, H**2 * scatter, 2)
    x, y = np.log(H) - np.log(H).mean(), np.log(H**2 * scatter)
    slope = x @ y / (x @ x)
    residual = y - y.mean() - slope * x
    half = 3.182446305 * np.sqrt(residual @ residual / 3 / (x @ x))
    assert (found.slope, found.low, found.high) == pytest.approx((slope, slope - half, slope + half))


@pytest.mark.parametrize(("steps", "errors"), [([1, 2, 3], [1, 1, 1]), ([2, 1], [1, 1]), ([3, 2, 1], [1, 1])])
def test_levels_that_are_no_sequence_are_refused(steps, errors):
    with pytest.raises(ValueError, match="must decrease"):
        observe(steps, errors, 2)


def test_local_orders_take_any_ratio():
    assert local_orders([1, 0.5, 0.1], [1, 0.25, 0.01]) == pytest.approx([2, 2])
