"""The night: what is tried first, what fits, what goes wrong, what is kept, what others read."""

import json
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import typer

from actin_xcheck import nightly_command as commands
from actin_xcheck.claims import Claim
from actin_xcheck.errors import UserError
from actin_xcheck.faults.catalogue import FAULTS
from actin_xcheck.faults.checks import Compared
from actin_xcheck.faults.fault import ControlError, replaced
from actin_xcheck.history.database import read_claims, read_nights, read_numbers
from actin_xcheck.history.record import Kind, Number
from actin_xcheck.nightly import carry_out as work
from actin_xcheck.nightly.groups import Group, group_of, lasting
from actin_xcheck.nightly.items import Checked, Control, Costed, Diluted, Found, NotDecided
from actin_xcheck.nightly.junit import junit
from actin_xcheck.nightly.keep import new_folder
from actin_xcheck.nightly.plan import Past, Plan, chosen, past, suite
from actin_xcheck.nightly.record import FILE_NAME, Begun, Journal, Kept, read_night
from actin_xcheck.scene import load_scene
from actin_xcheck.workers import in_turn as in_this_process
from tests.lab import FEM, FV

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Stub:
    """A check that takes as long as it is told, and then gives a value against the bound 1."""

    name: str
    guess: float = 0.0
    value: float = 0.5
    lasts: float = 0.0
    how: str = ""
    log: str = ""

    def find(self, folder: Path) -> Found:
        if self.log:
            with open(self.log, "a", encoding="utf-8") as log:
                log.write(f"{self.name}\n")
        time.sleep(self.lasts)
        if self.how == "raises":
            raise ValueError("no such \x01 mesh")
        if self.how == "dies":
            os._exit(7)
        if self.how == "undecided":
            raise NotDecided("nothing to decide it by")
        (folder / "kept.txt").write_text("a file")
        claim = Claim("scene", (FEM,), f"claim of {self.name}", self.value, 1.0, "again", "/run/x", "why")
        return Found((claim,), ("kept.txt",), (Number(f"error/{self.name}", Kind.ERROR, self.value),))


class InTurn:
    """Processes without processes."""

    def results(self, work, tasks):
        yield from ((number, work(task)) for number, task in enumerate(tasks))


@contextmanager
def in_turn(jobs, scheduler=None):
    yield InTurn()


@pytest.fixture
def here(monkeypatch):
    """All work is done in this process, which saves seconds of imports."""
    monkeypatch.setattr(work, "executor", in_turn)
    monkeypatch.setattr(work, "work_alone", lambda find, task, report: find(task, report))


@pytest.fixture
def night(here, monkeypatch, tmp_path):
    """Run `nightly` with these checks; its exit code."""

    def run(*stubs, controls=(), **options):
        plan = Plan(stubs, tuple(controls))
        monkeypatch.setattr(commands, "suite", lambda: plan)
        with pytest.raises(typer.Exit) as left, in_this_process():
            commands.nightly_command(**{"out_dir": tmp_path, "quiet": True, "jobs": 1, **options})
        return left.value.exit_code

    return run


def only_night(folder: Path) -> Kept:
    (found,) = folder.glob(f"*/{FILE_NAME}")
    return read_night(found.parent)


# what is tried, and in which order


def test_what_failed_last_then_what_often_fails_then_what_is_cheap():
    plan = Plan(
        tuple(Stub(name, guess) for name, guess in (("dear", 9), ("cheap", 1), ("often", 5), ("red", 8)))
    )
    known = Past({"cheap": 2.0, "dear": 1.0}, frozenset({"red"}), {"often": 0.2, "red": 0.1, "cheap": 0.0})
    assert [item.name for item in chosen(plan, (), False, known).items] == ["red", "often", "dear", "cheap"]
    assert [item.name for item in chosen(plan, (), False, Past()).items] == ["cheap", "often", "red", "dear"]


