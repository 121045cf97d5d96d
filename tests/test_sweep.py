"""Sweeps: what a file asks for, that nothing is run twice, and that a lost process costs its own run only."""

import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import actin_xcheck
from actin_xcheck.cli.output import SweepAnswer
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.parameters import Fidelity
from actin_xcheck.report.exhibits import read_chapters
from actin_xcheck.runs import accuracy as accuracies
from actin_xcheck.runs import executor as executors
from actin_xcheck.runs.executor import executor
from actin_xcheck.runs.numerics import Wanted
from actin_xcheck.scene.scene import load_scene, parse_scene
from actin_xcheck.studies import sweep as sweeping
from actin_xcheck.studies.sweep import LOG, SweepRun, finished, read_table
from actin_xcheck.studies.sweep.charts import chapters_of
from actin_xcheck.studies.sweep.plan import points_of
from tests.processes import cluster, started, wait_until
from tests.test_cli import cli, one_line

SMALL = """
scene = "static-decay"
[over.parameters]
d = { from = 1e-3, to = 1e-1, count = 3, scale = "log" }
psi = [0.0, 10.0]
"""
NUMERICS = {"refine": 1, "dt": 0.25, "fidelity": "full"}
SWEEP = "sweep sweep.toml --out out"
OPTIONS = ("--method", "fem-p1-paper", "--refine", 1, "--dt", 0.25, "--fidelity", "full", "--quiet")


def sweep_file(folder: Path, text: str) -> Path:
    path = folder / "sweep.toml"
    path.write_text(text, encoding="utf-8")
    return path


def starts(folder: Path) -> Counter[str]:
    """How often each run was begun."""
    lines = (folder / LOG).read_text(encoding="utf-8").splitlines() if (folder / LOG).exists() else []
    return Counter(line.split()[1] for line in lines)


def test_ranges_are_combined_with_the_last_one_fastest(tmp_path: Path) -> None:
    points = points_of(sweep_file(tmp_path, SMALL))
    given = [(point.values["parameters.d"], point.values["parameters.psi"]) for point in points]
    assert given == [(d, psi) for d in np.geomspace(1e-3, 1e-1, 3) for psi in (0.0, 10.0)]
    scenes = [parse_scene(point.text, "here") for point in points]
    assert [(scene.parameters.d, scene.parameters.psi) for scene in scenes] == given
    base = load_scene("static-decay")
    assert all(scene.output_times == base.output_times and scene.probes == base.probes for scene in scenes)


