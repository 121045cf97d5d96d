"""A number is made again by the command that is printed beside it, whatever report it stands in."""

import shlex

import numpy as np
import pytest
from typer.testing import CliRunner

from actin_xcheck.cli.app import app
from actin_xcheck.core.model import Closure
from actin_xcheck.nightly.plan import suite
from actin_xcheck.nightly.record import read_night
from actin_xcheck.runs.executor import in_turn
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics, command
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.run import run
from actin_xcheck.runs.store import read_run, reading
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.scene.shelf import scene_text
from actin_xcheck.studies import compare as comparison
from actin_xcheck.studies.audit import AuditEntry
from actin_xcheck.studies.checks import SUITE, Reduced, Studied, Tolerated
from actin_xcheck.studies.closures.measure import Course, follow
from actin_xcheck.studies.converge import Error, Order
from actin_xcheck.studies.distort.cases import FAMILIES, answer_of, cases_of
from actin_xcheck.studies.extremes.attempt import trials
from actin_xcheck.studies.study import carry_out_here
from actin_xcheck.verdicts.judge import judge
from tests.lab import FEM, FV

P1, P2, FV_2 = "fem-p1-imex2", "fem-p2-imex3", "fv-order2"


def typed(line, *more):
    """Do what a printed command says, in this process; a claim that fails is no reason to complain."""
    words = shlex.split(line)
    assert words[:3] == ["python", "-m", "actin_xcheck"]
    with in_turn():
        done = CliRunner().invoke(app, [*words[3:], *more])
    assert done.exit_code in (0, 1), done.output
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception


def test_what_is_given_is_written_to_the_last_bit_and_what_is_not_is_left_out():
    given = {"method": (FEM, FV), "dt": np.float64(0.1), "rtol": None, "mesh": np.nan, "remesh": True}
    assert command("run", "a b.toml", **given, force=False) == (
        f"python -m actin_xcheck run 'a b.toml' --method {FEM} --method {FV} --dt 0.1 --remesh"
    )


