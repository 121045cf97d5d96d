"""The night: what is judged, what others read of it, and a night on a real cluster."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.cli.output import NightAnswer
from actin_xcheck.core.claim import Claim, ClaimKind
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly import carry_out as work
from actin_xcheck.nightly.carry_out import AskedItem, carry_out, ended
from actin_xcheck.nightly.items import CheckItem, Control, Diluted, Group, control, group_of
from actin_xcheck.nightly.plan import past, suite
from actin_xcheck.nightly.record import FILE_NAME, Done, NumberKind
from actin_xcheck.runs.executor import in_turn as in_this_process
from actin_xcheck.runs.method import METHODS
from actin_xcheck.runs.numerics import Numerics
from actin_xcheck.runs.processes import Lost
from actin_xcheck.runs.run import run
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies.checks import Compared
from actin_xcheck.studies.faults import FAULTS, held_against
from actin_xcheck.studies.faults.fault import replaced
from tests import nights
from tests.claims import claim
from tests.lab import FEM, FV
from tests.nights import ROOT, Stub, only_night
from tests.processes import cluster
from tests.test_cli import cli

night = nights.night  # a fixture

# what is read by others


@pytest.mark.parametrize(
    ("wish", "said"),
    [
        ({"fault": "no-such"}, "--fault: 'no-such' is not a fault; valid: rim-integral-sign"),
        ({"baseline": "2020"}, "no such file"),
        ({"resume": True}, "--resume: no night in"),
        (
            {"resume": True, "failed": True},
            "--resume: goes on with what the night was begun with; valid: without",
        ),
        ({"only": ("x",)}, "--only: no check is called 'x'"),
    ],
)
def test_a_mistake_is_one_line_and_makes_no_folder(night, tmp_path, wish, said):
    with pytest.raises(UserError, match=said):
        night(Stub("one"), **wish)
    assert list(tmp_path.iterdir()) == []


def test_the_summary_says_what_fails(night, tmp_path, capsys):
    stubs = (Stub("green"), Stub("red", value=3.0), Stub("none", value=np.nan), Stub("large", 1e3))
    assert night(*stubs, minutes=1.0, as_json=True) == 1
    said = json.loads(capsys.readouterr().out)
    kept = only_night(tmp_path)
    assert said == json.loads((kept.folder / "summary.json").read_text())
    assert NightAnswer.model_validate(said | {"failed": []}).green is False
    assert said["claims"] == {"PASS": 1, "FAIL": 2}
    assert [one["check"] for one in said["failed"]] == ["red", "none"]
    assert said["failed"][1]["value"] is None  # no number is a failure
    assert said["failed"][0]["file"] == "checks/red/kept.txt"
    assert list(said["not_run"]) == ["large"]


def test_junit_counts_what_fails_breaks_and_is_skipped(night, tmp_path):
    night(
        Stub("a <green> & one"),
        Stub("red", value=3.0),
        Stub("breaks", how="raises"),
        Stub("large", 1e3),
        minutes=1.0,
    )
    (path,) = tmp_path.glob("*/junit.xml")
    root = ET.parse(path).getroot()
    counts = ("tests", "failures", "errors", "skipped")
    assert [int(root.get(name)) for name in counts] == [4, 1, 1, 1]
    assert [suite.get("name") for suite in root] == ["a <green> & one", "red", "breaks", "large"]
    for suite_ in root:
        assert {"timestamp", "hostname"} <= set(suite_.attrib)
        cases = suite_.findall("testcase")
        tags = ("testcase", "testcase/failure", "testcase/error", "testcase/skipped")
        assert [len(suite_.findall(tag)) for tag in tags] == [int(suite_.get(name)) for name in counts]
        assert all(case.get("classname") == suite_.get("name") and case.get("name") for case in cases)
    assert root.find("testsuite/testcase/failure").get("message") == "3 > 1"
    assert r"no such \x01 mesh" in root.find("testsuite/testcase/error").get("message")


def test_a_baseline_must_not_be_undercut(night, tmp_path, capsys):
    assert night(Stub("one", value=0.2), Stub("two", value=1e-14)) == 0
    baseline = only_night(tmp_path).folder.name
    worse = (Stub("one", value=0.5), Stub("two", value=5e-14))  # within the bound; in round-off
    assert night(*worse) == 0
    assert night(*worse, baseline=baseline) == 1
    said = capsys.readouterr().out
    assert "no claim's value is twice what it was" in said
    assert "claim/other/scene/" + FEM + " · one: 0.2 -> 0.5 (x 2.5)" in said
    assert " · two: " not in said
    assert night(Stub("one", value=0.19), Stub("new"), baseline=baseline) == 0
    assert night(Stub("other"), baseline=baseline) == 1
    said = capsys.readouterr().out
    assert "there are numbers to compare" in said
    assert f"nothing in common with {baseline}" in said


# what is judged


def small(*methods: str) -> CheckItem:
    return CheckItem(Compared("static-decay", methods, 2, 10), 1.0)


def test_a_night_with_a_fault_is_red_names_it_and_is_no_part_of_the_history(night, tmp_path, capsys):
    assert night(small(FEM), controls=[Control("fem-leak", 1.0)], fault="reaction-sign") == 1
    assert not (tmp_path / "history.sqlite").exists()
    assert "deliberate fault: reaction-sign" in capsys.readouterr().out
    kept = only_night(tmp_path)
    assert [one.name for one in kept.done] == [small(FEM).name]
    page = (kept.folder / "index.html").read_text()
    assert "A deliberate fault was on all night: reaction-sign." in page
    assert "1 of 1 checks called it" in page


def test_a_fault_that_nothing_notices_is_missed(night, tmp_path, capsys):
    """A leak of the finite volumes, in a night of finite elements."""
    assert night(small(FEM), fault="fv-leak", as_json=True) == 1
    (missed,) = json.loads(capsys.readouterr().out)["failed"]
    assert (missed["check"], missed["group"]) == ("fault fv-leak", Group.CONTROLS)
    assert missed["note"].startswith("missed: none of the night's 1 checks turned red")
    kept = only_night(tmp_path)
    assert not kept.green
    assert missed["note"].split(";")[0] in (kept.folder / "index.html").read_text().replace("&#39;", "'")
    assert not (tmp_path / "history.sqlite").exists()


def failing(value: float, bound: float = 1.0) -> Claim:
    return claim(f"is {value}", value, bound)


@dataclass(frozen=True)
class Answering:
    """A check that gives these claims, and calls what the fault replaces."""

    name: str
    found: tuple[Claim, ...]
    bounded: bool = True

    def claims(self, folder: Path) -> list[Claim]:
        run(load_scene("static-decay"), Numerics(METHODS[FEM], 1, 0.5), folder / "run.vtkhdf")
        return [*self.found]


NO_NUMBER, SMALL, LARGE, ROUND_OFF = failing(np.nan), failing(1.25), failing(8.0), failing(1e-9, 0.0)


@pytest.mark.parametrize(
    ("checks", "by", "value"),
    [
        ([[NO_NUMBER]], NO_NUMBER, 1.0),
        ([[NO_NUMBER], [SMALL]], SMALL, 0.8),
        ([[SMALL], [NO_NUMBER]], SMALL, 0.8),
        ([[NO_NUMBER, SMALL], [LARGE]], LARGE, 0.125),
        ([[NO_NUMBER], [failing(0.5)]], NO_NUMBER, 1.0),
        ([[NO_NUMBER], [ROUND_OFF]], ROUND_OFF, 0.0),
        ([[failing(np.inf)]], failing(np.inf), 1.0),
    ],
)
def test_a_fault_is_caught_by_a_number_where_there_is_one(checks, by, value, tmp_path):
    held = [Answering(f"check {i}", tuple(claims)) for i, claims in enumerate(checks)]
    caught = held_against((FAULTS["reaction-sign"], held), tmp_path)
    assert repr(caught.claim) == repr(by)  # nan is not nan
    said = control(caught)
    assert (said.value, said.verdict) == (pytest.approx(value), "PASS")
    assert ("has no number" in said.note) == (not np.isfinite(by.value))


def test_controls_are_held_against_the_checks_that_reach_them(night, tmp_path):
    controls = [Control(name, 1.0) for name in ("reaction-sign", "fv-leak", "ring-not-fitted")]
    assert night(small(FEM), controls=controls) == 1
    found = {one.name: one for one in only_night(tmp_path).done}
    (caught,) = found["fault reaction-sign"].claims
    assert caught.holds
    assert caught.value < 0.5  # twice the bound or more
    assert "static-decay" in caught.note
    missed = found["fault fv-leak"].claims[0]  # no check of this night calls it
    assert missed.verdict == "FAIL"
    assert "no green check calls" in missed.note


def test_a_control_is_not_red_where_checks_it_needs_had_no_time(night, tmp_path):
    plan = (small(FEM), replace(small(FEM, FV), guess=1e3))
    assert night(*plan, controls=[Control("fv-leak", 0.1)], minutes=1.0) == 0
    why = {one.name: one.why for one in only_night(tmp_path).left_out}
    assert why["fault fv-leak"] == "no check that calls what it replaces was run and is green"


def test_volumes_dilute_exactly_and_old_volumes_show(tmp_path):
    check = Diluted((FEM, FV), 2, 10)

    def diluted():
        return [one for one in check.claims(tmp_path) if one.kind is ClaimKind.GEOMETRY]

    with in_this_process():
        right = diluted()
        with replaced(FAULTS["fv-volumes-old"].target, FAULTS["fv-volumes-old"].wrong):
            wrong = diluted()
    assert [group_of(one) for one in right] == [Group.GEOMETRY] * 2
    assert all(one.holds and one.bound < 1e-11 for one in right)
    assert [one.verdict for one in wrong] == ["PASS", "FAIL"]


def test_claims_have_a_light_and_a_key_of_their_own(tmp_path):
    with in_this_process():
        claims = Compared("static-decay", (FEM, FV), 2, 10).claims(tmp_path)
    found = {group_of(one) for one in claims}
    assert found == {Group.CONSERVATION, Group.GEOMETRY, Group.EXACT, Group.AGREEMENT, Group.ENDS}
    assert len({one.key for one in claims}) == len(claims)
    reworded = {replace(one, statement="", note="", path="").key for one in claims}
    assert reworded == {one.key for one in claims}
    assert f"triangle/area/static-decay/{FEM}+{FV}" in reworded
    assert {group_of(claim(kind=kind)) for kind in ClaimKind} == {*Group}


@pytest.mark.slow
@pytest.mark.nightly  # and by the night itself
def test_a_free_viscoelastic_rim_under_pressure_is_studied(tmp_path):
    checks = [item for item in suite() if isinstance(item, CheckItem)]
    studied = [item for item in checks if item.name.startswith("converge fitted-ring-elastic")]
    assert studied
    with in_this_process():
        found = [one for item in studied for one in item.find(tmp_path).claims]
    assert {one.verdict for one in found} == {"PASS"}
    assert {group_of(one) for one in found} == {Group.ORDERS}


@pytest.mark.slow
def test_a_real_night(tmp_path):
    """A check of every kind in processes of their own, from the command line."""
    only = ["compare mode-11-wall*fv-coupled refine 3", "converge smooth-fronts fem-p1-imex2 *"]
    only += [
        "cost * fv-order2 *",
        "run smooth-fronts fem-p1-paper*",
        "compare fig14-four-fronts fem-p1-paper refine 4",
    ]
    words = [word for name in only for word in ("--only", name)]
    words += ["--out", str(tmp_path), "--budget", "3", "--json"]
    call = [sys.executable, "-m", "actin_xcheck", "nightly", *words]
    done = subprocess.run(call, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    said = json.loads(done.stdout)
    assert len(said["checks"]) == len(only)
    kept = only_night(tmp_path)
    groups = {group_of(one) for one in kept.claims}
    assert groups == {*Group} - {Group.OTHER, Group.EXACT, Group.CONTROLS, Group.BASELINE}
    for one in kept.done:
        assert all((kept.folder / file).is_file() for file in one.files if file)
    keys = {one.key.split("/")[0] for done in kept.done for one in done.numbers}
    assert keys >= {"seconds", "memory", "solves", "factorisations", "error", "order", "rate", "steps"}
    assert (kept.folder / kept.done[0].folder / "index.html").exists() or kept.done[0].name.startswith("run")


@pytest.mark.parametrize(
    ("check", "group"),
    [("fault fv-leak", Group.CONTROLS), ("cost scene m", Group.COST), ("compare scene m", Group.ENDS)],
)
def test_what_comes_to_no_verdict_fails_in_its_own_light(check, group):
    (said,) = ended(check, Lost("was stopped", False), 1.0).claims
    assert (said.verdict, group_of(said), said.note) == ("FAIL", group, "broke down: was stopped")


def test_an_order_that_can_no_longer_be_read_off_is_red(tmp_path):
    silent = Answering("study", (claim(), claim("the order is 2", 0.1, np.nan, kind=ClaimKind.ORDER_H)))
    with in_this_process():
        *_, last = CheckItem(silent, 1.0, watches=False).find(tmp_path).claims
    assert (last.verdict, last.note) == ("FAIL", "1 of its orders came to no verdict")


ONLY = (
    "compare static-decay fem-p1-paper fv-coupled refine 3",
    "run smooth-fronts fv-order2 refine 2 rtol 1e-05",
    "cost * fem-p1-paper *",
)


@pytest.mark.slow
def test_checks_go_to_the_cluster_and_costs_are_measured_here(tmp_path: Path) -> None:
    """To workers as `dask worker` starts them: daemons of a nanny, with threads."""
    pytest.importorskip("distributed")
    words = [word for name in ONLY for word in ("--only", name)]
    (tmp_path / "away").mkdir()
    with cluster(tmp_path / "away", 1, ("--nthreads", "2", "--nworkers", "1")) as (address, _):
        done = cli("nightly", *words, "--scheduler", address, "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    kept = only_night(tmp_path / "out")
    there = {one.name: one for one in kept.done if one.host}
    here = {one.name: one for one in kept.done if not one.host}
    assert {name.split()[0] for name in there} == {"compare", "run"}
    assert [name.split()[0] for name in here] == ["cost"]
    assert not any(number.kind.of_machine for one in there.values() for number in one.numbers)
    assert {NumberKind.TIME, NumberKind.MEMORY} <= {
        number.kind for one in here.values() for number in one.numbers
    }
    assert all(one.reached and any(n.kind is NumberKind.COUNT for n in one.numbers) for one in there.values())
    assert all((kept.folder / file).is_file() for one in there.values() for file in one.files if file)
    assert json.loads(done.stdout)["checks"].keys() == there.keys() | here.keys()
    planned = past(tmp_path / "out" / "history.sqlite").seconds
    assert all(planned[name] == one.seconds > 0 for name, one in there.items())


@pytest.mark.slow
def test_a_workers_check_has_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / FILE_NAME).touch()
    done = carry_out(AskedItem(Stub("a stub"), away=True), tmp_path)
    assert isinstance(done, Done)
    assert (done.red, done.folder) == (0, "checks/a_stub")
    assert [number.key for number in done.numbers] == ["error/a stub"]
    assert done.seconds > 0
    done = carry_out(AskedItem(Stub("a stub", how="dies"), away=True), tmp_path)
    assert isinstance(done, Done)
    assert done.trouble == "broke down: its process ended with exit code 7"
    (tmp_path / FILE_NAME).unlink()
    with pytest.raises(UserError, match=f"does not see {tmp_path}; valid: --out names a folder"):
        carry_out(AskedItem(Stub("a stub"), away=True), tmp_path)
    monkeypatch.setattr(work, "code", lambda: "other")
    with pytest.raises(UserError, match="another version of the code"):
        carry_out(AskedItem(Stub("a stub"), away=True), tmp_path)
