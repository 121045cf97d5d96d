"""Whatever interrupts a run, a page or a command: what was there stays whole, and says how to go on."""

import errno
import multiprocessing
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from actin_xcheck.core import files
from actin_xcheck.core.contract import Frame
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import database, locked, replace_file, unfinished
from actin_xcheck.runs import march
from actin_xcheck.runs.store import RUN_ATTRIBUTES, RunWriter, annotate, read_run
from actin_xcheck.scene.scene import load_scene
from tests.kills import FRONTS, KINDS, QUICK, Kind, bits, campaign, go
from tests.processes import posix, started, wait_until

pytestmark = posix


def test_one_process_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "run.vtkhdf"
    with locked(path):
        with pytest.raises(UserError, match="another process is writing it"):
            go(QUICK[0], path)
        (tmp_path / "other.vtkhdf.1.new").touch()
        with locked(tmp_path / "other.vtkhdf"):
            pass
    assert {one.name for one in tmp_path.iterdir()} == {"other.vtkhdf.1.new"}
    (tmp_path / ".run.partial.vtkhdf.123.new").write_text("what a kill left")
    (tmp_path / ".run.2.vtkhdf.123.new").write_text("of another run")
    with locked(path):
        assert not (tmp_path / ".run.partial.vtkhdf.123.new").exists()
    assert (tmp_path / ".run.2.vtkhdf.123.new").exists()


