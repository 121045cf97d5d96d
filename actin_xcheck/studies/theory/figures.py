"""The article's theoretical figures as data: Figs. 1 to 5 and 21 to 23, as printed and corrected.

Fig. 23a is the (psi, p) plane by what the marginal mode does: printed, corrected and for the moving cell.
"""

import numpy as np
from scipy.ndimage import distance_transform_edt, minimum_filter

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array, Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Line, Picture, Plot, Regions, Sheet
from actin_xcheck.theory.borders import Branch, cell_branches, prove, stiffnesses, wall_branches
from actin_xcheck.theory.dispersion import (
    Version,
    coefficients,
    growth_rates,
    printed_3_7,
    rate_in_words,
    sigma_prime,
    wavenumber,
)
from actin_xcheck.theory.eigenfields import eigenfield
from actin_xcheck.theory.errata import TABLE_4_PRINTED

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
        Picture(f"cell-{m}", f"moving cell, m = {m}: λ = {rate_in_words(field.rate)}", on_grid(field.a(x)))
        for m in range(3)
        for field in [eigenfield(cell, m, 1)]
    ]


PSI_MAX, P_MAX = 240.0, 1.74
"""The window: several bands of every version; p as far as the article takes it."""

PIXELS = 400

STABLE, DAMPED = "stable", "H (damped oscillation of the first mode)"
INFINITE = "infinitely many growing modes"
_FIRST_BAND = 3

_LETTER, _LINE = 5.6, 13
"""Width of a letter and height of a line in pixels, as reports draw maps."""

CELLS = (Closure.REFERENCE_NORMAL, Closure.TRACTION_FREE)
"""Closures of the moving cell; `current-normal` is the same as `reference-normal` to first order."""

_TABLED = (0.26, 0.8)
"""Pressures at which both delta are compared: Table 4's, and that of the article's walk through Fig. 23a."""


def maps() -> list[Regions]:
    """Return Fig. 23a's four versions for delta = 1: (3.6) printed and corrected, and two moving cells."""
    return [map_of(key) for key in versions()]


def map_of(key: str) -> Regions:
    """Return the version of Fig. 23a with this key, see `versions`.

    ArithmeticError where the map would contradict the argument principle.
    """
    (title, note, model, version), (psi, p) = versions()[key], (centres(PSI_MAX), centres(P_MAX))
    branches = branches_of(model, p, version)
    return _map(key, title, note, (psi, p), branches, stiffnesses(model, p, version))


def centres(largest: float) -> Array:
    """Centres (PIXELS,) of the pixels from 0 to `largest`."""
    return (np.arange(PIXELS) + 0.5) * largest / PIXELS


def branches_of(model: Model, p: Array, version: Version = Version.CORRECTED) -> list[Branch]:
    """The counted branches of a model's closure in the window; as printed there is nothing to count."""
    if model.closure is not Closure.IRROTATIONAL_WALL:
        return cell_branches(model, p, PSI_MAX)
    branches = wall_branches(model, p, PSI_MAX, version)
    if version is Version.CORRECTED:
        prove(branches, model, p, PSI_MAX)
    return branches


def _plane(closure: Closure, delta: Delta = Delta.FULL) -> Model:
    return Model(Parameters(0.0, 0.0), closure=closure, delta=delta)


def versions() -> dict[str, tuple[str, str, Model, Version]]:
    """Title, note, model and equations of each version of Fig. 23a, by its key."""
    wall = _plane(Closure.IRROTATIONAL_WALL)
    void = "beyond p = 1.167 infinitely many modes grow for every ψ, however small"
    exact = (
        "exact modes of the moving cell, named by angular number; borders followed by continuation and "
        "held against the argument principle; " + void
    )
    printed = "δ = 1; beyond p = 1.75, outside the map, infinitely many modes would grow"
    corrected = f"δ = 1, exact on a static disk with an irrotational wall; {void}"
    return {
        "fig23a-printed": ("Fig. 23a as printed: (3.6) with (3.8)", printed, wall, Version.AS_PRINTED),
        "fig23a-corrected": (
            "Fig. 23a corrected: (3.6), arctan a expanded about 1",
            corrected,
            wall,
            Version.CORRECTED,
        ),
        **{
            f"fig23a-{cell}": (f"The moving cell, {cell}", f"δ = 1; {exact}", _plane(cell), Version.CORRECTED)
            for cell in CELLS
        },
    }


