"""The history: nights that get in whole or not at all, and changes found in the night they came in."""

import json
import math
import os
import signal
import sqlite3
import subprocess
import sys
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from actin_xcheck.cli.app import app
from actin_xcheck.core.claim import ClaimKind
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.differences import differences, turned
from actin_xcheck.nightly.history import (
    JudgedNumber,
    append,
    find_night,
    read_claims,
    read_nights,
    read_numbers,
    read_series,
)
from actin_xcheck.nightly.record import Night, Number, NumberKind
from tests.claims import claim
from tests.histories import NIGHTS, history, night
from tests.processes import posix


def judged(value: float, kind: ClaimKind = ClaimKind.AGREEMENT) -> JudgedNumber:
    made = claim("so it is", value, 0.02, kind=kind, scene="fig14", methods=("fem-p1", "fv"))
    return JudgedNumber(made, "compare fig14", 3.0, "f")


def kept(path, number: int, **values: float) -> Night:
    return append(
        path, night(number), [Number(key, NumberKind.ERROR, value) for key, value in values.items()]
    )


# the database


def test_a_night_comes_back_as_it_went_in(tmp_path):
    path = tmp_path / "reports" / "history.sqlite"
    given = night(1, budget=1800.0, command="nightly", versions={"numpy": "2.4", "fipy": "4.0"})
    numbers = [
        Number("error/a", NumberKind.ERROR, 1e-3, "", "a.vtkhdf"),
        Number("order/a", NumberKind.ORDER, math.inf),
    ]
    numbers.append(Number("time/a", NumberKind.TIME, math.nan, "s"))
    assert append(path, given, numbers, [judged(0.01), judged(math.nan, ClaimKind.ENDS)]) == replace(given)
    (found,) = read_nights(path)
    assert replace(found.night, seconds=0.0) == replace(given, seconds=0.0)
    assert math.isnan(found.night.seconds)
    assert (found.numbers, dict(found.verdicts)) == (3, {"PASS": 1, "FAIL": 1})
    again = read_numbers(path, given.name)
    assert again[:2] == numbers[:2]
    assert math.isnan(again[2].value)
    assert read_claims(path, given.name)[judged(0.01).key] == judged(0.01)


def test_nights_are_in_the_order_of_their_dates_and_series_follow_them(tmp_path):
    path = tmp_path / "h.sqlite"
    for number in (3, 1, 2):
        kept(path, number, **{"error/a": float(number), "error/b": 1.0})
    assert [one.night.name for one in read_nights(path)] == [night(number).name for number in (1, 2, 3)]
    (found,) = read_series(path, "*/a")
    assert found.values.tolist() == [1.0, 2.0, 3.0]
    assert [one.commit for one in found.nights] == [night(number).commit for number in (1, 2, 3)]


def test_names_and_keys_given_twice_are_kept_apart(tmp_path):
    path = tmp_path / "h.sqlite"
    twice = [Number("a", NumberKind.ERROR, 1.0)] * 2, [judged(0.01)] * 2
    names = [append(path, night(1), *twice).name for _ in "ab"]
    assert names == ["2026-03-01", "2026-03-01-2"]
    assert [one.key for one in read_numbers(path, names[1])] == ["a", "a-2"]
    assert len(read_claims(path, names[1])) == 2


def test_a_night_is_found_by_how_its_name_begins(tmp_path):
    path = tmp_path / "h.sqlite"
    for number in (1, 2, 32):
        kept(path, number, a=1.0)
    kept(path, 1, a=1.0)
    nights = read_nights(path)
    assert find_night(nights, "2026-04").night.name == "2026-04-01"
    assert find_night(nights, "2026-03-01").night.name == "2026-03-01"  # and not 2026-03-01-2
    with pytest.raises(
        UserError, match=r"2026-03: several nights begin so; such as 2026-03-01, 2026-03-01-2"
    ):
        find_night(nights, "2026-03")
    with pytest.raises(UserError, match=r"1999: no night begins so"):
        find_night(nights, "1999")


KILLED = """
import os, signal, sys
import actin_xcheck
from actin_xcheck.nightly.history import append
from actin_xcheck.nightly.record import NumberKind, Night, Number

class Deadly(Number):
    @property
    def key(self):
        os.kill(os.getpid(), signal.SIGKILL)

    @key.setter
    def key(self, key):
        pass

many = [Number("k%d" % i, NumberKind.ERROR, 1.0, source="x" * 200) for i in range(30000)]
deadly = Number.__new__(Deadly)
append(sys.argv[1], Night("new", "2027-01-01", "c", {"numpy": "1"}, "m"), [*many, deadly])
"""


@posix
def test_of_a_night_that_is_killed_nothing_is_left(tmp_path):
    path = tmp_path / "h.sqlite"
    kept(path, 1, a=1.0)
    ended = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False, capture_output=True)
    assert ended.returncode == -signal.SIGKILL
    left = os.path.getsize(path.with_name("h.sqlite-journal"))
    assert left > 0  # it had begun to write
    assert [one.night.name for one in read_nights(path)] == [night(1).name]
    assert [one.key for one in read_series(path)] == ["a"]
    kept(path, 2, a=2.0)
    assert sqlite3.connect(path).execute("PRAGMA integrity_check").fetchone() == ("ok",)


def many(path, number):
    return kept(path, number, **{f"k{i}": 1.0 for i in range(2000)})


