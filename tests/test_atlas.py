"""The atlas: the article's facts as printed, and maps of the moving cell against the argument principle."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters
from actin_xcheck.report.exhibits import Regions
from actin_xcheck.report.figure import BANDS
from actin_xcheck.studies.theory import errata_sheet
from actin_xcheck.studies.theory.figures import (
    DAMPED,
    INFINITE,
    P_MAX,
    PSI_MAX,
    STABLE,
    centres,
    delta_sheet,
    map_of,
    pictures,
    plots,
)
from actin_xcheck.theory.borders import cell_branches, prove
from actin_xcheck.theory.dispersion import Mode, Version, growth_rates, modes_below, sigma_prime, wavenumber
from actin_xcheck.theory.exact import DiskModes
from tests.browser import SEEN, lab, linear

CELLS = [Closure.REFERENCE_NORMAL, pytest.param(Closure.TRACTION_FREE, marks=pytest.mark.slow)]
SOFT = 1.75 / 1.5
"""Where e = 1 + nu' - p_e vanishes for delta = 1, corrected."""


def plane(closure):
    return Model(Parameters(0.0, 0.0), closure=closure, delta=Delta.FULL)


@cache
def mapped(key: str) -> Regions:
    return map_of(f"fig23a-{key}")


def name(plane: Regions, psi: float, p: float) -> str:
    return plane.names[plane.codes[np.argmin(np.abs(plane.y - p)), np.argmin(np.abs(plane.x - psi))]]


def border(plane: Regions, label: str) -> np.ndarray:
    return next(line.x for line in plane.borders if line.label == label)


def passed(names):
    """Names without immediate repetition."""
    return [one for one, before in zip(names, [None, *names], strict=False) if one != before]


def pixels(seed: int, count: int, p_max: float):
    """Seeded centres of pixels below p_max."""
    random = np.random.default_rng(seed)
    psi, p = centres(PSI_MAX), centres(P_MAX)
    return zip(random.choice(psi, count), random.choice(p[p < p_max], count), strict=True)


def test_as_printed_the_maps_facts_are_those_of_the_text():
    printed = mapped("printed")
    assert name(printed, 62.4, 0.26) == "T: w1,1"  # A.1.1: the only growing mode, by a Turing instability
    assert name(printed, 95.327, 0.26) == "T: w2,1"  # the first two
    along_psi = passed([name(printed, psi, 0.8) for psi in np.arange(10, 60, 0.3)])
    assert along_psi == [STABLE, DAMPED, "OS: w1,1", "T: w1,1"]
    # it names psi from 30 and a stable region, which ends at 20.1
    assert [name(printed, psi, 0.8) for psi in (20.0, 20.5, 30.0)] == [STABLE, DAMPED, DAMPED]
    along_p = passed([name(printed, 38.24, p) for p in np.arange(0.01, 1.74, 0.01)])
    assert along_p == ["OS: w1,1", "T: w1,1"]


@pytest.mark.parametrize("version", Version)
def test_wall_maps_are_the_dispersion_relation_pixel_by_pixel(version):
    one = mapped("printed" if version is Version.AS_PRINTED else "corrected")
    for psi, p in pixels(1, 300, 1.74 if version is Version.AS_PRINTED else SOFT):
        model = plane(Closure.IRROTATIONAL_WALL).varied(psi=psi, p=p)
        leading = {
            mode: growth_rates(model, mode.k**2, version)[0] for mode in modes_below(9.0) if mode.k > 0
        }
        growing = [mode for mode, rate in leading.items() if rate.real > 0]
        if growing:
            expected = f"{'OS' if leading[growing[-1]].imag else 'T'}: {growing[-1]}"
        else:
            expected = DAMPED if leading[Mode(1, 1)].imag else STABLE
        assert name(one, psi, p) == expected, (psi, p)


