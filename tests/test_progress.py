"""What is said of the time left: nothing that is not known, and never more than there is."""

import sys
from io import StringIO

import pytest

from actin_xcheck.cli import output
from actin_xcheck.cli.output import Progress


@pytest.fixture
def clock(monkeypatch):
    """Seconds, to be moved on by hand."""
    now = [100.0]
    monkeypatch.setattr(output.time, "monotonic", lambda: now[0])
    return now


def test_a_line_says_the_time_left_where_the_pace_is_known(clock, capsys):
    with Progress(False) as told:
        for seconds, done in ((0, 0), (11, 0), (11, 1), (11, 2), (0, 4)):
            clock[0] += seconds
            told.report("run", done, 4)
    assert capsys.readouterr().err.splitlines() == [
        "run: 0%",  # and not "nan s left"
        "run: 25%, 66 s left",
        "run: 50%, 33 s left",
        "run: 100%, 0 s left",
    ]


def test_the_whole_is_said_once_however_often_a_study_asks_again(clock, capsys):
    with Progress(False) as told:
        for done, whole in ((0, 2), (2, 2), (2, 3), (3, 3)):
            clock[0] += 1
            told.report("study", done, whole)
    assert capsys.readouterr().err.splitlines() == ["study: 100%, 0 s left"]


def test_a_run_that_goes_on_has_not_made_all_of_it_just_now(clock, capsys):
    with Progress(False) as told:
        for done in (50, 60):
            told.report("run", done, 100)
            clock[0] += 20
            told.report("run", done + 5, 100)
    assert capsys.readouterr().err.splitlines() == ["run: 55%, 180 s left", "run: 65%, 93 s left"]


def test_no_more_is_left_than_the_budget(clock, capsys, monkeypatch):
    with Progress(False, 180.0) as told:
        told.report("night", 0, 100)
        clock[0] += 30
        told.report("night", 3, 100)
        clock[0] += 160
        told.report("night", 4, 100)
    assert capsys.readouterr().err.splitlines() == ["night: 3%, 150 s left", "night: 4%, 0 s left"]


def test_a_bar_says_the_same(clock, monkeypatch):
    said = StringIO()
    monkeypatch.setattr(said, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "stderr", said)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    with Progress(False, 180.0) as told:
        told.report("night", 0, 100)
        clock[0] += 30
        told.report("night", 3, 100)
        told.bars.refresh()
    assert "150 s left" in said.getvalue()
    assert "970 s" not in said.getvalue()