@pytest.mark.parametrize(
    "damage",
    [
        lambda whole: b"hello\n" * 1000,
        lambda whole: whole[: len(whole) // 2],
        lambda whole: whole[:4096] + b"\xff" * 8192 + whole[12288:],
    ],
)
def test_a_damaged_history_is_one_line(tmp_path, damage):
    path = tmp_path / "h.sqlite"
    with pytest.raises(UserError, match="no such file"):
        read_nights(path)
    assert not path.exists()
    many(path, 1)
    path.write_bytes(damage(path.read_bytes()))
    for asked in (read_nights, read_series, lambda path: many(path, 2)):
        with pytest.raises(UserError, match=r"h\.sqlite: not a whole history"):
            asked(path)


@pytest.mark.parametrize(
    ("said", "of"),
    [
        ("PRAGMA application_id = 7", "a database of something else"),
        ("PRAGMA user_version = 99", "schema 99, but this version reads schema 2"),
        ("UPDATE numbers SET kind = 'colour'", "'colour' is not a valid NumberKind"),
    ],
)
def test_a_file_of_something_else_is_one_line(tmp_path, said, of):
    path = tmp_path / "h.sqlite"
    kept(path, 1, a=1.0)
    with sqlite3.connect(path) as other:
        other.execute(said)
    with pytest.raises(UserError, match=of):
        read_series(path)


# two nights


def test_differences_are_sorted_by_what_is_of_interest():
    error, order, time = NumberKind.ERROR, NumberKind.ORDER, NumberKind.TIME
    known = {
        "same": (error, 1.0, 1.0 + 1e-12),
        "zero": (error, 0.0, 1e-17),
        "twice": (error, 1e-3, 4e-3),
        "order": (order, 2.0, 2.3),
        "time": (time, 1.0, 1.05),
    }
    old = [*(Number(key, kind, was) for key, (kind, was, _) in known.items()), Number("gone", time, 1.0)]
    new = [
        *(Number(key, kind, now) for key, (kind, _, now) in known.items()),
        Number("new", NumberKind.COUNT, 3.0),
    ]
    found = differences(old, new)
    assert {one.key: one.direction for one in found[:2]} == {"new": "new", "gone": "gone"}
    assert [(one.key, one.direction) for one in found[2:]] == [
        ("order", "better"),
        ("twice", "worse"),
        ("time", "worse"),
    ]
    assert [one.weight for one in found[2:]] == pytest.approx([3.0, 2.0, math.log(1.05) / math.log(1.15)])


def test_claims_that_turn_are_listed_failures_first():
    old = {"a": judged(0.01), "b": judged(0.03), "c": judged(0.01), "d": judged(0.01)}
    new = {"a": judged(0.01), "b": judged(0.01), "c": judged(0.03)}
    assert [(one.key, one.was, one.now) for one in turned(old, new)] == [
        ("c", "PASS", "FAIL"),
        ("b", "FAIL", "PASS"),
        ("d", "PASS", "none"),
    ]


# the commands


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("history") / "h.sqlite"
    through = history(1)
    for at in range(NIGHTS):
        numbers = [Number(one.key, one.kind, float(one.values[at])) for one in through]
        append(path, night(at + 1), numbers, [judged(0.03 if at >= 50 else 0.01)])
    return path


def said(*words) -> str:
    answer = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
    assert answer.exit_code == 0
    return answer.output


def test_history_lists_nights_numbers_and_changes(written):
    nights = said("history", "--file", written)
    assert len(nights.splitlines()) == NIGHTS + 1
    assert "2026-03-01" in nights
    numbers = said("history", "--key", "order/*", "--file", written)
    assert len(numbers.splitlines()) == 2
    steps = said("history", "--steps", "--file", written)
    assert "23 numbers: 3 changes, 0 minor ones, 0 suspects" in steps
    dated = {
        "2026-04-06": "order/dropped",
        "2026-04-14": "time/slower",
        "2026-04-20": "claim/agreement/fig14",
    }
    for first, key in dated.items():
        assert any(first in line and key in line for line in steps.splitlines())
    assert "commit 000000000000 -> 000000000000" not in steps


@pytest.mark.parametrize("option", ["--steps", "--json"])
def test_numbers_that_are_not_there_are_a_mistake_that_names_those_that_are(written, option):
    wanted = r"^--key: no number is called 'nothing/\*'; valid: such as claim/\*, "
    with pytest.raises(UserError, match=wanted):
        said("history", "--key", "nothing/*", "--file", written, option)


def test_the_same_as_json(written):
    found = json.loads(said("history", "--steps", "--key", "order/*", "--json", "--file", written))
    assert len(found["nights"]) == NIGHTS
    assert found["nights"][0]["budget"] == "inf"
    assert len(found["series"][0]["values"]) == NIGHTS
    (step,) = found["steps"]
    assert (step["key"], step["night"], step["commit"]) == ("order/dropped", "2026-04-06", night(37).commit)
    assert step["within"] == ["2026-04-06"]


def test_diff_shows_what_turned_and_what_changed(written):
    text = said("diff", "2026-03-20", "2026-04-29", "--file", written)
    assert "1 claims turned" in text
    assert "PASS" in text
    assert "order/dropped" in text
    found = json.loads(said("diff", "2026-03-20", "2026-04-29", "--json", "--file", written))
    assert found["claims"][0]["now"] == "FAIL"
    assert found["numbers"][0]["weight"] >= found["numbers"][1]["weight"]
    worse = said("diff", "2026-03-20", "2026-04-29", "--markdown", "--file", written)
    assert worse.startswith("### 1 claims fail that did not, ")
    assert "| order/dropped | " in worse
    assert said("diff", "2026-03-20", "2026-03-20", "--file", written).count("\n") == 3
