"""Rows of the audit: Tables 1 to 6."""

from dataclasses import replace

import numpy as np

from actin_xcheck.core.model import Delta, Model
from actin_xcheck.core.parameters import DimensionalParameters, Parameters
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.scene.expression import Expression, coordinates
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.measures import disk_quadrature, found, rounds_to
from actin_xcheck.theory.dispersion import Version, isolated_modes, k2_crit
from actin_xcheck.theory.errata import TABLE_4_PRINTED, TABLE_6_PRINTED
from actin_xcheck.theory.modes import Mode, table_6

_PSI, _P = 72.0, 0.3
"""psi (A.1.1) and p (0.26 by (3.1)) in dyn/cm^2; Table 1 gives neither."""

INITIAL = {
    "Fig. 6 (Section 5.1.1)": "1.0009 + 0.001*sin(x)",
    "Fig. 7 (Section 5.1.2)": "1 + 0.001*cos(x)",
    "Fig. 8b, c": "1 + abs(0.1*cos(x))",
    "Fig. 8e, f": "1 + abs(0.1*sin(y)**2)",
    "Fig. 9b, c": "1 + abs(0.1*sin(x)*sin(y))",
    "Fig. 9e, f": "1 + abs(20*0.1*sin(x)*sin(y))",
    "Fig. 9e, f without bars": "1 + 20*0.1*sin(x)*sin(y)",
}
"""The article's initial concentrations; rnd is 1e-3, and the sum's twenty terms are equal."""

_TARGETS = (Mode(1, 1), Mode(0, 2), Mode(2, 1), Mode(3, 1), Mode(4, 1))


def components(formula: str, mode: Mode) -> tuple[float, float]:
    """Coefficients of w_mn and of w_mn turned by pi/(2 m) (its sine phase) in an initial concentration.

    The least-squares coefficients on the unit disk, the uniform part taken off.
    """
    x, weights = disk_quadrature()
    a = Expression(formula, ("x", "y", "r", "theta"))(**coordinates(x))
    a = a - weights @ a / weights.sum()
    cosine = mode.value(x)
    if mode.m == 0:
        return float(weights @ (a * cosine) / mode.norm2), 0.0
    angle = np.pi / (2 * mode.m)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return float(weights @ (a * cosine) / mode.norm2), float(
        weights @ (a * mode.value(turn @ x)) / mode.norm2
    )


def shown(component: float) -> str:
    """Return a component as tables and sentences print it; what round-off leaves of a zero is 0."""
    return "0" if abs(component) < 1e-14 else f"{component:.3e}"


def selection_sheet() -> Sheet:
    """Return the table of every initial concentration's components on the modes the article names."""
    rows = [("initial a", "formula", *(f"{mode}: cos, sin" for mode in _TARGETS))]
    for name, formula in INITIAL.items():
        pairs = [components(formula, mode) for mode in _TARGETS]
        cells = (", ".join(map(shown, pair)) for pair in pairs)
        rows.append((name, formula, *cells))
    return Sheet(
        "selection",
        "Which modes the initial concentrations contain",
        "Coefficients of w_m,n and of its sine phase, by quadrature on the unit disk; 0 is below 1e-14."
        " Components that are zero by symmetry stay zero in every later state.",
        tuple(rows),
    )


def _table_1() -> Finding:
    units = DimensionalParameters(psi=_PSI, p=_P)
    printed = {
        "E": 1.5,
        "nu": 0.3,
        "D_a": 0.012,
        "k_a": 0.03,
        "a_sat": 1.4,
        "mu1": 96.15,
        "mu2": 250,
        "l0": 0.8,
        "a_c": 1.0,
    }
    differing = [name for name, value in printed.items() if getattr(units, name) != value]
    length = float(np.sqrt(units.D_a / (units.k_a * 0.4)))
    return found(
        Judgement.REPRODUCED,
        f"Of {len(printed)} values {len(differing)} differ from the defaults used here. d = 0.4 (Table 2)"
        f" needs L = {length:.4g} cm, which the table does not list.",
        "The values are the ones computed with. Two things do not fit: a cell of radius 1 cm, and a_sat = 1.4"
        " credited to Stephanou et al. (2004), of whom Section 3.2 says that they used 1.1.",
        holds=not differing and abs(length - units.L) < 1e-9,
        numbers={"differences": len(differing), "L": length},
    )


