"""How every study is carried out, on one that is small enough to be looked through."""

import errno
import importlib
import json
import sqlite3
import subprocess
import sys
import webbrowser
from contextlib import closing
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import h5py
import numpy as np
import pytest

from actin_xcheck.cli import conduct
from actin_xcheck.core import files
from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.report.exhibits import Chapter, Line, Plot
from actin_xcheck.report.page import write_page
from actin_xcheck.runs.executor import executor, in_turn
from actin_xcheck.runs.processes import Lost, work_alone
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.studies import journal, underway
from actin_xcheck.studies import study as studies
from actin_xcheck.studies.study import Batch, Report, Table, Task, answered, at_work, counted, study_file
from tests.claims import claim
from tests.processes import InTurn, cluster
from tests.studies import carry
from tests.tags import Tags


class Parity(StrEnum):
    EVEN = "even"
    ODD = "odd"


@dataclass(frozen=True)
class Square:
    number: int
    value: float
    parity: Parity
    powers: Array
    words: tuple[str, ...]
    root: float | None = None


def square(number: int, folder: Path) -> Square:
    with (folder / "made.txt").open("a") as made:
        made.write(f"{number}\n")
    root = None if number < 0 else number**0.5
    return Square(number, number**2 / 3, Parity(Parity.ODD if number % 2 else Parity.EVEN),
                  np.array([1.0, 2.0, 3.0]) ** number, ("as", "said"), root)  # fmt: skip


def squares(numbers):
    """Asks twice: the second time for what the first answers say."""
    first = yield [Task(square, number, seconds=abs(number)) for number in numbers]
    second = yield [Task(square, 100 + one.number) for one in first]
    made = claim("squares are positive", -min(one.value for one in first), 0.0, methods=())
    plot = Plot("plot", "Squares", "", "n", (Line("n", np.arange(2.0), np.arange(2.0)),))
    chapters = (Chapter("all", "All", "", (plot,)),)
    return Report(
        counted([made], "Squares"),
        "By hand.",
        {"squares": Table("Squares", [*first, *second])},
        (made,),
        ("they are",),
        chapters,
    )


def made(folder):
    return [int(line) for line in (folder / "made.txt").read_text().split()]


def test_a_study_is_driven_without_running_anything():
    report = answered(squares([1, 2]), lambda tasks: [square_of(task.ask) for task in tasks])
    assert [one.number for one in report.tables["squares"].rows] == [1, 2, 101, 102]


def square_of(number):
    return Square(number, number**2, Parity.ODD, np.zeros(1), ())


def test_answers_come_in_the_order_asked_and_the_longest_are_begun_first(tmp_path):
    report = carry(tmp_path, squares([2, 5, 3, 5]))
    assert [one.number for one in report.tables["squares"].rows] == [2, 5, 3, 5, 102, 105, 103, 105]
    assert made(tmp_path) == [5, 3, 2, 102, 105, 103]  # each once


def test_answers_of_other_code_are_not_taken_up(tmp_path, monkeypatch):
    carry(tmp_path, squares([1]))
    monkeypatch.setattr(journal, "code", lambda: "another digest")
    carry(tmp_path, squares([1]))
    assert made(tmp_path) == [1, 101, 1, 101]


