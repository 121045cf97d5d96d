"""Pictures, exports and the interface for notebooks: what is drawn and written is what was computed."""

import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from string import ascii_letters, digits

import meshio
import numpy as np
import pytest
import pyvista
from PIL import Image

import actin_xcheck
from actin_xcheck.cli.output import FilesAnswer, schemas
from actin_xcheck.core import lagrange
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import locked
from actin_xcheck.report.pictures import export
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.run import run as stored_run
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import load_scene
from tests.test_cli import cli, one_line
from tests.test_isolation import loaded_by

NAMES = [
    *("film", "a:b", "a b", " a", "über", "α", "p%20q", "h#x", "q&r", "it's", 'say "a"', "a<b", "a;b", "a.b"),
    "-a",
]
"""What people call films."""

PARAVIEW = """
import json, sys
from paraview.simple import OpenDataFile
for path in sys.argv[1:]:
    film = OpenDataFile(path)
    film.UpdatePipelineInformation()
    times = list(film.TimestepValues)
    film.UpdatePipeline(times[-1])
    found = film.GetDataInformation()
    print(json.dumps([path, times, found.GetNumberOfPoints(), found.GetBounds()[1]]))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tools")


@pytest.fixture(scope="module")
def curved(folder: Path) -> Run:
    """A cell of 16 curved triangles that grows."""
    path = folder / "curved.vtkhdf"
    return actin_xcheck.run("growing-disk", "fem-p2-imex3", refine=1, dt=0.05, fidelity="full", out=path)


@pytest.fixture(scope="module")
def straight(folder: Path) -> Run:
    path = folder / "straight.vtkhdf"
    return actin_xcheck.run("growing-disk", "fem-p1-paper", refine=1, dt=0.05, fidelity="full", out=path)


def test_importing_the_package_loads_nothing_and_pins_one_thread() -> None:
    pinned = "import os, actin_xcheck\nassert os.environ['OMP_NUM_THREADS'] == '1'"
    loaded = loaded_by("import os\nos.environ.pop('OMP_NUM_THREADS', None)\n" + pinned)
    assert not {name for name in loaded if name.startswith("actin_xcheck.")} | (
        loaded & {"numpy", "vtk", "h5py"}
    )
    others = {"fem", "fv", "fipy", "pyvista", "distributed"}
    assert not loaded_by("from actin_xcheck import run, load, sweep") & others


def test_the_interface_has_its_eight_names_and_no_other() -> None:
    from actin_xcheck import api

    names = ["chart", "converge", "cross_check", "load", "predict", "render", "run", "sweep"]
    assert actin_xcheck.__all__ == api.__all__ == names
    assert set(actin_xcheck.__all__) <= set(dir(actin_xcheck))
    for name in actin_xcheck.__all__:
        assert getattr(actin_xcheck, name) is getattr(api, name)
        assert getattr(api, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'lode'"):
        actin_xcheck.lode  # noqa: B018


def test_a_run_is_the_commands_to_the_last_bit_and_loads_as_arrays(tmp_path: Path, command) -> None:
    ours = actin_xcheck.run("static-decay", "fem-p1-paper", refine=2, dt=0.25)
    assert not ours.path.exists()  # nothing was asked to be kept
    path = tmp_path / "run.vtkhdf"
    done = command("run static-decay --method fem-p1-paper --refine 2 --dt 0.25 --out", path)
    assert done.returncode == 0, done.stderr
    theirs = actin_xcheck.load(str(path))
    for name in ("times", "xi", "cells", "points", "a_points", "a_cells", "u", "v"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
    for name, values in theirs.series.items():
        assert np.array_equal(ours.series[name], values, equal_nan=True), name
    assert ours.attributes["fidelity"] == theirs.attributes["fidelity"] == "sector"


def test_a_run_that_fails_is_a_result() -> None:
    failed = actin_xcheck.run("sec54-failure", "fem-p1-paper", refine=2, dt=1e-3)
    assert failed.attributes["outcome"] == "tangled"  # on so coarse a mesh
    assert "signed area" in failed.attributes["message"]
    assert 0 < failed.series["time"][-1] < 0.01


@pytest.mark.parametrize(
    ("call", "valid"),
    [
        (lambda: actin_xcheck.run("static-decay", "fem"), "fem-p1-paper"),
        (lambda: actin_xcheck.run("static-decay", "fem-p1-paper", rtol=1e-3), "fem-p2-imex3"),
        (lambda: actin_xcheck.run("static-decay", "fem-p1-paper", fidelity="half"), "sector"),
        (lambda: actin_xcheck.run("static-deca", "fem-p1-paper"), "did you mean static-decay"),
        (lambda: actin_xcheck.load("nothing.vtkhdf"), "no such file"),
    ],
)
def test_a_mistake_is_one_line(call, valid: str) -> None:
    with pytest.raises(UserError, match=valid) as mistake:
        call()
    assert "\n" not in str(mistake.value)


@pytest.mark.slow
def test_a_cross_check_is_the_commands(tmp_path: Path) -> None:
    found = actin_xcheck.cross_check("static-decay", refine=3, out=tmp_path / "c")
    assert {claim.scene for claim in found.claims} == {"static-decay"}
    assert all(claim.holds for claim in found.claims if claim.judged)
    assert set(found.runs) == {"static-decay/fem-p1-imex2", "static-decay/fv"}
    assert (tmp_path / "c" / "index.html").exists()
    made = [path.stat().st_mtime_ns for path in (tmp_path / "c").glob("*.vtkhdf")]
    again = actin_xcheck.cross_check("static-decay", refine=3, out=tmp_path / "c")
    assert again.claims == found.claims
    assert [path.stat().st_mtime_ns for path in (tmp_path / "c").glob("*.vtkhdf")] == made


def test_a_cross_check_waits_for_nobody(tmp_path: Path) -> None:
    with (
        locked(tmp_path / "index.html"),
        pytest.raises(UserError, match=r"index.html: another process is writing it"),
    ):
        actin_xcheck.cross_check("static-decay", out=tmp_path)


def test_no_report_is_overwritten_unasked(tmp_path: Path, command) -> None:
    for name in ("compare.h5", "index.html"):
        (tmp_path / name).write_text("of yesterday")
    compare = f"compare static-decay --out {tmp_path}"
    one_line(command(compare), str(tmp_path), "already; valid: another folder, or --force")
    assert {path.read_text() for path in tmp_path.iterdir()} == {"of yesterday"}
    assert len(list(tmp_path.iterdir())) == 2
    with locked(tmp_path / "index.html"):
        one_line(command(compare, "--force"), "index.html", "another process is writing it")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda folder: None, "no such folder"),
        (lambda folder: folder.write_text(""), "a file, no folder"),
        (lambda folder: folder.mkdir(), "an empty folder"),
        (lambda folder: (folder / "sweep.h5").mkdir(parents=True), "holds no report but sweep.h5;"),
        (
            lambda folder: [(folder / name).mkdir(parents=True) for name in "gbcdeaf"],
            "holds no report but a, b, c, d, e and 2 others;",
        ),
    ],
)
def test_a_folder_without_a_report_is_told_what_it_holds(make, said: str, tmp_path: Path, command) -> None:
    make(tmp_path / "f")
    valid = "valid: the folder of a command that writes a report"
    one_line(command("report", "f"), f"actin_xcheck: f: {said}", valid)


def area_in(picture: np.ndarray, half: float) -> float:
    """Area of what is coloured between title and colour bar, in a picture of what reaches to `half`."""
    assert picture.shape == (800, 800, 3)
    shown = picture[60:720]
    return float((shown.min(axis=2) < 250).sum() * (2 * 1.3 * half / 800) ** 2)


def test_curved_cells_are_drawn_curved(curved: Run, straight: Run, tmp_path: Path) -> None:
    """Sixteen curved cells draw a disk: 8 chords of its rim would leave out a tenth of it."""
    for run, chords in (curved, False), (straight, True):
        path = actin_xcheck.render(run, tmp_path / "cell.png", time=0.0)
        drawn = area_in(np.asarray(Image.open(path).convert("RGB")), np.abs(run.points).max())
        polygon = 4 * np.sin(np.pi / 4)
        assert drawn == pytest.approx(
            polygon if chords else np.pi, rel=0.01
        )  # the outline's width is half a per cent


def test_a_film_has_a_frame_for_each_output_time_and_grows_as_the_cell_does(
    curved: Run, tmp_path: Path
) -> None:
    path = actin_xcheck.render(curved.path, tmp_path / "cell.gif")
    areas = []
    with Image.open(path) as film:
        assert film.n_frames == len(curved.times) > 2
        assert film.info["duration"] == 250
        for frame in range(film.n_frames):
            film.seek(frame)
            areas.append(area_in(np.asarray(film.convert("RGB")), np.abs(curved.points).max()))
    stored = [lagrange.areas(x, curved.cells).sum() for x in curved.points]
    assert areas == pytest.approx(stored, rel=0.01)
    assert areas[-1] > 1.05 * areas[0]


def test_a_page_plays_a_run_and_says_what_it_comes_to(curved: Run, tmp_path: Path) -> None:
    text = actin_xcheck.render(curved, tmp_path / "cell.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="film-1">(.*?)</script>', text)[1])
    assert data["times"] == pytest.approx(curved.times)
    assert [one["name"] for one in data["runs"]] == [curved.attributes["method_name"]]
    assert f"<dt>area at the end</dt><dd>{curved.series['area'][-1]:.6g}</dd>" in text
    assert str(curved.attributes["command"]) in text
    assert "plotly" not in text  # which has no charts


def test_an_mp4_where_ffmpeg_is_there(curved: Run, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    path = actin_xcheck.render(curved, tmp_path / "cell.mp4", field="v")
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run([ffmpeg, "-v", "error", "-i", path, *raw], capture_output=True, check=True)
    assert len(done.stdout) == len(curved.times) * 800 * 800 * 3


def test_colours_are_those_of_the_field(curved: Run, tmp_path: Path) -> None:
    """Viridis brightens with its values: a of cos 2 theta, u and v of a disk that grows."""

    def brightness(field: str) -> dict[str, int]:
        path = actin_xcheck.render(curved, tmp_path / "c.png", field=field)
        picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
        places = {"centre": (400, 400), "east": (400, 680), "north": (120, 400), "inside": (440, 490)}
        return {name: picture[place].sum() for name, place in places.items()}

    for field in ("a", "a_cells"):
        seen = brightness(field)
        assert seen["east"] > seen["centre"] > seen["north"]
    for field in ("u", "v"):
        seen = brightness(field)
        assert seen["east"] == pytest.approx(seen["north"], abs=6)
        assert seen["east"] > seen["inside"] > seen["centre"]
    assert not curved.delta.any()  # the mesh is too coarse for a ring
    assert set(brightness("delta").values()) == {68 + 1 + 84}  # the darkest viridis


def test_what_cannot_be_drawn_is_one_line(curved: Run, tmp_path: Path, command) -> None:
    for arguments, parts in {
        ("--field", "b"): ("--field", "a_cells"),
        ("--time", 0.123): ("--time", "0.123", f"{curved.times[1]:g}"),
        ("--out", "cell.jpg"): (".png, .gif, .mp4, .html",),
        ("--out", "cell.html", "--field", "u"): ("plays a, not u",),
        ("--out", "cell.gif", "--time", 0): ("--time", ".png"),
    }.items():
        one_line(command("render", curved.path, *arguments), *parts)
    one_line(command("export", curved.path, "--to", "film.vtk"), "film.vtk", ".xdmf, .pvd")
    assert not list(tmp_path.iterdir())


def test_render_and_export_say_in_json_what_they_wrote_and_overwrite_nothing(
    curved: Run, tmp_path: Path, command
) -> None:
    frames = len(curved.times)
    for arguments, files, times in (
        (("render", curved.path, "--out", "c.png"), 1, 1),
        (("export", curved.path, "--to", "c.pvd"), 1 + frames, frames),
    ):
        done = command(*arguments, "--json")
        assert done.returncode == 0, done.stderr
        answer = FilesAnswer.model_validate_json(done.stdout)
        assert answer.command == arguments[0]
        assert (len(answer.files), len(answer.times)) == (files, times)
        assert all((tmp_path / file).exists() for file in answer.files)
        one_line(command(*arguments), "--force", "exists already")


def test_vtu_keeps_curved_cells_and_all_numbers(curved: Run, tmp_path: Path) -> None:
    listing, *files = export(curved, tmp_path / "film.pvd")
    sets = ET.parse(listing).getroot().iter("DataSet")
    assert [(float(one.get("timestep", "nan")), one.get("file")) for one in sets] == [
        (t, file.name) for t, file in zip(curved.times, files, strict=True)
    ]
    for frame, file in enumerate(files):
        seen = pyvista.read(file)
        assert set(seen.celltypes) == {pyvista.CellType.LAGRANGE_TRIANGLE}
        assert np.array_equal(seen.points[:, :2].T, curved.points[frame])
        assert np.array_equal(seen["a"], curved.a_points[frame])
        assert np.array_equal(seen["v"][:, :2].T, curved.v[frame])
        assert np.array_equal(seen["a_cells"], curved.a_cells[frame])
        assert np.array_equal(meshio.read(file).cells[0].data.T, curved.cells)


def test_xdmf_is_a_film_whose_points_move(curved: Run, tmp_path: Path) -> None:
    files = export(curved, tmp_path / "new.xdmf")
    assert [file.name for file in files] == ["new.xdmf", "new.h5"]
    reader = pyvista.get_reader(files[0])
    assert np.array_equal(reader.time_values, curved.times)
    for frame, t in enumerate(reader.time_values):
        reader.set_active_time_value(t)
        seen = reader.read()
        assert np.array_equal(seen.points[:, :2].T, curved.points[frame])
        assert np.array_equal(seen["a"], curved.a_points[frame])
        assert seen.n_cells == 4 * curved.cells.shape[1]  # k^2 straight triangles
        assert np.array_equal(seen["a_cells"], np.repeat(curved.a_cells[frame], 4))


@pytest.mark.parametrize("name", NAMES)
def test_a_film_is_opened_whatever_it_is_called_and_wherever_from(
    curved: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "f:ö").mkdir()
    for suffix in (".xdmf", ".pvd"):
        monkeypatch.chdir(tmp_path / "f:ö")
        first, *others = export(curved, Path(f"{name}{suffix}"))
        assert first == Path(f"{name}{suffix}")
        # ParaView's own reader of .pvd is not in VTK: it takes a ':' in what is listed for a drive
        assert all(set(other.name) < set(f"{ascii_letters}{digits}-._~%") for other in others)
        for path, cwd in ((first, Path.cwd()), (first.resolve(), tmp_path), (Path("f:ö", first), tmp_path)):
            monkeypatch.chdir(cwd)
            reader = pyvista.get_reader(path)
            assert np.array_equal(reader.time_values, curved.times)
            reader.set_active_time_value(curved.times[-1])
            seen = reader.read()
            seen = seen[0] if suffix == ".pvd" else seen
            assert np.array_equal(seen.points[:, :2].T, curved.points[-1])
            assert np.array_equal(seen["a"], curved.a_points[-1])


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("pvpython"), reason="needs ParaView (Debian: python3-paraview)")
def test_paraview_opens_every_film(curved: Run, tmp_path: Path) -> None:
    """The suffix that ParaView 5.11 opens too, and XDMF; by a bare name that aborts on any XDMF with HDF5."""
    films = [
        export(curved, tmp_path / f"{name}{suffix}")[0] for name in NAMES for suffix in (".pvd", ".xdmf")
    ]
    done = subprocess.run(
        ["pvpython", "--force-offscreen-rendering", "-", *films],
        input=PARAVIEW,
        capture_output=True,
        text=True,
    )
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    last = [curved.times.tolist(), curved.xi.shape[1], pytest.approx(curved.points[-1, 0].max(), rel=1e-6)]
    assert found == [[str(film), *last] for film in films], done.stderr


def test_what_no_reader_opens_or_somebody_else_wrote_is_one_line(
    curved: Run, tmp_path: Path, command
) -> None:
    if os.name == "posix":
        for path in ("a\\b.pvd", "a\\b/film.xdmf"):
            one_line(command("export", curved.path, "--to", path), "backslash")
    for film, theirs in (("film.xdmf", "film.h5"), ("film.pvd", "film-0001.vtu")):
        (tmp_path / theirs).write_text("mine")
        one_line(command("export", curved.path, "--to", film), f"--to: {theirs} exists already", "--force")
        assert (tmp_path / theirs).read_text() == "mine"
        assert not (tmp_path / film).exists()
    with pytest.raises(UserError, match="holds no frame"):
        export(replace(curved, times=curved.times[:0]), tmp_path / "none.pvd")


def test_no_display_is_needed(curved: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":77")
    assert cli("render", curved.path, "--out", "cell.png", cwd=tmp_path).returncode == 0
    assert (tmp_path / "cell.png").exists()


def test_a_script_that_draws_is_not_run_once_more(curved: Run, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(f"import actin_xcheck\nprint(actin_xcheck.render({str(curved.path)!r}, 'cell.png'))\n")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout == "cell.png\n"
    assert (tmp_path / "cell.png").exists()


def test_scenes_made_in_python_are_run_too(tmp_path: Path) -> None:
    scene = load_scene("static-decay")
    ours = actin_xcheck.run(scene, "fv-coupled", refine=2, dt=0.5, fidelity="full")
    outcome = stored_run(scene, Numerics(METHODS["fv-coupled"], 2, 0.5), tmp_path / "f.vtkhdf")
    assert outcome.ok
    assert np.array_equal(actin_xcheck.load(tmp_path / "f.vtkhdf").a_cells, ours.a_cells)


def test_every_answer_has_a_schema_that_names_its_command_and_explains_itself() -> None:
    for name, schema in schemas().items():
        assert name.endswith("Answer")
        assert schema["description"]
        assert not schema["additionalProperties"]
        command = schema["properties"]["command"]
        assert command.get("const") or command.get("enum") or name == "CostAnswer"  # of any command
    assert "no file before" in schemas()["SweepAnswer"]["properties"]["made"]["description"]
