"""A user's mesh: what is read, what is refused in one line, and what runs on it."""

import meshio
import numpy as np
import pytest
import pyvista
import vtk
from scipy.spatial import Delaunay

from actin_xcheck.cli.app import app
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.mesh import Mesh, disk, locate, signed_areas
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.run import solver_for
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene.mesh_file import read_triangulation
from actin_xcheck.scene.outline import Fit, caveats, read_mesh, refined, write_mesh
from actin_xcheck.scene.resolve import resolve
from actin_xcheck.scene.scene import load_scene
from fem.space import Space
from tests.lab import film_of, scene_of

pytestmark = pytest.mark.usefixtures("read_here")

SQUARE = np.array([[-1, 1, 1, -1, 0], [-1, -1, 1, 1, 0.0]])
FAN = np.array([[0, 1, 2, 3], [1, 2, 3, 0], [4, 4, 4, 4]])


GMSH = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
2 1 "cell"
$EndPhysicalNames
$Entities
1 1 1 0
1 -1 -1 0 0
1 -1 -1 0 1 1 0 0 2 1 -1
1 -1 -1 0 1 1 0 1 1 1 1
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
-1 -1 0
1 -1 0
1 1 0
-1 1 0
$EndNodes
$Elements
3 7 1 7
0 1 15 1
1 1
1 1 1 4
2 1 2
3 2 3
4 3 4
5 4 1
2 1 2 2
6 1 2 4
7 4 2 3
$EndElements
"""
"""All of a gmsh model, of which the surface only is in a physical group, as its option SaveAll writes it."""


def write(path, points, cells, kind="triangle", z=0.0, **options):
    points = np.vstack([points, np.full(points.shape[1], z) if np.isscalar(z) else z])
    blocks = cells if isinstance(cells, list) else [(kind, np.asarray(cells).T)]
    meshio.Mesh(points.T, blocks).write(path, **options)
    return path


def clover(path, n=48):
    """A smooth outline that is not convex: r = 1 + cos(3 theta)/4, with cells of about its sides' length."""
    theta = 2 * np.pi * np.arange(n) / n
    rim = (1 + np.cos(3 * theta) / 4) * np.array([np.cos(theta), np.sin(theta)])
    points = np.hstack(
        [rim, *(rim[:, :: 2 * k] * s for k, s in ((1, 0.75), (1, 0.5), (2, 0.25))), np.zeros((2, 1))]
    )
    triangles = Delaunay(points.T).simplices.T
    triangles = np.where(signed_areas(points, triangles) > 0, triangles, triangles[[0, 2, 1]])
    x, y = points[:, triangles].mean(axis=1)
    inside = np.hypot(x, y) < 1 + np.cos(3 * np.arctan2(y, x)) / 4 - 1e-3
    return write(path, points, triangles[:, inside])


@pytest.mark.parametrize(
    "suffix", [".vtu", ".vtk", ".xdmf", ".off", ".obj", ".ply", ".inp", ".mesh", ".med", ".xml", ".avs"]
)
def test_what_meshio_writes_is_read(tmp_path, suffix):
    own = disk(2, 0.8)
    write_mesh(tmp_path / f"cell{suffix}", own)
    mesh = read_mesh(tmp_path / f"cell{suffix}")
    assert np.allclose(mesh.xi, own.xi, atol=1e-7)
    assert np.array_equal(mesh.triangles, own.triangles)
    assert mesh.h == pytest.approx(own.h, rel=0.02)
    assert mesh.origin.startswith(f"cell{suffix} sha256:")


@pytest.mark.parametrize("version", ["gmsh22", "gmsh"])
def test_gmsh_files_are_read_and_what_is_no_triangle_beside_them_is_ignored(tmp_path, version):
    blocks = [("triangle", FAN.T)] + ([("line", FAN[:2].T), ("vertex", [[0]])] if version == "gmsh22" else [])
    path = write(tmp_path / "cell.msh", SQUARE, blocks, file_format=version)
    xi, triangles = read_triangulation(path)
    assert np.array_equal(xi, SQUARE)
    assert np.array_equal(triangles, FAN)


