import numpy as np
import pytest
from skfem import MeshTri

from actin_xcheck.core.errors import Ending
from actin_xcheck.core.mesh import (
    Symmetry,
    disk,
    integral,
    locate,
    orientation,
    sector,
    signed_areas,
    unfold,
)


def edges(triangles):
    return {tuple(sorted(edge)) for t in triangles.T for edge in (t[:2], t[1:], t[[0, 2]])}


@pytest.mark.parametrize(("refine", "nodes"), [(5, 2113), (6, 8321)])
def test_the_articles_meshes_have_the_articles_node_counts(refine, nodes):
    assert disk(refine, 0.8).xi.shape[1] == nodes


def test_topology_is_that_of_init_circle():
    """Undo the circles: on the diamond both are the same uniform refinement."""
    ours, theirs = disk(3, 0.8), MeshTri.init_circle(3)
    diamond = MeshTri(
        np.array([[0, 1, 0, -1, 0], [0, 0, 1, 0, -1.0]]),
        np.array([[0, 1, 2], [0, 1, 4], [0, 2, 3], [0, 3, 4]]).T,
    )
    for _ in range(3):
        diamond = diamond.refined()
    assert np.array_equal(diamond.t, theirs.t)
    layer = np.abs(diamond.p).sum(axis=0)
    angle = np.arctan2(diamond.p[1], diamond.p[0])
    quarter = np.floor(angle / (np.pi / 2) + 1e-12)
    x, y = diamond.p / np.where(layer > 0, layer, 1)
    along = np.abs(np.where(quarter % 2 == 0, y, x))
    radius = np.interp(np.rint(layer * 8), [0, 6, 8], [0, 0.8, 1])
    points = radius * np.array([np.cos(np.pi / 2 * (quarter + along)), np.sin(np.pi / 2 * (quarter + along))])
    match = np.hypot(*(points[:, :, None] - ours.xi[:, None, :])).argmin(axis=1)
    assert len(set(match)) == ours.xi.shape[1]
    assert edges(match[theirs.t]) == edges(ours.triangles)


@pytest.mark.parametrize("l0", [0.3, 0.8, 0.93])
def test_a_line_of_nodes_lies_on_the_ring(l0):
    mesh = disk(4, l0)
    on_ring = np.isclose(np.hypot(*mesh.xi), l0, atol=1e-14)
    assert on_ring.sum() == 4 * round(l0 * 16)
    outside = np.hypot(*mesh.centroids) > l0
    corners = np.hypot(*mesh.xi[:, mesh.triangles])
    assert np.all(corners[:, outside] >= l0 - 1e-12)
    assert np.all(corners[:, ~outside] <= l0 + 1e-12)


def test_triangles_are_counter_clockwise_and_fill_the_disk_to_second_order():
    defects = []
    for refine in (3, 4, 5):
        mesh = disk(refine, 0.8, rotation=0.3)
        areas = signed_areas(mesh.xi, mesh.triangles)
        assert areas.min() > 0
        defects.append(np.pi - areas.sum())
    assert np.allclose(np.log2(np.array(defects[:-1]) / defects[1:]), 2, atol=0.02)


def test_rim_is_one_counter_clockwise_chain():
    mesh = disk(3, 0.8)
    angle = np.unwrap(np.arctan2(*mesh.xi[::-1, mesh.rim_nodes]))
    assert np.all(np.diff(angle) > 0)
    assert mesh.rim_nodes.size == 32
    assert np.array_equal(mesh.rim[1], np.roll(mesh.rim[0], -1))


def test_locate_finds_material_points_and_projects_those_outside_the_polygon():
    mesh = disk(3, 0.8)
    rng = np.random.default_rng(1)
    radius, angle = np.sqrt(rng.uniform(0, 0.98, 200)), rng.uniform(0, 2 * np.pi, 200)
    points = radius * np.array([np.cos(angle), np.sin(angle)])
    cells, weights = locate(mesh, points)
    assert weights.min() >= -1e-12
    found = (weights * mesh.xi[:, mesh.triangles[:, cells]]).sum(axis=1)
    assert np.allclose(found, points, atol=1e-14)
    mid_chord = np.array([[np.cos(np.pi / 32)], [np.sin(np.pi / 32)]])
    cells, weights = locate(mesh, mid_chord)
    found = (weights * mesh.xi[:, mesh.triangles[:, cells]]).sum(axis=1)
    assert np.allclose(found, mid_chord * np.cos(np.pi / 32), atol=1e-14)


def test_integral_of_a_linear_field_is_exact():
    mesh = disk(3, 0.8)
    field = 2 + mesh.xi[0] - 3 * mesh.xi[1]
    assert integral(mesh.xi, mesh.triangles, field[mesh.triangles]) == pytest.approx(
        2 * signed_areas(mesh.xi, mesh.triangles).sum(), rel=1e-13
    )


