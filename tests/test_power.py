"""Power may fail and calls may fail at any moment: nothing that was reported as done is lost."""

import errno
import os
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from actin_xcheck.core.files import database, replace_file, unfinished
from actin_xcheck.runs import march, store
from actin_xcheck.runs.store import read_run
from tests.kills import bits, go
from tests.lab import refusal
from tests.power import Disk, losses
from tests.test_interrupted import QUICK

ERRORS = (errno.EIO, errno.ENOSPC)
RUN, PART = "run.vtkhdf", "run.partial.vtkhdf"


def watched(folder: Path, monkeypatch, **how) -> Disk:
    """A disk in whose folder what is put in its place is noted as told, once it is said to be there."""
    disk = Disk(folder, **how)
    put = store.replace_file

    def noted(path: Path, content: bytes) -> None:
        put(path, content)
        disk.told(path.name, content)

    monkeypatch.setattr(store, "replace_file", noted)
    disk.stand_in(monkeypatch)
    return disk


def test_a_file_that_is_replaced_is_the_old_or_the_new_one(tmp_path, monkeypatch):
    disk = Disk(tmp_path, portion=3)
    disk.stand_in(monkeypatch)
    for content in (b"old content", b"newer", b""):
        replace_file(tmp_path / "x", content)
        disk.told("x", content)
    points = 0
    for left in losses(disk.operations):
        points += 1
        valid = {b"old content", b"newer", b""}
        assert "x" not in left.files or left.files["x"] in valid
        if left.told.get("x") == b"old content":
            assert left.files["x"] in valid
        if left.after == len(disk.operations):
            assert left.files == {"x": b""}
    assert points > 50


@pytest.mark.parametrize("missing", ["sync", "names"])
def test_without_either_fsync_the_layer_finds_a_loss(missing, tmp_path, monkeypatch):
    """The control: what is renamed before it is on the disk, and a name that nobody asked to be there."""
    disk = Disk(tmp_path)
    disk.stand_in(monkeypatch)
    for content in (b"old", b"new"):
        replace_file(tmp_path / "x", content)
        disk.told("x", content)
    left = losses([one for one in disk.operations if one.kind != missing])
    lost = [one for one in left if one.told.get("x") == b"new" and one.files.get("x") != b"new"]
    assert lost


def test_every_call_that_fails_leaves_the_old_or_the_new_file(tmp_path, monkeypatch):
    path, calls = tmp_path / "x", 9
    for number in range(1, calls + 2):
        for error in (*ERRORS, errno.EDQUOT, errno.EROFS):
            with monkeypatch.context() as patch:
                replace_file(path, b"old content")
                disk = Disk(tmp_path, portion=4, fails=number, error=error)
                disk.stand_in(patch)
                failed = refusal(replace_file, path, b"new content")
                assert failed in ("", f"{path}: cannot be written ({os.strerror(error)})")
                assert path.read_bytes() in (
                    (b"old content", b"new content") if failed else (b"new content",)
                )
                assert failed or number > min(disk.calls, calls) - 1  # but for what tidies up
                for left in tmp_path.iterdir():
                    if left != path:
                        left.unlink()


