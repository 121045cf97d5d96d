"""Rows of the audit: Figs. 1 to 5, 21 to 23 and the predicted panels of Figs. 6 to 9."""

import math
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from actin_xcheck.core.model import Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Exhibit, Sheet
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.measures import circle, found, rounds_to
from actin_xcheck.studies.audit.theory.tables import INITIAL, components, shown
from actin_xcheck.studies.theory.curves import pictures, plots
from actin_xcheck.studies.theory.regions import maps
from actin_xcheck.theory.dispersion import (
    Version,
    active_slope,
    coefficients,
    growth_rates,
    isolated_modes,
    k2_crit,
    sigma_prime,
    stiffness,
)
from actin_xcheck.theory.modes import Mode

W11, W21, W02 = Mode(1, 1), Mode(2, 1), Mode(0, 2)


@lru_cache
def _atlas() -> dict[str, Exhibit]:
    """The atlas's curves and pictures by key."""
    curves: list[Exhibit] = [*plots(), *pictures()]
    return {one.key: one for one in curves}


def atlas(*keys: str) -> tuple[Exhibit, ...]:
    """Return the atlas's exhibits whose keys begin with one of `keys`."""
    return tuple(one for key, one in _atlas().items() if key.startswith(keys))


def linear_model(psi: float, p: float, delta: Delta) -> Model:
    """Return Table 2's model at another psi and p, delta constant."""
    return Model(Parameters(psi, p), delta=delta)


def kind(model: Model, mode: Mode, version: Version) -> str:
    """Return what a mode does: "stable", "damped" (the article's Hopf), "oscillatory" or "real" (Turing)."""
    rate = growth_rates(model, mode.k**2, version)[0]
    if rate.real < 0:
        return "damped" if rate.imag else "stable"
    return "oscillatory" if rate.imag else "real"


@dataclass(frozen=True)
class Borders:
    """The psi at which a mode starts to oscillate, to grow, and to grow without oscillation."""

    damped: float
    neutral: float
    real: float


def borders(p: float, delta: Delta, mode: Mode, version: Version) -> Borders:
    """Return a mode's borders at pressure p from the double roots of (3.6), proved on either side.

    ArithmeticError where the roots do not change character there.
    """
    still = linear_model(0.0, p, delta)
    par, e = still.parameters, stiffness(still, version)
    decay = par.mu * (1 + par.d * mode.k**2)
    slopes = (math.sqrt(decay) - math.sqrt(e)) ** 2, decay + e, (math.sqrt(decay) + math.sqrt(e)) ** 2
    per_psi, at_rest = sigma_prime(Parameters(1.0, p)), active_slope(still, version)
    psi = [(slope - at_rest) / per_psi for slope in slopes]
    sides = [
        kind(linear_model(at * (1 + shift), p, delta), mode, version) for at in psi for shift in (-1e-6, 1e-6)
    ]
    if sides != ["stable", "damped", "damped", "oscillatory", "oscillatory", "real"]:
        raise ArithmeticError(f"{mode} at p = {p:g}: {sides}")
    return Borders(*psi)


def _contractility() -> Finding:
    model = Model(Parameters(1.0, 0.0, a_sat=1.1))
    a = np.linspace(0, 12, 120001)
    sigma = model.contractility(a)
    peak = float(a[np.argmax(sigma)])
    low, high = (
        float(np.log(sigma[j] / sigma[i]) / np.log(a[j] / a[i])) for i, j in ((100, 101), (1000, 1001))
    )
    late = float(np.log(sigma[-1] / sigma[-2]) / (a[-1] - a[-2]))
    return found(
        Judgement.IN_KIND,
        f"a_sat = 1.1, ψ = 1: σ grows like a^{low:.2f} at a = 0.01 (a^{high:.2f} at 0.1), is largest at a ="
        f" {peak:.4f} (σ = {sigma.max():.4f}) and at a = 12 falls at the rate {late:.3f} (-1/a_sat ="
        f" {-1 / 1.1:.3f}).",
        "Parabolic rise, a critical density 2 a_sat and exponential decrease, as the caption says.",
        holds=abs(low - 2) < 0.02 and abs(peak - 2.2) < 1e-3 and late < -0.7,
        exhibits=atlas("fig01"),
        numbers={"peak": peak, "exponent": low, "late rate": late},
    )