def _map(
    key: str, title: str, note: str, grid: tuple[Array, Array], branches: list[Branch], e: Array
) -> Regions:
    psi, p = grid
    codes = classify(branches, psi, e)
    bands = (f"{kind}: {one.name}" for one in branches for kind in ("OS", "T"))
    names = (STABLE, DAMPED, INFINITE, *bands)
    borders = [Line("the first mode oscillates", _first_damped(branches), p)]
    for one in branches:
        borders.append(Line(f"{one.name}, Re λ = 0", one.neutral, p))
        later = [(one.neutral < other.neutral) & (other.neutral < one.real) for other in branches]
        shown = np.where(np.any(later, axis=0), np.nan, one.real)  # where it is no mode's that grew before
        borders.append(Line(f"{one.name} becomes real", shown, p))
    labels = _labels(codes, names, psi, p)
    return Regions(key, title, note, "ψ", "p", psi, p, codes, names, tuple(borders), labels)


def classify(branches: list[Branch], psi: Array, e: Array) -> Indices:
    """Return the codes (n_p, n_psi) of the plane: the state of the mode that began to grow last.

    0 stable, 1 damped oscillation of the mode that will grow first, 2 infinitely many growing modes, then for
    branch i 3 + 2 i while it oscillates and 4 + 2 i where its rates are real.

    Parameters
    ----------
    branches : borders over n_p pressures.
    psi : (n_psi,).
    e : stiffness at the pressures, (n_p,).
    """
    neutral = np.array([np.nan_to_num(one.neutral, nan=np.inf) for one in branches])
    real = np.array([np.nan_to_num(one.real, nan=np.inf) for one in branches])
    rows, first = np.arange(len(e)), _first_damped(branches)
    if np.isnan(first[e > 0]).any():
        raise ArithmeticError("where the first mode to grow starts to oscillate is unknown: no closed form")
    grows = neutral[:, :, None] < psi
    last = np.argmax(np.where(grows, neutral[:, :, None], -np.inf), axis=0)
    bands = _FIRST_BAND + 2 * last + (psi > real[last, rows[:, None]])
    codes = np.where(grows.any(axis=0), bands, (psi > first[:, None]).astype(int))
    return np.where(e[:, None] > 0, codes, 2)


def _first_damped(branches: list[Branch]) -> Array:
    """The psi (n_p,) at which the mode that will grow first starts to oscillate; nan where unknown."""
    neutral = np.array([np.nan_to_num(one.neutral, nan=np.inf) for one in branches])
    first = np.argmin(neutral, axis=0)
    return np.array([one.damped for one in branches])[first, np.arange(neutral.shape[1])]


def _labels(
    codes: Indices, names: tuple[str, ...], psi: Array, p: Array
) -> tuple[tuple[str, float, float], ...]:
    """A name in the widest place of each band that has room for it, along psi or else along p."""
    labels = []
    for code in np.unique(codes):
        text, band = names[code].split(" (")[0], np.pad(codes == code, 1)
        room = distance_transform_edt(band)
        length = round(_LETTER * (len(text) + 1))
        for box in ((_LINE, length), (round(1.3 * length), _LINE)):  # a map is wider than high
            possible = room * minimum_filter(band.astype(int), size=box)
            row, column = np.unravel_index(np.argmax(possible), possible.shape)
            if possible[row, column] > 0:
                labels.append((text, float(psi[column - 1]), float(p[row - 1])))
                break
    return tuple(labels)


def delta_sheet() -> Sheet:
    """Return by how much the borders of Fig. 23a differ between delta = 1 and delta = 0.

    The first two modes of each version, at two pressures.
    """
    borders = {"H": "damped", "OS": "neutral", "T": "real"}
    columns = (column for border in borders for column in (f"{border}, δ = 1", "less δ = 0"))
    rows = [("version", "p", "mode", *columns)]
    p = np.array([0.0, *_TABLED])
    for version, closure in (
        *((version, Closure.IRROTATIONAL_WALL) for version in (Version.AS_PRINTED, Version.CORRECTED)),
        *((Version.CORRECTED, closure) for closure in CELLS),
    ):
        full, none = (branches_of(_plane(closure, delta), p, version) for delta in (Delta.FULL, Delta.NONE))
        name = f"(3.6) {version}" if closure is Closure.IRROTATIONAL_WALL else str(closure)
        others = {one.name: one for one in none}
        for i, pressure in enumerate(_TABLED, start=1):
            for one in full[:2]:
                cells: list[str] = []
                for border in borders.values():
                    mine, other = (getattr(each, border)[i] for each in (one, others[one.name]))
                    known = np.isfinite(mine) and np.isfinite(other)
                    cells += [f"{mine:.3f}", f"{mine - other:+.3f}"] if known else ["", ""]
                rows.append((name, f"{pressure:g}", one.name, *cells))
    return Sheet(
        "fig23a-delta",
        "Fig. 23a for δ = 1 against δ = 0",
        "The article calls the two maps identical. ψ at which a mode starts to oscillate (H), to grow (OS) "
        "and to grow without oscillation (T), for δ = 1 and less that for δ = 0; the first two modes of each "
        "version. H of m = 1 lies where no list of rates is complete.",
        tuple(rows),
    )