def test_only_some_are_chosen_by_patterns_and_controls_bring_their_checks():
    plan = suite()
    names = [item.name for item in chosen(plan, ["compare fig14*"], False, Past()).items]
    assert len(names) >= 3
    assert all(name.startswith("compare fig14") for name in names)
    with_checks = chosen(plan, ["fault fv-leak"], False, Past())
    assert [one.fault for one in with_checks.controls] == ["fv-leak"]
    assert len(with_checks.checks) == 24
    with pytest.raises(UserError, match=r"--only: no check is called 'fig99\*'; valid: such as compare"):
        chosen(plan, ["compare*", "fig99*"], False, Past())
    with pytest.raises(UserError, match="--failed: nothing failed"):
        chosen(plan, (), True, Past())


def test_the_suite_has_all_parts_and_names_of_its_own():
    plan = suite()
    names = [item.name for item in plan.items]
    assert len(set(names)) == len(names)
    assert len(plan.controls) > 50
    assert {item.method for item in plan.costs} >= {FEM, FV, "fv-order2", "fem-p4-imex4"}
    assert isinstance(plan.costs[0], Costed)


def test_what_is_not_expected_to_fit_is_not_begun(night, tmp_path):
    log = tmp_path / "log"
    stubs = [
        Stub("small", 0.1, log=str(log)),
        Stub("large", 40.0, log=str(log)),
        Stub("last", 0.2, log=str(log)),
    ]
    assert night(*stubs, budget=0.5) == 0
    assert log.read_text().split() == ["small", "last"]
    kept = only_night(tmp_path)
    assert [one.name for one in kept.left_out] == ["large"]
    assert "40.0 s expected, 2" in kept.left_out[0].why


def test_the_next_night_knows_how_long_each_takes_and_what_failed(night, tmp_path):
    assert night(Stub("green", 5.0), Stub("red", 7.0, 2.0), Stub("gone", 1.0, how="raises")) == 1
    known = past(tmp_path / "history.sqlite")
    assert known.failed == {"red", "gone"}
    assert known.expected(Stub("green", 5.0)) < 1.0
    assert known.often == {"green": 0.0, "red": 1.0, "gone": 1.0}
    log = tmp_path / "log"
    assert night(Stub("green", log=str(log)), Stub("red", log=str(log)), failed=True) == 0
    assert log.read_text().split() == ["red"]
    assert past(tmp_path / "history.sqlite").failed == {"gone"}  # the last time that it was run
    assert past(tmp_path / "none.sqlite") == Past()


# what goes wrong


def test_a_check_that_breaks_down_is_red_and_the_night_goes_on(night, tmp_path, capsys):
    assert night(Stub("breaks", how="raises"), Stub("fine", 1.0)) == 1
    kept = only_night(tmp_path)
    assert [one.name for one in kept.done] == ["breaks", "fine"]
    assert kept.done[0].trouble == "broke down: ValueError: no such \x01 mesh"
    assert "FAIL breaks: broke down: ValueError" in capsys.readouterr().out


def test_a_check_without_end_is_stopped_and_red(night, tmp_path, monkeypatch):
    monkeypatch.setattr(work, "LEAST_PATIENCE", 0.3)
    assert night(Stub("endless", 0.01, lasts=60), Stub("fine", 0.02)) == 1
    kept = only_night(tmp_path)
    assert kept.done[0].trouble.startswith("was stopped after 0 s")
    assert kept.done[1].red == 0


def test_at_the_end_of_the_budget_what_runs_is_stopped_and_not_red(night, tmp_path):
    assert night(Stub("fine", 0.0), Stub("slower than thought", 0.1, lasts=60), budget=0.02) == 0
    kept = only_night(tmp_path)
    assert kept.seconds < 5
    assert kept.left_out[0].why.startswith("stopped at the end of the budget")


def test_a_night_that_judges_nothing_is_not_green(night):
    assert night(Stub("large", 100.0), budget=0.1) == 1
    assert night(Stub("nothing", how="undecided")) == 1


