"""The night: what is tried first, what fits, what goes wrong, what is kept."""

import json
import re
import shutil
import signal
import time
import webbrowser
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from actin_xcheck.cli.nightly import spend
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly import plan as plans
from actin_xcheck.nightly.history import FILE_NAME as HISTORY
from actin_xcheck.nightly.history import read_claims, read_nights, read_numbers
from actin_xcheck.nightly.items import Control, Costed
from actin_xcheck.nightly.plan import KERNEL, Past, Wish, chosen, night_folder, past, suite
from actin_xcheck.nightly.record import FILE_NAME, read_night
from actin_xcheck.runs.executor import cores, executor
from actin_xcheck.scene.scene import load_scene
from actin_xcheck.studies import journal
from actin_xcheck.studies.checks import SUITE, Compared
from tests import nights
from tests.lab import FEM, FV
from tests.nights import Stub, only_night, start
from tests.processes import posix

night = nights.night  # a fixture

# what is tried, and in which order


def test_what_failed_last_then_what_often_fails_then_what_is_cheap():
    guesses = {"dear": 9, "cheap": 1, "often": 5, "red": 8}
    plan = [Stub(name, guess) for name, guess in guesses.items()]
    known = Past({"cheap": 2.0, "dear": 1.0}, frozenset({"red"}), {"often": 0.2, "red": 0.1, "cheap": 0.0})
    assert [item.name for item in chosen(plan, (), False, known)] == ["red", "often", "dear", "cheap"]
    assert [item.name for item in chosen(plan, (), False, Past())] == ["cheap", "often", "red", "dear"]


def test_only_some_are_chosen_by_patterns_and_controls_bring_their_checks():
    plan = suite()
    names = [item.name for item in chosen(plan, ["compare fig14*"], False, Past())]
    assert len(names) >= 3
    assert all(name.startswith("compare fig14") for name in names)
    with_checks = chosen(plan, ["fault fv-leak"], False, Past())
    assert with_checks[-1].fault == "fv-leak"
    assert len(with_checks) == len(SUITE) + 1
    with pytest.raises(UserError, match=r"--only: no check is called 'fig99\*'; valid: such as compare"):
        chosen(plan, ["compare*", "fig99*"], False, Past())
    with pytest.raises(UserError, match="--failed: nothing failed"):
        chosen(plan, (), True, Past())


def test_the_suite_has_all_parts_names_of_its_own_and_scenes_that_are_shipped():
    names = [item.name for item in suite()]
    assert len(set(names)) == len(names)
    assert sum(isinstance(item, Control) for item in suite()) > 50
    costed = {item.method for item in suite() if isinstance(item, Costed)}
    assert costed >= {FEM, FV, "fv-order2", "fem-p4-imex4"}
    checks = [getattr(item, "check", None) for item in suite()]
    assert all(load_scene(one.scene).name == one.scene for one in checks if isinstance(one, Compared))


def test_what_a_night_would_take_is_said_without_one(command, tmp_path):
    known = suite()
    said = command("nightly --dry-run --jobs 2 --budget 1 --out nights")
    told = re.fullmatch(
        r"nightly: (\d+) checks, about (\d+) min on 2 processes; (\d+) of them fit; nothing was run\n",
        said.stdout,
    )
    assert told, said
    count, minutes, fit = map(int, told.groups())
    assert count == len(known)
    assert 0 < fit < count
    assert 2 * 60 * minutes > sum(item.guess for item in known)
    (one,) = [
        json.loads(command(f"nightly --dry-run --json --only '{item.name}'").stdout) for item in known[:1]
    ]
    assert (one["tasks"], one["seconds"]) == (1, pytest.approx(known[0].guess / cores()))
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_expected_to_fit_is_not_begun(night, tmp_path):
    log = tmp_path / "log"
    sizes = {"small": 0.1, "large": 40.0, "last": 0.2}
    assert night(*(Stub(name, guess, log=str(log)) for name, guess in sizes.items()), minutes=0.5) == 0
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
    assert kept.done[0].trouble == r"broke down: ValueError: no such \x01 mesh"
    assert "FAIL breaks: broke down: ValueError" in capsys.readouterr().out


def test_a_check_without_end_is_stopped_and_not_run(night, tmp_path, capsys):
    assert night(Stub("endless", 0.01, lasts=60), Stub("fine", 0.02), patience=0.5) == 0
    kept = only_night(tmp_path)
    assert [one.name for one in kept.done] == ["fine"]
    (left,) = kept.left_out
    assert left.why == f"stopped after {left.seconds:.1f} s; 0.0 s had been expected"
    assert 0.5 <= left.seconds < 5
    assert f"NOT RUN endless: {left.why}" in capsys.readouterr().out