@pytest.fixture(params=[errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def lockless(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system without locks, as the system says it of one."""

    def none(*_: object) -> None:
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr("fcntl.flock", none)
    monkeypatch.setattr(files, "flock", none)


def _hold_and_die(path: Path) -> None:
    with locked(path):
        os._exit(0)


def test_one_process_at_a_time_where_there_are_no_locks(tmp_path: Path, lockless: None) -> None:
    path = tmp_path / "run.vtkhdf"
    killed = multiprocessing.get_context("fork").Process(target=_hold_and_die, args=(path,))
    killed.start()
    killed.join()
    assert list(tmp_path.iterdir())  # nothing but a file tells of it, and of its end its number alone
    with locked(path):
        with pytest.raises(UserError, match="another process is writing it; valid: another"):
            go(QUICK[0], path)
        with locked(tmp_path / "other.vtkhdf"):
            pass
    assert list(tmp_path.iterdir()) == []


HOLDER = """
import fcntl, sys
held = open(sys.argv[1], "r+b")
fcntl.lockf(held, fcntl.LOCK_EX)
print("held", flush=True)
sys.stdin.read()
"""


def test_a_database_where_there_are_no_locks_is_held_by_ours(tmp_path: Path, lockless: None) -> None:
    """Another process has the lock that SQLite would wait for."""
    path = tmp_path / "h.sqlite"
    path.touch()
    call = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with database(path, "rwc") as rows:
            rows.execute("CREATE TABLE t (x)")
            rows.execute("INSERT INTO t VALUES (1)")
            with pytest.raises(UserError, match="another process is writing it"), locked(path):
                pass
        with database(path, "rw") as rows:
            assert rows.execute("SELECT x FROM t").fetchall() == [(1,)]
    assert [one.name for one in tmp_path.iterdir()] == ["h.sqlite"]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder in which nobody can write")
def test_where_nothing_can_be_written_nobody_is_said_to_write() -> None:
    with pytest.raises(UserError, match=r"/proc/x.vtkhdf: cannot be written \(No such file"):
        go(QUICK[0], Path("/proc/x.vtkhdf"))


def _kill_yourself(kind: Kind, path: Path, moment: str) -> None:
    """In a process of its own: run, and be killed while the third file is put in its place, or the last."""
    march.REST, count = 0.0, 0

    def die(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    write, move = files.write_through, os.replace

    def half(file: Path, content: bytes) -> None:
        nonlocal count
        count += 1
        write(file, content[: len(content) // 2] if count == 3 else content)
        if count == 3:
            die()

    def placed(source: Path, destination: Path) -> None:
        last = destination == path
        if last and moment == "before the last":
            die()
        move(source, destination)
        if last and moment == "after the last":
            die()

    if moment == "half written":
        files.write_through = half
    files.os.replace = placed  # type: ignore[assignment]
    go(kind, path)


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The bits of the first quick kind."""
    path = tmp_path_factory.mktemp("whole") / "run.vtkhdf"
    assert go(QUICK[0], path).ok
    return bits(path)


def _in_a_process(work, *arguments) -> int:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.test_resume", "fem.solver"])
    process = context.Process(target=work, args=arguments)
    process.start()
    process.join()
    assert process.exitcode is not None
    return process.exitcode


@pytest.mark.slow
@pytest.mark.parametrize("moment", ["half written", "before the last", "after the last"])
def test_a_kill_while_a_file_is_put_in_its_place(moment: str, tmp_path: Path, expected) -> None:
    path = tmp_path / "run.vtkhdf"
    assert _in_a_process(_kill_yourself, QUICK[0], path, moment) == -signal.SIGKILL
    left = {one.name for one in tmp_path.iterdir()} - {".run.vtkhdf.lock"}
    assert "run.partial.vtkhdf" in left
    assert ("run.vtkhdf" in left) == (moment == "after the last")
    assert len(left) == 2
    assert read_run(unfinished(path)).attributes["outcome"] == "interrupted"
    assert go(QUICK[0], path, resume=True).ok
    assert bits(path) == expected
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.slow
def test_random_kills(tmp_path: Path) -> None:
    """A small campaign; `python -m tests.kills 200` is a large one."""
    for found in campaign(6, 5, tmp_path, (KINDS[1], KINDS[10])):
        assert not found.wrong
        assert found.counts["same bits"] > 0


def _fill(path: Path, bytes_left: int) -> None:
    """In a process of its own: run with a limit on the size of files."""
    march.REST = 0.0
    import resource  # POSIX's

    resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, bytes_left))
    try:
        go(QUICK[0], path)
    except UserError as error:
        kept = "; run.partial.vtkhdf holds the last checkpoint, --resume goes on"
        sys.exit(2 if str(error).endswith(f"cannot be written (File too large){kept}") else 3)


@pytest.mark.slow
def test_a_full_disk_leaves_the_last_checkpoint(tmp_path: Path, expected) -> None:
    path = tmp_path / "run.vtkhdf"
    go(QUICK[0], path, 0)
    size = unfinished(path).stat().st_size
    unfinished(path).unlink()
    assert _in_a_process(_fill, path, size + 4000) == 2
    assert {one.name for one in tmp_path.iterdir()} == {"run.partial.vtkhdf"}
    part = read_run(unfinished(path))
    assert 0 < part.series["time"][-1] < load_scene(FRONTS).time.end
    assert go(QUICK[0], path, resume=True).ok
    assert bits(path) == expected
    assert _in_a_process(_fill, tmp_path / "more.vtkhdf", 1000) == 3  # not even the beginning fits
    assert [*tmp_path.iterdir()] == [path]


def _starve(path: Path, bytes_more: int) -> None:
    """In a process of its own: write frames with a limit on memory until there is none."""
    import resource

    n = 50_000
    xi, cells, frame = np.zeros((2, n)), np.zeros((3, n), dtype=np.int64), np.ones(n)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + bytes_more
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    with (
        suppress(MemoryError),
        RunWriter(path, xi, cells, frame, dict.fromkeys(RUN_ATTRIBUTES, "")) as writer,
    ):
        for t in range(100):
            writer.frame(t, Frame(xi, xi, frame, frame))
    sys.exit(2)


@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc how much memory there is")
@pytest.mark.parametrize("bytes_more", [60 * 2**20, 110 * 2**20])
def test_a_run_without_memory_ends_in_its_error_and_not_in_a_crash(tmp_path: Path, bytes_more: int) -> None:
    assert _in_a_process(_starve, tmp_path / "run.vtkhdf", bytes_more) == 2
    assert not [*tmp_path.iterdir()]


def test_a_page_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch) -> None:
    page = tmp_path / "index.html"
    replace_file(page, b"old")
    write = files.write_through

    def full(file: Path, content: bytes) -> None:
        write(file, content[:1])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files, "write_through", full)
    with pytest.raises(UserError, match=r"index.html: cannot be written \(No space left on device\)"):
        replace_file(page, b"new")
    assert [*tmp_path.iterdir()] == [page]
    assert page.read_bytes() == b"old"


