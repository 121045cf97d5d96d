"""Rows of the audit: Tables 1 to 6, Figs. 1 to 5, 21 to 23, predicted panels of Figs. 6 to 9, times."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from actin_xcheck.core.model import Array, Delta, Model
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.report.exhibits import Exhibit, Sheet
from actin_xcheck.scene.expression import Expression, coordinates
from actin_xcheck.studies.audit import RowAnswer, answer, article, examines
from actin_xcheck.studies.audit.linear import (
    CONSTANT,
    CORRECTED,
    PRINTED,
    W02,
    W11,
    W21,
    borders,
    isolated,
    leading,
    linear_model,
)
from actin_xcheck.studies.audit.sample import circle, disk_quadrature, rounds_to
from actin_xcheck.studies.audit.stability import turns_real
from actin_xcheck.studies.theory.figures import maps, pictures, plots
from actin_xcheck.theory.dispersion import (
    Mode,
    Version,
    coefficients,
    isolated_modes,
    k2_crit,
    modes_below,
    sigma_prime,
    table_6,
)
from actin_xcheck.theory.errata import TABLE_4_PRINTED, TABLE_6_PRINTED, Table4Row

_UNITS = DimensionalParameters(psi=72.0, p=0.3)
"""psi (A.1.1) and p (0.26 by (3.1)) in dyn/cm^2; Table 1 gives neither."""


@lru_cache
def _atlas() -> dict[str, Exhibit]:
    """The atlas's curves and pictures by key."""
    curves: list[Exhibit] = [*plots(), *pictures()]
    return {one.key: one for one in curves}


def atlas(key: str) -> tuple[Exhibit, ...]:
    """Return the atlas's exhibits whose keys begin with `key`."""
    return tuple(one for name, one in _atlas().items() if name.startswith(key))


def components(formula: str, mode: Mode) -> tuple[float, float]:
    """Coefficients of w_mn and of w_mn turned by pi/(2 m) (its sine phase) in an initial concentration.

    The least-squares coefficients on the unit disk, the uniform part taken off.
    """
    x, weights = disk_quadrature()
    a = Expression(formula, ("x", "y", "r", "theta"))(**coordinates(x))
    a = a - weights @ a / weights.sum()

    def coefficient(w: Array) -> float:
        return float(weights @ (a * w) / mode.norm2)

    if mode.m == 0:
        return coefficient(mode.value(x)), 0.0
    angle = np.pi / (2 * mode.m)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return coefficient(mode.value(x)), coefficient(mode.value(turn @ x))


def _initial(name: str) -> str:
    """The article's initial concentration for a figure; Table 5's row has them all."""
    return str(article()["table5"]["given"]["initial"][name])


def _shown(component: float) -> str:
    """A component as tables and sentences print it; what round-off leaves of a zero is 0."""
    return "0" if abs(component) < 1e-14 else f"{component:.3e}"


@examines("table1")
def _table_1(printed: dict[str, float]) -> RowAnswer:
    differing = [name for name, value in printed.items() if getattr(_UNITS, name) != value]
    length = float(np.sqrt(_UNITS.D_a / (_UNITS.k_a * 0.4)))
    same = not differing and abs(length - _UNITS.L) < 1e-9
    return answer(same, count=len(printed), differing=len(differing), length=length)


@examines("table2")
def _table_2(printed: dict[str, str]) -> RowAnswer:
    groups = _UNITS.non_dimensional()
    wrong = [name for name, text in printed.items() if not rounds_to(getattr(groups, name), text)]
    rows = [("group", "Table 2", "(3.1) of Table 1")]
    rows += ((name, text, f"{getattr(groups, name):.6g}") for name, text in printed.items())
    sheet = Sheet("table2", "Table 2 from Table 1", "L = 1 cm", tuple(rows))
    return answer(not wrong, exhibits=(sheet,), groups=groups, wrong=len(wrong))


@examines("table3")
def _table_3() -> RowAnswer:
    """Signs of Re lambda on a random sample of (b, c), mu = 9."""
    b, c = np.random.default_rng(0).normal(size=(2, 4000))
    root = np.sqrt((b**2 - 36 * c).astype(complex))
    one, other = ((-b + root) / 18).real, ((-b - root) / 18).real
    grows = np.maximum(one, other)
    exceptions = {
        "b > 0, c > 0": int((grows[(b > 0) & (c > 0)] >= 0).sum()),
        "b > 0, c < 0": int((grows[(b > 0) & (c < 0)] <= 0).sum()),
        "b < 0, c > 0": int((grows[(b < 0) & (c > 0)] <= 0).sum()),
        "b < 0, c < 0": int((grows[(b < 0) & (c < 0)] <= 0).sum()),
    }
    both = int(((one * other)[c < 0] >= 0).sum())
    return answer(not any(exceptions.values()) and not both, exceptions=exceptions, both=both)