def test_ranges_side_by_side_and_lists_of_scenes(tmp_path: Path) -> None:
    zipped = SMALL.replace("count = 3", "count = 2").replace("[over", 'combine = "zip"\n[over')
    points = points_of(sweep_file(tmp_path, zipped))
    assert [tuple(point.values.values()) for point in points] == [(1e-3, 0.0), (1e-1, 10.0)]
    (tmp_path / "mine.toml").write_text(points[1].text, encoding="utf-8")
    text = 'scenes = ["growing-disk", "mine.toml"]\n[over.model]\nrheology = ["viscous", "viscoelastic"]\n'
    points = points_of(sweep_file(tmp_path, text))
    assert [(point.scene, point.values["model.rheology"]) for point in points] == [
        ("growing-disk", "viscous"), ("growing-disk", "viscoelastic"),
        ("mine.toml", "viscous"), ("mine.toml", "viscoelastic"),
    ]  # fmt: skip
    alone = points_of(sweep_file(tmp_path, 'scenes = ["growing-disk"]'))
    assert [point.text for point in alone] == [load_scene("growing-disk").text]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("scene = 3", ("scene = 3", "string")),
        ("", ("scene", "scenes a list")),
        ('scene = "static-decay"\nscenes = ["growing-disk"]', ("scene = 'static-decay'",)),
        ('scene = "static-deca"', ("unknown scene", "static-deca'", "static-decay,")),
        ('scenes = ["missing.toml"]', ("missing.toml", "cannot be read")),
        ('scene = "static-decay"\nrange = 1', ("range", "unknown key", "combine")),
        ('scene = "static-decay"\n[over]\npsi = 3', ("over.psi = 3", "from")),
        ('scene = "static-decay"\n[over.parameters]\nd = []', ("over.parameters.d = []",)),
        ('scene = "static-decay"\n[over]\nx = { from = 1, to = 2 }', ("over.x", "count is missing")),
        ('scene = "static-decay"\n[over]\nx = { from = 1, to = 2, count = 1 }', ("over.x.count = 1", "2")),
        ('scene = "static-decay"\n[over]\nx = { from = 1, to = 2, count = 2, step = 1 }', ("step", "scale")),
        ('scene = "static-decay"\n[over]\nx = { from = -1.0, to = 2, count = 2, scale = "log" }', ("sign",)),
        (SMALL.replace("[over", 'combine = "zip"\n[over'), ("parameters.d has 3", "parameters.psi has 2")),
        (SMALL.replace("count = 3", "count = 100000"), ("200000 runs", "100000")),
        (SMALL.replace("psi = [", "psy = ["), ("parameters.psy", "did you mean psi")),
        (SMALL.replace("psi = [0.0", "psi = [-3.0"), ("parameters.d = 0.001, parameters.psi = -3.0:",)),
        (SMALL + '[over.name]\nfirst = ["x"]', ("name.first", "no table")),
        ("scene = \x00", ("not valid TOML",)),
    ],
)  # fmt: skip
def test_a_mistake_in_the_file_is_one_line_and_nothing_is_run(
    text: str, parts: tuple[str, ...], tmp_path: Path
) -> None:
    path = sweep_file(tmp_path, text)
    with pytest.raises(UserError) as mistake:
        actin_xcheck.sweep(path, "fem-p1-paper", out=tmp_path / "out", jobs=1, **NUMERICS)
    said = str(mistake.value)
    assert "\n" not in said
    for part in parts:
        assert part in said
    assert not starts(tmp_path / "out")


def test_a_key_is_that_of_scene_method_numerics_and_code_alone(monkeypatch) -> None:
    one = SweepRun(load_scene("static-decay").text, "here", Wanted("fem-p1-paper"), "sweep")
    same = replace(one, origin="there", command="another")
    others = [
        replace(one, text=load_scene("growing-disk").text),
        *(
            replace(one, numerics=numerics)
            for numerics in (
                Wanted("fv-coupled"),
                Wanted("fem-p1-paper", refine=4),
                Wanted("fem-p1-paper", dt=0.1),
                Wanted("fem-p1-paper", rtol=1e-3),
                Wanted("fem-p1-paper", fidelity=Fidelity.FULL),
                Wanted("fem", accuracy=1e-2),
                Wanted("fem", accuracy=1e-3),
            )
        ),
    ]
    keys = {each.key for each in (one, same, *others)}
    assert same == one
    assert len(keys) == 1 + len(others)
    monkeypatch.setattr(sweeping, "code", lambda: "other code")
    assert one.key not in keys