@pytest.mark.slow
@pytest.mark.parametrize("closure", CELLS)
def test_maps_of_the_cell_hold_at_random_pixels(closure):
    one = mapped(closure)
    for psi, p in pixels(7, 15, SOFT):
        row = np.argmin(np.abs(one.y - p))
        model = plane(closure).varied(psi=psi, p=p)
        here = name(one, psi, p)
        for m in range(5):
            pairs = sum(line.x[row] < psi for line in one.borders if line.label == f"m = {m}, Re λ = 0")
            assert DiskModes(model, m).count(0.0) == 2 * pairs, (psi, p, m)
        if ":" in here:
            kind, m = here.split(": m = ")
            rates = DiskModes(model, int(m)).rates(0.0)
            assert len(rates) == 2
            assert np.iscomplex(rates).all() == (kind == "OS"), (psi, p, rates)
        else:
            damped = growth_rates(model, wavenumber(0, 2) ** 2)[0]
            assert damped.real < 0
            assert here == (DAMPED if damped.imag else STABLE)


@pytest.mark.parametrize("closure", CELLS)
def test_modes_set_in_between_two_pixels(closure):
    """In random rows: to the left of its border a mode does not grow, to the right a pair does."""
    one, random = mapped(closure), np.random.default_rng(8)
    lines = {line.label: line.x for line in one.borders}
    assert lines.keys() >= {f"m = {m}, Re λ = 0" for m in range(3)}
    for m in range(5):
        neutral = lines.get(f"m = {m}, Re λ = 0", np.full(one.y.size, np.inf))
        for row in random.choice(np.flatnonzero(one.y < SOFT), 8):
            model, right = plane(closure).varied(p=float(one.y[row])), np.searchsorted(one.x, neutral[row])
            for column, growing in ((right - 1, 0), (right, 2)):
                if 0 <= column < one.x.size:
                    found = DiskModes(model.varied(psi=float(one.x[column])), m).count(0.0)
                    assert found == growing, (column, row, m)


@pytest.mark.parametrize(
    ("closure", "m"),
    [(Closure.REFERENCE_NORMAL, 2), pytest.param(Closure.TRACTION_FREE, 1, marks=pytest.mark.slow)],
)
def test_borders_are_thresholds_and_double_roots(closure, m):
    one, row = mapped(closure), 100
    p = float(one.y[row])
    neutral = border(one, f"m = {m}, Re λ = 0")[row]
    for factor, growing in ((1 - 1e-8, 0), (1 + 1e-8, 2)):
        assert DiskModes(plane(closure).varied(psi=factor * neutral, p=p), m).count(0.0) == growing
    row = 255  # p = 1.11, where borders bend
    double = border(one, f"m = {m} becomes real")[row]
    for factor, pair in ((1 - 1e-5, True), (1 + 1e-5, False)):
        rates = DiskModes(plane(closure).varied(psi=factor * double, p=float(one.y[row])), m).rates(0.0)
        assert np.iscomplex(rates).all() == pair


@pytest.mark.parametrize("version", ["corrected", *CELLS])
def test_a_soft_cell_has_infinitely_many_growing_modes(version):
    one = mapped(version)
    infinite = one.names.index(INFINITE)
    assert np.array_equal(one.codes == infinite, np.repeat(one.y[:, None] > SOFT, len(one.x), axis=1))
    soft = plane(Closure.REFERENCE_NORMAL).varied(psi=1.0, p=SOFT + 1e-3)
    assert max(DiskModes(soft, 1).boundary_points().values()) > 0
    assert INFINITE not in {mapped("printed").names[code] for code in np.unique(mapped("printed").codes)}