def _names(modes: tuple[Mode, ...]) -> str:
    return ", ".join(map(str, modes))


def _table_4_row(row: Table4Row) -> tuple[str, ...]:
    """What (3.8) gives beside a row of Table 4."""
    crit = [k2_crit(row.model(delta), PRINTED) for delta in CONSTANT]
    found = isolated_modes(row.model(Delta.NONE), PRINTED)
    above = isolated_modes(linear_model(2 * row.psi, 0.26, Delta.NONE))[len(found)]
    printed = f"{row.psi:g}", f"{row.psi_dimensional:g}", _names(row.modes)
    return *printed, _names(found), f"{crit[0]:.4f}, {crit[1]:.4f}", f"{above.k**2:.4f}"


@examines("table4")
def _table_4() -> RowAnswer:
    sets = {row.psi: isolated(row.psi, 0.26) for row in TABLE_4_PRINTED}
    wrong = [f"{row.psi:g}" for row in TABLE_4_PRINTED if set(sets[row.psi]) != {row.modes}]
    per_unit = DimensionalParameters(psi=1.0, p=0.3).non_dimensional().psi
    # both columns are rounded: some psi must round to both
    off = 0.0005 + 0.0005 / per_unit
    digits = [abs(row.psi / per_unit - row.psi_dimensional) <= off for row in TABLE_4_PRINTED]
    agree = all(len(set(found)) == 1 for found in sets.values())
    head = ("ψ", "ψ (dyn/cm²)", "printed", "b < 0", "k²_crit, δ = 0 and 1", "first k² above")
    sheet = Sheet("table4", "Table 4 by (3.8)", "p = 0.26", (head, *map(_table_4_row, TABLE_4_PRINTED)))
    return answer(
        not wrong and all(digits),
        corrected=len(wrong) == 3 and agree and all(digits),
        exhibits=(sheet,),
        wrong=len(wrong),
        count=len(TABLE_4_PRINTED),
        which=wrong,
        digits=sum(digits),
    )


@examines("table5")
def _table_5(psi: dict[str, float], initial: dict[str, str]) -> RowAnswer:
    """Psi against Table 4, and what the initial concentrations can excite."""
    rounded = [printed for printed, exact in psi.items() if rounds_to(exact, printed)]
    scale = DimensionalParameters(psi=1.0, p=0.3).non_dimensional().psi
    names = _names(isolated_modes(linear_model(110 * scale, 0.26, Delta.NONE)))
    w21 = max(map(abs, components(initial["Fig. 9e, f"], W21)))
    w31 = max(map(abs, components(initial["Fig. 8e, f"], Mode(3, 1))))
    without = components(initial["Fig. 9e, f without bars"], W21)[1]
    w41 = components(initial["Fig. 9b, c"], Mode(4, 1))[0]
    ratio = components(initial["Fig. 8b, c"], W21)[0] / components(initial["Fig. 8b, c"], W02)[0]
    targets = (W11, W02, W21, Mode(3, 1), Mode(4, 1))
    rows = [("initial a", "formula", *(f"{mode}: cos, sin" for mode in targets))]
    for name, formula in initial.items():
        pairs = (components(formula, mode) for mode in targets)
        rows.append((name, formula, *(", ".join(map(_shown, pair)) for pair in pairs)))
    note = (
        "Coefficients of w_m,n and of its sine phase, by quadrature on the unit disk; 0 is below 1e-14."
        " Components that are zero by symmetry stay zero in every later state."
    )
    return answer(
        min(w21, w31) > 1e-12,
        corrected=max(w21, w31) < 1e-12 < min(abs(without), abs(w41)) and len(rounded) == len(psi),
        exhibits=(Sheet("selection", "Which modes the initial concentrations contain", note, tuple(rows)),),
        w21=w21,
        w31=w31,
        without=without,
        w41=w41,
        ratio=ratio,
        rounded=len(rounded),
        names=names,
    )


@examines("table6")
def _table_6() -> RowAnswer:
    exact = table_6()
    off = [
        (m, n, printed, float(exact[n - 1, m]))
        for n, row in enumerate(TABLE_6_PRINTED, start=1)
        for m, printed in enumerate(row)
        if not rounds_to(float(exact[n - 1, m]), f"{printed:.5f}")
    ]
    cut = all(np.floor(value * 1e5) == round(printed * 1e5) for _, _, printed, value in off)
    entries = sum(map(len, TABLE_6_PRINTED))
    return answer(
        not off,
        corrected=bool(off) and cut,
        right=entries - len(off),
        entries=entries,
        listed="; ".join(f"j'_{m},{n} = {value:.8f}, printed {text:.5f}" for m, n, text, value in off),
        off=len(off),
        largest=np.abs(exact - np.array(TABLE_6_PRINTED)).max(),
    )


