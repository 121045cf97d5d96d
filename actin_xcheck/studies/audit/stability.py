"""Rows of the audit: sentences on linear stability, of Sections 3.3, 5, 6 and A.1."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from actin_xcheck.core.model import Closure, Delta, Model
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.studies.audit import RowAnswer, answer, examines
from actin_xcheck.studies.audit.linear import (
    CONSTANT,
    CORRECTED,
    PRINTED,
    VERSIONS,
    W02,
    W11,
    W21,
    borders,
    isolated,
    kind,
    leading,
    linear_model,
)
from actin_xcheck.studies.audit.sample import ROUND_OFF, disk_quadrature, rounds_to
from actin_xcheck.theory.dispersion import (
    Mode,
    Version,
    coefficients,
    count_below,
    growth_rates,
    isolated_modes,
    k2_crit,
    modes_below,
    sigma_prime,
    stiffness,
)
from actin_xcheck.theory.errata import REALISTIC_CELL
from actin_xcheck.theory.exact import DiskModes

_TABLE_2 = Parameters(62.4, 0.26)


@examines("s3.3-zero")
def _void_at_zero() -> RowAnswer:
    """The determinant (3.5) at k = 0 for any rate."""
    par, k, worst = _TABLE_2, 0.0, 0.0
    slope = sigma_prime(par)
    for rate in (2.0, -0.7, 1 + 3j):
        matrix = np.array(
            [[rate + par.d * k**2 + 1, rate * 1j * k], [-1j * k * slope, k**2 * (par.mu * rate + 1.49)]]
        )
        worst = max(worst, abs(np.linalg.det(matrix)))
    model = linear_model(270.0, 0.0, Delta.NONE)
    b, c = coefficients(model, 0.0)
    return answer(worst == 0, worst=worst, root=growth_rates(model, 0.0)[0].real, b=b, c=c)


@examines("s3.3-c")
def _c_sign() -> RowAnswer:
    k2 = np.array([W11.k**2, 100.0, 1e4])

    def signs(sign: int, *pressures: float) -> bool:
        models = ((linear_model(62.4, p, delta), version) for p in pressures for delta, version in VERSIONS)
        return all((sign * coefficients(model, k2, version)[1] > 0).all() for model, version in models)

    above, below = signs(-1, 1.76, 3.0), signs(1, 0.26, 1.1)
    return answer(above and below, above=above, below=below, bound=1.75)


@examines("s3.3-ranges")
def _ranges() -> RowAnswer:
    """Conditions 1 to 3: how many of the wave numbers up to k = 1000 grow."""
    cases = {1: (5.0, 2.0), 2: (62.4, 0.26), 3: (62.4, 2.0)}
    k2 = np.linspace(W11.k, 1000, 4000) ** 2
    growing, signs = {}, []
    for number, (psi, p) in cases.items():
        model = linear_model(psi, p, Delta.NONE)
        b, c = coefficients(model, k2)
        signs.append((bool(b[0] < 0), bool(c[0] < 0)))
        growing[number] = float((growth_rates(model, k2)[0].real > 0).mean())
    shares = growing[1] == growing[3] == 1 > growing[2] > 0
    return answer(shares and signs == [(False, True), (True, False), (True, True)], growing=growing)


@examines("s3.3-sufficient")
def _sufficient() -> RowAnswer:
    """G and k_crit of the two bullets with and without the minus signs, at the article's point."""
    par, p = _TABLE_2, _TABLE_2.p
    sigma, pressure = sigma_prime(par), p * (1 + 2 / math.pi)
    right, bare = 1 + par.nu_prime + par.mu - sigma - pressure, 1 + par.nu_prime + par.mu * sigma * pressure
    crit = k2_crit(linear_model(62.4, p, Delta.FULL), PRINTED)
    agrees = abs(-right / (par.mu * par.d) - crit) < 1e-9
    return answer(agrees, right=right, bare=bare, crit=crit, k2=W11.k**2)


@examines("s3.3-either")
def _either_large() -> RowAnswer:
    par, k2 = Parameters(1.0, 0.26), W11.k**2
    rest = par.mu * (1 + par.d * k2) + 1 + par.nu_prime
    psi, p = (rest - 0.26) / sigma_prime(par), rest
    below, above = (coefficients(linear_model(psi * s, 0.26, Delta.NONE), k2)[0] for s in (0.999, 1.001))
    low, high = (coefficients(linear_model(0.0, p * s, Delta.NONE), k2)[0] for s in (0.999, 1.001))
    return answer(bool(below > 0 > above and low > 0 > high), psi=psi, p=p)


def _slope_at(a_sat: float, psi: float = 1.0) -> float:
    return sigma_prime(Parameters(psi, 0.0, a_sat=float(a_sat)))