@pytest.mark.slow
def test_a_sweep_is_its_runs_and_goes_on_where_it_was(tmp_path: Path, command) -> None:
    path, out = sweep_file(tmp_path, SMALL), tmp_path / "out"
    done = command("sweep", path, *OPTIONS, "--jobs", 2, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    answer = SweepAnswer.model_validate_json(done.stdout)
    assert (answer.runs, answer.made, answer.outcomes) == (6, 6, {"completed": 6})
    table = read_table(out)
    assert set(starts(out).values()) == {1}
    assert set(starts(out)) == set(table["key"])

    for row, file in enumerate(table["file"]):
        run = actin_xcheck.load(out / file)
        last = {name: values[-1] for name, values in run.series.items()}
        for name in ("time", "area", "total_actin", "polarity", "a_max"):
            assert table[name][row] == last[name]
        assert [table[f"probe_a_{i}"][row] for i in range(5)] == last["probe_a"].tolist()
        assert [table[f"probe_x_4_{axis}"][row] for axis in "xy"] == last["probe_x"][4].tolist()
        assert parse_scene(run.attributes["scene"], "here").parameters.psi == table["parameters.psi"][row]
        assert (table["dt"][row], table["refine"][row], table["steps"][row]) == (0.25, 1, 2)
    still, moving = table["parameters.psi"] == 0, table["parameters.psi"] == 10
    assert np.ptp(table["area"][still]) == 0  # without contraction nothing moves, whatever diffuses
    assert np.all(table["area"][moving] != table["area"][still])

    csv = (out / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert len(csv) == 7
    assert csv[0].split(",") == list(table.columns)

    again = actin_xcheck.sweep(path, "fem-p1-paper", out=out, jobs=1, **NUMERICS)
    assert set(starts(out).values()) == {1}  # nothing was run
    for name, values in table.columns.items():
        assert np.array_equal(again[name], values, equal_nan=values.dtype.kind == "f"), name

    with h5py.File(out / table["file"][2], "r+") as file:  # a damaged one alone is run again
        del file["run/series/area"], file["run"].attrs["outcome"]
    larger = sweep_file(tmp_path, SMALL.replace("psi = [0.0", "psi = [5.0, 0.0"))
    more = actin_xcheck.sweep(larger, "fem-p1-paper", out=out, jobs=1, **NUMERICS)
    assert starts(out).pop(table["key"][2]) == 2
    assert Counter(starts(out).values()) == {1: 5 + 3, 2: 1}  # and what a larger sweep has on top
    wrong = sweep_file(tmp_path, SMALL.replace("psi = [0.0", "psi = [-5.0, 0.0"))
    with pytest.raises(UserError, match="should be greater"):
        actin_xcheck.sweep(wrong, "fem-p1-paper", out=out, jobs=1, **NUMERICS)
    assert len(read_table(out)) == 9  # a mistake changes nothing
    kept = more["parameters.psi"] != 5
    assert np.array_equal(more["total_actin"][kept], table["total_actin"])


@pytest.mark.slow
def test_runs_that_fail_are_rows_and_the_others_go_on(tmp_path: Path, command) -> None:
    text = 'scene = "sec54-failure"\n[over]\nparameters.psi = [1.0, 1.04e5]\ntime = [{ end = 0.01 }]\n'
    sweep_file(tmp_path, text)
    words = "sweep sweep.toml --method fem-p1-paper --refine 1 --dt 0.001 --jobs 1 --out out --quiet"
    done = command(words)
    assert done.returncode == 1
    assert "2 runs, 2 of them made now: 1 completed, 1 tangled" in done.stdout
    table = read_table(tmp_path / "out")
    assert table["outcome"].tolist() == ["completed", "tangled"]
    assert "signed area" in table["message"][1]
    assert table["time"][1] < table["time"][0] == 0.01
    assert set(table["scene.time"]) == {'{"end": 0.01}'}
    done = command(words)
    assert done.returncode == 1
    assert "0 of them made now" in done.stdout  # a failure is an answer too
    done = command(words, "--force")
    assert "2 of them made now: 1 completed, 1 tangled" in done.stdout
    assert set(starts(tmp_path / "out").values()) == {2}
    (tmp_path / "out" / "journal.sqlite").unlink()
    (tmp_path / "out" / "sweep.h5").rename(tmp_path / "out" / "compare.h5")
    one_line(command(words), "holds compare.h5 already; valid: another folder, or --force")
    assert command(words, "--force").returncode == 1


@pytest.mark.slow
def test_an_exception_is_a_row_and_is_tried_again(tmp_path: Path) -> None:
    """Growth is measured against an unperturbed run, step by step: not with steps chosen by their error."""
    path = sweep_file(tmp_path, 'scene = "mode-1-cell"\n[over.initial]\na = ["1", "1 + 1e-4*x"]\n')
    for times in 1, 2:
        table = actin_xcheck.sweep(path, "fem-p1-imex2", out=tmp_path / "out", jobs=1, refine=1, rtol=1e-2)
        assert table["outcome"].tolist() == ["completed", "error"]
        assert "unperturbed" in table["message"][1]
        assert np.isnan(table["area"][1])
        assert [starts(tmp_path / "out")[key] for key in table["key"]] == [1, times]


MANY = """
scene = "static-decay"
[over.parameters]
psi = { from = 0.0, to = 5.0, count = 20 }
d = { from = 1e-3, to = 1e-1, count = 25, scale = "log" }
"""


@pytest.mark.slow
def test_a_cluster_without_workers_is_not_waited_for(tmp_path: Path, monkeypatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "ALONE", 1.0)
    with cluster(tmp_path, 1) as (address, (_, worker)), executor(1, address) as processes:
        results = processes.results(time.sleep, [0.0, 60.0])
        assert next(results) == (0, None)
        worker.kill()
        with pytest.raises(UserError, match="its workers are gone"):
            next(results)


@pytest.mark.slow
@pytest.mark.nightly
def test_a_sweep_on_a_cluster_loses_a_worker_and_nothing_else(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    sweep_file(tmp_path, MANY)
    out = tmp_path / "out"
    with cluster(tmp_path, 2) as (address, (_, *workers)):
        sweep = started(tmp_path, SWEEP, *OPTIONS, "--scheduler", address, "--json")
        wait_until(lambda: len(starts(out)) >= 100, 240)
        workers[0].kill()  # SIGKILL, in the middle of what it does
        said, _ = sweep.communicate(timeout=600)
    assert sweep.returncode == 0
    answer = SweepAnswer.model_validate_json(said)
    assert (answer.runs, answer.made, answer.outcomes) == (500, 500, {"completed": 500})
    table, begun = read_table(out), starts(out)
    assert len(set(table["key"])) == len(begun) == 500
    assert all(finished(out / file) for file in table["file"])
    twice = [key for key, times in begun.items() if times > 1]
    assert len(twice) <= 1  # what the lost worker was at
    assert all(begun[key] == 2 for key in twice)
    lines = [line.split() for line in (out / LOG).read_text(encoding="utf-8").splitlines()]
    lost, left = (str(worker.pid) for worker in workers)
    assert {line[3] for line in lines} == {lost, left}
    for key in twice:
        assert [line[3] for line in lines if line[1] == key] == [lost, left]

    done = cli(SWEEP, *OPTIONS, "--scheduler", address, cwd=tmp_path)
    assert "0 of them made now" in done.stdout  # it asks nobody: the cluster is gone
    assert starts(out) == begun


@pytest.mark.slow
def test_a_scheduler_without_workers_and_one_that_goes_are_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    sweep_file(tmp_path, SMALL.replace("count = 3", "count = 50"))
    with cluster(tmp_path, 0) as (address, _):
        done = cli(SWEEP, *OPTIONS, "--scheduler", address, cwd=tmp_path)
        one_line(done, "--scheduler", address, "has no workers")
    done = cli(SWEEP, *OPTIONS, "--scheduler", address, cwd=tmp_path)
    one_line(done, "--scheduler", address, "no scheduler answers")
    (tmp_path / "again").mkdir()
    with cluster(tmp_path / "again", 1) as (address, (scheduler, _)):
        sweep = started(tmp_path, SWEEP, *OPTIONS, "--scheduler", address)
        wait_until(lambda: len(starts(tmp_path / "out")) >= 20, 120)
        scheduler.kill()
        _, said = sweep.communicate(timeout=120)
    assert sweep.returncode == 2
    assert said == "actin_xcheck: --scheduler: it is gone; what was finished is kept\n"
    kept = read_table(tmp_path / "out")
    assert len(kept) >= 3
    assert set(kept["outcome"]) == {"completed"}


@pytest.mark.slow
def test_every_run_of_a_sweep_is_as_accurate_as_asked_and_says_so(tmp_path: Path) -> None:
    path = sweep_file(tmp_path, SMALL.replace("count = 3", "count = 2"))
    asked = {"out": tmp_path / "out", "jobs": 1, "accuracy": 1e-3}
    table = actin_xcheck.sweep(path, "fem", **asked)
    assert set(table["outcome"]) == {"completed"}
    assert set(table["method"]) == {"fem"}
    assert (table["accuracy"] == 1e-3).all()
    assert (table["error_estimate"] <= 1e-3).all()
    run = actin_xcheck.load(table.folder / table["file"][0])
    assert run.attributes["error_estimate"] == table["error_estimate"][0]
    assert actin_xcheck.sweep(path, "fem", **asked)["file"].tolist() == table["file"].tolist()
    assert set(starts(tmp_path / "out").values()) == {1}


def test_an_accuracy_out_of_reach_is_a_row_that_says_so_with_what_was_reached(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(accuracies, "LEVELS_ON_A_RAY", accuracies.LEVELS_ON_A_RAY[:2])
    monkeypatch.setattr(accuracies, "LEVELS", accuracies.LEVELS[:2])
    text = load_scene("fig14-four-fronts").text
    asked = SweepRun(text, "here", Wanted("fem", accuracy=1e-5))
    found = sweeping.work(asked, tmp_path)
    assert found.outcome == sweeping.ERROR
    assert "out of reach" in found.message
    assert 1e-5 < dict(found.numbers)["error_estimate"] < 1e-2
    assert sweeping.work(asked, tmp_path) == found


@pytest.mark.parametrize(
    ("methods", "options", "said"),
    [
        ("fv", {}, "not with --method fv; valid: --method fem"),
        (["fem", "fv"], {}, "not with --method fv; valid: --method fem alone"),
        ("fem", {"refine": 3}, "chooses --refine itself"),
        ("fem", {"accuracy": 2.0}, "2 is no error"),
    ],
)
def test_a_mistake_beside_an_accuracy_is_one_line(methods, options, said, tmp_path: Path) -> None:
    path = sweep_file(tmp_path, SMALL)
    with pytest.raises(UserError, match=said):
        actin_xcheck.sweep(path, methods, out=tmp_path / "out", **{"accuracy": 1e-3, **options})


@pytest.mark.slow
def test_a_page_shows_every_column_over_the_ranges(tmp_path):
    """psi and p over a rectangle: lines with the table's numbers, a map of outcomes, a cell a run."""
    asked = 'scene = "static-decay"\n[over.parameters]\npsi = [0, 1, 2]\np = [0.1, 0.3]\n'
    file, out = sweep_file(tmp_path, asked + '[over.model]\ndelta = ["full"]\n'), tmp_path / "out"
    table = actin_xcheck.sweep(file, "fem-p1-paper", out=out, jobs=1, refine=1, dt=0.1)
    names = [Path(each).name.rpartition("--")[0] for each in table["file"]]
    assert names[:2] == ["psi-0--p-0.1", "psi-0--p-0.3"]
    with h5py.File(tmp_path / "out" / "sweep.h5") as file:
        columns, cells = read_chapters(file["exhibits"])
    shown = {one.key: one for one in columns.exhibits}
    low, high = shown["area"].lines
    assert (low.label, high.label) == ("p = 0.1", "p = 0.3")
    of_high = table["parameters.p"] == 0.3
    assert np.array_equal(high.x, table["parameters.psi"][of_high])
    assert np.array_equal(high.y, table["area"][of_high])
    assert shown["outcomes"].names == ("completed",)
    assert shown["outcomes"].codes.shape == (2, 3)
    assert [len(one.shots) for one in cells.exhibits] == [6]
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "6 of 6" in page
    assert high.links == tuple(table["film"][of_high])
    assert sorted(sum(shown["outcomes"].links, ())) == sorted(table["film"])
    assert [one.link for one in cells.exhibits[0].shots] == table["film"].tolist()
    assert all((out / one).exists() for one in table["film"])


def test_what_did_not_complete_is_red_in_charts():
    columns = {
        "scene": np.array(["one"] * 3),
        "parameters.psi": np.array([1.0, 2.0, 3.0]),
        "method": np.array(["fem"] * 3),
        "outcome": np.array(["completed", "completed", "tangled"]),
        "area": np.array([3.0, 3.1, 2.0]),
        "file": np.array([""] * 3),
    }
    (chapter,) = chapters_of(Path(), columns, ("parameters.psi",))
    good, bad = chapter.exhibits[0].lines
    assert (good.red, bad.red, bad.said) == (False, True, ("tangled",))
    assert np.array_equal(good.y, [3.0, 3.1])