def _pressure() -> Finding:
    model, a = Model(Parameters(0.0, 0.26)), np.linspace(0, 1e4, 100001)
    near, far = (model.pressure(a, 0 * a, delta) for delta in (1.0, 0.0))
    return found(
        Judgement.IN_KIND,
        f"p = 0.26, φ = 0: near the membrane p(a) rises from {near[0]:.3f} to {near[-1]:.3f}, away from it"
        f" stays {far.min():.3f}; l0 = {model.parameters.l0:g}.",
        "A passive part p/(1 + φ) and an active part that at most doubles it, beyond l0 = 0.8.",
        holds=bool((np.diff(near) > 0).all())
        and abs(near[-1] / near[0] - 2) < 1e-3
        and float(np.ptp(far)) == 0,
        exhibits=atlas("fig02"),
        numbers={"at a = 0": float(near[0]), "limit": float(near[-1])},
    )


def _slope() -> Finding:
    grid = np.linspace(0.05, 20, 39901)
    slope = np.array([sigma_prime(Parameters(1.0, 0.0, a_sat=float(s))) for s in grid[::100]])
    zero = float(np.interp(0, slope[grid[::100] > 0.34], grid[::100][grid[::100] > 0.34]))
    least = float(grid[::100][np.argmin(slope)])
    return found(
        Judgement.IN_KIND,
        f"ψ = 1: σ'(1) has its minimum {slope.min():.4f} at a_sat = {least:.2f}, is zero at {zero:.3f}, "
        f"{sigma_prime(Parameters(1.0, 0.0)):.4f} at 1.4 and tends to 2.",
        "Negative below a_sat = 1/2, positive and growing above, as the text says of the figure.",
        holds=abs(zero - 0.5) < 1e-3 and bool((slope[grid[::100] < 0.5] < 1e-12).all()),
        exhibits=atlas("fig03"),
        numbers={"zero": zero, "minimum": float(slope.min())},
    )


def _surface(key: str, parts: dict[Mode, float], initial: str | None = None) -> Finding:
    """A predicted surface: combinations of eigenmodes, and what of them the initial concentration has."""
    x, n, _ = circle()
    flux = max(float(np.abs((n * mode.gradient(x)).sum(axis=0)).max()) for mode in parts)
    rim = sum(factor * mode.value(x) for mode, factor in parts.items())
    centre = sum(factor * float(mode.value(np.zeros((2, 1)))[0]) for mode, factor in parts.items())
    words = (
        f"n·∇w on the rim is {flux:.1e}; the surface is {centre:.4f} in the centre and {np.min(rim):.4f} to "
        f"{np.max(rim):.4f} on the rim."
    )
    reason = "A Neumann eigenmode of A.1." if len(parts) == 1 else "A sum of Neumann eigenmodes of A.1."
    numbers = {"flux": flux, "centre": centre, "rim max": float(np.max(rim))}
    if initial is not None:
        phases = {mode: components(INITIAL[initial], mode) for mode in parts}
        numbers |= {f"{mode} in the initial a": c + s for mode, (c, s) in phases.items()}
        has = ", ".join(f"{mode}: {shown(c)} (cos), {shown(s)} (sin)" for mode, (c, s) in phases.items())
        words += f" The initial a of {initial} contains {has}."
        missing = [str(mode) for mode, pair in phases.items() if max(map(abs, pair)) < 1e-12]
        if missing:
            reason += f" By symmetry the simulation beside it cannot start {', '.join(missing)}."
    return found(Judgement.IN_KIND, words, reason, holds=flux < 1e-12, exhibits=atlas(key), numbers=numbers)


def _selected_surfaces() -> Finding:
    modes = [mode for mode in isolated_modes(linear_model(317.758, 0.26, Delta.NONE)) if mode.k > 0]
    x, n, _ = circle()
    flux = max(float(np.abs((n * mode.gradient(x)).sum(axis=0)).max()) for mode in modes)
    return found(
        Judgement.IN_KIND,
        f"The {len(modes)} modes {', '.join(map(str, modes))} of Table 4's last row have n·∇w = {flux:.1e} on"
        " the rim.",
        "The eigenmodes are those of A.1; which of them the figure shows the text does not say.",
        holds=flux < 1e-12,
        exhibits=atlas("fig05"),
        numbers={"flux": flux},
    )


