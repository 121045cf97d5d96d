"""The commands as a user meets them: one line and exit code 2 for a mistake, 1 for a failure, files kept."""

import json
import os
import shlex
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pytest

import actin_xcheck
from actin_xcheck.cli import app as commands
from actin_xcheck.core import files as folders
from actin_xcheck.core.files import report_folder
from actin_xcheck.runs.executor import cores, in_turn, jobs_asked
from actin_xcheck.scene.shelf import scene_text, shipped_scenes
from tests.processes import posix

SERIES = {
    "time": (), "dt": (), "area": (), "total_actin": (), "balance_residual": (), "centroid": (2,),
    "polarity": (), "a_min": (), "a_max": (), "jacobian_min": (), "probe_a": (5,), "probe_x": (5, 2),
}  # fmt: skip


def cli(line, *arguments, cwd):
    command = [sys.executable, "-W", "error", "-m", "actin_xcheck", *shlex.split(line), *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def one_line(done, *parts):
    """The command failed as a user's mistake does, and its line says all of this."""
    assert done.returncode == 2, done
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    for part in parts:
        assert part in done.stderr


def test_run_stores_what_it_promises(tmp_path):
    done = cli("run static-decay --method fv-coupled --refine 2 --dt 0.1 --out new/run.vtkhdf", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "completed" in done.stdout
    with h5py.File(tmp_path / "new/run.vtkhdf") as file:
        run = file["run"]
        for name, shape in SERIES.items():
            assert run["series"][name].shape == (7, *shape), name
        assert run["series/time"][0] == 0
        assert run["series/time"][-1] == 0.5
        assert set(
            ["outcome", "message", "scene", "method", "schema", "seed", "versions", "commit", "wall_seconds"]
        ) <= set(run.attrs)
        assert run.attrs["outcome"] == "completed"
        assert set(file["VTKHDF/PointData"]) == {"a", "u", "v", "xi"}
        assert set(file["VTKHDF/CellData"]) == {"a", "delta"}
        assert np.array_equal(file["VTKHDF/Steps/Values"][:], [0, 0.25, 0.5])


def test_an_existing_output_is_kept_without_force(tmp_path, command):
    run = "run static-decay --method fem-p1-paper --refine 2 --dt 0.25 --out a.vtkhdf"
    assert command(run).returncode == 0
    first = (tmp_path / "a.vtkhdf").read_bytes()
    one_line(command(run), "a.vtkhdf", "--force")
    assert (tmp_path / "a.vtkhdf").read_bytes() == first
    assert command(run, "--force", "--quiet").returncode == 0


def test_a_run_that_fails_exits_1_and_keeps_its_file(tmp_path, command):
    (tmp_path / "strong.toml").write_text(
        'name = "strong"\n[parameters]\npsi = 7800.0\np = 0.026\n'
        '[initial]\na = "1 + 1e-3*cos(x)"\n[time]\nend = 0.1\n',
        encoding="utf-8",
    )
    done = command("run strong.toml --method fem-p1-paper --refine 3 --dt 0.001 --out s.vtkhdf")
    assert done.returncode == 1
    assert "singular_dilation" in done.stdout
    with h5py.File(tmp_path / "s.vtkhdf") as file:
        assert file["run"].attrs["outcome"] == "singular_dilation"
        assert "1 + phi" in file["run"].attrs["message"]
        assert 0 < file["run/series/time"][-1] < 0.1


WRONG = 'name = "mine"\n[parameters]\nspi = 1.0\np = 0.1\n[initial]\na = "1 + 0.1*x"\n[time]\nend = 0.1\n'
SWEEP = 'scene = "static-decay"\n[over.parameters]\nd = [1e-3, 1e-2]\n'
ONE = "--out x.vtkhdf"


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (f"run mine.toml --method fem-p1-paper {ONE}", ["mine.toml", "parameters.spi (did you mean psi?)"]),
        *((f"{study} mine.toml", ["mine.toml", "parameters.spi"])
          for study in ("compare", "converge", "chart", "distort", "frontier --scene")),
        (f"run fig11 --method fem-p1-paper {ONE}",
         ["scene 'fig11' begins more than one name", "fig11-two-fronts-single"]),
        ("compare --method fv-d --method fv-t --method fv-",
         ["method 'fv-' begins more than one name; valid: fv-paper"]),
        ("run stirred --refine 3", ["--refine: of which method?"]),
        ("predict modes --psi 1", ["--p: is missing; valid: a number, or --scene"]),
        (f"run stirred --method fem {ONE}", ["'fem'", "fem-p1-paper", "fv-tpfa"]),
        ("run stirred --method fv-coupled --out x.h5", ["x.h5", ".vtkhdf"]),
        (f"run stirred --method fv-coupled --dt 0 {ONE}", ["--dt", "0"]),
        (f"run stirred --method fv-coupled --dt nan {ONE}", ["--dt", "nan"]),
        (f"run sec54-failure --method fem-p1-paper --remesh {ONE}",
         ["--remesh: not for fem-p1-paper; valid with fv, fv-paper, fem-p1-imex2"]),
        (f"run stirred --method fem-p2-imex3 --remesh {ONE}", ["--remesh: stirred prescribes its motion"]),
        (f"run mode-40.toml --method fem-p1-paper {ONE}", ["mode-40.toml", "no mode (2, 40)"]),
        ("scenes show nothing.toml", ["nothing.toml"]),
        ("predict modes --psi 270 --p 0 --delta none --above -1 --json", ["--above", "-1/mu1"]),
        ("predict modes --psi 1 --p 0 --delta none --m 8:0", ["--m", "8:0"]),
        *((f"{study} no-such-scene", ["unknown scene"])
          for study in ("compare", "converge", "chart", "distort", "frontier --scene")),
        *((f"{study} --method fem", ["'fem'", "not a method"])
          for study in ("compare", "converge", "chart stirred", "distort", "frontier", "closures")),
        ("sweep sweep.toml --method fem", ["'fem'", "not a method"]),
        ("converge static-decay same.toml", ["more than one scene"]),
        ("converge smooth-fronts --method fv-tpfa", ["stall"]),
        ("distort smooth-fronts --method fv-driven", ["follows another run's nodes"]),
        ("closures --method fv-driven", ["moves its rim as another"]),
        ("frontier --over psi,q", ["--over: 'psi,q' is not a plane; valid: psi,dt"]),
        ("frontier --scene mode-11-wall", ["starts on a mode"]),
        ("frontier --scene growing-disk", ["moves as prescribed"]),
        ("frontier --scene static-decay", ["--scene: static-decay", "psi > 0"]),
        ("extremes --only fig14-four-fronts", ["'fig14-four-fronts' is not in the study; valid:"]),
        ("faults --only fv-leak --only gone", ["--only: 'gone' is not a fault; valid: rim-integral-sign, "]),
        ("paper --only fig41", ["'fig41'", "fig21"]),
        ("random --count 0", ["--count"]),
        ("sweep sweep.toml --method fem-p1-paper --rtol 1e-3", ["--rtol", "fem-p2-imex3"]),
        *((f"{study} --jobs 2 --scheduler tcp://here:1", ["--jobs", "--scheduler", "one of the two"])
          for study in ("frontier", "nightly", "sweep sweep.toml --method fem-p1-paper")),
        *((f"{study} --quiet --scheduler nonsense://here", ["--scheduler", "nonsense"])
          for study in ("frontier --out out", "nightly --out out",
                        "sweep sweep.toml --method fem-p1-paper --out out")),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_and_nothing_is_written(words, parts, tmp_path, command):
    texts = {"mine": WRONG, "same": scene_text("static-decay"), "sweep": SWEEP}
    texts["mode-40"] = scene_text("mode-2-cell").replace("n = 1", "n = 40")
    for name, text in texts.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    one_line(command(words), *parts)
    left = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert left - {"journal.sqlite", "history.sqlite"} == {f"{name}.toml" for name in texts}


@pytest.mark.slow
def test_compare_writes_one_folder_and_report_makes_the_page_again(tmp_path, command):
    done = cli("compare growing-disk --refine 3 --dt 0.05 --out c", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "claims hold; report: c/index.html" in done.stdout
    names = {"compare.h5", "index.html", "journal.sqlite"} | {
        f"growing-disk--{m}{coarser}.vtkhdf"
        for m in ("fem-p1-imex2", "fv")
        for coarser in ("", "--coarser-1", "--coarser-2")
    }
    assert {path.name for path in (tmp_path / "c").iterdir()} == names
    page = (tmp_path / "c/index.html").read_bytes()
    (tmp_path / "c").rename(tmp_path / "moved")
    assert command("report", "moved").returncode == 0
    assert (tmp_path / "moved/index.html").read_bytes() == page
    one_line(command("converge", "growing-disk", "--out", "moved"), "moved", "--force")


def test_compare_exits_1_where_a_claim_fails(command):
    """The exhibit fails its own claims: FiPy's diffusion alone does not converge."""
    with in_turn():
        done = command("compare stirred --method fv-tpfa --refine 4 --dt 0.005 --out c")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "FAIL stirred [fv-tpfa]" in done.stdout


def test_scenes_lists_and_shows(tmp_path, command):
    listed = command("scenes")
    assert listed.returncode == 0
    assert "fig14-four-fronts" in listed.stdout
    shown = command("scenes", "show", "fig14-four-fronts")
    assert 'name = "fig14-four-fronts"' in shown.stdout
    (tmp_path / "own.toml").write_text(shown.stdout, encoding="utf-8")
    done = command("run own.toml --method fem-p1-paper --refine 2 --dt 0.05 --out own.vtkhdf")
    assert done.returncode == 0


def test_the_ill_posed_closure_is_warned_of_and_the_gauged_one_reports_its_loads(tmp_path, command):
    text = (
        'name = "n"\n[parameters]\npsi = 60.0\np = 0.2\n[model]\nclosure = "{}"\n'
        '[initial]\na = "1 + 0.1*x"\n[time]\nend = 0.02\n'
    )
    for closure in ("current-normal", "traction-free"):
        (tmp_path / "n.toml").write_text(text.format(closure), encoding="utf-8")
        with in_turn():
            done = command("compare n.toml --refine 2 --dt 0.01 --out", closure)
        assert done.returncode == 0, done.stdout + done.stderr
        page = (tmp_path / closure / "index.html").read_text(encoding="utf-8")
        assert ("ill-posed" in done.stderr) == ("ill-posed" in page) == (closure == "current-normal")
        assert ("Net torque" in page) == (closure == "traction-free")
    with h5py.File(tmp_path / "traction-free" / "n--fem-p1-imex2.vtkhdf") as file:
        assert abs(file["run/series/net_force"][1, 0]) > 0.1
        assert np.abs(file["run/series/net_torque"][1:]).max() < 1e-10


def test_reports_of_the_same_second_have_folders_of_their_own(tmp_path, monkeypatch):
    class Still(datetime):
        @classmethod
        def now(cls):
            return cls(2026, 3, 4, 5, 6, 7)

    monkeypatch.setattr(folders, "datetime", Still)
    monkeypatch.chdir(tmp_path)
    names = [report_folder(None, "compare").name for _ in range(3)]
    assert names == ["compare-20260304-050607", "compare-20260304-050607-2", "compare-20260304-050607-3"]
    assert sorted(path.name for path in (tmp_path / "reports").iterdir()) == names
    assert report_folder(Path("mine"), "compare") == Path("mine")
    assert not Path("mine").exists()  # what is asked for is checked first


@pytest.mark.parametrize(
    ("words", "made"),
    [(["run", "static-decay"], 1), (["nightly"], 1), (["predict", "modes"], 22), (["chrat"], 22), ([], 22)],
)
def test_a_command_that_is_named_is_made_alone(words, made, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["actin_xcheck", *words])
    asked = commands._asked_for()
    assert len(asked.registered_commands) + len(asked.registered_groups) == made
    assert len(commands.app.registered_commands) + len(commands.app.registered_groups) == 22
    assert made > 1 or asked.registered_commands[0].name == words[0]


@posix
@pytest.mark.slow
def test_a_system_without_memory_is_one_line(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))"
    asked = "run growing-disk --method fem-p1-paper --refine 10 --dt 0.1 --fidelity full --out run.vtkhdf"
    words = ["actin_xcheck", *asked.split()]
    call = f"import sys; sys.argv = {words}; {limit}; from actin_xcheck.cli.app import main; main()"
    command = [sys.executable, "-c", call]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    cost, mistake = done.stderr.splitlines()
    assert (done.returncode, cost.split(": ")[0]) == (2, "growing-disk · fem-p1-paper")
    assert mistake.startswith("actin_xcheck: the system has no more memory (")


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processors cannot be taken away here")
def test_processes_are_as_many_as_processors_may_be_used():
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        assert cores() == jobs_asked(None, None) == 1
    finally:
        os.sched_setaffinity(0, allowed)
    assert cores() == len(allowed)
    assert jobs_asked(7, None) == 7


def test_the_beginning_of_a_name_is_enough_and_nothing_said_of_how_is_an_accuracy(tmp_path, command):
    assert command("run static-d --quiet").returncode == 0
    with h5py.File(tmp_path / "static-decay--fem.vtkhdf") as file:
        assert file["run"].attrs["accuracy"] == 1e-3
    assert command("run static-d --method fv-coup --refine 2 --dt 0.25 --quiet").returncode == 0
    with h5py.File(tmp_path / "static-decay--fv-coupled.vtkhdf") as file:
        assert (file["run"].attrs["scene_name"], file["run"].attrs["method_name"]) == (
            "static-decay",
            "fv-coupled",
        )
    assert "--force" in command("run static-d --quiet").stderr


def test_what_it_will_cost_is_said_and_nothing_is_run(tmp_path, command):
    said = [
        command(f"{line} --dry-run").stdout
        for line in ("compare fig14", "run fig14", "run stirred --method fv")
    ]
    assert said[0].startswith("compare: 6 tasks at first, about ")
    assert "sector: about" in said[1]
    assert said[2].startswith("stirred: fv, refine 5, dt 0.005: about ")
    assert all(one.endswith("nothing was run\n") for one in said)
    answer = json.loads(command("compare fig14 --dry-run --json").stdout)
    assert (answer["command"], answer["tasks"], answer["seconds"] > 1) == ("compare", 6, True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("paper", "fig14"),
        ("extremes", "sec6-long-viscous"),
        ("faults", "fv-leak"),
        ("nightly", "compare static-decay fem-p1-paper refine 4"),
    ],
)
def test_what_only_takes_is_listed(line, name, tmp_path, command):
    listed = command(f"{line} --list").stdout.splitlines()
    assert [one for one in listed if one == name or (line == "nightly" and one.startswith("compare "))]
    assert not list(tmp_path.iterdir())


def test_scenes_are_found_by_a_word_and_are_json(command):
    found = json.loads(command("scenes --match two-fronts --json").stdout)["scenes"]
    assert [one["name"] for one in found] == ["fig11-two-fronts", "fig11-two-fronts-single"]
    names = [line.split()[0] for line in command("scenes").stdout.splitlines()[1:] if line.strip()]
    assert names.index("sec6-realistic") < names.index("growing-disk")  # what the article has comes first
    assert len(names) == len(shipped_scenes())


def test_the_version_and_help_are_short_words(command):
    assert command("--version").stdout == f"actin_xcheck {actin_xcheck.__version__}\n"
    assert command("compare -h").stdout.startswith("Usage: ")


@pytest.mark.slow
def test_a_prediction_says_of_what_and_takes_a_scene(command):
    said = command("predict threshold --scene mode-2-cell --d 0.5 --m 1:2")
    assert said.stdout.startswith(
        "p = 0, d = 0.5, a_sat = 1.4, mu1 = 2.5, mu2 = 6.5, nu = 0.3, viscoelastic, reference-"
    )
    rows = [line.split() for line in said.stdout.splitlines()[2:]]
    psi = [float(row[1]) for row in rows]
    assert ["lowest" in row for row in rows] == [one == min(psi) for one in psi]
    answer = json.loads(command("predict modes --psi 240 --p 0 --m 2 --json").stdout)
    assert answer["conditions"]["psi"] == 240
    assert answer["conditions"]["closure"] == "reference-normal"