@pytest.mark.parametrize("key", ["printed", "corrected", *CELLS])
def test_a_map_has_its_size_labels_in_their_bands_and_neighbours_told_apart_in_grey_and_by_every_eye(key):
    one = mapped(key)
    assert one.codes.shape == (400, 400) == (len(one.y), len(one.x))
    assert len(one.labels) >= 8
    for text, psi, p in one.labels:
        assert name(one, psi, p).startswith(text)
    colour = dict(zip(one.names, BANDS * 2, strict=False))
    pairs = set()
    for here, beside in ((one.codes[1:], one.codes[:-1]), (one.codes[:, 1:], one.codes[:, :-1])):
        pairs |= set(zip(here[here != beside].tolist(), beside[here != beside].tolist(), strict=True))
    for pair in pairs:
        first, second = (linear(colour[one.names[code]]) for code in pair)
        assert abs(lab(first)[0] - lab(second)[0]) > 7.5, pair
        assert min(np.linalg.norm(lab(eye @ first) - lab(eye @ second)) for eye in SEEN.values()) > 12


@pytest.mark.slow
def test_a_border_in_the_wrong_place_is_an_error():
    model, p = plane(Closure.TRACTION_FREE), np.array([0.2, 0.4])
    branches = cell_branches(model, p, 150.0)
    assert [one.name for one in branches] == ["m = 0", "m = 1"]
    prove(branches, model, p, 150.0)
    for wrong in (
        branches[:1],
        [branches[0], replace(branches[1], neutral=branches[1].neutral + 40)],
        [replace(branches[0], real=branches[0].real + 40), branches[1]],
    ):
        with pytest.raises(ArithmeticError, match=r"m = [01], p = 0\.[24]"):
            prove(wrong, model, p, 150.0)


@pytest.mark.slow
def test_the_maps_for_both_delta_differ_in_every_border():
    header, *rows = delta_sheet().rows
    assert header[3:] == ("H, δ = 1", "less δ = 0", "OS, δ = 1", "less δ = 0", "T, δ = 1", "less δ = 0")
    assert len(rows) == 16
    slope = sigma_prime(Parameters(1.0, 0.0))
    for version, p, mode, *cells in rows:
        damped, neutral, real = (float(cell or "nan") for cell in cells[1::2])
        assert np.isnan(damped) == (mode == "m = 1")
        assert not any(abs(one) < 0.2 for one in (damped, neutral, real))
        # as printed every border moves by (2/pi) p / sigma'(1); corrected, e and f' move the neutral one
        if version.endswith("as printed"):
            assert [damped, neutral, real] == pytest.approx([-2 / np.pi * float(p) / slope] * 3, abs=1e-3)
        elif version.endswith("corrected"):
            assert neutral == pytest.approx(-(0.5 + 1 / np.pi) * float(p) / slope, abs=1e-3)


def test_curves_are_what_the_figures_show():
    found = {plot.key: plot for plot in plots()}
    for line, a_sat in zip(found["fig01"].lines, (1.1, 1.4), strict=True):
        assert line.x[np.argmax(line.y)] == pytest.approx(2 * a_sat, abs=0.03)
    full, none = found["fig02"].lines
    assert full.y[np.argmin(np.abs(full.x - 1))] == pytest.approx(1.5 * 0.26)
    assert none.y == pytest.approx(0.26)
    (slope,) = found["fig03"].lines
    assert np.all((slope.y > 0) == (slope.x > 0.5))
    for key, count in (("fig21a", 1), ("fig22a", 2)):  # as printed b < 0 for so many wave numbers
        b = next(line for line in found[key].lines if line.label == "b, as printed")
        assert sum(np.interp(x, b.x, b.y) < 0 for _, x in found[key].marks) == count
    re, im = (
        next(line for line in found["fig23b"].lines if line.label == f"{part}, as printed")
        for part in ("Re", "Im")
    )
    assert np.all(re.y > 0)
    assert im.y[0] > 0.5
    assert im.y[-1] == 0


def test_pictures_and_errata_are_complete():
    shown = {one.key: one for one in pictures()}
    assert {"fig04", "fig05-w0,2", "fig08a", "fig08d", "cell-0", "cell-1", "cell-2"} <= shown.keys()
    for one in shown.values():
        assert np.isfinite(one.values).all()
        assert one.values[:, 0] == pytest.approx(one.values[:, -1])  # the last angle is the first
    assert {row[0] for row in errata_sheet().rows[1:]} == set("12345678")