def test_answers_of_a_study_of_ones_own_are_not_taken_up_when_it_has_changed(tmp_path, monkeypatch):
    (tmp_path / "own_study.py").write_text("def work(): ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    work = importlib.import_module("own_study").work
    keys = []
    for line in ("", "", "# changed\n"):
        with (tmp_path / "own_study.py").open("a") as file:
            file.write(line)
        journal._module_code.cache_clear()
        keys.append(journal.key_of(work, "1"))
    assert keys[0] == keys[1] != keys[2]


def test_a_file_of_others_is_in_nobodys_way_and_not_written_over(tmp_path):
    for name in ("film.h5", "cubes.h5"):
        with h5py.File(tmp_path / name, "w") as file:
            file["x"] = 1.0
    with at_work(tmp_path, force=True):
        carry(tmp_path, squares([1]))
    journal_file = tmp_path / "journal.sqlite"
    journal_file.unlink()
    (tmp_path / "squares.h5").unlink()
    with pytest.raises(UserError, match=r"cubes\.h5 is no report; valid: another folder"):
        carry(tmp_path, squares([1]), name="cubes")
    assert (tmp_path / "film.h5").exists()


def test_a_study_has_its_folder_to_itself_where_there_are_no_locks(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.ENOLCK, "none")

    monkeypatch.setattr("fcntl.flock", none)
    monkeypatch.setattr(files, "flock", none)
    monkeypatch.setattr(files, "_PATIENCE", 0.1)
    with at_work(tmp_path):
        carry(tmp_path, squares([1]))
        with pytest.raises(UserError, match="another process is writing it"), at_work(tmp_path):
            pass


def leave(number: int, folder: Path) -> Square:
    (folder / "left.txt").write_text(str(number))
    return square(number, folder)


@pytest.mark.parametrize(
    "meddle", [Path.unlink, lambda file: file.write_text("8")], ids=["gone", "another's"]
)
def test_an_answer_whose_file_is_not_as_it_left_it_is_asked_for_again(tmp_path, meddle):
    def study():
        yield [Task(leave, 7, files=("left.txt",))]
        return Report("", "")

    carry(tmp_path, study())
    carry(tmp_path, study())
    assert made(tmp_path) == [7]
    meddle(tmp_path / "left.txt")
    carry(tmp_path, study())
    assert made(tmp_path) == [7, 7]
    assert (tmp_path / "left.txt").read_text() == "7"


def test_what_is_timed_is_of_the_code_that_was_there_when_the_others_began(tmp_path, monkeypatch):
    order = []

    class Noting(InTurn):
        def results(self, work, tasks):
            order.append("others")
            return super().results(work, tasks)

    monkeypatch.setattr(studies, "prepare", lambda modules, now: order.append(now))
    carry(tmp_path, timed([1, 2]), Noting(), alone=work_alone)
    assert order == [True, "others"]
    assert made(tmp_path) == [1, 2]


def test_a_lost_task_is_named_and_the_others_are_kept(tmp_path):
    with pytest.raises(UserError, match=r"squares: 1 lost, square of 2 \(killed\); valid: the same command"):
        carry(tmp_path, squares([1, 2, 3]), InTurn(lost=[2]))
    carry(tmp_path, squares([1, 2, 3]))
    assert made(tmp_path)[:3] == [3, 1, 2]


def test_a_lost_task_with_a_stand_in_does_not_end_the_study_and_is_tried_again(tmp_path):
    def study():
        (one,) = yield [
            Task(
                square, 4, lost=lambda ask, why: Square(ask, np.nan, Parity.EVEN, np.zeros(0), (why.message,))
            )
        ]
        return Report("", "", findings=one.words)

    assert carry(tmp_path, study(), InTurn(lost=[4])).findings == ("killed",)
    assert carry(tmp_path, study()).findings == ("as", "said")


@dataclass(frozen=True)
class Hurried:
    number: int
    seconds: float = field(compare=False)


def hurry(asked: Hurried, folder: Path) -> Square | Lost:
    return square(asked.number, folder) if asked.seconds > 1 else Lost("too little time")


def test_what_has_no_time_is_asked_again_and_turns_go_before_lengths(tmp_path):
    def study(seconds):
        answers = yield [
            Task(hurry, Hurried(number, seconds), number, lost=lambda ask, lost: lost, turn=turn)
            for turn, number in enumerate((3, 5))
        ]
        return Report("", "", findings=tuple(one.message for one in answers if isinstance(one, Lost)))

    assert carry(tmp_path, study(0.0)).findings == ("too little time",) * 2
    assert carry(tmp_path, study(2.0)).findings == ()
    assert carry(tmp_path, study(0.0)).findings == ()  # of what is compared it is the same question
    assert made(tmp_path) == [3, 5]


def timed(numbers):
    """Asks for all but the first to be timed, and expects to ask for ten seconds more than it does."""
    answers = yield Batch(
        (Task(square, number, seconds=number, alone=number != numbers[0]) for number in numbers), later=10
    )
    return Report("", "", {"squares": Table("Squares", answers)})


@pytest.mark.slow
def test_what_is_timed_runs_by_itself_when_the_others_are_over_and_is_kept(tmp_path):
    told = []
    with executor(2) as processes:
        report = carry(tmp_path, timed([1, 2, 3]), processes, tell=lambda *one: told.append(one))
        assert [one.number for one in report.tables["squares"].rows] == [1, 2, 3]
        assert made(tmp_path) == [1, 2, 3]
        assert told == [("squares", over, 16) for over in (0, 1, 3, 6)]
        carry(tmp_path, timed([1, 2, 3]), processes, alone=work_alone)
        assert made(tmp_path) == [1, 2, 3]
        carry(tmp_path, timed([1, 4]), processes, alone=work_alone)
    assert made(tmp_path) == [1, 2, 3, 4]


def test_progress_counts_expected_seconds_and_what_was_known(tmp_path):
    told = []
    carry(tmp_path, squares([1, 3]), tell=lambda *one: told.append(one))
    assert told[:3] == [("squares", 0, 4), ("squares", 3, 4), ("squares", 4, 4)]
    told.clear()
    carry(tmp_path, squares([1, 3, 4]), tell=lambda *one: told.append(one))
    assert told[:2] == [("squares", 4, 8), ("squares", 8, 8)]


def test_while_it_is_under_way_a_page_says_what_is_answered_and_how_much_is_left(tmp_path, monkeypatch):
    now, seen, opened = [0.0], [], []
    monkeypatch.setattr(underway.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(webbrowser, "open", opened.append)
    page = tmp_path / "index.html"

    def tell(label, over, whole):
        now[0] += 12.0  # as if that had been the time since
        seen.append(Tags(page))

    with conduct.shown(page, tell) as told:
        carry(tmp_path, squares([30, 10]), tell=told)
        assert opened == [page.as_uri()]  # before the end, and once
        write_page(tmp_path / "squares.h5")
    begun, one, both = seen[:3]
    assert "0% done " in begun.words
    assert "75% done, about 4 s left" in one.words
    assert "/tables/" not in one.words  # there is no file yet
    assert "1 rows numbervalueparityroot 30300even5.4772" in one.words
    assert "2 rows number" in both.words
    assert all(tags.attributes("main", "data-again") == ["5"] for tags in seen)
    assert Tags(page).attributes("main", "data-again") == [""]
    assert len(begun.source) < 60_000


def test_what_is_over_before_anybody_looks_has_no_page_of_what_is_under_way(tmp_path):
    seen = []
    carry(tmp_path, squares([3, 5]), tell=lambda *one: seen.append((tmp_path / "index.html").exists()))
    assert seen == [False] * 6


@pytest.mark.parametrize(("numbers", "said"), [([3, 9], "about 12 s"), ([0], ""), ([270, 90], "about 6 min")])
def test_what_it_costs_is_said_before_its_first_run_and_not_where_nothing_is_run(
    numbers, said, tmp_path, capsys
):
    for expected in (said, ""):
        with in_turn():
            conduct.carry_out("squares", squares(numbers), tmp_path, False, 1, None, quiet=False)
        lines = capsys.readouterr().err.splitlines()
        assert [line for line in lines if "about" in line] == ([f"squares: {expected}"] if expected else [])
        assert not expected or lines.index(f"squares: {expected}") == 0


def test_the_file_holds_tables_claims_and_exhibits(tmp_path):
    report = carry(tmp_path, squares([2, 3]))
    with reading(tmp_path / "squares.h5", "report") as file:
        rows = read_table(file["tables/squares"], Square)
        claims = read_table(file["claims"], Claim)
        assert file["exhibits/all/plot"].attrs["title"] == "Squares"
        assert file.attrs["study"] == "squares"
        assert list(file["tables/squares/value"][()]) == [one.value for one in report.tables["squares"].rows]
    assert [vars(one) | {"powers": 0} for one in rows] == [
        vars(one) | {"powers": 0} for one in report.tables["squares"].rows
    ]
    assert all(type(one.parity) is Parity for one in rows)
    assert tuple(claims) == report.claims


def test_processes_of_this_machine_answer_like_this_one(tmp_path):
    with executor(2) as processes:
        carry(tmp_path, squares([1, 2, 3]), processes)
    assert sorted(made(tmp_path)) == [1, 2, 3, 101, 102, 103]


def test_a_page_shows_numbers_to_five_digits_and_words(tmp_path):
    carry(tmp_path, squares([2, 3]))
    page = write_page(study_file(tmp_path)).read_text()
    for text in ('<span class="score">1 of 1</span> Squares', "<td>odd</td>", ">1.3333<", "By hand."):
        assert text in page


TOY = Path(__file__).parents[1] / "examples" / "toy_study.py"


def toy(folder, *scheduler):
    """What the docs' study prints; a process in a directory of its own, as a user's."""
    command = [sys.executable, "-W", "error", str(TOY), str(folder), *scheduler]
    done = subprocess.run(
        command, cwd=folder.parent, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def asked(folder):
    with closing(sqlite3.connect(folder / journal.FILE_NAME)) as rows, rows:
        return sorted(json.loads(one) for (one,) in rows.execute("SELECT asked FROM answers"))


@pytest.mark.slow
def test_the_study_of_the_docs_is_whole_and_has_at_most_sixty_lines(tmp_path):
    assert len(TOY.read_text(encoding="utf-8").splitlines()) <= 60
    said = toy(tmp_path / "toy")
    assert said == f"1 of 1 orders hold; report: {tmp_path}/toy/index.html\n"
    assert "the error falls with the first power of dt" in (tmp_path / "toy" / "index.html").read_text()
    assert asked(tmp_path / "toy") == [0.03125, 0.0625, 0.125, 0.25]
    with closing(sqlite3.connect(tmp_path / "toy" / journal.FILE_NAME)) as rows, rows:
        rows.execute("DELETE FROM answers WHERE asked = '0.25'")
        rows.execute("UPDATE answers SET image = x'' WHERE asked = '0.125'")  # whoever takes it up fails
    with pytest.raises(AssertionError, match="file signature"):
        toy(tmp_path / "toy")


@pytest.mark.slow
def test_the_study_of_the_docs_is_carried_out_by_a_cluster(tmp_path):
    pytest.importorskip("distributed")
    with cluster(tmp_path, 2) as (address, _):
        assert toy(tmp_path / "toy", address).startswith("1 of 1 orders hold")
    assert len(asked(tmp_path / "toy")) == 4