def _table_2() -> Finding:
    groups = DimensionalParameters(psi=_PSI, p=_P).non_dimensional()
    printed = {
        "d": "0.4",
        "a_sat": "1.4",
        "mu1": "2.5",
        "mu2": "6.5",
        "psi": "62.4",
        "p": "0.26",
        "l0": "0.8",
    }
    wrong = [name for name, text in printed.items() if not rounds_to(getattr(groups, name), text)]
    rows = (
        ("group", "Table 2", "(3.1) of Table 1"),
        *((name, text, f"{getattr(groups, name):.6g}") for name, text in printed.items()),
    )
    return found(
        Judgement.REPRODUCED,
        f"(3.1) of Table 1 with L = 1 cm, ψ = 72 and p = 0.3 dyn/cm²: μ1 = {groups.mu1:.4f}, all seven to the"
        f" digits printed but {len(wrong)}.",
        "The note says all were obtained by (3.1) from their dimensional counterparts; those of ψ and p, 72"
        " and 0.3, are not in Table 1.",
        holds=not wrong,
        exhibits=(Sheet("table2", "Table 2 from Table 1", "L = 1 cm", rows),),
        numbers={"mu1": groups.mu1, "mu2": groups.mu2, "d": groups.d},
    )


def _table_3() -> Finding:
    """Signs of Re lambda on a random sample of (b, c), mu = 9."""
    b, c = np.random.default_rng(0).normal(size=(2, 4000))
    root = np.sqrt((b**2 - 36 * c).astype(complex))
    leading = np.maximum(((-b + root) / 18).real, ((-b - root) / 18).real)
    exceptions = {
        "b > 0, c > 0": int((leading[(b > 0) & (c > 0)] >= 0).sum()),
        "b > 0, c < 0": int((leading[(b > 0) & (c < 0)] <= 0).sum()),
        "b < 0, c > 0": int((leading[(b < 0) & (c > 0)] <= 0).sum()),
        "b < 0, c < 0": int((leading[(b < 0) & (c < 0)] <= 0).sum()),
    }
    both = ((-b[c < 0] + root[c < 0]) / 18).real * ((-b[c < 0] - root[c < 0]) / 18).real
    return found(
        Judgement.REPRODUCED,
        "Exceptions among 4000 random (b, c): "
        + ", ".join(f"{n} for {case}" for case, n in exceptions.items())
        + ".",
        "The four cases of Routh and Hurwitz. Where c < 0 one root is positive and the other negative "
        f"({int((both >= 0).sum())} exceptions); 'stable' needs b > 0 and c > 0 at every wave number.",
        holds=not any(exceptions.values()) and not (both >= 0).any(),
        numbers={case: n for case, n in exceptions.items()},
    )


def _names(modes: tuple[Mode, ...]) -> str:
    return ", ".join(str(mode) for mode in modes)


def _table_4() -> Finding:
    rows, wrong, digits = (
        [("ψ", "ψ (dyn/cm²)", "printed", "b < 0", "k²_crit, δ = 0 and 1", "first k² above")],
        [],
        [],
    )
    units = DimensionalParameters(psi=1.0, p=0.3)
    for row in TABLE_4_PRINTED:
        sets = {
            isolated_modes(row.model(delta), version)
            for delta in (Delta.NONE, Delta.FULL)
            for version in Version
        }
        if sets != {row.modes}:
            wrong.append(row)
        # both columns are rounded: some psi must round to both
        dimensional = row.psi / units.non_dimensional().psi
        digits.append(abs(dimensional - row.psi_dimensional) <= 0.0005 + 0.0005 / units.non_dimensional().psi)
        crit = [k2_crit(row.model(delta), Version.AS_PRINTED) for delta in (Delta.NONE, Delta.FULL)]
        isolated = isolated_modes(row.model(Delta.NONE), Version.AS_PRINTED)
        above = isolated_modes(replace(row.model(Delta.NONE), parameters=Parameters(2 * row.psi, 0.26)))[
            len(isolated)
        ]
        rows.append(
            (
                f"{row.psi:g}",
                f"{row.psi_dimensional:g}",
                _names(row.modes),
                _names(isolated),
                f"{crit[0]:.4f}, {crit[1]:.4f}",
                f"{above.k**2:.4f}",
            )
        )
    which = ", ".join(f"{row.psi:g}" for row in wrong)
    corrected = all(
        set(isolated_modes(row.model(Delta.FULL)))
        == set(isolated_modes(row.model(Delta.NONE), Version.AS_PRINTED))
        for row in TABLE_4_PRINTED
    )
    return found(
        Judgement.MISPRINT,
        f"{len(wrong)} of {len(TABLE_4_PRINTED)} rows do not list the modes with b(k²) < 0 by (3.8): ψ ="
        f" {which}. The dimensional column agrees with (3.1) in {sum(digits)} rows.",
        "131.869 and 317.758 also have w3,1 and w0,3; 174.767 does not have w4,1. The lists are the same for "
        "δ = 0 and 1, printed and corrected. All rows count w0,1 (k = 0), for which (3.6) is void: it"
        " decays.",
        holds=not wrong and all(digits),
        corrected=len(wrong) == 3 and corrected and all(digits),
        exhibits=(Sheet("table4", "Table 4 by (3.8)", "p = 0.26", tuple(rows)),),
        numbers={"wrong rows": len(wrong)},
    )