def _mixed_8a() -> Finding:
    """Fig. 8a against its title in Section 5.3.2: theta_1 = pi/2 turns one into the other."""
    surface = _surface("fig08a", {W02: 1.0, W21: 2.0}, "Fig. 8b, c")
    theta = np.linspace(0, 2 * np.pi, 65)
    x, turned = (np.array([np.cos(t), np.sin(t)]) * 0.7 for t in (theta, theta - np.pi / 2))
    difference = float(
        np.abs(W02.value(turned) + 2 * W21.value(turned) - W02.value(x) + 2 * W21.value(x)).max()
    )
    ratio = surface.numbers["w2,1 in the initial a"] / surface.numbers["w0,2 in the initial a"]
    return found(
        Judgement.IN_KIND,
        f"{surface.computed} Their ratio is {ratio:.2f}. w0,2 + 2w2,1 turned by a quarter and w0,2 - 2w2,1"
        f" (Section 5.3.2) differ by {difference:.1e}.",
        "The two names are one mode with θ1 = 0 and π/2: a turn of the whole picture. The initial a has the "
        "sign of Section 5.3.2's.",
        holds=surface.judgement is Judgement.IN_KIND and difference < 1e-12 and ratio < 0,
        exhibits=surface.exhibits,
        numbers={**surface.numbers, "ratio": ratio, "difference of names": difference},
    )


def _minus_w02() -> Finding:
    surface = _surface("fig05-w0,2", {W02: 1.0})
    w02, _ = components(INITIAL["Fig. 7 (Section 5.1.2)"], W02)
    return found(
        Judgement.IN_KIND,
        f"{surface.computed} 1 + rnd cos x contains {w02 / 1e-3:.4f} rnd of it.",
        "The caption and the text call the panel w0,2, the title -w0,2. The initial "
        "concentration has the opposite sign.",
        holds=surface.judgement is Judgement.IN_KIND and w02 > 0,
        exhibits=surface.exhibits,
        numbers={**surface.numbers, "w0,2 in cos x": w02 / 1e-3},
    )


def _isolating(key: str, psi: float, printed: dict[Mode, tuple[str, str]]) -> Finding:
    """Figs. 21 and 22: which modes have b < 0, and the digits of their k^2 (with those of j'_m,n)."""
    model = linear_model(psi, 0.26, Delta.FULL)
    sets = {version: isolated_modes(model, version) for version in Version}
    alone = all(set(modes) == {Mode(0, 1), *printed} for modes in sets.values())
    digits = all(rounds_to(mode.k**2, text) for mode, (text, _) in printed.items())
    squares = all(rounds_to(float(zero) ** 2, text) for text, zero in printed.values())
    rates = {version: growth_rates(model, W11.k**2, version)[0].real for version in Version}
    k2 = ", ".join(
        f"k²{str(mode)[1:]} = {mode.k**2:.5f} (printed {text})" for mode, (text, _) in printed.items()
    )
    crit = {version: k2_crit(model, version) for version in Version}
    return found(
        Judgement.MISPRINT,
        f"ψ = {psi:g}, p = 0.26, δ = 1: b < 0 up to k² = {crit[Version.AS_PRINTED]:.4f} printed,"
        f" {crit[Version.CORRECTED]:.4f} corrected. {k2}. λ of w1,1 is {rates[Version.AS_PRINTED]:.4f} by the"
        f" printed (3.6), {rates[Version.CORRECTED]:.4f} corrected.",
        f"{' and '.join(map(str, printed))} alone are unstable, printed and corrected. The last digit of k²"
        " is wrong: j'_m,n was rounded to five decimals and then squared. The curves carry (3.3)'s arctan.",
        holds=alone and digits,
        corrected=alone and squares,
        exhibits=atlas(key),
        numbers={
            "k2_crit printed": crit[Version.AS_PRINTED],
            "rate printed": rates[Version.AS_PRINTED],
            "rate": rates[Version.CORRECTED],
        }
        | {f"k2 of {mode}": mode.k**2 for mode in printed},
    )