def test_what_is_stated_later_changes_a_run_all_at_once(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "run.vtkhdf"
    assert go(QUICK[0], path).ok
    annotate(path, {"accuracy": 1e-3})
    assert read_run(path).attributes["accuracy"] == 1e-3
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "replace", fail)
    with pytest.raises(KeyboardInterrupt):
        annotate(path, {"accuracy": 1e-4})
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


WORDS = f"run {FRONTS} --method fem-p1-paper --refine 5 --dt 1e-3 --fidelity full --quiet"


def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, error = process.communicate(timeout=200)
    return process.returncode, out, error


def stopped(process: subprocess.Popen[str], number: signal.Signals) -> list[str]:
    """Send a signal to a run; the words that it says to go on with."""
    process.send_signal(number)
    code, out, error = ended(process)
    assert (code, out) == (128 + number, "")
    assert error.count("\n") == 1
    said, again = error.strip().split("; to go on: ")
    assert said.startswith("actin_xcheck: interrupted at t = ")
    _, *rest = shlex.split(again)
    assert "--force" not in rest
    return rest[2:]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_command_that_is_ended_says_how_to_go_on(number: signal.Signals, tmp_path: Path) -> None:
    process = started(tmp_path, WORDS, "--out", "run.vtkhdf", "--force")
    wait_until((tmp_path / "run.partial.vtkhdf").exists, 200)
    assert stopped(process, number)[-1] == "--resume"
    assert 0 < read_run(tmp_path / "run.partial.vtkhdf").series["time"][-1] < 0.1636


@pytest.mark.slow
def test_a_stopped_command_says_how_to_go_on_and_does(tmp_path: Path) -> None:
    path = tmp_path / "my run.vtkhdf"
    words = f"{WORDS} --out '{path.name}'"
    process = started(tmp_path, words, "--force")
    wait_until(unfinished(path).exists, 200)
    process.send_signal(signal.SIGSTOP)
    code, out, error = ended(started(tmp_path, words, "--resume"))
    process.send_signal(signal.SIGCONT)
    assert (code, out) == (2, "")  # and the first one goes on
    assert error.count("\n") == 1
    assert "another process is writing it" in error
    again = shlex.join(stopped(process, signal.SIGINT))
    assert ended(started(tmp_path, words))[0] == 2  # not to be lost by mistake
    code, out, error = ended(started(tmp_path, again))
    assert (code, out, error) == (0, f"completed: {path.name}\n", "")
    whole = started(tmp_path, WORDS, "--out", "whole.vtkhdf")
    assert ended(whole)[0] == 0
    assert bits(path) == bits(tmp_path / "whole.vtkhdf")
    code, out, error = ended(started(tmp_path, again))
    assert (code, error) == (0, "")
    assert "finished before" in out


@contextmanager
def mounted(folder: Path, options: str) -> Iterator[Path]:
    """A small file system; skips where none can be mounted."""
    folder.mkdir(exist_ok=True)
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip("nothing can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.slow
def test_a_disk_that_is_full_or_read_only_is_one_line(tmp_path: Path) -> None:
    words = f"{WORDS} --out"
    with mounted(tmp_path / "small", "size=900k") as folder:
        code, out, error = ended(started(tmp_path, words, folder / "run.vtkhdf"))
        assert (code, out, error.count("\n")) == (2, "", 1)
        assert "No space left on device" in error
        part = unfinished(folder / "run.vtkhdf")
        assert [*folder.iterdir()] == [part]
        assert read_run(part).series["time"][-1] >= 0
        subprocess.run(["mount", "-o", "remount,size=9m", folder], check=True)
        assert ended(started(tmp_path, words, folder / "run.vtkhdf", "--resume"))[0] == 0
        assert ended(started(tmp_path, words, "whole.vtkhdf"))[0] == 0
        assert bits(folder / "run.vtkhdf") == bits(tmp_path / "whole.vtkhdf")
    with mounted(tmp_path / "fixed", "ro") as folder:
        code, out, error = ended(started(tmp_path, words, folder / "run.vtkhdf"))
        assert (code, out, error.count("\n")) == (2, "", 1)
        assert "Read-only file system" in error
