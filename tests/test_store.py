"""The store: what is written is what VTK shows and what is read back; a destination is untouched or whole."""

import json
import os
import re
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import vtk
from skfem import ElementTriP1
from skfem.quadrature import get_quadrature
from vtk.util.numpy_support import vtk_to_numpy

from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.contract import Frame
from actin_xcheck.core.errors import Ending, Outcome, UserError
from actin_xcheck.core.lagrange import areas as lagrange_areas
from actin_xcheck.core.lagrange import order_of, rule
from actin_xcheck.core.mesh import Mesh, disk, signed_areas
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.provenance import provenance
from actin_xcheck.runs.run import bind
from actin_xcheck.runs.store import RUN_ATTRIBUTES, RunWriter, annotate, read_run
from actin_xcheck.runs.vtkhdf import Film
from actin_xcheck.studies.compare import FILE_NAME, read_comparison
from tests.claims import claim
from tests.lab import scene_of
from tests.processes import posix
from tests.studies import write_comparison

TIMES = (0.0, 0.25, 1.0)
ATTRIBUTES = {name: f"some {name}" for name in RUN_ATTRIBUTES} | {"refine": 2, "dt": 0.25, "seed": 7}
CLAIM = claim(
    "Area ≤ exact.", 1.5e-3, 2e-3, kind=ClaimKind.EXACT, quantity="area", scene="ψ-scene",
    methods=("fem-p1", "fv"), command="python -m …", path="/runs/s/m", note="h²",
)  # fmt: skip


@pytest.fixture
def mesh() -> Mesh:
    return disk(2, 0.8)


def write(path: Path, mesh: Mesh, outcome: Outcome | None = None, steps: int = 600) -> None:
    """A cell that grows by the factor 1 + t, with fields that are different at every output time."""
    with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
        for t in TIMES:
            writer.frame(t, fields(mesh, t))
        for n in range(steps):
            writer.record({"time": n, "centroid": (n, -n), "probe_x": np.full((3, 2), n), "probe_a": ()})
        writer.finish(outcome or Outcome(), wall_seconds=1.25)


def fields(mesh: Mesh, t: float) -> Frame:
    x = (1 + t) * mesh.xi
    n_cells = mesh.triangles.shape[1]
    return Frame(x, 2 * mesh.xi, 1 + t * mesh.xi[0], np.arange(n_cells) + t)


def delta(mesh: Mesh) -> np.ndarray:
    return (np.hypot(*mesh.centroids) > 0.8).astype(float)


def test_a_run_is_read_back_as_it_was_written(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh)
    run = read_run(tmp_path / "run.vtkhdf")
    assert run.attributes == {
        **ATTRIBUTES,
        **{"schema": 1, "outcome": "completed", "message": "", "wall_seconds": 1.25},
    }
    np.testing.assert_array_equal(run.times, TIMES)
    np.testing.assert_array_equal(run.xi, mesh.xi)
    assert run.order == 1
    for nodes in (run.cells, run.corners, run.triangles):
        np.testing.assert_array_equal(nodes, mesh.triangles)
    np.testing.assert_array_equal(run.delta, delta(mesh))
    for frame, t in enumerate(TIMES):
        stored, expected = (run.points, run.v, run.a_points, run.a_cells), vars(fields(mesh, t)).values()
        for values, value in zip(stored, expected, strict=True):
            np.testing.assert_array_equal(values[frame], value)
        np.testing.assert_array_equal(run.u[frame], run.points[frame] - mesh.xi)
    assert {name: values.shape for name, values in run.series.items()} == {
        "time": (600,),
        "centroid": (600, 2),
        "probe_x": (600, 3, 2),
        "probe_a": (600, 0),  # no probes at all
    }
    np.testing.assert_array_equal(run.series["time"], np.arange(600))
    np.testing.assert_array_equal(run.series["centroid"][:, 1], -np.arange(600))


def vtk_reader(path: Path) -> vtk.vtkHDFReader:
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    return reader