def test_what_is_in_no_physical_group_hinders_nobody(tmp_path):
    (tmp_path / "cell.msh").write_text(GMSH)
    xi, triangles = read_triangulation(tmp_path / "cell.msh")
    assert np.array_equal(xi, SQUARE[:, :4])
    assert np.array_equal(triangles, [[0, 3], [1, 1], [3, 2]])


@pytest.mark.parametrize("kind", ["int32", "int64", "uint8", "uint16", "uint32", "uint64"])
@pytest.mark.parametrize("binary", [True, False])
def test_node_numbers_are_whole_of_whatever_type(tmp_path, kind, binary):
    path = write(tmp_path / "cell.vtu", SQUARE, FAN.astype(kind), binary=binary)
    assert (
        f'type="{kind.replace("ui", "UI").replace("int", "Int").replace("UInt", "UInt")}' in path.read_text()
    )
    assert np.array_equal(read_triangulation(path)[1], FAN)


def test_what_vtk_packs_otherwise_is_read_by_vtk(tmp_path):
    cells = np.insert(FAN, 0, 3, axis=0).T
    surface = pyvista.PolyData(np.vstack([SQUARE, np.zeros(5)]).T, cells)
    for writer, data, name in (
        (vtk.vtkXMLUnstructuredGridWriter(), surface.cast_to_unstructured_grid(), "lz4.vtu"),
        (vtk.vtkXMLPolyDataWriter(), surface, "surface.vtp"),
    ):
        writer.SetInputData(data)
        writer.SetCompressorTypeToLZ4()
        writer.SetFileName(str(tmp_path / name))
        writer.Write()
        xi, triangles = read_triangulation(tmp_path / name)
        assert np.array_equal(xi, SQUARE)
        assert np.array_equal(triangles, FAN)


def test_surfaces_that_look_away_from_each_other_are_one_cell(tmp_path):
    turned = np.where(np.arange(4) % 2, FAN[[0, 2, 1]], FAN)
    xi, triangles = read_triangulation(write(tmp_path / "cell.vtu", SQUARE, turned))
    assert np.array_equal(xi, SQUARE)
    assert np.array_equal(triangles, FAN)


def test_clockwise_cells_are_turned_and_unused_nodes_left_out(tmp_path):
    points = np.hstack([np.full((2, 1), 7.0), SQUARE])
    xi, triangles = read_triangulation(write(tmp_path / "cell.vtu", points, FAN[[0, 2, 1]] + 1))
    assert np.array_equal(xi, SQUARE)
    assert signed_areas(xi, triangles).min() > 0


def _inverted():
    """The middle moved out of the square: the cell that it passed through lies on the others."""
    return np.hstack([SQUARE[:, :4], [[1.5], [0.0]]]), FAN


def _with_hole():
    ring = np.hstack([SQUARE[:, :4], SQUARE[:, :4] / 2])
    i, j = np.arange(4), (np.arange(4) + 1) % 4
    return ring, np.hstack([[i, j, j + 4], [i, j + 4, i + 4]])


def _hanging():
    points = np.hstack([SQUARE, [[0.5], [-0.5]]])  # within the side from node 1 to the middle
    return points, np.hstack([FAN[:, [0, 2, 3]], [[1, 2], [2, 4], [5, 5]]])


def _pinched():
    """Four cells more, from the fan's lower side round to its upper right corner: they touch it there."""
    points = np.hstack([SQUARE, [[0.8, 3.0, 1.5], [-3.0, 0.0, 0.2]]])
    return points, np.hstack([FAN, [[0, 5, 6, 7], [5, 6, 7, 6], [1, 1, 1, 2]]])


def _apart():
    return np.hstack([SQUARE, SQUARE + 3]), np.hstack([FAN, FAN + 5])