@pytest.mark.slow
def test_at_the_end_of_the_budget_what_runs_is_stopped_and_not_red(night, tmp_path):
    """However soon it had been expected: of its patience of minutes it had a few seconds."""
    slower = Stub("slower than thought", 0.01, lasts=60)
    assert night(Stub("fine"), slower, minutes=0.05) == 0
    kept = only_night(tmp_path)
    assert kept.red == 0
    assert kept.seconds < 7
    (left,) = kept.left_out
    assert left.why.startswith("stopped at the end of the budget, after ")
    assert 0.1 < left.seconds < 3.1
    assert past(tmp_path / HISTORY).expected(slower) == 2 * left.seconds
    assert night(replace(slower, lasts=0.0)) == 0  # was it a busy machine?
    assert past(tmp_path / HISTORY).expected(slower) < 0.1


def test_seconds_go_with_the_reference_kernel(night, tmp_path):
    """Those of what was stopped and of what is guessed too: a busy night does not make the next one small."""
    stubs = Stub("over"), Stub("stopped", 0.1, lasts=60)
    assert night(*stubs, patience=0.5) == 0
    (left,) = only_night(tmp_path).left_out
    (done,) = only_night(tmp_path).done
    for slower in (0.1, 8.0):
        known = past(tmp_path / HISTORY, slower * KERNEL)
        assert known.expected(stubs[0]) == pytest.approx(slower * done.seconds)
        assert known.expected(stubs[1]) == pytest.approx(slower * 2 * left.seconds)
        assert known.expected(Stub("never run", 7.0)) == pytest.approx(slower * 7)
    quick = past(tmp_path / HISTORY, 1e-3 * KERNEL)
    planned = chosen((Stub("large", 9.0), *stubs), (), False, quick)
    assert [item.name for item in planned] == ["over", "stopped", "large"]


def test_checks_are_guessed_in_the_order_of_what_they_take():
    """What takes longest on the finest meshes and had looked cheap came first, and nothing else was run."""
    guesses = {item.name: item.guess for item in suite()}
    fine = guesses["compare fig14-four-fronts fem-p1-paper fv-coupled refine 5"]
    middle = guesses["compare growing-disk fem-p1-paper fv-coupled refine 4"]
    quick = guesses["compare static-decay fem-p1-paper fv-coupled refine 3"]
    assert 1.5 * quick < middle < fine / 1.5 < 4 * quick


@pytest.mark.parametrize("how", ["no memory", "no disk"])
def test_a_machine_that_lacks_what_a_check_needs_has_judged_nothing(night, tmp_path, how):
    assert night(Stub("starved", how=how), Stub("fine", 1.0)) == 0
    kept = only_night(tmp_path)
    assert [one.name for one in kept.done] == ["fine"]
    assert kept.left_out[0].why.startswith("the machine has not enough memory, disk or files for it (")


def test_a_night_that_judges_nothing_is_not_green(night):
    assert night(Stub("large", 100.0), minutes=0.1) == 1
    assert night(Stub("nothing", how="undecided")) == 1


@pytest.mark.slow
def test_a_process_that_dies_is_red_and_one_that_is_killed_is_not_run(tmp_path):
    plan = Stub("dies", how="dies"), Stub("fine"), Stub("killed", how="killed")
    assert spend(Wish(tmp_path), plan, executor(1)) == 1
    kept = only_night(tmp_path)
    assert [one.trouble for one in kept.done] == ["broke down: its process ended with exit code 7", ""]
    (killed,) = kept.left_out
    assert (killed.name, killed.why[:37]) == ("killed", "its process was ended by SIGKILL (by ")


