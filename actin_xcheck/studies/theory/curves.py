"""The article's theoretical figures as data: Figs. 1 to 5 and 21 to 23b, c, as printed and corrected."""

import numpy as np

from actin_xcheck.core.model import Array, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Line, Picture, Plot
from actin_xcheck.theory.dispersion import Version, coefficients, growth_rates, printed_3_7, sigma_prime
from actin_xcheck.theory.eigenfields import eigenfield
from actin_xcheck.theory.errata import TABLE_4_PRINTED
from actin_xcheck.theory.modes import wavenumber

RADII, ANGLES = np.linspace(0, 1, 41), np.linspace(0, 2 * np.pi, 97)
"""The polar grid pictures are given on."""

_P_MAX = 1.74
"""Where Fig. 23b, c ends."""


def _first() -> tuple[tuple[str, float], ...]:
    """The least wave numbers on a static wall, squared."""
    return tuple((f"k²{m},{n}", wavenumber(m, n) ** 2) for m, n in ((1, 1), (2, 1), (0, 2), (3, 1)))


def plots() -> list[Plot]:
    """Return Figs. 1, 2, 3, 21, 22, 23b and 23c as curves."""
    relations = [
        plot
        for key, psi, words in (
            ("fig21", 62.4, "k²1,1 is the only unstable wave number"),
            ("fig22", 95.327, "the first two"),
        )
        for plot in _relation(key, Model(Parameters(psi, 0.26), delta=Delta.FULL), words)
    ]
    along_p = [
        _along_p("fig23b", "Fig. 23b", Delta.FULL),
        _along_p("fig23c", "Fig. 23c", Delta.NONE),
    ]
    return [_contractility(), _pressure(), _slope(), *relations, *along_p]


def _contractility() -> Plot:
    a = np.linspace(0, 8, 201)
    lines = tuple(
        Line(f"a_sat = {a_sat:g}", a, Model(Parameters(1.0, 0.0, a_sat=a_sat)).contractility(a))
        for a_sat in (1.1, 1.4)
    )
    note = "ψ = 1; a_sat = 1.1 as in the caption, 1.4 as in Table 2; largest at a = 2 a_sat"
    return Plot("fig01", "Fig. 1: contractility σ(a) (2.2)", note, "a", lines)


def _pressure() -> Plot:
    a, model = np.linspace(0, 8, 201), Model(Parameters(0.0, 0.26))
    lines = tuple(
        Line(f"δ = {delta:g}", a, model.pressure(a, np.zeros_like(a), delta) + 0 * a) for delta in (1.0, 0.0)
    )
    return Plot("fig02", "Fig. 2: pressure p(a) (2.5)", "p = 0.26, without dilation", "a", lines)


def _slope() -> Plot:
    a_sat = np.linspace(0.1, 5, 201)
    slope = np.array([sigma_prime(Parameters(1.0, 0.0, a_sat=float(x))) for x in a_sat])
    note = "ψ = 1; no contraction instability left of a_sat = 1/2"
    return Plot("fig03", "Fig. 3: σ′(1) (3.9)", note, "a_sat", (Line("σ′(1)", a_sat, slope),))


def _relation(key: str, model: Model, words: str) -> list[Plot]:
    """The coefficients and both roots of (3.6) over k^2."""
    k2, par = np.linspace(0.05, 20, 400), model.parameters
    where = f"ψ = {par.psi:g}, p = {par.p:g}, δ = 1: {words} as printed"
    name = f"Fig. {key.removeprefix('fig')}"
    pieces = {version: coefficients(model, k2, version) for version in Version}
    curves = tuple(
        Line(f"{symbol}, {version}", k2, value)
        for version, values in pieces.items()
        for symbol, value in zip("bc", values, strict=True)
    )
    rates = {str(version): growth_rates(model, k2, version)[0] for version in Version}
    # it diverges towards k = 0, which would leave no room for the others
    rates["(3.7) as printed, k² > 1.5"] = np.where(k2 > 1.5, printed_3_7(model, k2)[0], np.nan)
    return [
        Plot(f"{key}a", f"{name}a: b and c of (3.6)", where, "k²", curves, _first()),
        *(
            Plot(
                f"{key}b-{part}",
                f"{name}b: {part} λ, the leading root",
                where,
                "k²",
                tuple(Line(label, k2, getattr(rate, attribute)) for label, rate in rates.items()),
                _first(),
            )
            for part, attribute in (("Re", "real"), ("Im", "imag"))
        ),
    ]


def _along_p(key: str, name: str, delta: Delta) -> Plot:
    """Re and Im of w_11's leading rate at psi = 38.24 over p."""
    p, k2 = np.linspace(0, _P_MAX, 349), wavenumber(1, 1) ** 2

    def rates(version: Version) -> Array:
        return np.array(
            [growth_rates(Model(Parameters(38.24, float(x)), delta=delta), k2, version)[0] for x in p]
        )

    lines = []
    for version in Version:
        found = rates(version)
        lines += [Line(f"Re, {version}", p, found.real), Line(f"Im, {version}", p, found.imag)]
    note = f"w1,1 at ψ = 38.24, δ = {1 if delta is Delta.FULL else 0}"
    return Plot(key, f"{name}: λ over p", note, "p", tuple(lines))


def pictures() -> list[Picture]:
    """Return Fig. 4 (w_11), Fig. 5's modes and mixtures, and exact modes of the moving cell at psi = 270."""
    r, theta = np.meshgrid(RADII, ANGLES, indexing="ij")
    x = np.array([(r * np.cos(theta)).ravel(), (r * np.sin(theta)).ravel()])

    def on_grid(values: Array) -> Array:
        return values.reshape(r.shape)

    w = {str(mode): on_grid(mode.value(x)) for mode in TABLE_4_PRINTED[-1].modes if mode.k > 0}
    also = {"w0,2": ", 7a", "w4,1": ", 9a", "w2,1": ", 9d"}
    shown = [
        Picture("fig04", "Fig. 4: w1,1", w.pop("w1,1")),
        *(
            Picture(f"fig05-{name}", f"Fig. 5{also.get(name, '')}: {name}", values)
            for name, values in w.items()
        ),
    ]
    w02, w21, w31 = w["w0,2"], w["w2,1"], w["w3,1"]
    shown += [
        Picture("fig08a", "Fig. 8a: w0,2 + 2 w2,1", w02 + 2 * w21),
        Picture("fig08d", "Fig. 8d: w3,1 − w0,2 − 3 w2,1", w31 - w02 - 3 * w21),
    ]
    cell = Model(Parameters(270.0, 0.0), delta=Delta.NONE)
    return shown + [
        Picture(f"cell-{m}", f"moving cell, m = {m}: λ = {_rate(field.rate)}", on_grid(field.a(x)))
        for m in range(3)
        for field in [eigenfield(cell, m, 1)]
    ]


def _rate(rate: complex) -> str:
    return f"{rate.real:.4f}" + (f" ± {rate.imag:.4f}i" if rate.imag else "")