def _folded():
    points = np.hstack([SQUARE, [[0.0], [0.1]]])
    return points, np.hstack([FAN, [[0], [1], [5]]])


def _three_at_a_side():
    points = np.hstack([SQUARE, [[0.0], [-2.0]], [[0.5], [-2.5]]])
    return points, np.hstack([FAN, [[1, 1], [0, 0], [5, 6]]])


def _crossing():
    """A strip of cells that goes round more than once, its ends on top of each other."""
    theta = np.linspace(-0.2, 2 * np.pi + 0.4, 30)
    points = np.hstack([r * np.array([np.cos(theta), np.sin(theta)]) * (1 + theta / 50) for r in (0.5, 1.0)])
    i = np.arange(29)
    return points, np.hstack([[i, i + 30, i + 31], [i, i + 31, i + 1]])


def _duplicate_node():
    return np.hstack([SQUARE, SQUARE[:, :1]]), np.hstack([FAN[:, :3], [[3], [5], [4]]])


def _flat():
    return np.hstack([SQUARE, [[0], [-1.0]]]), np.hstack([FAN, [[0], [5], [1]]])


MISTAKES = {
    "inverted": (_inverted(), "cells 1 and 0 lie on one hand of the side they share"),
    "hole": (_with_hole(), "boundary is 2 loops, one of them about a hole"),
    "hanging": (_hanging(), "node 5 at .* lies within the side .*: a hanging node"),
    "pinched": (_pinched(), "touches itself in node 2 at"),
    "apart": (_apart(), "is in 2 pieces"),
    "folded": (_folded(), "lie on one hand of the side they share"),
    "three cells": (_three_at_a_side(), "3 cells meet at the side"),
    "crossing": (_crossing(), "crosses itself"),
    "duplicate cell": ((SQUARE, FAN[:, [0, 1, 2, 3, 1]]), "cells 1 and 4 are the same"),
    "duplicate node": (_duplicate_node(), "node 0 at .* and node 5 are one place"),
    "twice": ((SQUARE, np.hstack([FAN, [[0], [0], [4]]])), "names one node twice"),
    "flat": (_flat(), "cell 4 at .* has no area"),
    "not finite": ((np.where(np.arange(5) == 4, np.nan, SQUARE), FAN), "node 4 is not finite"),
    "micrometres": ((50 * SQUARE, FAN), "its farthest node is 70.71 from the origin"),
    "elsewhere": ((SQUARE + 4, FAN), "the origin is outside"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_what_is_no_mesh_of_one_cell_is_refused_in_one_line(tmp_path, name):
    (points, cells), sentence = MISTAKES[name]
    path = write(tmp_path / "bad.vtu", points, cells)
    with pytest.raises(UserError, match=sentence) as raised:
        read_mesh(path)
    message = str(raised.value)
    assert message.startswith(f"--mesh: {path}: ")
    assert "; valid: " in message
    assert "\n" not in message


@pytest.mark.slow
def test_other_cells_files_and_dimensions_are_refused_in_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.undo()  # readers complain of what they cannot read: in a process of their own
    quads = write(tmp_path / "quads.vtu", SQUARE, [("triangle", FAN.T), ("quad", np.array([[0, 1, 2, 3]]))])
    bent = write(tmp_path / "bent.vtu", SQUARE, FAN, z=np.array([0, 0, 0, 0, 1.0]))
    lines = write(tmp_path / "lines.vtu", SQUARE, FAN[:2], kind="line")
    far = write(tmp_path / "far.off", SQUARE, FAN + np.array([[0], [0], [9]]))
    for suffix in (".msh", ".vtu", ".xdmf", ".stl", ".txt"):
        (tmp_path / f"text{suffix}").write_text("not a mesh\n")
    garbled = [tmp_path / f"text{suffix}" for suffix in (".msh", ".vtu", ".xdmf", ".stl", ".txt")]
    sentences = {
        quads: "1 of type quad",
        bent: "z runs from 0 to 1",
        lines: "holds no triangle",
        far: "names the nodes",
        tmp_path / "none.vtu": "no such file",
        tmp_path: "no such file",
    } | dict.fromkeys(garbled, "meshio cannot read it|holds no triangle")
    for path, sentence in sentences.items():
        with pytest.raises(UserError, match=sentence):
            read_mesh(path)
    assert capsys.readouterr() == ("", "")


def test_a_refined_outline_keeps_its_arcs_its_polygon_and_its_normals(tmp_path):
    round_one = refined(
        read_mesh(write(tmp_path / "disk.vtu", disk(2, 0.75).xi, disk(2, 0.75).triangles)), 0.75, 2
    )
    assert np.allclose(np.hypot(*round_one.xi[:, round_one.rim_nodes]), 1, atol=1e-15)
    assert (np.abs(np.hypot(*round_one.xi) - 0.75) < 1e-14).sum() == 4 * 3 * 4
    assert not Fit.of(round_one, 0.75).crossed
    coarse = read_mesh(clover(tmp_path / "clover.vtu"))
    fine = refined(coarse, 0.8, 2)
    area = signed_areas(coarse.xi, coarse.triangles).sum()
    assert signed_areas(fine.xi, fine.triangles).sum() == pytest.approx(area, rel=1e-14)
    assert fine.triangles.shape[1] == 16 * coarse.triangles.shape[1]
    normals = fine.normals[:, fine.rim_nodes]
    turn = np.arccos(np.clip((normals * np.roll(normals, 1, axis=1)).sum(axis=0) / np.hypot(*normals) /
                             np.roll(np.hypot(*normals), 1), -1, 1))  # fmt: skip
    assert np.rad2deg(turn.max()) < 0.6 * Fit.of(coarse, 0.8).turn  # a polygon's own would keep its corners
    with pytest.raises(UserError, match="divides the mesh into"):
        refined(coarse, 0.8, 9)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_disk_of_unknown_origin_has_the_disks_rim_and_area(order):
    own = disk(3, 0.8)
    foreign = Space.on(Mesh(own.xi, own.triangles, own.h, layered=False), order, 0.8)
    directions = foreign.rim_normals / np.hypot(*foreign.rim_normals)
    assert np.abs(directions - foreign.xi[:, foreign.rim_nodes]).max() < 1e-14
    space = Space.on(own, order, 0.8)
    areas = [one.inside.at(one.xi).dx.sum() for one in (space, foreign)]
    assert areas[1] == pytest.approx(areas[0], rel=1e-13)


def test_the_arcs_of_curved_cells_fit_the_disk_to_twice_the_order():
    defects = {}
    for order in (2, 3, 4):
        for refine in (2, 3):
            own = disk(refine, 0.8)
            space = Space.on(Mesh(own.xi, own.triangles, own.h, layered=False), order, 0.8)
            defects[order, refine] = abs(space.inside.at(space.xi).dx.sum() - np.pi)
        observed = np.log2(defects[order, 2] / defects[order, 3])
        assert 2 * order - 0.3 < observed < 2 * order + 0.5


@pytest.mark.parametrize("closure", ["reference-normal", "current-normal", "traction-free"])
@pytest.mark.parametrize("method", ["fem-p1-paper", "fem-p2-imex3", "fv-order2"])
def test_actin_is_conserved_on_an_outline_that_is_not_convex(tmp_path, method, closure):
    mesh = read_mesh(clover(tmp_path / "clover.vtu"))
    scene = scene_of("psi = 60.0\np = 0.2", "1 + 0.1*x", 0.02, f'[model]\nclosure = "{closure}"\n')
    film, outcome = film_of(solver_for(resolve(scene), METHODS[method], mesh), 0.004, scene.output_times)
    assert outcome.ok, outcome
    assert film.residual < 1e-13
    assert np.abs(film.last.x - film.states[0].x).max() > 1e-4


def test_traction_free_motion_knows_nothing_of_the_nodes_that_were_tied(tmp_path):
    """Turned with its scene, the cell moves alike, though other rim nodes take the rigid motions out."""
    scene = scene_of("psi = 60.0\np = 0.2", "1 + 0.1*r**2", 0.02, '[model]\nclosure = "traction-free"\n')
    mesh = read_mesh(clover(tmp_path / "clover.vtu"))
    order = np.roll(np.arange(mesh.xi.shape[1]), 5)
    number = np.argsort(order)
    other = Mesh(mesh.xi[:, order], number[mesh.triangles], mesh.h, layered=False)
    ends = [
        film_of(solver_for(resolve(scene), METHODS["fem-p1-paper"], one), 0.004, scene.output_times)[0].last.x
        for one in (mesh, other)
    ]
    assert np.abs(ends[1] - ends[0][:, order]).max() < 1e-11


def test_material_points_are_found_in_an_outline_that_is_not_convex(tmp_path):
    mesh = read_mesh(clover(tmp_path / "clover.vtu"))
    points = mesh.centroids[:, ::7]
    cells, weights = locate(mesh, points)
    assert np.abs((weights * mesh.xi[:, mesh.triangles[:, cells]]).sum(axis=1) - points).max() < 1e-14
    assert np.abs(weights.min(axis=0) - 1 / 3).max() < 1e-12


def test_what_a_scene_needs_of_its_outline_is_said_or_refused(tmp_path):
    mesh = read_mesh(clover(tmp_path / "clover.vtu"))
    with pytest.raises(UserError, match="irrotational-wall is slip friction on the unit circle"):
        caveats(load_scene("mode-11-wall"), mesh)
    with pytest.raises(UserError, match="its modes are those of the unit disk"):
        caveats(load_scene("mode-0-cell"), mesh)
    with pytest.raises(UserError, match=r"probes.points: \(-1, 0\) is 0.2.* outside of the outline"):
        caveats(scene_of(more="[probes]\npoints = [[0, 0], [-1, 0]]\n"), mesh)
    assert "cells lie on both sides of the ring" in caveats(scene_of(), mesh)[0]
    none = '[model]\ndelta = "none"\n'
    assert not caveats(scene_of(more=none), mesh)
    assert not caveats(load_scene("mode-11-wall"), Mesh(*_own(3, 0.8), 0.125, layered=False))
    square = read_mesh(write(tmp_path / "square.vtu", SQUARE, FAN))
    assert "turns by 90 degrees" in caveats(scene_of(more=none), square)[0]


def _own(refine, l0):
    mesh = disk(refine, l0)
    return mesh.xi, mesh.triangles


def test_a_run_on_a_mesh_names_it_and_mistakes_exit_with_2(tmp_path, monkeypatch, capsys):
    write_mesh(tmp_path / "cell.vtu", disk(2, 0.8))
    run = ["run", "static-decay", "--method", "fem-p1-paper", "--dt", "0.1", "--quiet"]
    given = [*run, "--mesh", str(tmp_path / "cell.vtu")]
    for more, name in (([], "a"), (["--refine", "1"], "b")):
        app([*given, *more, "--out", str(tmp_path / f"{name}.vtkhdf")], standalone_mode=False)
    plain, finer = (read_run(tmp_path / f"{name}.vtkhdf") for name in "ab")
    assert plain.attributes["mesh"].startswith("cell.vtu sha256:")
    assert plain.attributes["fidelity"] == "full"
    assert [plain.xi.shape[1], finer.xi.shape[1]] == [41, 145]
    for bad, sentence in (
        ([*given, "--fidelity", "sector"], "not with --fidelity sector"),
        ([*run, "--mesh", str(tmp_path / "none.msh")], "no such file"),
    ):
        with pytest.raises(UserError, match=sentence):
            app([*bad, "--out", str(tmp_path / "c.vtkhdf")], standalone_mode=False)