@examines("fig01")
def _contractility() -> RowAnswer:
    a = np.linspace(0, 12, 120001)
    sigma = Model(Parameters(1.0, 0.0, a_sat=1.1)).contractility(a)
    peak = float(a[np.argmax(sigma)])
    low, high = (np.log(sigma[j] / sigma[i]) / np.log(a[j] / a[i]) for i, j in ((100, 101), (1000, 1001)))
    late = np.log(sigma[-1] / sigma[-2]) / (a[-1] - a[-2])
    return answer(
        abs(low - 2) < 0.02 and abs(peak - 2.2) < 1e-3 and late < -0.7,
        exhibits=atlas("fig01"),
        low=low,
        high=high,
        peak=peak,
        largest=sigma.max(),
        late=late,
        expected=-1 / 1.1,
    )


@examines("fig02")
def _pressure() -> RowAnswer:
    model, a = Model(Parameters(0.0, 0.26)), np.linspace(0, 1e4, 100001)
    near, far = (model.pressure(a, 0 * a, delta) for delta in (1.0, 0.0))
    stated = (np.diff(near) > 0).all() and abs(near[-1] / near[0] - 2) < 1e-3 and np.ptp(far) == 0
    values = {"start": near[0], "limit": near[-1], "far": far.min(), "l0": model.parameters.l0}
    return answer(stated, exhibits=atlas("fig02"), **values)


@examines("fig03")
def _slope() -> RowAnswer:
    grid = np.linspace(0.05, 20, 39901)[::100]
    slope = np.array([sigma_prime(Parameters(1.0, 0.0, a_sat=float(s))) for s in grid])
    zero = float(np.interp(0, slope[grid > 0.34], grid[grid > 0.34]))
    return answer(
        abs(zero - 0.5) < 1e-3 and (slope[grid < 0.5] < 1e-12).all(),
        exhibits=atlas("fig03"),
        minimum=slope.min(),
        least=grid[np.argmin(slope)],
        zero=zero,
        sigma=sigma_prime(Parameters(1.0, 0.0)),
    )


@examines("fig04", "fig06a", "fig08d", "fig09a", "fig09d")
def _surface(
    picture: str, parts: dict[str, float], initial: str = "", missing: tuple[str, ...] = ()
) -> RowAnswer:
    """A predicted surface, a sum of eigenmodes, and which of them the initial concentration has or lacks."""
    modes = {Mode.named(name): factor for name, factor in parts.items()}
    rim = sum(factor * mode.value(circle()[0]) for mode, factor in modes.items())
    centre = sum(factor * float(mode.value(np.zeros((2, 1)))[0]) for mode, factor in modes.items())
    phases = {str(mode): components(_initial(initial), mode) for mode in modes} if initial else {}
    lacking = [name for name, pair in phases.items() if max(map(abs, pair)) < 1e-12]
    flux = _flux(modes)
    return answer(
        flux < 1e-12 and lacking == list(missing),
        exhibits=atlas(picture),
        flux=flux,
        centre=centre,
        least=np.min(rim),
        most=np.max(rim),
        has={name: tuple(map(_shown, pair)) for name, pair in phases.items()},
        sums={name: cosine + sine for name, (cosine, sine) in phases.items()},
    )


def _flux(modes: Iterable[Mode]) -> float:
    """Largest |n . grad w| on the rim."""
    x, n, _ = circle()
    return max(float(np.abs((n * mode.gradient(x)).sum(axis=0)).max()) for mode in modes)


@examines("fig05")
def _selected_surfaces() -> RowAnswer:
    modes = [mode for mode in isolated_modes(linear_model(317.758, 0.26, Delta.NONE)) if mode.k > 0]
    flux = _flux(modes)
    return answer(flux < 1e-12, exhibits=atlas("fig05"), count=len(modes), modes=modes, flux=flux)


@examines("fig07a")
def _minus_w02(**given: Any) -> RowAnswer:
    surface = _surface(**given)
    per_rnd = surface.values["sums"]["w0,2"] / 1e-3
    return replace(
        surface, holds=surface.holds and per_rnd > 0, values={**surface.values, "per_rnd": per_rnd}
    )


@examines("fig08a")
def _mixed_8a(**given: Any) -> RowAnswer:
    """Fig. 8a against its title in Section 5.3.2: theta_1 = pi/2 turns one into the other."""
    surface = _surface(**given)
    theta = np.linspace(0, 2 * np.pi, 65)
    x, turned = (np.array([np.cos(t), np.sin(t)]) * 0.7 for t in (theta, theta - np.pi / 2))
    off = W02.value(turned) + 2 * W21.value(turned) - W02.value(x) + 2 * W21.value(x)
    difference = float(np.abs(off).max())
    sums = surface.values["sums"]
    ratio = sums["w2,1"] / sums["w0,2"]
    holds = surface.holds and difference < 1e-12 and ratio < 0
    return replace(surface, holds=holds, values={**surface.values, "ratio": ratio, "difference": difference})