def _plane() -> Finding:
    """Fig. 23a: the order of its regions along psi at two pressures, and its maps."""
    rows: list[tuple[str, ...]] = [("p", "relation", "mode", "damped from", "grows from", "real from")]
    ordered = []
    for p in (0.26, 0.8):
        for version in Version:
            first, second = (borders(p, Delta.FULL, mode, version) for mode in (W11, W21))
            third = borders(p, Delta.FULL, W02, version)
            ordered.append(first.real < second.neutral and second.real < third.neutral)
            for name, one in (("w1,1", first), ("w2,1", second), ("w0,2", third)):
                rows.append(
                    (f"{p:g}", f"{version}", name, *(f"{x:.3f}" for x in (one.damped, one.neutral, one.real)))
                )
    one, two = (borders(0.26, Delta.FULL, mode, Version.AS_PRINTED) for mode in (W11, W21))
    return found(
        Judgement.IN_KIND,
        f"p = 0.26, δ = 1, printed (3.6): stable to ψ = {one.damped:.2f}, H to {one.neutral:.2f}, OS1 to"
        f" {one.real:.2f}, Turing with w1,1 to {two.neutral:.2f}, OS2 of w2,1 to {two.real:.2f}, then Turing"
        " with both.",
        "The regions come in the caption's order at both pressures, printed and corrected. They are those of"
        " a static wall, not of the moving cell, and corrected they end at p = 1.167, beyond which every mode"
        " grows.",
        holds=all(ordered),
        exhibits=(
            Sheet("fig23a-borders", "Borders of Fig. 23a", "ψ; δ = 1, static wall", tuple(rows)),
            *maps(),
        ),
        numbers={"H": one.damped, "OS1": one.neutral, "T1": one.real, "OS2": two.neutral, "T2": two.real},
    )


def turns_real(delta: Delta, version: Version) -> tuple[float, float]:
    """Return the p from 0 to 1.74 at which w1,1 at psi = 38.24 turns real, and its least Re lambda."""
    p = np.linspace(0, 1.74, 1741)
    rates = np.array([growth_rates(linear_model(38.24, float(x), delta), W11.k**2, version)[0] for x in p])
    complex_until = int(np.flatnonzero(rates.imag).max())
    monotone = bool((rates.imag[: complex_until + 1] > 0).all())
    return (float(p[complex_until]) if monotone else math.nan), float(rates.real.min())


def _along_p(key: str, delta: Delta) -> Finding:
    found_at = {version: turns_real(delta, version) for version in Version}
    (printed, least), (ours, least_ours) = found_at[Version.AS_PRINTED], found_at[Version.CORRECTED]
    c = float(coefficients(linear_model(38.24, 1.74, delta), W11.k**2)[1])
    note = f"Corrected, c < 0 beyond p = 1.167 ({c:.3f} at 1.74), so that every mode grows there."
    if delta is Delta.NONE:
        note = "For δ = 0 (3.6) needs no correction."
    return found(
        Judgement.IN_KIND,
        f"w1,1 at ψ = 38.24 is a growing pair from p = 0 and turns real at p = {printed:.3f} by the printed"
        f" (3.6), {ours:.3f} corrected; Re λ is at least {least:.4f} and {least_ours:.4f}.",
        f"Oscillatory to Turing as p rises from 0 to 1.74. {note}",
        holds=min(least, least_ours) > 0 and 0 < printed < 1.74,
        exhibits=atlas(key),
        numbers={"printed": printed, "corrected": ours, "least Re": least},
    )


THEORY_FIGURES: tuple[Row, ...] = (
    Row(
        "fig01",
        _contractility,
    ),
    Row(
        "fig02",
        _pressure,
    ),
    Row("fig03", _slope),
    Row(
        "fig04",
        partial(_surface, "fig04", {W11: 1.0}),
    ),
    Row(
        "fig05",
        _selected_surfaces,
    ),
    Row(
        "fig06a",
        partial(_surface, "fig04", {W11: 1.0}, "Fig. 6 (Section 5.1.1)"),
    ),
    Row("fig07a", _minus_w02),
    Row(
        "fig08a",
        _mixed_8a,
    ),
    Row(
        "fig08d",
        partial(_surface, "fig08d", {Mode(3, 1): 1.0, W02: -1.0, W21: -3.0}, "Fig. 8e, f"),
    ),
    Row(
        "fig09a",
        partial(_surface, "fig05-w4,1", {Mode(4, 1): 1.0}, "Fig. 9b, c"),
    ),
    Row(
        "fig09d",
        partial(_surface, "fig05-w2,1", {W21: 1.0}, "Fig. 9e, f"),
    ),
    Row(
        "fig21",
        partial(_isolating, "fig21", 62.4, {W11: ("3.38994", "1.84118")}),
    ),
    Row(
        "fig22",
        partial(_isolating, "fig22", 95.327, {W11: ("3.38994", "1.84118"), W21: ("9.32838", "3.05424")}),
    ),
    Row(
        "fig23a",
        _plane,
    ),
    Row(
        "fig23b",
        partial(_along_p, "fig23b", Delta.FULL),
    ),
    Row(
        "fig23c",
        partial(_along_p, "fig23c", Delta.NONE),
    ),
)