def test_a_flipped_triangle_is_named():
    mesh = disk(2, 0.8)
    x = mesh.xi.copy()
    x[:, 5] += 1.0
    outcome = orientation(mesh, 0.25, x)
    assert outcome.ending is Ending.TANGLED
    assert "t = 0.25" in outcome.message
    assert orientation(mesh, 0.0, mesh.xi).ok
    assert orientation(mesh, 0.0, mesh.xi * np.nan).ending is Ending.NON_FINITE


HALF, QUARTER, SIXTH = Symmetry(1, 0.3), Symmetry(2, 0.3), Symmetry(3, 0.3)
SECTORS = pytest.mark.parametrize("symmetry", [HALF, QUARTER, SIXTH], ids=["half", "quarter", "sixth"])


@SECTORS
def test_every_point_of_the_disk_comes_from_one_of_the_sector(symmetry):
    rng = np.random.default_rng(2)
    radius, angle = np.sqrt(rng.random(50)), symmetry.start + symmetry.angle * rng.random(50)
    points = radius * np.array([np.cos(angle), np.sin(angle)])
    for number, image in enumerate(symmetry.images):
        assert np.linalg.det(image) == pytest.approx((-1) ** number, abs=1e-14)
        originals, images = symmetry.fold(image @ points)
        assert np.abs(originals - points).max() < 1e-14
        assert (images == number).all()
    # the mirror lines are still: neighbouring images share them
    first, second = symmetry.sides.T
    for number in range(2 * symmetry.mirrors):
        shared = second if number % 2 == 0 else first
        following = symmetry.images[(number + 1) % (2 * symmetry.mirrors)]
        assert np.abs((symmetry.images[number] - following) @ shared).max() < 1e-14


@pytest.mark.parametrize(
    ("mirrors", "start", "rotation"),
    [
        (1, 0.3, 0.3),
        (2, 0.3, 0.3),
        (4, 0.3, 0.3),
        (1, np.pi / 2, 0),
        (4, np.pi / 4, 0),
        (6, 0.3, 0.3 + np.pi),
    ],
)
def test_a_half_and_a_quarter_are_parts_of_the_disk(mirrors, start, rotation):
    """Node by node and cell by cell, where any of the mirror lines is an axis of the disk's."""
    whole, part = disk(3, 0.8, rotation), sector(3, 0.8, Symmetry(mirrors, start), rotation)
    node = np.hypot(*(part.xi[:, :, None] - whole.xi[:, None])).argmin(axis=1)
    assert np.abs(whole.xi[:, node] - part.xi).max() < 2e-15
    cells = {tuple(sorted(cell)) for cell in whole.triangles.T}
    assert {tuple(sorted(cell)) for cell in node[part.triangles].T} <= cells
    assert part.triangles.shape[1] == whole.triangles.shape[1] // (2 if mirrors == 1 else 4)
    assert part.h == whole.h
    if start == rotation:
        assert np.array_equal(whole.xi[:, node], part.xi)


def test_a_sector_off_the_axes_is_no_part_of_the_disk():
    whole, part = disk(3, 0.8), sector(3, 0.8, QUARTER)
    assert part.symmetry == QUARTER
    assert np.hypot(*(part.xi[:, :, None] - whole.xi[:, None])).min(axis=1).max() > 0.01


@SECTORS
def test_a_sectors_boundary_is_its_arc_and_its_straight_sides(symmetry):
    mesh = sector(3, 0.8, symmetry)
    rim = mesh.rim_nodes
    assert np.abs(np.hypot(*mesh.xi[:, rim]) - 1).max() < 1e-15
    angle = np.unwrap(np.arctan2(*mesh.xi[::-1, rim])) - symmetry.start
    assert angle == pytest.approx(np.linspace(0, symmetry.angle, rim.size), abs=1e-14)
    assert np.array_equal(mesh.rim, [rim[:-1], rim[1:]])
    assert mesh.sides.shape == (2, 16)
    along = mesh.xi[:, mesh.sides[1]] - mesh.xi[:, mesh.sides[0]]
    assert along.sum(axis=1) == pytest.approx(
        symmetry.sides @ [1, -1], abs=1e-14
    )  # out on one, in on the other
    assert symmetry.on_sides(mesh.xi[:, mesh.sides.ravel()]).any(axis=0).all()
    assert disk(3, 0.8).sides.shape == (2, 0)


@SECTORS
def test_the_images_of_a_sector_tile_a_disk(symmetry):
    part = sector(3, 0.8, symmetry)
    whole = unfold(part)
    copies = 2 * symmetry.mirrors
    areas = signed_areas(whole.xi, whole.triangles)
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(copies * signed_areas(part.xi, part.triangles).sum(), rel=1e-14)
    assert whole.rim_nodes.size == copies * (part.rim_nodes.size - 1)
    layers = 8
    assert (
        whole.xi.shape[1] == 1 + whole.rim_nodes.size * (layers + 1) // 2
    )  # every layer has j/8 of the rim's
    assert np.isclose(np.hypot(*whole.xi), 0.8, atol=1e-14).sum() == whole.rim_nodes.size * 6 // layers
