"""Meshes made worse on purpose, what is exact on them all the same, and the report that charts the rest."""

import numpy as np
import pytest

from actin_xcheck.core.mesh import disk, signed_areas
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.run import solver_for
from actin_xcheck.scene.expression import coordinates
from actin_xcheck.scene.outline import (
    Fit,
    aspects,
    flattened,
    largest_angle,
    off_ring,
    perturbed,
    read_mesh,
    stretched,
)
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.distort.cases import FAMILIES, answer_of, cases_of, families_of
from fem.kernels import CellRule
from fem.space import Space
from fv.equations import over_relaxed_split, vertex_interpolation
from fv.mesh import Faces
from tests.lab import error_against, film_of

WORST = {
    "perturbed": lambda refine: perturbed(disk(refine, 0.8), 0.5, 0.8, seed=refine),
    "stretched": lambda refine: stretched(disk(refine, 0.8), 90),
    "slivers": lambda refine: flattened(disk(refine, 0.8), 1e-3, 0.8, seed=refine),
    "off-ring": lambda refine: off_ring(refine, 0.8, 0.3),
}


@pytest.mark.parametrize("name", WORST)
def test_distortions_keep_the_disk_its_rim_and_their_cells(name):
    own, worse = disk(4, 0.8), WORST[name](4)
    assert signed_areas(worse.xi, worse.triangles).min() > 0
    assert np.array_equal(worse.triangles, own.triangles)
    assert np.abs(np.hypot(*worse.xi[:, worse.rim_nodes]) - 1).max() < 1e-15
    assert not worse.layered
    assert np.array_equal(WORST[name](4).xi, worse.xi)  # seeded


def test_distortions_are_as_bad_as_they_say():
    own = disk(4, 0.8)
    of = {name: aspects(make(4).xi, make(4).triangles) for name, make in WORST.items()}
    assert aspects(own.xi, own.triangles).max() < 2
    assert of["stretched"].max() > 50
    assert np.mean(of["stretched"] > 20) > 0.4
    assert of["slivers"].max() > 1000
    slivers = WORST["slivers"](4)
    assert largest_angle(slivers.xi, slivers.triangles) > 179.8
    assert 0.04 < np.mean(of["slivers"] > 100) < 0.1
    moved = np.hypot(*(WORST["perturbed"](4).xi - own.xi))
    assert np.median(moved[moved > 0]) > 0.2 * own.h
    assert Fit.of(WORST["off-ring"](4), 0.8).crossed > 0
    assert not Fit.of(slivers, 0.8).crossed


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ["perturbed", "stretched", "slivers"])
def test_a_linear_field_is_exact_in_elements_on_every_distorted_mesh(name, order):
    """The patch test: no residual of stiffness or stress at nodes off the rim, and the exact strain."""
    space = Space.on(WORST[name](4), order, 0.8)
    fine: CellRule = space.rule(2 * order)
    field = np.array([0.3, -0.7]) @ space.xi
    inner = np.setdiff1d(np.arange(space.xi.shape[1]), space.rim_nodes)
    stiffness = space.scalars.matrix(fine.at(space.xi).stiffness())
    scale = (abs(stiffness) @ np.abs(field)).max()
    straight = order == 1  # curved cells integrate rational functions
    assert np.abs((stiffness @ field)[inner]).max() < (1e-13 if straight else 2e-3) * scale
    strain, dilation = space.inside.at(space.xi).strain(np.array([[1.0, 2.0], [0.5, -3.0]]) @ space.xi)
    assert np.abs(strain[0, 1] - 1.25).max() < 1e-8
    assert np.abs(dilation + 2).max() < 1e-8


@pytest.mark.parametrize("name", ["perturbed", "stretched", "slivers"])
def test_a_linear_field_has_no_net_flux_out_of_inner_volumes(name):
    """The cross flux makes the two-point one exact for linear fields, however skew the faces are."""
    mesh = WORST[name](4)
    faces = Faces.of(mesh)
    field = np.array([0.3, -0.7]) @ mesh.centroids
    coefficients, from_vertices = over_relaxed_split(faces, mesh.xi)
    first, second = faces.cells[:, faces.interior]
    flux = coefficients * (field[second] - field[first])
    near_rim = np.isin(
        mesh.triangles, np.unique(mesh.triangles[:, np.isin(mesh.triangles, mesh.rim_nodes).any(axis=0)])
    )
    inner = ~near_rim.any(axis=0)

    def net(two_point, cross):
        into = np.bincount(first, two_point, field.size) - np.bincount(second, two_point, field.size)
        return np.abs((into + cross)[inner]).max()

    crossed = from_vertices @ (vertex_interpolation(faces, mesh.xi) @ field)
    assert net(flux, crossed) < 1e-12 * np.abs(flux).max()
    assert net(flux, 0 * crossed) > 1e-3 * np.abs(flux).max()  # without it nothing cancels