def test_vtk_plays_the_film(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh)
    reader = vtk_reader(tmp_path / "run.vtkhdf")
    assert reader.GetNumberOfSteps() == len(TIMES)
    information = reader.GetOutputInformation(0)
    assert information.Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()) == TIMES
    for t in (*TIMES, TIMES[0]):  # and back again
        reader.UpdateTimeStep(t)
        grid = reader.GetOutput()
        x, v, a_points, a_cells = vars(fields(mesh, t)).values()
        assert grid.GetCellType(0) == vtk.VTK_TRIANGLE
        points = vtk_to_numpy(grid.GetPoints().GetData())
        np.testing.assert_array_equal(points, np.pad(x.T, ((0, 0), (0, 1))))
        cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
        np.testing.assert_array_equal(cells.reshape(-1, 3).T, mesh.triangles)

        point_data, cell_data = grid.GetPointData(), grid.GetCellData()
        names = {point_data.GetArrayName(i) for i in range(point_data.GetNumberOfArrays())}
        assert names == {"a", "u", "v", "xi"}
        np.testing.assert_array_equal(vtk_to_numpy(point_data.GetArray("a")), a_points)
        for name, values in (("u", x - mesh.xi), ("v", v), ("xi", mesh.xi)):
            vectors = vtk_to_numpy(point_data.GetArray(name))
            np.testing.assert_array_equal(vectors[:, :2].T, values)
            assert not vectors[:, 2].any()
        np.testing.assert_array_equal(vtk_to_numpy(cell_data.GetArray("a")), a_cells)
        np.testing.assert_array_equal(vtk_to_numpy(cell_data.GetArray("delta")), delta(mesh))


@pytest.mark.parametrize("k", [2, 3, 4])
def test_vtk_shows_curved_cells_and_polynomials_on_them(tmp_path: Path, k: int) -> None:
    """VTK's own P_k map gives the disk's area, its own P_k field the integral that `lagrange.py` reads."""
    solver = bind(scene_of(a="1 + x**2"), Numerics(METHODS[f"fem-p{k}-imex{min(k + 1, 4)}"], 3, 1.0))
    path = tmp_path / "run"
    grid, frame = solver.grid, solver.frame(solver.init())
    with RunWriter(path, grid.xi, grid.cells, np.zeros(grid.cells.shape[1]), ATTRIBUTES) as writer:
        writer.frame(0.0, frame)
        writer.finish(Outcome(), 0.0)
    reader = vtk_reader(path)
    reader.UpdateTimeStep(0.0)
    shown = reader.GetOutput()
    a = vtk_to_numpy(shown.GetPointData().GetArray("a"))
    area, total, flat = 0.0, 0.0, 0.0
    points, weights = get_quadrature(ElementTriP1(), 4 * k)
    for number in range(shown.GetNumberOfCells()):
        cell = shown.GetCell(number)
        assert (cell.GetCellType(), cell.GetOrder()) == (vtk.VTK_LAGRANGE_TRIANGLE, k)
        place = vtk_to_numpy(cell.GetPoints().GetData())[:, :2].T
        nodes = [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())]
        flat += np.linalg.det(place[:, 1:3] - place[:, :1]) / 2
        for r, weight in zip(points.T, weights, strict=True):
            values, slopes = [0.0] * len(nodes), [0.0] * (2 * len(nodes))
            cell.InterpolateFunctions((*r, 0.0), values)
            cell.InterpolateDerivs((*r, 0.0), slopes)
            dx = weight * np.linalg.det(place @ np.reshape(slopes, (2, -1)).T)
            area, total = area + dx, total + dx * (values @ a[nodes])
    assert flat == pytest.approx(np.pi, abs=0.03)
    assert abs(flat - np.pi) > 0.01
    assert area == pytest.approx(np.pi, abs={2: 1e-5, 3: 1e-8, 4: 1e-11}[k])
    run, of_total = read_run(path), rule(k, 4 * k)
    dx = of_total.dx(run.points[-1], run.cells)
    assert (of_total.blend(run.a_points[-1], run.cells) * dx).sum() == pytest.approx(total, rel=1e-13)
    assert lagrange_areas(run.points[-1], run.cells) @ run.a_cells[-1] == pytest.approx(total, rel=1e-13)
    assert total == pytest.approx(1.25 * np.pi, abs={2: 1e-4, 3: 1e-5, 4: 1e-6}[k])


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_what_is_drawn_of_a_cell_tiles_it(k: int) -> None:
    solver = bind(scene_of(), Numerics(METHODS[f"fem-p{k}-imex{min(k + 1, 4)}"], 2, 1.0))
    film = Film(*([np.zeros(1), solver.grid.xi, solver.grid.cells] + [np.zeros(1)] * 6))
    pieces = signed_areas(film.xi, film.triangles)
    assert pieces.min() > 0
    assert pieces.size == k**2 * film.cells.shape[1]
    on_rim = np.hypot(*film.xi) > 1 - 1e-5  # nodes of order 3 and 4 lie on P_k rims, not quite on the circle
    assert on_rim.sum() == 16 * k
    polygon = 16 * k / 2 * np.sin(2 * np.pi / (16 * k))  # its corners are not quite equidistant
    assert pieces.sum() == pytest.approx(polygon, rel=1e-3)
    assert film.corners.shape == (3, film.cells.shape[1])
    with pytest.raises(ValueError, match="5 nodes"):
        order_of(5)