@examines("s3.3-half")
def _sigma_at_half() -> RowAnswer:
    values = {a_sat: _slope_at(a_sat) for a_sat in (0.1, 0.3, 0.49, 0.5, 0.51)}
    *below, half, above = values.values()
    double = _slope_at(1.4, 2.0) / _slope_at(1.4)
    return answer(half == 0 < above and max(below) < 0 and double == 2, values=values, double=double)


@examines("s3.3-negative")
def _negative_sigma() -> RowAnswer:
    """a_sat = 0.4: the p that makes b(k_11) negative, against the p that makes c negative."""
    still = Model(Parameters(62.4, 0.0, a_sat=0.4), delta=Delta.FULL)

    def b(p: float) -> float:
        return float(coefficients(still.varied(p=p), W11.k**2, PRINTED)[0])

    p = b(0.0) / (b(0.0) - b(1.0))  # b is linear in p
    return answer(b(0.99 * p) > 0 > b(1.01 * p), sigma=sigma_prime(still.parameters), p=p)


@examines("s3.3-assumption")
def _above_saturation() -> RowAnswer:
    grid = np.linspace(0.05, 5, 991)
    same = bool(((np.array([*map(_slope_at, grid)]) > 1e-12) == (2 * grid > 1 + 1e-9)).all())
    return answer(same, count=grid.size, same=same)


def _onset(model: Model, m: int) -> float:
    """The psi from the article's 62.4 to 1000 beyond which a mode of angular number m grows, to 1e-9."""
    low, high = 62.4, 1000.0
    while high - low > 1e-9 * high:
        middle = (low + high) / 2
        if DiskModes(model.varied(psi=middle), m).count(0.0):
            high = middle
        else:
            low = middle
    return high


@examines("s3.3-points-normal", "s3.3-points-free")
def _bifurcation_point(closure: str) -> RowAnswer:
    """The cell's own thresholds at p = 0.26, delta = 0, against the article's 62.4 and its wall's."""
    model = Model(Parameters(0.0, 0.26), closure=Closure(closure), delta=Delta.NONE)
    psi = [_onset(model, m) for m in (0, 1)]
    printed = borders(0.26, Delta.NONE, CORRECTED).neutral
    return answer(abs(psi[1] / printed - 1) < 0.05, psi=psi, printed=printed)


@examines("s3.3.1-discrete")
def _discrete() -> RowAnswer:
    gap = min(
        after - one
        for one, after in pairwise(sorted(Mode(m, n).k ** 2 for m in range(6) for n in range(1, 5)))
    )
    return answer(gap > 0, gap=gap)


@examines("sA.1.1-nu")
def _nu_prime() -> RowAnswer:
    nu_prime, e = _TABLE_2.nu_prime, stiffness(linear_model(62.4, 0.0, Delta.NONE))
    return answer(rounds_to(nu_prime, "0.75") and abs(e - 1.75) < ROUND_OFF, nu_prime=nu_prime, e=e)


def _non_zero(modes: tuple[Mode, ...]) -> list[Mode]:
    return [mode for mode in modes if mode.k > 0]


@examines("sA.1-lowest")
def _lowest() -> RowAnswer:
    first, second, *_ = _non_zero(modes_below(6.0))
    return answer(first == W11, first=first, second=second, w02=W02)


@examines("sA.1-steady")
def _steady_solutions() -> RowAnswer:
    """How near to zero w1,1's rates ever come as psi rises: a steady state bifurcates at lambda = 0 only."""
    rates = np.array(
        [growth_rates(linear_model(psi, 0.26, Delta.NONE), W11.k**2) for psi in np.linspace(0, 120, 1201)]
    )
    product = float(np.prod(rates, axis=1).real.min())
    neutral = borders(0.26, Delta.NONE, CORRECTED).neutral
    crossing, at_printed = (leading(psi, 0.26, Delta.NONE, CORRECTED) for psi in (neutral, 62.4))
    omega = abs(crossing.imag)
    return answer(product < 1e-6, product=product, neutral=neutral, omega=omega, at_printed=at_printed.real)


@examines("sA.1.1-c")
def _c_positive() -> RowAnswer:
    stiff = {
        (p, delta): stiffness(linear_model(62.4, p, delta))
        for p in (0.26, 1.0, 1.646, 1.74)
        for delta in CONSTANT
    }
    bad = [
        f"p = {p:g}, δ = {1 if delta is Delta.FULL else 0}: {e:.3f}"
        for (p, delta), e in stiff.items()
        if e <= 0
    ]
    bound = 1.75 / 1.5
    ours = all(e > 0 for (p, delta), e in stiff.items() if delta is Delta.NONE or p < bound)
    return answer(not bad, corrected=ours, bad="; ".join(bad), bound=bound)