def test_a_night_hands_out_a_summary_and_its_page(night, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    text = tmp_path / "it.md"
    assert night(Stub("one", value=0.25), Stub("two", value=2.0), markdown=text, open_page=True) == 1
    assert text.read_text(encoding="utf-8").startswith("## 1 of 2 claims hold\n\n|")
    assert opened == [(only_night(tmp_path).folder / "index.html").as_uri()]


# what is kept


def test_a_night_is_kept_in_the_history_once(night, tmp_path):
    assert night(Stub("one", value=0.25), Stub("two")) == 0
    history = tmp_path / "history.sqlite"
    (counted,) = read_nights(history)
    assert counted.night.name == f"{datetime.now(UTC):%Y-%m-%d}" == only_night(tmp_path).folder.name
    assert counted.verdicts == {"PASS": 2}
    claims = read_claims(history, counted.night.name)
    judged = claims[f"other/scene/{FEM} · one"]
    assert (judged.claim.value, judged.source) == (0.25, "checks/one/kept.txt")
    numbers = {one.key: one.value for one in read_numbers(history, counted.night.name)}
    assert numbers["error/one"] == 0.25
    assert numbers["red/one"] == 0
    assert {"kernel", "seconds/one", "memory/one"} <= set(numbers)
    interrupted(tmp_path)  # after it had been added, before it was closed
    assert night(Stub("one", value=0.25), Stub("two"), resume=True) == 0
    assert len(read_nights(history)) == 1
    assert only_night(tmp_path).closed


def interrupted(folder):
    """Take a night back to where it was killed before it was closed."""
    path = only_night(folder).folder / FILE_NAME
    path.write_text(path.read_text().splitlines()[0] + "\n")


@posix
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
    said, warned = process.communicate(timeout=300)
    assert process.returncode == 0, warned
    assert b"5 of 5 claims hold in 5 checks" in said
    tried = log.read_text().splitlines()
    assert [tried.count(f"check {i}") for i in range(5)] == [1, 1, 2, 1, 1]
    assert len(read_nights(tmp_path / "history.sqlite")) == 1


@pytest.mark.slow
def test_two_nights_at_once_are_two_nights(tmp_path):
    both = [start(tmp_path, tmp_path / f"log-{i}") for i in range(2)]
    for process in both:
        said = process.communicate(timeout=300)
        assert process.returncode == 0, said
    date = f"{datetime.now(UTC):%Y-%m-%d}"
    folders = {path.parent.name for path in tmp_path.glob(f"*/{FILE_NAME}")}
    assert folders == {date, f"{date}-2"}
    assert {one.night.name for one in read_nights(tmp_path / "history.sqlite")} == folders
    page = (tmp_path / "index.html").read_text()
    assert all(f"{name}/index.html" in page for name in folders)


def test_a_night_that_is_gone_on_with_takes_up_what_the_same_code_has_answered(night, tmp_path, monkeypatch):
    log = tmp_path / "log"
    stubs = Stub("one", value=0.25, log=str(log)), Stub("two", log=str(log))
    assert night(*stubs) == 0
    whole = only_night(tmp_path)
    interrupted(tmp_path)
    assert repr(only_night(tmp_path).done) == repr(whole.done)
    assert night(*stubs, resume=True) == 0
    assert repr(only_night(tmp_path).done) == repr(whole.done)
    interrupted(tmp_path)
    monkeypatch.setattr(journal, "code", lambda: "other")
    monkeypatch.setattr(plans, "provenance", lambda: {"commit": "other"})
    assert night(*stubs, resume=True) == 0
    assert log.read_text().split() == ["one", "two"] * 2
    assert only_night(tmp_path).begun.versions == {"commit": "other"}
    interrupted(tmp_path)
    with pytest.raises(UserError, match="planned 'two', which is no check any more; valid: without"):
        night(stubs[0], resume=True)


def test_a_night_has_a_name_that_the_history_has_not_though_its_folder_is_gone(night, tmp_path):
    assert night(Stub("one")) == 0
    date = only_night(tmp_path).folder
    shutil.rmtree(date)
    assert night(Stub("one")) == 0
    assert only_night(tmp_path).folder.name == f"{date.name}-2"
    assert [one.night.name for one in read_nights(tmp_path / HISTORY)] == [date.name, f"{date.name}-2"]


def test_folders_are_made_by_date_and_never_shared(tmp_path):
    begun = datetime(2026, 3, 4, 1, tzinfo=UTC)
    made = [night_folder(tmp_path, begun).name for _ in range(3)]
    assert made == ["2026-03-04", "2026-03-04-2", "2026-03-04-3"]


@pytest.mark.parametrize("damage", ["", "[]", "{}", '{"schema": 9}', '{"schema": 1, "begun": {}}'])
def test_what_is_no_night_is_one_line(damage, tmp_path):
    (tmp_path / FILE_NAME).write_text(damage)
    with pytest.raises(UserError, match=FILE_NAME):
        read_night(tmp_path)
    with pytest.raises(UserError, match="no such file"):
        read_night(tmp_path / "none")
