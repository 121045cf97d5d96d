"""What surrounds a run must not change it: not the directory, the variables, the terminal or the streams."""

import io
import json
import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
from multiprocessing.connection import Listener
from pathlib import Path

import h5py
import pytest

import actin_xcheck
from actin_xcheck.cli import app as cli
from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.processes import have_room_for_sockets
from actin_xcheck.runs.provenance import provenance
from actin_xcheck.scene import shelf
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import shipped_scenes
from fv import mesh as fv_mesh
from tests.processes import posix
from tests.studies import numbers
from tests.test_report import ANOTHER_STYLE

LONG = "x" * 120
"""A folder's name that leaves no room for that of a socket in it."""

INLINE = "module://matplotlib_inline.backend_inline"
"""The backend that Jupyter sets, here where its package is not installed."""

ENVIRONMENTS = {
    "a long TMPDIR": {"TMPDIR": LONG},
    "Jupyter": {"MPLBACKEND": INLINE, "FORCE_COLOR": "1"},
    "a FiPy of another's": {
        **{"FIPY_SOLVERS": "petsc", "FIPY_INLINE": "1", "FIPY_DISPLAY_MATRIX": "1"},
        "FIPY_LOG_CONFIG": "nowhere",
    },
    "a hook of git's": {"GIT_DIR": "/nowhere", "GIT_WORK_TREE": "/", "GIT_INDEX_FILE": "none"},
    "no docstrings": {"PYTHONOPTIMIZE": "2"},
    "a locale without letters": {
        **{"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        "PYTHONIOENCODING": "ascii",
    },
    "no terminal and no home": {
        **{
            "TERM": "dumb",
            "COLUMNS": "20",
            "NO_COLOR": "1",
            "HOME": "/nowhere",
            "XDG_CACHE_HOME": "/nowhere",
        },
        **{"XDG_CONFIG_HOME": "/nowhere", "MPLCONFIGDIR": "/nowhere"},
    },
    "another time": {"SOURCE_DATE_EPOCH": "0", "TZ": "Pacific/Kiritimati", "PYTHONHASHSEED": "12"},
    "other paths": {
        "PYTHONPATH": f":{os.environ.get('PYTHONPATH', '')}:/nowhere",
        "PYTHONWARNINGS": "error",
    },
    "HDF5 for others": {"HDF5_DRIVER": "mpio", "HDF5_USE_FILE_LOCKING": "TRUE"},
}

ALL = {name: value for one in ENVIRONMENTS.values() for name, value in one.items()}

SHADOWS = ("fem", "fv", "fipy", "numpy", "h5py", "typing", "queue", "random", "selectors", "tempfile")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A working directory of someone who names files as we do and draws otherwise."""
    (tmp_path / "here").mkdir()
    (tmp_path / LONG).mkdir()
    for name in SHADOWS:
        (tmp_path / "here" / f"{name}.py").write_text(f"raise SystemExit('{name}.py of the directory')\n")
    style = "\n".join(f"{name}: {value}" for name, value in ANOTHER_STYLE.items())
    (tmp_path / "here" / "matplotlibrc").write_text(style)
    return tmp_path / "here"


def say(place: Path, around: dict[str, str], *words: object, **more) -> subprocess.CompletedProcess:
    """A command in such a directory and environment."""
    around = around | ({"TMPDIR": str(place.parent / LONG)} if "TMPDIR" in around else {})
    call = [sys.executable, "-m", "actin_xcheck", *map(str, words)]
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | more
    return subprocess.run(
        call, cwd=place, env=os.environ | around, text=True, timeout=300, check=False, **given
    )


def without_stderr() -> None:
    """In a process about to start: its standard error is closed, not just thrown away."""
    os.close(2)


@pytest.mark.slow
@posix
def test_everything_at_once_changes_no_bit_of_a_run_and_says_one_object(place: Path, tmp_path: Path) -> None:
    run = ("run", "static-decay", "--method", "fv-coupled", "--refine", 2, "--dt", 0.1, "--out", "a.vtkhdf")
    done = say(place, ALL, *run, "--json", stderr=None, preexec_fn=without_stderr)
    assert done.returncode == 0, done
    assert json.loads(done.stdout)["outcome"] == "completed"
    actin_xcheck.run("static-decay", "fv-coupled", refine=2, dt=0.1, out=tmp_path / "clean.vtkhdf")
    assert numbers(place / "a.vtkhdf") == numbers(tmp_path / "clean.vtkhdf")
    with h5py.File(place / "a.vtkhdf") as stored:
        assert stored["run"].attrs["commit"] == provenance()["commit"]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, bytes | str]]:
    folder = tmp_path_factory.mktemp("clean")
    return worked(folder, {})


def worked(place: Path, around: dict[str, str]) -> dict[str, dict[str, bytes | str]]:
    """What commands of each family compute, by file."""
    (place / "s.toml").write_text('scene = "static-decay"\n[over]\n"parameters.d" = [0.1, 0.2]\n')
    shared = ("--refine", 2, "--dt", 0.1, "--quiet")
    for words in (
        ("compare", "fig14-four-fronts", *shared, "--out", "c"),
        ("sweep", "s.toml", "--method", "fem-p2-imex3", *shared, "--out", "s"),
        ("report", "c"),
        ("export", "c/fig14-four-fronts--fv-paper.vtkhdf", "--to", "film.xdmf"),
        ("predict", "threshold", "--p", 0.26, "--m", 1, "--json"),
        ("scenes",),
    ):
        done = say(place, around, *words)
        assert done.returncode == 0, done
        assert "Traceback" not in done.stderr
    files = [*(place / "c").glob("*.vtkhdf"), place / "c/compare.h5", *(place / "s/runs").glob("*.vtkhdf")]
    return {file.name: numbers(file) for file in files}


@posix
@pytest.mark.slow
@pytest.mark.parametrize(
    "around", [ALL, *(pytest.param(one, marks=pytest.mark.nightly) for one in ENVIRONMENTS.values())]
)
def test_no_environment_changes_a_bit_of_any_command(around: dict, place: Path, clean: dict) -> None:
    """All at once; one by one, which says whose the fault is, every night."""
    found = worked(place, around)
    assert len(found) == 7
    assert found == clean


@posix
@pytest.mark.slow
def test_a_chart_measures_where_sockets_have_no_room(place: Path) -> None:
    (place / "own.py").write_text(
        "import operator\nfrom actin_xcheck.runs.processes import work_alone\n"
        "if __name__ == '__main__':\n    print(work_alone(operator.truth, 3))\n"
    )
    for name in SHADOWS:  # a script's own directory comes first by its owner's will
        (place / f"{name}.py").unlink()
    around = os.environ | {"TMPDIR": str(place.parent / LONG)}
    done = subprocess.run([sys.executable, "own.py"], cwd=place, env=around, capture_output=True, check=False)
    assert done.stdout == b"True\n", done


@posix
def test_sockets_have_room_where_tmpdir_leaves_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / LONG).mkdir()
    config = multiprocessing.current_process()._config
    monkeypatch.setitem(config, "tempdir", None)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / LONG))
    have_room_for_sockets()
    with Listener(family="AF_UNIX") as listener:
        assert Path(listener.address).exists()
    assert tempfile.gettempdir() == str(tmp_path / LONG)  # all else still goes where the user wants it


def test_a_fipy_that_is_there_with_other_solvers_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FIPY_SOLVERS", "petsc")
    monkeypatch.setattr(fv_mesh.fipy.solvers, "solver_suite", "petsc")
    with pytest.raises(UserError, match="petsc solvers already; valid: FIPY_SOLVERS=scipy"):
        fv_mesh._import_fipy()
    assert os.environ["FIPY_SOLVERS"] == "scipy"


def test_the_end_of_a_file_is_no_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> None:
        raise EOFError("a pipe's other end has gone")

    monkeypatch.setattr(shelf, "shipped_scenes", broken)
    monkeypatch.setattr(sys, "argv", ["actin_xcheck", "scenes"])
    with pytest.raises(EOFError, match="a pipe's other end"):
        cli.main()


class Terminal(io.StringIO):
    """Standard output that somebody looks at."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_scenes_are_as_wide_as_the_terminal(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stdout", terminal := Terminal())
    cli.app(["scenes"], standalone_mode=False)
    plain = re.sub(r"\x1b\[[0-9;]*m", "", terminal.getvalue())
    lines = [line.rstrip() for line in plain.splitlines()]
    assert max(map(len, lines)) <= columns
    assert {line.split()[0] for line in lines} >= set(shipped_scenes())  # to be typed again


def test_scenes_are_whole_lines_for_a_pipe(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    cli.app(["scenes"], standalone_mode=False)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + len(shipped_scenes())
    listed = [line.split()[0] for line in lines[1:]]
    assert sorted(listed) == sorted(shipped_scenes())
    for name, line in zip(listed, lines[1:], strict=True):
        assert load_scene(name).citation in line
        assert f"psi {load_scene(name).parameters.psi:g}, p " in line