def test_a_folder_that_takes_no_fsync_is_no_failure(tmp_path, monkeypatch):
    disk = Disk(tmp_path)
    disk.stand_in(monkeypatch)
    replace_file(tmp_path / "x", b"old")
    again = Disk(tmp_path, fails=disk.calls - 2, error=errno.EINVAL)
    again.stand_in(monkeypatch)
    replace_file(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new"
    assert "names" not in [one.kind for one in again.operations]


def _run_through(folder: Path, monkeypatch, portion: int) -> tuple[int, set[tuple[str, bytes]]]:
    """How many states a loss of power can leave of a run with many checkpoints, and what files they hold."""
    disk = watched(folder, monkeypatch, portion=portion)
    monkeypatch.setattr(march, "REST", 0.0)
    assert go(QUICK[0], folder / RUN).ok
    published = [(one.name, one.content) for one in disk.operations if one.kind == "done"]
    points, found = 0, set()
    for left in losses(disk.operations):
        points += 1
        seen = {name: content for name, content in left.files.items() if not name.startswith(".")}
        for name, content in seen.items():
            assert (name, content) in published, f"{name} after {left.after} is none that was put there"
            told = left.told.get(name)
            if told is not None:
                assert published.index((name, content)) >= published.index((name, told))
        for name in left.told:
            assert name in seen or RUN in seen, f"{name} is lost after {left.after}"
        found |= set(seen.items())
    assert (RUN, published[-1][1]) in found
    return points, found


def test_power_fails_anywhere_in_a_run(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    points, found = _run_through(tmp_path / "a", monkeypatch, 2**30)
    monkeypatch.undo()
    assert points > 100
    parts = sorted(content for name, content in found if name == PART)
    for content in (parts[0], parts[-1]):
        _goes_on(tmp_path, content, bits(tmp_path / "a" / RUN))


def _goes_on(folder: Path, content: bytes, expected: dict[str, bytes]) -> None:
    """A checkpoint that power left opens, and leads to the bits of a run that nobody interrupted."""
    path = folder / RUN
    path.unlink(missing_ok=True)
    unfinished(path).write_bytes(content)
    assert read_run(unfinished(path)).attributes["outcome"] == "interrupted"
    assert go(QUICK[0], path, resume=True).ok
    assert bits(path) == expected


@pytest.mark.nightly
def test_power_fails_at_three_thousand_moments(tmp_path, monkeypatch):
    """Each write is short, and power fails in between; every checkpoint is gone on with."""
    (tmp_path / "a").mkdir()
    points, found = _run_through(tmp_path / "a", monkeypatch, 2000)
    monkeypatch.undo()
    assert points >= 3000
    expected = bits(tmp_path / "a" / RUN)
    for _, content in sorted(one for one in found if one[0] == PART):
        _goes_on(tmp_path, content, expected)


@pytest.mark.slow
def test_calls_of_a_run_that_fail_are_a_sentence_and_it_goes_on(tmp_path, monkeypatch):
    """Of its first checkpoint the write and the folder's fsync, of its end the same; a night tries all."""
    _fail_each(tmp_path, monkeypatch, errno.EIO, lambda calls: (2, 7, calls - 7, calls - 2))


@pytest.mark.nightly
@pytest.mark.parametrize("error", [*ERRORS, errno.EDQUOT, errno.EROFS])
def test_every_single_call_of_a_run_that_fails(error, tmp_path, monkeypatch):
    _fail_each(tmp_path, monkeypatch, error, lambda calls: range(1, calls + 1))


def _fail_each(tmp_path: Path, monkeypatch, error: int, chosen: Callable[[int], Iterable[int]]) -> None:
    monkeypatch.setattr(march, "REST", 0.0)
    whole = tmp_path / "whole"
    whole.mkdir()
    with monkeypatch.context() as patch:
        disk = Disk(whole)
        disk.stand_in(patch)
        assert go(QUICK[0], whole / RUN).ok
    expected = bits(whole / RUN)
    for number in chosen(disk.calls):
        folder = tmp_path / str(number)
        folder.mkdir()
        with monkeypatch.context() as patch:
            failing = Disk(folder, fails=number, error=error)
            failing.stand_in(patch)
            failed = refusal(go, QUICK[0], folder / RUN)
        assert not failed or os.strerror(error) in failed
        assert not failed or go(QUICK[0], folder / RUN, resume=True).ok
        assert bits(folder / RUN) == expected
        assert {one.name for one in folder.iterdir()} <= {RUN, PART}


def test_a_journal_outlasts_a_loss_of_power_when_it_has_committed(tmp_path):
    """SQLite synchronises file, journal and, in this mode alone, the folder after the journal is gone."""
    with database(tmp_path / "x.sqlite", "rwc") as rows:
        assert rows.execute("PRAGMA synchronous").fetchone() == (3,)
        assert rows.execute("PRAGMA journal_mode").fetchone() == ("delete",)