@pytest.mark.slow
def test_a_process_that_dies_is_red_and_the_night_goes_on(monkeypatch, tmp_path):
    monkeypatch.setattr(work, "SOLVERS", [])
    begun = Begun("n", "2026-01-01", {"commit": "c"}, "m", "c", np.inf, "", "", ("dies", "fine"), 1.0)
    journal = Journal(tmp_path / FILE_NAME)
    journal.begin(begun)
    plan = Plan((Stub("dies", how="dies"), Stub("fine")))
    over, left_out = work.work_through(
        plan, Kept(tmp_path, begun), journal, Past(), 1, np.inf, lambda label, done, total: None
    )
    assert [one.trouble for one in over] == ["broke down: a run's process ended with exit code 7", ""]
    assert left_out == []
    assert repr(read_night(tmp_path).done) == repr(tuple(over))  # nan is not nan


# what is kept


def test_a_night_is_kept_in_the_history_once(night, tmp_path):
    assert night(Stub("one", value=0.25), Stub("two")) == 0
    history = tmp_path / "history.sqlite"
    (counted,) = read_nights(history)
    assert counted.night.name == f"{datetime.now(UTC):%Y-%m-%d}" == only_night(tmp_path).folder.name
    assert counted.verdicts == {"PASS": 2}
    claims = read_claims(history, counted.night.name)
    judged = claims[f"scene [{FEM}] claim of one · one"]
    assert (judged.claim.value, judged.source) == (0.25, "checks/one/kept.txt")
    numbers = {one.key: one.value for one in read_numbers(history, counted.night.name)}
    assert numbers["error/one"] == 0.25
    assert numbers["red/one"] == 0
    assert {"kernel", "seconds/one", "memory/one"} <= set(numbers)
    # a night that was killed after it had been added, before it was closed
    journal = only_night(tmp_path).folder / FILE_NAME
    lines = journal.read_text().splitlines()
    journal.write_text("\n".join(lines[:-1]) + '\n{"closed": [')
    assert night(Stub("one", value=0.25), Stub("two"), resume=True) == 0
    assert len(read_nights(history)) == 1
    assert only_night(tmp_path).closed


def drive(out: str, log: str, *options: str) -> None:
    """In a process of its own: `nightly` with slow stubs, as the command line calls it."""
    plan = Plan(tuple(Stub(f"check {i}", 0.1 * i, lasts=0.3, log=log) for i in range(5)))
    commands.suite = lambda: plan
    work.executor = in_turn
    work.work_alone = lambda find, task, report: find(task, report)
    try:
        commands.nightly_command(out_dir=Path(out), quiet=True, jobs=1, resume="--resume" in options)
    except typer.Exit as left:
        sys.exit(left.exit_code)