ORDERS = {
    "fem-p1-imex2": ((4, 5), 1.75, 2.3),
    "fem-p2-imex3": ((2, 3), 2.6, 4.0),
    "fv-order2": ((3, 4), 1.75, 2.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", ORDERS)
@pytest.mark.parametrize("name", ["perturbed", "stretched", "slivers"])
def test_orders_and_conservation_hold_on_distorted_meshes(name, method):
    scene, (refines, least, most), errors = load_scene("manufactured-moving"), ORDERS[method], []
    for refine in refines:
        solver = solver_for(resolve(scene), METHODS[method], WORST[name](refine))
        film, outcome = film_of(solver, scene.time.end / 2 ** (refine + 1), scene.output_times)
        assert outcome.ok, outcome
        assert film.residual < 1e-13

        def exact(x, xi):
            return scene.expect.exact.a(**coordinates(x), x0=xi[0], y0=xi[1], t=scene.time.end)

        if method == "fv-order2":
            errors.append(error_against(film, exact))
        else:
            off = film.last.a - exact(film.last.x, solver.space.xi)
            errors.append(np.sqrt(np.mean(off**2)))
    assert least < np.log2(errors[0] / errors[1]) < most


def test_a_ring_off_the_sides_costs_p2_its_order():
    scene = load_scene("fitted-ring")
    truth = film_of(solver_for(resolve(scene), METHODS["fem-p4-imex4"], disk(2, 0.75)), 0.02, (0.25,))[0]
    area = truth.solver.measure(truth.last).area
    errors = {}
    for offset in (0.0, 0.3):
        for refine in (2, 3):
            solver = solver_for(resolve(scene), METHODS["fem-p2-imex3"], off_ring(refine, 0.75, offset))
            film, outcome = film_of(solver, 0.02, (0.25,))
            assert outcome.ok
            errors[offset, refine] = abs(solver.measure(film.last).area - area)
    assert np.log2(errors[0, 2] / errors[0, 3]) > 2.8
    assert np.log2(errors[0.3, 2] / errors[0.3, 3]) < 1.3
    assert errors[0.3, 3] > 50 * errors[0, 3]


@pytest.mark.slow
def test_needles_that_stall_bicgstab_are_solved(tmp_path):
    """Cells drawn out 54 times: the preconditioned matrix gets eigenvalues far from the real axis."""
    needles = FAMILIES["stretched"]
    case, _ = cases_of(load_scene("smooth-fronts"), METHODS["fv"], needles, needles.severities[-1])
    answer = answer_of(case, tmp_path).said
    assert (answer.ending, answer.message) == ("completed", "")
    assert answer.residual < 1e-13


@pytest.mark.slow
def test_the_report_charts_its_runs_and_keeps_their_meshes(carried):
    whole, family = carried("distort"), FAMILIES["slivers"]
    rows = whole.report.tables["runs"].rows
    assert len(rows) == 2 * len(family.severities)
    assert {row.ending for row in rows} == {"completed"}
    assert max(row.residual for row in rows) < 1e-13
    assert all(row.a_error > 0 for row in rows)
    assert "all methods hold" in whole.report.findings[0]
    scene = load_scene("static-decay")
    case = cases_of(scene, METHODS["fem-p1-imex2"], family, 1000.0)[0]
    mesh = read_mesh(whole.folder / case.mesh_file)
    assert np.array_equal(mesh.xi, case.mesh(scene.parameters.l0).xi)


def test_a_ring_is_missed_where_there_is_one():
    assert "off-ring" not in [family.key for family in families_of(load_scene("smooth-fronts"))]
    assert "off-ring" in [family.key for family in families_of(load_scene("fitted-ring"))]