def test_text_is_utf8_of_any_length_except_what_vtk_reads(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh)
    with h5py.File(tmp_path / "run.vtkhdf") as file:
        kind = h5py.check_string_dtype(file["run"].attrs.get_id("scene").dtype)
        assert (kind.encoding, kind.length) == ("utf-8", None)
        kind = h5py.check_string_dtype(file["VTKHDF"].attrs.get_id("Type").dtype)
        assert (kind.encoding, kind.length) == ("ascii", len("UnstructuredGrid"))


def test_an_exception_leaves_nothing_and_the_old_file_whole(tmp_path: Path, mesh: Mesh) -> None:
    path = tmp_path / "run.vtkhdf"

    def crash() -> None:
        with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
            writer.frame(0.0, fields(mesh, 0.0))
            raise RuntimeError("on its way")

    with pytest.raises(RuntimeError, match="on its way"):
        crash()
    assert not list(tmp_path.iterdir())
    write(path, mesh)
    before = path.read_bytes()
    with pytest.raises(RuntimeError, match="on its way"):
        crash()
    assert [*tmp_path.iterdir()] == [path]
    assert path.read_bytes() == before


def test_the_destination_changes_only_at_the_finish(tmp_path: Path, mesh: Mesh) -> None:
    path = tmp_path / "run.vtkhdf"
    path.write_text("older")
    with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
        writer.frame(0.0, fields(mesh, 0.0))
        assert path.read_text() == "older"
        writer.finish(Outcome(), 0.0)
        assert read_run(path).times == [0.0]
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that cannot be caught")
def test_what_a_killed_process_leaves_is_its_last_checkpoint(tmp_path: Path) -> None:
    script = """
        import os, signal, sys
        from pathlib import Path
        from actin_xcheck.core.mesh import disk
        from tests.test_store import ATTRIBUTES, Ending, Outcome, RunWriter, delta, fields
        mesh = disk(2, 0.8)
        writer = RunWriter(Path(sys.argv[1]), mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES)
        for t in (0.0, 0.25):
            writer.frame(t, fields(mesh, t))
            writer.record({"time": t})
        writer.checkpoint({"x": mesh.xi, "turned": mesh.xi.T}, Outcome(Ending.INTERRUPTED, "there"), 1.5)
        writer.frame(1.0, fields(mesh, 1.0))
        os.kill(os.getpid(), signal.SIGKILL)
    """
    path, root = tmp_path / "run.vtkhdf", Path(__file__).parents[1]
    command = [sys.executable, "-c", textwrap.dedent(script), str(path)]
    killed = subprocess.run(command, cwd=root, env=os.environ | {"PYTHONPATH": str(root)}, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert [*tmp_path.iterdir()] == [tmp_path / "run.partial.vtkhdf"]
    partial = tmp_path / "run.partial.vtkhdf"
    assert vtk_reader(partial).GetNumberOfSteps() == 2
    run = read_run(partial)
    assert (run.attributes["outcome"], run.attributes["wall_seconds"]) == ("interrupted", 1.5)
    assert run.times.tolist() == run.series["time"].tolist() == [0, 0.25]


def test_a_run_goes_on_from_its_checkpoint(tmp_path: Path, mesh: Mesh) -> None:
    """Arrays come back with their order in memory; what was written after the checkpoint is gone."""
    path = tmp_path / "run.vtkhdf"
    arrays = {"x": mesh.xi, "turned": mesh.xi.T, "waves": np.exp(1j * mesh.xi[0]), "fed": np.array(0.1)}
    with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
        writer.record({"time": 0.0})
        writer.checkpoint({"x": mesh.xi}, Outcome(Ending.INTERRUPTED), 0.0)
        writer.frame(0.0, fields(mesh, 0.0))
        writer.checkpoint(arrays, Outcome(Ending.INTERRUPTED), 0.0)
        writer.record({"time": 99.0})
        with pytest.raises(ValueError, match="every second of a checkpoint is not contiguous"):
            writer.checkpoint({"every second": mesh.xi[:, ::2]}, Outcome(Ending.INTERRUPTED), 0.0)
    assert [*tmp_path.iterdir()] == [tmp_path / "run.partial.vtkhdf"]
    with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES, goes_on=True) as writer:
        found = writer.last_checkpoint()
        assert set(found) == set(arrays)
        for name, array in arrays.items():
            assert (found[name].dtype, found[name].strides) == (array.dtype, array.strides)
            np.testing.assert_array_equal(found[name], array)
        assert writer.rows == 1
        writer.record({"time": 1.0})
        writer.frame(1.0, fields(mesh, 1.0))
        writer.finish(Outcome(), 2.0)
    assert [*tmp_path.iterdir()] == [path]
    run = read_run(path)
    assert run.times.tolist() == run.series["time"].tolist() == [0, 1]
    with h5py.File(path) as file:
        assert set(file["run"]) == {"series"}
    finer = disk(3, 0.8)
    (tmp_path / "run.vtkhdf").rename(tmp_path / "run.partial.vtkhdf")
    with pytest.raises(UserError, match="another mesh"):
        RunWriter(path, finer.xi, finer.triangles, delta(finer), ATTRIBUTES, goes_on=True)