@examines("fig21", "fig22")
def _isolating(picture: str, psi: float, printed: dict[str, tuple[str, str]]) -> RowAnswer:
    """Which modes have b < 0, and the digits of their k^2 (with those of j'_m,n)."""
    modes = {Mode.named(name): texts for name, texts in printed.items()}
    alone = all(set(found) == {Mode(0, 1), *modes} for found in isolated(psi, 0.26))
    digits = all(rounds_to(mode.k**2, text) for mode, (text, _) in modes.items())
    squares = all(rounds_to(float(zero) ** 2, text) for text, zero in modes.values())
    return answer(
        alone and digits,
        corrected=alone and squares,
        exhibits=atlas(picture),
        crit={version: k2_crit(linear_model(psi, 0.26, Delta.FULL), version) for version in Version},
        rates={version: leading(psi, 0.26, Delta.FULL, version).real for version in Version},
        k2={str(mode): mode.k**2 for mode in modes},
        digits={f"{mode.m},{mode.n}": (mode.k**2, text) for mode, (text, _) in modes.items()},
        names=" and ".join(printed),
    )


@examines("fig23a")
def _plane() -> RowAnswer:
    """The order of its regions along psi at two pressures, and its maps."""
    rows: list[tuple[str, ...]] = [("p", "relation", "mode", "damped from", "grows from", "real from")]
    ordered = []
    for p, version in product((0.26, 0.8), Version):
        found = {mode: borders(p, Delta.FULL, version, mode) for mode in (W11, W21, W02)}
        first, second, third = found.values()
        ordered.append(first.real < second.neutral and second.real < third.neutral)
        for mode, one in found.items():
            cells = (f"{x:.3f}" for x in (one.damped, one.neutral, one.real))
            rows.append((f"{p:g}", f"{version}", f"{mode}", *cells))
    sheet = Sheet("fig23a-borders", "Borders of Fig. 23a", "ψ; δ = 1, static wall", tuple(rows))
    one, two = (borders(0.26, Delta.FULL, PRINTED, mode) for mode in (W11, W21))
    return answer(all(ordered), exhibits=(sheet, *maps()), one=one, two=two)


@examines("fig23b", "fig23c")
def _along_p(picture: str, delta: str) -> RowAnswer:
    (printed, least), (ours, least_ours) = (turns_real(Delta(delta), one) for one in (PRINTED, CORRECTED))
    return answer(
        min(least, least_ours) > 0 and 0 < printed < 1.74,
        exhibits=atlas(picture),
        printed=printed,
        ours=ours,
        least=least,
        least_ours=least_ours,
        c=coefficients(linear_model(38.24, 1.74, Delta(delta)), W11.k**2)[1],
    )


@examines("s5.1.2-encouraged")
def _encouraged(initial: str) -> RowAnswer:
    w02, w21 = (components(_initial(initial), mode)[0] / 1e-3 for mode in (W02, W21))
    modes = [mode for mode in modes_below(6.0) if mode.k > 0]
    holds = w02 < 0 and abs(w02) > abs(w21) and modes[0] == W02
    return answer(holds, w02=w02, w21=w21, lowest=modes[0], number=1 + modes.index(W02))


@examines("s5-times")
def _times(times: list[tuple[str, str, float, int]]) -> RowAnswer:
    """Printed times against the step of their runs and the number of steps, 0 where it is not printed."""
    rows, wrong = [("where", "printed t", "Δt", "steps", "n Δt")], []
    for where, text, dt, printed in times:
        steps = printed or round(float(text) / dt)
        if not (rounds_to(steps * dt, text) or _cut(steps * dt, text)):
            wrong.append((text, steps, steps * dt))
        rows.append(
            (where, text, f"{dt:g}", f"{steps}{'' if printed else ' (nearest)'}", f"{steps * dt:.6f}")
        )
    return answer(
        not wrong,
        corrected=len(wrong) == 1 and rounds_to(wrong[0][2], "0.1493"),
        exhibits=(Sheet("times", "Printed times and steps", "", tuple(rows)),),
        right=len(times) - len(wrong),
        count=len(times),
        listed=", ".join(f"{text} for n = {steps}, which is t = {t:.4f}" for text, steps, t in wrong),
        wrong=len(wrong),
    )


def _cut(value: float, printed: str) -> bool:
    """Whether a value, cut off after the digits of a printed number, is that number."""
    digits = len(printed.split("e")[0].split(".")[1])
    scale = 10.0 ** (int(printed.split("e")[1]) if "e" in printed else 0)
    return 0 <= value / scale - float(printed) / scale < 10.0**-digits
