"""The store: what is written is what VTK shows and what is read back; a destination is untouched or whole."""

import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import h5py
import numpy as np
import pytest
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from actin_xcheck.claims import Claim
from actin_xcheck.errors import UserError
from actin_xcheck.geometry import Mesh, disk
from actin_xcheck.result import Ending, Outcome
from actin_xcheck.store import (
    RUN_ATTRIBUTES,
    RunWriter,
    provenance,
    read_comparison,
    read_run,
    write_comparison,
)

TIMES = (0.0, 0.25, 1.0)
ATTRIBUTES = {name: f"some {name}" for name in RUN_ATTRIBUTES} | {"refine": 2, "dt": 0.25, "seed": 7}
CLAIM = Claim("ψ-scene", ("fem-p1", "fv"), "Area ≤ exact.", 1.5e-3, 2e-3, "python -m …", "/runs/s/m", "h²")


@pytest.fixture
def mesh() -> Mesh:
    return disk(2, 0.8)


def write(path: Path, mesh: Mesh, outcome: Outcome | None = None, steps: int = 600) -> None:
    """A cell that grows by the factor 1 + t, with fields that are different at every output time."""
    with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
        for t in TIMES:
            writer.frame(t, *fields(mesh, t))
        for n in range(steps):
            writer.record({"time": n, "centroid": (n, -n), "probe_x": np.full((3, 2), n), "probe_a": ()})
        writer.finish(outcome or Outcome(), wall_seconds=1.25)


def fields(mesh: Mesh, t: float) -> tuple[np.ndarray, ...]:
    x = (1 + t) * mesh.xi
    n_cells = mesh.triangles.shape[1]
    return x, 1 + t * mesh.xi[0], np.arange(n_cells) + t, x - mesh.xi, 2 * mesh.xi


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
    np.testing.assert_array_equal(run.triangles, mesh.triangles)
    np.testing.assert_array_equal(run.delta, delta(mesh))
    for frame, t in enumerate(TIMES):
        stored = run.points, run.a_points, run.a_cells, run.u, run.v
        for values, expected in zip(stored, fields(mesh, t), strict=True):
            np.testing.assert_array_equal(values[frame], expected)
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
        x, a_points, a_cells, u, v = fields(mesh, t)
        assert grid.GetCellType(0) == vtk.VTK_TRIANGLE
        points = vtk_to_numpy(grid.GetPoints().GetData())
        np.testing.assert_array_equal(points, np.pad(x.T, ((0, 0), (0, 1))))
        cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
        np.testing.assert_array_equal(cells.reshape(-1, 3).T, mesh.triangles)

        point_data, cell_data = grid.GetPointData(), grid.GetCellData()
        names = {point_data.GetArrayName(i) for i in range(point_data.GetNumberOfArrays())}
        assert names == {"a", "u", "v", "xi"}
        np.testing.assert_array_equal(vtk_to_numpy(point_data.GetArray("a")), a_points)
        for name, values in (("u", u), ("v", v), ("xi", mesh.xi)):
            vectors = vtk_to_numpy(point_data.GetArray(name))
            np.testing.assert_array_equal(vectors[:, :2].T, values)
            assert not vectors[:, 2].any()
        np.testing.assert_array_equal(vtk_to_numpy(cell_data.GetArray("a")), a_cells)
        np.testing.assert_array_equal(vtk_to_numpy(cell_data.GetArray("delta")), delta(mesh))


def test_text_is_utf8_of_any_length_except_what_vtk_reads(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh)
    with h5py.File(tmp_path / "run.vtkhdf") as file:
        kind = h5py.check_string_dtype(file["run"].attrs.get_id("scene").dtype)
        assert (kind.encoding, kind.length) == ("utf-8", None)
        kind = h5py.check_string_dtype(file["VTKHDF"].attrs.get_id("Type").dtype)
        assert (kind.encoding, kind.length) == ("ascii", len("UnstructuredGrid"))


def test_a_failed_run_keeps_its_file(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh, Outcome(Ending.TANGLED, "triangle 3 at t = 0.3"), steps=2)
    run = read_run(tmp_path / "run.vtkhdf")
    assert (run.attributes["outcome"], run.attributes["message"]) == ("tangled", "triangle 3 at t = 0.3")
    assert len(run.series["time"]) == 2