@examines("sA.1.1-rising")
def _with_rising_psi() -> RowAnswer:
    of = {version: borders(0.26, Delta.FULL, version) for version in Version}
    one = of[PRINTED]
    return answer(0 < one.damped < one.neutral < one.real < 62.4, of=of)


@examines("sA.1.1-typical")
def _typical_psi() -> RowAnswer:
    kinds = {kind(62.4, 0.26, delta, version) for delta, version in VERSIONS}
    dimensional = 62.4 / DimensionalParameters(psi=1.0, p=0.3).non_dimensional().psi
    alone = set(isolated(62.4, 0.26)) == {(Mode(0, 1), W11)}
    agrees = alone and kinds == {"real"} and rounds_to(dimensional, "72")
    return answer(agrees, kinds=" and ".join(kinds), dimensional=dimensional)


@examines("sA.1.1-identical")
def _identical_curves() -> RowAnswer:
    k2 = np.linspace(0.05, 20, 400)
    inner, ring = (linear_model(62.4, 0.26, delta) for delta in CONSTANT)
    shift, gap, at = {}, {}, {}
    for v in Version:
        shift[v] = float(np.abs(coefficients(inner, k2, v)[0] - coefficients(ring, k2, v)[0]).max())
        gap[v] = float(np.abs(growth_rates(inner, k2, v)[0].real - growth_rates(ring, k2, v)[0].real).max())
        at[v] = [leading(62.4, 0.26, delta, v).real for delta in CONSTANT]
    return answer(max(shift.values()) < 1e-9, shift=shift, gap=gap, at=at)


@examines("sA.1.1-only-first")
def _only_the_first() -> RowAnswer:
    """The isolated sets as psi rises: nested, each with one mode more."""
    lowest, sizes = _non_zero(modes_below(20.0)), set()
    for psi in np.linspace(0, 400, 2001):
        modes = _non_zero(isolated_modes(linear_model(float(psi), 0.26, Delta.FULL), PRINTED))
        sizes.add((len(modes), modes == lowest[: len(modes)]))
    nested, counts = all(initial for _, initial in sizes), sorted(size for size, _ in sizes)
    return answer(nested and counts[:2] == [0, 1], nested=nested, counts=counts, largest=counts[-1])


@examines("sA.1.1-k3")
def _first_two() -> RowAnswer:
    crit = [k2_crit(linear_model(95.327, 0.26, delta), version) for delta, version in VERSIONS]
    second, printed, ours = (mode.k**2 for mode in (W21, Mode(0, 1), W02))
    return answer(
        all(second < c < printed for c in crit),
        corrected=all(second < c < ours for c in crit),
        least=min(crit),
        largest=max(crit),
        second=second,
        printed=printed,
        ours=ours,
    )


@examines("sA.1.1-superposition")
def _superposition() -> RowAnswer:
    """Best k^2 for Delta w = -k^2 w and what it leaves: w02 + 2 w21, and w21 alone."""
    x, weights = disk_quadrature()

    def left(parts: dict[Mode, float]) -> float:
        w = sum(c * mode.value(x) for mode, c in parts.items())
        laplacian = -sum(c * mode.k**2 * mode.value(x) for mode, c in parts.items())
        best = float(weights @ (laplacian * w)) / float(weights @ w**2)
        return float(np.sqrt(weights @ (laplacian - best * w) ** 2 / (weights @ laplacian**2)))

    mixed, single = left({W02: 1.0, W21: 2.0}), left({W21: 2.0})
    return answer(mixed < 1e-9, corrected=single < 1e-9 < mixed, mixed=mixed, single=single)


@examines("sA.1.2-hopf")
def _hopf() -> RowAnswer:
    one = borders(0.8, Delta.FULL, PRINTED)
    psi = (one.damped + one.neutral) / 2
    model, rate = linear_model(psi, 0.8, Delta.FULL), leading(psi, 0.8, Delta.FULL, PRINTED)
    modes = _non_zero(modes_below(60.0))
    faster = max(leading(psi, 0.8, Delta.FULL, PRINTED, mode).real for mode in modes)
    b = coefficients(model, W11.k**2, PRINTED)[0]
    return answer(faster > 0, corrected=faster < 0 < rate.imag, psi=psi, rate=rate, b=b, faster=faster)


@examines("sA.1.2-identical")
def _identical_maps() -> RowAnswer:
    printed, ours = (
        [
            borders(p, Delta.NONE, version).neutral - borders(p, Delta.FULL, version).neutral
            for p in (0.26, 0.8, 1.1)
        ]
        for version in (PRINTED, CORRECTED)
    )
    per_p = 2 / np.pi / _slope_at(1.4)
    return answer(max(map(abs, printed)) < 1e-6, printed=printed, ours=ours, per_p=per_p, at_end=1.74 * per_p)