def test_rows_must_be_alike(tmp_path: Path, mesh: Mesh) -> None:
    with RunWriter(tmp_path / "run", mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
        writer.record({"time": 0.0, "centroid": (0, 0)})
        for row in ({"time": 1.0}, {"time": 1.0, "centroid": (0, 0, 0)}, {"time": 1.0, "centre": (0, 0)}):
            with pytest.raises(ValueError, match="of the first"):
                writer.record(row)


def test_missing_attributes_are_named(tmp_path: Path, mesh: Mesh) -> None:
    some = {name: value for name, value in ATTRIBUTES.items() if name not in ("seed", "commit")}
    with pytest.raises(ValueError, match="lack seed, commit"):
        RunWriter(tmp_path / "run", mesh.xi, mesh.triangles, delta(mesh), some)
    assert not list(tmp_path.iterdir())


def within(spoil: Callable[[h5py.File], object]) -> Callable[[Path], None]:
    """What spoils something in the file at a path."""

    def spoiled(path: Path) -> None:
        with h5py.File(path, "a") as file:
            spoil(file)

    return spoiled


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (Path.unlink, "no such file"),
        (lambda path: path.write_text("text"), "not a whole run"),
        (lambda path: path.write_bytes(path.read_bytes()[:3000]), "not a whole run"),
        (
            within(lambda file: file["run"].attrs.update(schema=99)),
            "schema 99, but this version reads schema 1",
        ),
        (within(lambda file: file["VTKHDF/Points"].resize(1, axis=0)), "not a whole run"),
        (within(lambda file: file["run"].pop("series")), "not a whole run"),
    ],
)
def test_what_is_not_a_run_is_refused_in_one_line(tmp_path: Path, mesh: Mesh, spoil, reason: str) -> None:
    path = tmp_path / "run.vtkhdf"
    write(path, mesh)
    spoil(path)
    with pytest.raises(UserError, match=reason) as caught:
        read_run(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_comparison_is_read_back_after_its_folder_moved(tmp_path: Path, mesh: Mesh) -> None:
    folder = tmp_path / "one"
    (folder / "runs").mkdir(parents=True)
    paths = {f"{scene}/fem-p1": folder / "runs" / f"{scene}.vtkhdf" for scene in ("zeta", "alpha")}
    for path in paths.values():
        write(path, mesh)
    failed = claim("Never.", float("nan"), scene="alpha", methods=("fem-p1",))
    write_comparison(folder, [CLAIM, failed], paths, "again")
    folder.rename(tmp_path / "two")

    comparison = read_comparison(tmp_path / "two" / FILE_NAME)
    assert comparison.claims[0] == CLAIM
    assert [claim.verdict for claim in comparison.claims] == ["PASS", "FAIL"]
    assert comparison.attributes["command"] == "again"
    assert list(comparison.runs) == list(paths)  # in the order given
    assert comparison.runs["zeta/fem-p1"].path.parent == tmp_path / "two" / "runs"
    with h5py.File(tmp_path / "two" / FILE_NAME) as file:  # the links are HDF5's own
        np.testing.assert_array_equal(file["runs/alpha/fem-p1/run/series/time"], np.arange(600))
    assert not list(tmp_path.rglob("*.partial.*"))


def test_a_comparison_without_one_of_its_runs_is_refused(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh)
    write_comparison(tmp_path, [], {"s/m": tmp_path / "run.vtkhdf"})
    (tmp_path / "run.vtkhdf").unlink()
    with pytest.raises(UserError, match=r"run\.vtkhdf: no such file"):
        read_comparison(tmp_path / FILE_NAME)


@posix
def test_a_file_is_read_without_a_lock(tmp_path: Path, mesh: Mesh) -> None:
    """Where there are none, to ask for one fails as it does where another has it."""
    import fcntl

    write(tmp_path / "run.vtkhdf", mesh)
    file = write_comparison(tmp_path, [CLAIM], {"s/m": tmp_path / "run.vtkhdf"})
    with (tmp_path / "run.vtkhdf").open("r+b") as run, file.open("r+b") as comparison:
        for held in (run, comparison):
            fcntl.flock(held, fcntl.LOCK_EX)
        annotate(tmp_path / "run.vtkhdf", {"more": 1})
        (found,) = read_comparison(file).runs.values()
    assert found.attributes["more"] == 1


def test_the_commit_is_that_of_this_code_whatever_git_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    commit = provenance()["commit"]
    assert re.fullmatch(r"[0-9a-f]{40}(-dirty)?|unknown", commit)
    for name, value in {"GIT_DIR": "/nowhere", "GIT_WORK_TREE": "/", "GIT_INDEX_FILE": "none"}.items():
        monkeypatch.setenv(name, value)
    assert provenance()["commit"] == commit


def test_provenance_names_what_computed() -> None:
    stated = provenance()
    assert stated["h5py"] == h5py.__version__
    assert stated["numpy"] == np.__version__
    assert {"python", "scipy", "scikit-fem", "fipy", "actin-xcheck", "platform", "commit"} <= set(stated)
    json.dumps(stated)