def test_an_exception_leaves_nothing_and_the_old_file_whole(tmp_path: Path, mesh: Mesh) -> None:
    path = tmp_path / "run.vtkhdf"

    def crash() -> None:
        with RunWriter(path, mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES) as writer:
            writer.frame(0.0, *fields(mesh, 0.0))
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
        writer.frame(0.0, *fields(mesh, 0.0))
        assert path.read_text() == "older"
        writer.finish(Outcome(), 0.0)
        assert read_run(path).times == [0.0]
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that cannot be caught")
def test_what_a_killed_process_leaves_opens_in_vtk_but_is_no_run(tmp_path: Path) -> None:
    script = """
        import os, signal, sys
        from pathlib import Path
        from actin_xcheck.geometry import disk
        from tests.test_store import ATTRIBUTES, RunWriter, delta, fields
        mesh = disk(2, 0.8)
        writer = RunWriter(Path(sys.argv[1]), mesh.xi, mesh.triangles, delta(mesh), ATTRIBUTES)
        for t in (0.0, 0.25):
            writer.frame(t, *fields(mesh, t))
        os.kill(os.getpid(), signal.SIGKILL)
    """
    path, root = tmp_path / "run.vtkhdf", Path(__file__).parents[1]
    command = [sys.executable, "-c", textwrap.dedent(script), str(path)]
    killed = subprocess.run(command, cwd=root, env=os.environ | {"PYTHONPATH": str(root)}, check=False)
    assert killed.returncode == -signal.SIGKILL
    (partial,) = tmp_path.iterdir()
    assert partial.match("run.vtkhdf.*.partial")
    assert vtk_reader(partial).GetNumberOfSteps() == 2
    with pytest.raises(UserError, match="lacks outcome"):
        read_run(partial)


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


def test_a_destination_that_cannot_be_written_is_the_users_mistake(tmp_path: Path, mesh: Mesh) -> None:
    with pytest.raises(UserError, match="cannot be written"):
        write(tmp_path / "absent" / "run.vtkhdf", mesh)


def spoil_schema(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file["run"].attrs["schema"] = 99


def spoil_length(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:3000])


def spoil_frames(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file["VTKHDF/Points"].resize(len(file["VTKHDF/Points"]) - 1, axis=0)


def spoil_series(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["run/series"]


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (Path.unlink, "no such file"),
        (lambda path: path.write_text("text"), "not a whole run"),
        (spoil_schema, "schema 99, but this version reads schema 1"),
        (spoil_length, "not a whole run"),
        (spoil_frames, "not a whole run"),
        (spoil_series, "not a whole run"),
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
    failed = Claim("alpha", ("fem-p1",), "Never.", float("nan"), 1.0, "true", "/runs/alpha/fem-p1")
    write_comparison(folder / "comparison.h5", [CLAIM, failed], paths, {"commit": "abc"})
    folder.rename(tmp_path / "two")

    comparison = read_comparison(tmp_path / "two" / "comparison.h5")
    assert comparison.claims[0] == CLAIM
    assert [claim.verdict for claim in comparison.claims] == ["PASS", "FAIL"]
    assert comparison.attributes["commit"] == "abc"
    assert list(comparison.runs) == list(paths)  # in the order given
    assert comparison.runs["zeta/fem-p1"].path.parent == tmp_path / "two" / "runs"
    with h5py.File(tmp_path / "two" / "comparison.h5") as file:  # the links are HDF5's own
        np.testing.assert_array_equal(file["runs/alpha/fem-p1/run/series/time"], np.arange(600))
    assert not list(tmp_path.rglob("*.partial"))


def test_a_comparison_without_one_of_its_runs_is_refused(tmp_path: Path, mesh: Mesh) -> None:
    write(tmp_path / "run.vtkhdf", mesh)
    write_comparison(tmp_path / "comparison.h5", [], {"s/m": tmp_path / "run.vtkhdf"}, {})
    (tmp_path / "run.vtkhdf").unlink()
    with pytest.raises(UserError, match=r"run\.vtkhdf: no such file"):
        read_comparison(tmp_path / "comparison.h5")


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(1.0, "PASS"), (2.0, "PASS"), (2.0000001, "FAIL"), (float("nan"), "FAIL"), (float("-inf"), "FAIL")],
)
def test_a_claim_holds_if_its_value_is_finite_and_within_the_bound(value: float, verdict: str) -> None:
    assert Claim("s", (), "…", value, 2.0, "", "").verdict == verdict


def test_provenance_names_what_computed() -> None:
    stated = provenance()
    assert stated["h5py"] == h5py.__version__
    assert stated["numpy"] == np.__version__
    assert {"python", "scipy", "scikit-fem", "fipy", "actin-xcheck", "platform", "commit"} <= set(stated)
    json.dumps(stated)