def turns_real(delta: Delta, version: Version) -> tuple[float, float]:
    """Return the p from 0 to 1.74 at which w1,1 at psi = 38.24 turns real, and its least Re lambda."""
    p = np.linspace(0, 1.74, 1741)
    rates = np.array([leading(38.24, float(x), delta, version) for x in p])
    complex_until = int(np.flatnonzero(rates.imag).max())
    monotone = bool((rates.imag[: complex_until + 1] > 0).all())
    return (float(p[complex_until]) if monotone else math.nan), float(rates.real.min())


@examines("sA.1.2-along-p")
def _transition_along_p() -> RowAnswer:
    ring, inner = (turns_real(delta, PRINTED) for delta in (Delta.FULL, Delta.NONE))
    stated = all(0 < p < 1.74 and least > 0 for p, least in (ring, inner))
    return answer(stated, ring=ring, inner=inner, ours=turns_real(Delta.FULL, CORRECTED))


@examines("sA.1.2-along-psi")
def _transition_along_psi() -> RowAnswer:
    found = {(delta, version): borders(0.8, delta, version) for delta, version in VERSIONS}
    inside = all(one.damped > 30 and one.real < 60 for one in found.values())
    tail = all(30 < one.neutral < one.real < 60 for one in found.values())
    inner, ring = (found[delta, PRINTED] for delta in CONSTANT)
    return answer(inside, ring=ring, inner=inner, tail="yes" if tail else "no")


@examines("s5.1.2-isolates")
def _isolates_again() -> RowAnswer:
    alone = set(isolated(38.24, 1.646)) == {(Mode(0, 1), W11)}
    ring = linear_model(38.24, 1.646, Delta.FULL)
    e = {version: stiffness(ring, version) for version in Version}
    fast = growth_rates(ring, np.array([1e2, 1e4, 1e6]))[0].real
    return answer(
        alone and min(e.values()) > 0,
        corrected=alone and e[PRINTED] > 0 > e[CORRECTED] and (fast > 0).all(),
        alone=alone,
        e=e,
        fast=fast,
    )


@examines("s5.1.2-discontinuous")
def _discontinuous() -> RowAnswer:
    inner, ring = (leading(38.24, 1.646, delta, PRINTED) for delta in CONSTANT)
    ours, jump = leading(38.24, 1.646, Delta.FULL, CORRECTED), ring.real - inner.real
    return answer(abs(ring - inner) > 1e-3, inner=inner, ring=ring, ours=ours, jump=jump)


@examines("s5.4-near-rim")
def _near_the_rim() -> RowAnswer:
    """Half-way between the onsets for delta = 1 and 0 at p = 0.26."""
    kinds, width, says = [], {}, []
    for v in Version:
        onsets = [borders(0.26, delta, v).neutral for delta in CONSTANT]
        psi = sum(onsets) / 2
        width[v] = abs(onsets[0] - psi) * 2
        kinds.append([kind(psi, 0.26, delta, v) for delta in CONSTANT])
        says.append(f"ψ = {psi:.3f} ({v}): {kinds[-1][0]} inside, {kinds[-1][1]} near the rim")
    stated = all(pair == ["damped", "oscillatory"] for pair in kinds)
    return answer(stated, says="; ".join(says), width=width)


@examines("s5.4-condition")
def _uniform_condition() -> RowAnswer:
    low, high = (
        sorted(k2_crit(linear_model(70.366, p, delta), version) for delta, version in VERSIONS)
        for p in (0.026, 0.433)
    )
    return answer(True, low=low[0], low_most=low[-1], high=high[0], high_most=high[-1], k2=W21.k**2)


@examines("s5.4-w01")
def _named_w01() -> RowAnswer:
    return answer(True, w01=Mode(0, 1), w02=W02)


@examines("s6-wavenumbers")
def _realistic_wavenumbers() -> RowAnswer:
    inner, ring = (
        float(np.sqrt(k2_crit(replace(REALISTIC_CELL, delta=delta), PRINTED))) for delta in CONSTANT
    )
    zeros, k41 = count_below(inner), Mode(4, 1).k
    rate = growth_rates(REALISTIC_CELL, np.array([k41, W11.k]) ** 2)[0].real
    return answer(
        int(zeros.sum()) > 7 and k41 < inner,
        inner=inner,
        ring=ring,
        wavenumbers=zeros.sum(),
        modes=int(2 * zeros.sum() - zeros[0]),
        k41=k41,
        rate=rate,
    )