def start(out: Path, log: Path, *options: str) -> subprocess.Popen:
    call = f"import tests.test_nightly as t; t.drive({str(out)!r}, {str(log)!r}, *{options!r})"
    return subprocess.Popen(
        [sys.executable, "-c", call], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


@pytest.mark.slow
def test_a_killed_night_is_gone_on_with(tmp_path):
    log = tmp_path / "log"
    process = start(tmp_path, log)
    while not log.exists() or len(log.read_text().split("\n")) < 4:
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    kept = only_night(tmp_path)
    assert not kept.closed
    assert not (tmp_path / "history.sqlite").exists()
    process = start(tmp_path, log, "--resume")
    said, warned = process.communicate(timeout=60)
    assert process.returncode == 0, warned
    assert b"5 of 5 claims hold in 5 checks" in said
    tried = log.read_text().splitlines()
    assert [tried.count(f"check {i}") for i in range(5)] == [1, 1, 2, 1, 1]
    assert len(read_nights(tmp_path / "history.sqlite")) == 1


@pytest.mark.slow
def test_two_nights_at_once_are_two_nights(tmp_path):
    both = [start(tmp_path, tmp_path / f"log-{i}") for i in range(2)]
    for process in both:
        said = process.communicate(timeout=60)
        assert process.returncode == 0, said
    date = f"{datetime.now(UTC):%Y-%m-%d}"
    folders = {path.parent.name for path in tmp_path.glob(f"*/{FILE_NAME}")}
    assert folders == {date, f"{date}-2"}
    assert {one.night.name for one in read_nights(tmp_path / "history.sqlite")} == folders
    page = (tmp_path / "index.html").read_text()
    assert all(f"{name}/index.html" in page for name in folders)


def test_other_code_does_not_go_on_with_a_night(night, tmp_path, monkeypatch):
    assert night(Stub("one")) == 0
    path = only_night(tmp_path).folder / FILE_NAME
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    monkeypatch.setattr(commands, "provenance", lambda: {"commit": "other"})
    with pytest.raises(UserError, match=r"begun by other code \(commit .* -> other\); valid: without"):
        commands.nightly_command(out_dir=tmp_path, quiet=True, resume=True)


def test_folders_are_made_by_date_and_never_shared(tmp_path):
    begun = datetime(2026, 3, 4, 1, tzinfo=UTC)
    assert [new_folder(tmp_path, begun).name for _ in range(3)] == [
        "2026-03-04",
        "2026-03-04-2",
        "2026-03-04-3",
    ]


@pytest.mark.parametrize("damage", ["", "[]", "{}", '{"schema": 9}', '{"schema": 1, "begun": {}}'])
def test_what_is_no_night_is_one_line(damage, tmp_path):
    (tmp_path / FILE_NAME).write_text(damage)
    with pytest.raises(UserError, match=FILE_NAME):
        read_night(tmp_path)
    with pytest.raises(UserError, match="no such file"):
        read_night(tmp_path / "none")


# what is read by others


def test_mistakes_are_one_line(night, tmp_path):
    for options, said in (
        ({"fault": "no-such"}, "--fault: 'no-such' is not a fault; valid: rim-integral-sign"),
        ({"baseline": "2020"}, "no such file"),
        ({"resume": True}, "--resume: no night in"),
        ({"only": ["x"]}, "--only: no check is called 'x'"),
    ):
        with pytest.raises(UserError, match=said):
            commands.nightly_command(out_dir=tmp_path, quiet=True, **options)
    assert list(tmp_path.glob(f"*/{FILE_NAME}")) == []


def test_the_summary_says_what_fails(night, tmp_path, capsys):
    stubs = (Stub("green"), Stub("red", value=3.0), Stub("none", value=np.nan), Stub("large", 1e3))
    assert night(*stubs, budget=1.0, as_json=True) == 1
    said = json.loads(capsys.readouterr().out)
    kept = only_night(tmp_path)
    assert said == json.loads((kept.folder / "summary.json").read_text())
    assert commands.NightAnswer.model_validate(said | {"failed": []}).green is False
    assert said["claims"] == {"PASS": 1, "FAIL": 2}
    assert [one["check"] for one in said["failed"]] == ["red", "none"]
    assert said["failed"][1]["value"] is None  # no number is a failure
    assert said["failed"][0]["file"] == "checks/red/kept.txt"
    assert list(said["not_run"]) == ["large"]


def test_junit_counts_what_fails_breaks_and_is_skipped(night, tmp_path):
    stubs = (
        Stub("a <green> & one"),
        Stub("red", value=3.0),
        Stub("breaks", how="raises"),
        Stub("large", 1e3),
    )
    night(*stubs, budget=1.0)
    kept = only_night(tmp_path)
    assert (kept.folder / "junit.xml").read_bytes() == junit(kept)
    root = ET.fromstring(junit(kept))
    assert root.tag == "testsuites"
    counted = {"tests": 4, "failures": 1, "errors": 1, "skipped": 1}
    assert {name: int(root.get(name)) for name in counted} == counted
    for suite_ in root:
        assert suite_.tag == "testsuite"
        assert {"name", "tests", "failures", "errors", "skipped", "timestamp", "hostname"} <= set(
            suite_.attrib
        )
        cases = suite_.findall("testcase")
        assert len(cases) == int(suite_.get("tests"))
        assert all(case.get("classname") == suite_.get("name") and case.get("name") for case in cases)
        for tag, count in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
            assert len(suite_.findall(f"testcase/{tag}")) == int(suite_.get(count))
    assert root.find("testsuite/testcase/failure").get("message") == "3 > 1"
    assert "no such ? mesh" in root.find("testsuite/testcase/error").get("message")  # \x01 is no XML


def test_a_baseline_must_not_be_undercut(night, tmp_path, capsys):
    assert night(Stub("one", value=0.2), Stub("two", value=1e-14)) == 0
    baseline = only_night(tmp_path).folder.name
    worse = (Stub("one", value=0.5), Stub("two", value=5e-14))  # within the bound; in round-off
    assert night(*worse) == 0
    assert night(*worse, baseline=baseline) == 1
    said = capsys.readouterr().out
    assert "no claim's value is twice what it was" in said
    assert "claim of one · one: 0.2 -> 0.5 (x 2.5)" in said
    assert "claim of two" not in said
    assert night(Stub("one", value=0.19), Stub("new"), baseline=baseline) == 0


# what is judged


def small(*methods: str) -> Checked:
    return Checked(Compared("static-decay", methods, 2, 10), 1.0)


def test_a_night_with_a_fault_is_red_names_it_and_is_no_part_of_the_history(night, tmp_path, capsys):
    assert night(small(FEM), controls=[Control("fem-leak", 1.0)], fault="reaction-sign") == 1
    assert not (tmp_path / "history.sqlite").exists()
    assert "deliberate fault: reaction-sign" in capsys.readouterr().out
    kept = only_night(tmp_path)
    assert [one.name for one in kept.done] == [small(FEM).name]
    page = (kept.folder / "index.html").read_text()
    assert "A deliberate fault was on all night: reaction-sign." in page
    assert "1 of 1 checks called it" in page


def test_controls_are_held_against_the_checks_that_reach_them(night, tmp_path):
    controls = [Control(name, 1.0) for name in ("reaction-sign", "fv-leak", "ring-not-fitted")]
    assert night(small(FEM), controls=controls) == 1
    found = {one.name: one for one in only_night(tmp_path).done}
    claim = found["fault reaction-sign"].claims[0]
    assert claim.holds
    assert claim.value < 0.5  # twice the bound or more
    assert "static-decay" in claim.note
    missed = found["fault fv-leak"].claims[0]  # no check of this night calls it
    assert missed.verdict == "FAIL"
    assert "no green check calls" in missed.note


def test_a_control_is_not_red_where_checks_it_needs_had_no_time(night, tmp_path):
    plan = (small(FEM), replace(small(FEM, FV), guess=1e3))
    assert night(*plan, controls=[Control("fv-leak", 0.1)], budget=1.0) == 0
    why = {one.name: one.why for one in only_night(tmp_path).left_out}
    assert why["fault fv-leak"] == "no check that calls what it replaces was run and is green"


def test_a_fault_whose_target_is_gone_does_not_stop_the_others(monkeypatch, tmp_path):
    monkeypatch.setitem(FAULTS, "gone", replace(FAULTS["fv-leak"], name="gone", target="fv.solver:nothing"))
    with pytest.raises(ControlError), replaced("fv.solver:nothing"):
        pass
    with in_this_process():
        found = small(FEM).find(tmp_path)
    assert "fv.solver:nothing" not in found.reached
    assert len(found.reached) > 5


def test_volumes_dilute_exactly_and_old_volumes_show(tmp_path):
    check = Diluted((FEM, FV), 2, 10)

    def diluted():
        return [one for one in check.claims(tmp_path) if one.statement.startswith("concentration equals")]

    with in_this_process():
        right = diluted()
        with replaced(FAULTS["fv-volumes-old"].target, FAULTS["fv-volumes-old"].wrong):
            wrong = diluted()
    assert [group_of(one) for one in right] == [Group.GEOMETRY] * 2
    assert all(one.holds and one.bound < 1e-11 for one in right)
    assert [one.verdict for one in wrong] == ["PASS", "FAIL"]


def test_claims_have_a_light_and_words_that_last(tmp_path):
    with in_this_process():
        claims = [lasting(one) for one in Compared("static-decay", (FEM, FV), 2, 10).claims(tmp_path)]
    found = {group_of(one) for one in claims}
    assert found == {Group.CONSERVATION, Group.GEOMETRY, Group.EXACT, Group.AGREEMENT, Group.ENDS}
    triangles = [one for one in claims if one.path.startswith("/triangles/")]
    assert "both codes and theory agree on area" in [one.statement for one in triangles]
    assert all(lasting(one) == one for one in claims if not one.path.startswith("/triangles/"))
    rate = Claim(
        "s",
        (FEM,),
        "mode (1, 1) grows at the predicted rate 16.3 (relative error; measured 16.2)",
        0,
        0,
        "",
        "",
    )
    assert lasting(rate).statement == "mode (1, 1) grows at the predicted rate 16.3 (relative error)"
    assert lasting(rate).note == "measured 16.2"
    assert group_of(rate) is Group.MODES
    order = Claim("s", (FEM,), "the order in h of area is 2: settled", 0, 0, "", "/studies/x")
    assert (lasting(order).statement, lasting(order).note) == ("the order in h of area is 2", "settled")


def test_extra_scenes_are_shipped():
    scenes = {
        item.check.scene for item in suite().checks if isinstance(getattr(item, "check", None), Compared)
    }
    assert all(load_scene(name).name == name for name in scenes)


@pytest.mark.slow
def test_a_real_night(tmp_path):
    """A check of every kind in processes of their own, from the command line."""
    only = ["compare mode-11-wall*refine 3", "converge smooth-fronts fem-p1-imex2 *", "cost * fv-order2 *"]
    only += ["run smooth-fronts fem-p1-paper*", "compare fig14-four-fronts fem-p1-paper refine 4"]
    words = [word for name in only for word in ("--only", name)]
    call = [
        sys.executable,
        "-m",
        "actin_xcheck",
        "nightly",
        *words,
        "--out",
        tmp_path,
        "--budget",
        "3",
        "--json",
    ]
    done = subprocess.run(call, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    said = json.loads(done.stdout)
    assert len(said["checks"]) == len(only)
    kept = only_night(tmp_path)
    groups = {group_of(claim) for claim in kept.claims}
    assert groups == {*Group} - {Group.OTHER, Group.EXACT, Group.CONTROLS, Group.BASELINE}
    for one in kept.done:
        assert all((kept.folder / file).is_file() for file in one.files if file)
    keys = {one.key.split("/")[0] for done in kept.done for one in done.numbers}
    assert keys >= {
        "seconds",
        "memory",
        "solves",
        "factorisations",
        "error",
        "order",
        "rate",
        "steps",
        "step",
    }
    assert (kept.folder / kept.done[0].folder / "index.html").exists() or kept.done[0].name.startswith("run")


@pytest.mark.parametrize(
    ("check", "group"),
    [("fault fv-leak", Group.CONTROLS), ("cost scene m", Group.COST), ("compare scene m", Group.ENDS)],
)
def test_what_comes_to_no_verdict_fails_in_its_own_light(check, group):
    (claim,) = work.broken(check, "was stopped", 1.0).claims
    assert (claim.verdict, group_of(claim), claim.note) == ("FAIL", group, "was stopped")


@dataclass(frozen=True)
class Silent:
    """A check whose order can no longer be read off."""

    name: str = "study"
    bounded: bool = True

    def claims(self, folder: Path) -> list[Claim]:
        return [
            Claim("scene", (FEM,), "holds", 0.0, 1.0, "command", "/runs/scene"),
            Claim("scene", (FEM,), "the order in h of area is 2", 0.1, np.nan, "command", "/studies/key"),
        ]


def test_an_order_that_can_no_longer_be_read_off_is_red(tmp_path):
    *_, last = Checked(Silent(), 1.0, watches=False).find(tmp_path).claims
    assert (last.verdict, last.note) == ("FAIL", "1 of its orders came to no verdict")