def _table_5() -> Finding:
    """Psi against Table 4, and what the initial concentrations can excite."""
    units = DimensionalParameters(psi=1.0, p=0.3).non_dimensional()
    psi = {"3.1e2": 311.647, "2.0e2": 201.654, "3.67e2": 366.643, "1.1e2": 109.993}
    rounded = [printed for printed, exact in psi.items() if rounds_to(exact, printed)]
    isolates = {
        text: isolated_modes(Model(Parameters(float(text) * units.psi, 0.26), delta=Delta.NONE))
        for text in psi
    }
    w21 = max(map(abs, components(INITIAL["Fig. 9e, f"], Mode(2, 1))))
    w31 = max(map(abs, components(INITIAL["Fig. 8e, f"], Mode(3, 1))))
    without = components(INITIAL["Fig. 9e, f without bars"], Mode(2, 1))[1]
    w41 = components(INITIAL["Fig. 9b, c"], Mode(4, 1))[0]
    w02, w21_cos = (components(INITIAL["Fig. 8b, c"], Mode(m, n))[0] for m, n in ((0, 2), (2, 1)))
    numbers = {
        "w2,1 in Fig. 9e": w21,
        "w3,1 in Fig. 8e": w31,
        "w2,1 without bars": without,
        "w4,1 in Fig. 9b": w41,
        "w2,1 over w0,2 in Fig. 8b": w21_cos / w02,
    }
    return found(
        Judgement.MISPRINT,
        f"1 + |Σ 0.1 sin x sin y| (Fig. 9e, for w2,1) has |w2,1| = {w21:.1e} in either phase; without the"
        f" bars {without:.3f} (sine phase). 1 + |0.1 sin²y| (Fig. 8e, for w3,1 - w0,2 - 3w2,1) has |w3,1| ="
        f" {w31:.1e}. Fig. 9b's has w4,1 ({w41:.2e}), Fig. 8b's w2,1/w0,2 = {w21_cos / w02:.2f}. ψ is Table"
        f" 4's to the digits printed in {len(rounded)} of 4 rows; ψ = 110 isolates"
        f" {_names(isolates['1.1e2'])}.",
        "|sin x sin y| is unchanged by quarter turns and sin²y by x → -x: components without that symmetry"
        " are zero and stay zero. Fig. 9e as named needs Σ 0.1 sin x sin y without bars; Fig. 8e cannot start"
        " w3,1. The caption says Fig. 8 for Figs. 8 and 9.",
        holds=min(w21, w31) > 1e-12,
        corrected=max(w21, w31) < 1e-12 < abs(without) and len(rounded) == 4 and abs(w41) > 1e-12,
        exhibits=(selection_sheet(),),
        numbers=numbers,
    )


def _table_6() -> Finding:
    exact = table_6()
    off = [
        (m, n, printed, float(exact[n - 1, m]))
        for n, row in enumerate(TABLE_6_PRINTED, start=1)
        for m, printed in enumerate(row)
        if not rounds_to(float(exact[n - 1, m]), f"{printed:.5f}")
    ]
    cut = all(np.floor(value * 1e5) == round(printed * 1e5) for _, _, printed, value in off)
    listed = "; ".join(f"j'_{m},{n} = {value:.8f}, printed {printed:.5f}" for m, n, printed, value in off)
    entries = sum(map(len, TABLE_6_PRINTED))
    return found(
        Judgement.MISPRINT,
        f"{entries - len(off)} of {entries} zeros agree to the five decimals printed. The others: {listed}.",
        "These three are cut off instead of rounded, all in the column m = 0.",
        holds=not off,
        corrected=bool(off) and cut,
        numbers={
            "entries off": len(off),
            "largest difference": float(np.abs(exact - np.array(TABLE_6_PRINTED)).max()),
        },
    )


TABLES: tuple[Row, ...] = (
    Row(
        "table1",
        _table_1,
    ),
    Row(
        "table2",
        _table_2,
    ),
    Row(
        "table3",
        _table_3,
    ),
    Row(
        "table4",
        _table_4,
    ),
    Row(
        "table5",
        _table_5,
    ),
    Row("table6", _table_6),
)
