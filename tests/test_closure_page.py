"""Ripples of the moving rim: their formula, what methods make of it, refinement, the file and its page."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from actin_xcheck.core.mesh import disk
from actin_xcheck.core.model import Model
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology
from actin_xcheck.report.page import write_page
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.closures import METHODS, ROUGH_SCENE, closures, plan
from actin_xcheck.studies.closures.findings import (
    JUDGED,
    departure,
    ladders,
)
from actin_xcheck.studies.closures.measure import (
    Course,
    Rim,
    Ripples,
    _rims,
    distance,
    follow,
    measure,
    roughness,
)
from actin_xcheck.theory.dispersion import advance_per_fold, contrast, ripple_exponent
from fem.force_balance import ForceBalance
from tests.small import RIMS
from tests.studies import carry
from tests.tags import Tags

TABLE_2 = Parameters(0.0, 2.0)
CURRENT, REFERENCE = Closure.CURRENT_NORMAL, Closure.REFERENCE_NORMAL
P2 = "fem-p2-imex3"


# the formula


def test_kappa_is_that_of_table_2():
    assert contrast(TABLE_2) == pytest.approx(0.1389, abs=5e-5)
    assert advance_per_fold(TABLE_2) == pytest.approx(1.146, abs=5e-4)


def test_short_ripples_grow_as_on_a_half_plane_and_a_translation_not_at_all():
    assert ripple_exponent(CURRENT, TABLE_2, 1) == 0
    for m in (100, 1000):
        half_plane = contrast(TABLE_2) * m
        assert abs(ripple_exponent(CURRENT, TABLE_2, m) / half_plane - 1) < 0.2 / m


def test_rays_do_not_feed_the_slope_back():
    assert ripple_exponent(REFERENCE, TABLE_2, 50) == 1


def test_what_is_no_ripple_is_refused():
    with pytest.raises(ValueError, match="m = 0"):
        ripple_exponent(CURRENT, TABLE_2, 0)
    with pytest.raises(ValueError, match="holds the rim still"):
        ripple_exponent(Closure.IRROTATIONAL_WALL, TABLE_2, 1)


@pytest.mark.parametrize("moduli", [(2.5, 6.5), (6.0, 1.0), (1.0, 0.2)])
@pytest.mark.parametrize("closure", [CURRENT, REFERENCE, Closure.TRACTION_FREE])
def test_the_force_balance_gives_ripples_the_rates_of_the_formula(closure, moduli):
    """Instantaneous velocities on a displaced rim, for other viscosities too: no step is taken."""
    parameters = Parameters(0.0, 2.0, mu1=moduli[0], mu2=moduli[1])
    mesh = disk(3, 0.8)
    balance = ForceBalance(Model(parameters, Rheology.VISCOUS, closure, Delta.MEMBRANE), mesh, 3)
    xi = balance.space.xi
    ones = np.ones(balance.space.cells.shape)
    rim = balance.space.rim_nodes
    radius, angle = np.hypot(*xi), np.arctan2(xi[1], xi[0])

    def radial(x):
        v = balance.velocity(0.0, x, ones)[:, rim]
        return (v * xi[:, rim]).sum(axis=0)

    bare = radial(xi)
    for m in (1, 2, 3, 5):
        cosine = np.cos(m * angle)
        grown = (radial(xi * (1 + 1e-6 * radius ** (m + 1) * cosine)) - bare) / 1e-6
        gamma = (grown @ cosine[rim]) / (cosine[rim] @ cosine[rim]) / bare.mean()
        assert gamma == pytest.approx(ripple_exponent(closure, parameters, m), rel=0.01, abs=1e-3)


# measured


@pytest.mark.parametrize(("method", "refine", "bound"), [(P2, 3, 0.005), ("fem-p4-imex4", 2, 0.002)])
def test_resolved_ripples_grow_at_their_rate(method, refine, bound):
    found = measure(Ripples(method, refine, CURRENT, modes=(2, 4)))
    assert found.measured == pytest.approx(found.predicted, rel=bound)
    assert departure(found, found.nodes / 4) < bound


@pytest.mark.parametrize("method", ["fem-p1-paper", "fv-coupled"])
def test_straight_sides_know_the_longest_ripple_and_cut_short_ones_off(method):
    found = measure(Ripples(method, 4, CURRENT, modes=(2, 8, 31)))
    assert found.measured[0] == pytest.approx(found.predicted[0], rel=0.02)
    assert found.measured[1] < 0.7 * found.predicted[1]
    assert found.measured[2] < 0.3 * found.predicted[2]


def test_where_the_rim_retracts_the_same_ripples_are_damped():
    found = measure(Ripples(P2, 3, CURRENT, advancing=False, modes=(3, 6)))
    assert found.speed < 0
    assert found.measured == pytest.approx(found.predicted, rel=0.01)


@pytest.mark.parametrize("method", ["fem-p1-paper", P2])
def test_with_reference_normal_every_ripple_keeps_its_share_of_the_radius(method):
    found = measure(Ripples(method, 3, REFERENCE, modes=(2, 7, 13)))
    assert found.measured == pytest.approx(np.ones(3), abs=1e-6)


@pytest.mark.parametrize("ends", [{4}, {0}])
def test_a_run_that_fails_is_stored_and_drawn_as_a_gap(ends, tmp_path, monkeypatch):
    said, right = "singular dilation, 1 + phi reaches zero at t = 0.001", _rims

    def fails(asked, m):
        rims, message = right(asked, m)
        return rims, said if m in ends else message

    monkeypatch.setattr(sys.modules[measure.__module__], "_rims", fails)
    asked = [replace(RIMS[0], closure=closure) for closure in (CURRENT, REFERENCE)]
    report = carry(tmp_path, closures([*asked, *RIMS[3:]]), name="closures")
    failed = [bool(row.message) for row in report.tables["ripples"].rows]
    assert failed == ([True] * 4 if 0 in ends else [False, True] * 2)
    assert failed == [np.isnan(row.measured) for row in report.tables["ripples"].rows]
    assert sum(said in sentence for sentence in report.findings) == 2
    assert not any("nan" in sentence.split() for sentence in report.findings)
    assert said in Tags(write_page(tmp_path / "closures.h5")).text
    drawn = [plot.key for chapter in report.chapters for plot in chapter.exhibits]
    assert ("steady" in drawn) == (0 not in ends)


# refinement


@pytest.fixture(scope="module")
def rims(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rims")
    return [
        follow(Course(ROUGH_SCENE, P2, closure, level), folder)
        for closure in (CURRENT, REFERENCE)
        for level in range(3)
    ]


@pytest.mark.slow
def test_finer_meshes_get_worse_with_current_normal(rims):
    ill = ladders(rims)[0]
    assert ill.closure is CURRENT
    assert np.isinf(ill.lost[0])
    assert ill.lost[2] < 0.7 * ill.lost[1] < np.inf
    early = ill.changes(JUDGED)
    assert early[1] > 0.4 * early[0]  # no second order, nor first
    finest = ill.rims[2]
    assert finest.roughness[-1] > 5 * finest.roughness[0]


@pytest.mark.slow
def test_meshes_converge_with_reference_normal(rims):
    well = ladders(rims)[1]
    assert np.isinf(well.lost).all()
    for part in (JUDGED, 1.0):
        coarse, fine = well.changes(part)
        assert fine < coarse / 5
    for rim in well.rims:
        assert rim.roughness[-1] == pytest.approx(rim.roughness[0], rel=1e-6)


@pytest.mark.slow
def test_the_cell_swells_as_its_rims_tension_says(rims):
    """R' = R T/(mu1 + 2 mu2), a' = 1 - a - 2 a T/(mu1 + 2 mu2), T = p (2/pi) arctan a."""
    scene = load_scene(ROUGH_SCENE)
    p = scene.parameters

    def rates(t, y):
        swells = p.p * 2 / np.pi * np.arctan(y[1]) / (p.mu1 + 2 * p.mu2)
        return [swells, 1 - y[1] - 2 * y[1] * swells]

    exact = np.exp(solve_ivp(rates, (0, scene.time.end), [0.0, 1.0], rtol=1e-10, atol=1e-12).y[0, -1])
    finest = ladders(rims)[1].rims[-1]
    assert finest.radius[-1] / finest.radius[0] == pytest.approx(exact, rel=2e-5)


def test_roughness_is_that_of_short_ripples_alone():
    angle = 2 * np.pi * np.arange(64) / 64
    radius = 2 * (1 + 0.1 * np.cos(4 * angle) + 0.02 * np.sin(13 * angle))
    rim = radius * np.array([np.cos(angle), np.sin(angle)])
    assert roughness(rim) == pytest.approx(0.02 / np.sqrt(2))
    assert distance(rim, 1.25 * rim[:, ::2]) == pytest.approx(0.2, rel=0.01)


def test_a_run_that_fails_is_lost_then_and_the_others_when_they_are_rough():
    course = Course(ROUGH_SCENE, P2, CURRENT, 1)
    angle, times = 2 * np.pi * np.arange(64) / 64, np.arange(4.0)

    def rim(amplitudes, outcome="completed"):
        radii = 1 + np.outer(amplitudes, np.cos(16 * angle))
        rims = radii[:, None] * np.array([np.cos(angle), np.sin(angle)])
        return Rim(course, times[: len(rims)], rims, outcome, "")

    twin = rim([1e-3] * 4)
    assert rim([1e-3, 1e-3, 4e-3, 8e-3]).lost(twin) == pytest.approx(1.5)
    assert rim([1e-3, 1e-3], "tangled").lost(twin) == 1
    assert rim([1e-3] * 4).lost(twin) == np.inf
    assert rim([1e-17, 3e-17]).lost(rim([1e-17, 1e-17])) == np.inf


# the report


def test_the_plan_asks_for_both_readings_and_both_ways():
    asked = plan(METHODS)
    assert len(set(asked)) == len(asked)
    for method in METHODS:
        ripples = {
            (one.closure, one.advancing) for one in asked if isinstance(one, Ripples) and one.method == method
        }
        assert ripples == {(CURRENT, True), (CURRENT, False), (REFERENCE, True)}
        courses = [one for one in asked if isinstance(one, Course) and one.method == method]
        assert {one.level for one in courses if one.closure is CURRENT} == {0, 1, 2, 3}


def test_meshes_of_a_level_have_as_many_rim_nodes(tmp_path):
    for method in METHODS:
        course = Course(ROUGH_SCENE, method, REFERENCE, 1)
        assert follow(replace(course, level=0), tmp_path).nodes == 32
    assert [Course(ROUGH_SCENE, method, REFERENCE, 3).refine for method in METHODS] == [6, 5, 4, 6]


def test_the_page_says_why_and_shows_every_outline(carried):
    whole = carried("closures")
    page = Tags(whole.folder / "index.html")
    assert whole.report.findings[0].startswith("The default is reference-normal because")
    polygons = [one for one in page.attributes("polygon", "class") if one == "rim"]
    runs = whole.report.tables["runs"].rows
    assert len(polygons) == len(runs) == 4
    assert runs[0].rims.shape == (11, 2, 32)
    ripples = whole.report.tables["ripples"].rows
    assert [(one.closure, one.advancing, one.m) for one in ripples] == [
        (asked.closure, asked.advancing, m) for asked in RIMS[:3] for m in asked.modes
    ]