CASES = {
    "a claim of each kind but two": (["growing-disk"], [FEM, FV], 2, 0.1, None),
    "growth": (["mode-11-wall"], [FEM, FV], 2, None, None),
    "references, steps chosen": (["fig14-four-fronts"], [P1, FV_2], 2, 0.03, 1e-3),
    "steps chosen by one of two": (["growing-disk"], [P2, FV], 2, 0.1, 1e-3),
}
LONG = ("growth", "references, steps chosen")


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [pytest.param(one, marks=pytest.mark.slow) if one in LONG else one for one in CASES]
)
def test_every_claim_and_every_run_of_a_comparison_is_made_again(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scenes, methods, refine, dt, rtol = CASES[case]
    loaded = [load_scene(name) for name in scenes]
    (tmp_path / "c").mkdir()
    jobs = comparison.jobs_of(loaded, [METHODS[one] for one in methods], refine, dt, rtol)
    claims = carry_out_here("compare", comparison.compare(jobs), tmp_path / "c", "").claims
    found = {}
    for number, line in enumerate(dict.fromkeys(claim.command for claim in claims)):
        typed(line, "--out", str(number), "--quiet")
        found[line] = comparison.read_comparison(tmp_path / str(number) / comparison.FILE_NAME).claims
    for claim in claims:
        (again,) = (one for one in found[claim.command] if one.key == claim.key)
        assert np.array_equal([again.value, again.bound], [claim.value, claim.bound], equal_nan=True)
    for file in (tmp_path / "c").glob("*.vtkhdf"):
        kept = read_run(file)
        typed(kept.attributes["command"], "--quiet")
        series = read_run(tmp_path / file.name).series
        assert all(np.array_equal(series[name], kept.series[name], equal_nan=True) for name in kept.series)


def test_the_bound_of_a_run_that_chose_its_steps_is_made_of_those_it_took(tmp_path):
    """Of the largest it might have taken the bound would be 0.3, and 4 % too much would pass."""
    scene, path = load_scene("fig14-four-fronts"), tmp_path / "t.vtkhdf"
    run(scene, Numerics(METHODS[P1], 3, scene.time.end, 1e-5), path)
    kept = read_run(path)
    taken = np.diff(kept.series["time"]).max()
    assert taken < 0.1 * kept.attributes["dt"]
    (area,) = (claim for claim in judge(scene, {P1: kept}) if claim.quantity == "area")
    assert area.bound == pytest.approx(1.2 / 64 + 4.5 * taken)
    assert f"dt = {taken:g}, the largest step chosen by the tolerance 1e-05" in area.note
    assert "--rtol 1e-05" in area.command


def test_what_no_other_command_makes_is_a_check_of_a_night():
    names = {item.name for item in suite()}
    for check in SUITE:
        assert check.name in names
        assert not set("*?[") & set(check.name)  # --only takes patterns


@pytest.mark.slow
@pytest.mark.parametrize(
    "check",
    [
        next(one for one in SUITE if isinstance(one, Reduced) and one.method == FEM),
        next(one for one in SUITE if isinstance(one, Studied) and one.method == P1),
        next(one for one in SUITE if isinstance(one, Tolerated) and one.method == P2),
    ],
    ids=lambda check: check.name,
)
def test_claims_of_the_checks_are_made_again_by_their_commands(check, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c").mkdir()
    with in_turn():
        claims = check.claims(tmp_path / "c")
    for number, line in enumerate(dict.fromkeys(claim.command for claim in claims)):
        wanted = [(one.value, one.bound) for one in claims if one.command == line]
        typed(line, "--out", str(number), "--quiet")
        if shlex.split(line)[3] == "compare":
            made = comparison.read_comparison(tmp_path / str(number) / comparison.FILE_NAME).claims
        else:
            made = next(read_night(path.parent) for path in tmp_path.rglob("night.jsonl")).claims
        assert set(wanted) <= {(one.value, one.bound) for one in made}


@pytest.mark.slow
def test_an_order_is_made_again_by_its_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    typed(command("converge", "static-decay", method=P1, out="one"), "--quiet")
    orders = _table(tmp_path / "one" / "converge.h5", "orders", Order)
    for number, line in enumerate({order.command for order in orders}):
        typed(line, "--out", str(number), "--quiet")
        files = (tmp_path / one / "converge.h5" for one in ("one", str(number)))
        first, again = (_table(file, "errors", Error) for file in files)
        assert [one.error for one in again] == [one.error for one in first]


def _table(path, name, kind):
    with reading(path, "report") as file:
        return read_table(file[f"tables/{name}"], kind)


def test_a_row_of_the_audit_is_made_again_by_its_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    typed(command("paper", only="fig20a", out="one"), "--quiet")
    (entry,) = _table(tmp_path / "one" / "paper.h5", "rows", AuditEntry)
    typed(entry.command, "--out", "two", "--quiet")
    assert _table(tmp_path / "two" / "paper.h5", "rows", AuditEntry) == [entry]


def test_a_run_on_a_distorted_mesh_is_made_again_by_its_command(tmp_path, monkeypatch):
    """In the report's folder, wherever the scene was when it was asked for."""
    (tmp_path / "mine.toml").write_text(scene_text("static-decay"))
    monkeypatch.chdir(tmp_path)
    scene, folder = load_scene("mine.toml"), tmp_path / "distort"
    case, _ = cases_of(scene, METHODS[P1], FAMILIES["perturbed"], 0.3)
    answer = answer_of(case, folder)
    monkeypatch.chdir(folder)
    typed(case.command(scene), "--quiet")
    made = read_run(folder / "run.vtkhdf").series
    assert made["area"][-1] == pytest.approx(answer.said.area, rel=1e-14)
    assert made["probe_a"][-1] == pytest.approx(answer.said.a[: len(scene.probes.points)], rel=1e-12)
    assert len(made["time"]) == answer.said.steps + 1


def test_a_rim_is_made_again_by_its_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    course = Course("rough-swelling", FEM, Closure.CURRENT_NORMAL, 0)
    rim = follow(course, tmp_path)
    typed(course.command, "--quiet")
    made = read_run(tmp_path / f"{course.key}.vtkhdf")
    assert np.array_equal(made.series["time"], rim.times)
    gaps = np.abs(made.points[-1][:, None] - rim.rims[-1][:, :, None]).max(axis=0)
    assert gaps.min(axis=1).max() < 1e-13  # every node of the rim is one of the run's


def test_breakdowns_and_twins_are_made_again_by_extremes_itself():
    """`run` tells neither: minutes, so that the words alone are looked at."""
    assert {one.command for one in trials()} == {command("extremes", only=one.scene) for one in trials()}
