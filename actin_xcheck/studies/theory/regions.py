"""Fig. 23a: the (psi, p) plane by what the marginal mode does: printed, corrected and for the moving cell."""

import numpy as np
from scipy.ndimage import distance_transform_edt, minimum_filter

from actin_xcheck.core.mesh import Indices
from actin_xcheck.core.model import Array, Closure, Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Line, Regions, Sheet
from actin_xcheck.theory.borders import Branch, cell_branches, prove, stiffnesses, wall_branches
from actin_xcheck.theory.dispersion import Version

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
    """The proved branches of a model's closure in the window; as printed there is nothing to prove."""
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
