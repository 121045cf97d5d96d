"""Interrupted runs: whatever stops one, its last checkpoint is whole, and it goes on to the same bits."""

import errno
import json
import multiprocessing
import os
import random
import resource
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from actin_xcheck import checkpoint, files
from actin_xcheck.checkpoint import Keeper
from actin_xcheck.errors import UserError
from actin_xcheck.fidelity import Fidelity, reduced
from actin_xcheck.files import locked, replace_file, unfinished
from actin_xcheck.registry import METHODS
from actin_xcheck.result import COMPLETED, Ending, Outcome
from actin_xcheck.runs import bind, run
from actin_xcheck.scene import load_scene
from actin_xcheck.solver import State
from actin_xcheck.stepping import Checkpoint, Tolerance, integrate
from actin_xcheck.store import annotate, read_run
from fem.remeshing import Remeshing
from tests.kills import FRONTS, KINDS, ROUND, SMALL, STIRRED, Kind, bits, campaign
from tests.lab import Film

QUICK = (
    Kind(FRONTS, "fem-p1-paper", 2, 5e-3),
    Kind(FRONTS, "fem-p1-paper", 3, 1e-2, fidelity=Fidelity.SECTOR),
    Kind(FRONTS, "fem-p2-imex3", 2, 1.0, 1e-4),
    Kind(FRONTS, "fem-p4-imex4", 2, 1.0, 1e-5, Fidelity.SECTOR),
    Kind(ROUND, "fem-p4-imex4", 3, 1.0, 1e-7, Fidelity.RADIAL),
    Kind(SMALL, "fem-p2-imex3", 2, 1.0, 1e-6, Fidelity.MODAL),
    Kind(FRONTS, "fv-coupled", 2, 1e-2),
    Kind(FRONTS, "fv-order2", 2, 1.0, 1e-3),
    Kind(STIRRED, "fv-driven", 2, 1e-2),
)


def label(kind: Kind) -> str:
    return kind.label.replace(" ", "-")


def go(kind: Kind, path: Path, stop_after: int | None = None, resume: bool = False) -> Outcome:
    """Run a kind of run in this process; Ctrl-C comes while it measures its state after so many steps."""
    steps = 0

    def progress(done: int, total: int) -> None:
        nonlocal steps
        if steps == stop_after:
            signal.raise_signal(signal.SIGINT)
        steps += 1

    scene, method = kind.loaded, METHODS[kind.method]
    reduction = reduced(scene, method, kind.fidelity, kind.rtol)
    return run(
        scene,
        method,
        kind.refine,
        kind.dt,
        path,
        "",
        progress,
        kind.rtol,
        reduction,
        resume,
        heeds_signals=True,
    )


@pytest.mark.parametrize("kind", QUICK, ids=label)
def test_a_step_from_what_is_remembered_gives_the_same_bits(kind: Kind) -> None:
    """At every state of a run; arrays are contiguous, so that a file can hold them as they are."""
    scene, method = kind.loaded, METHODS[kind.method]
    solver = bind(
        scene, method, kind.refine, kind.dt, reduction=reduced(scene, method, kind.fidelity, kind.rtol)
    )
    state = solver.init()
    step = kind.dt if kind.rtol is None else scene.output_times[0] / 20
    for _ in range(4):
        memento = solver.memento(state)
        assert all(array.flags.forc for array in memento.values())
        other = bind(
            scene, method, kind.refine, kind.dt, reduction=reduced(scene, method, kind.fidelity, kind.rtol)
        )
        again = other.restored({name: array.copy(order="K") for name, array in memento.items()})
        new, outcome = solver.step(state, step)
        assert outcome.ok
        expected = solver.memento(new)
        found = other.memento(other.step(again, step)[0])
        assert {name: array.tobytes() for name, array in found.items()} == {
            name: array.tobytes() for name, array in expected.items()
        }
        state = new


@pytest.mark.parametrize("kind", QUICK, ids=label)
def test_an_interrupted_run_goes_on_to_the_same_bits(kind: Kind, tmp_path: Path) -> None:
    """Interrupted again and again: at t = 0, then after a few steps each."""
    outcome = go(kind, tmp_path / "whole.vtkhdf")
    assert outcome.ok
    whole = read_run(tmp_path / "whole.vtkhdf")
    draw, path, seen = random.Random(3), tmp_path / "run.vtkhdf", 0
    for stop in (0, *(draw.randint(0, len(whole.series["time"]) // 4) for _ in range(3))):
        outcome = go(kind, path, stop, resume=True)
        assert outcome.ending is Ending.INTERRUPTED
        assert not path.exists()
        part = read_run(unfinished(path))
        seen += stop + 1
        assert len(part.series["time"]) == seen
        assert set(part.times) <= set(whole.times)
        np.testing.assert_array_equal(part.series["area"], whole.series["area"][:seen])
    assert go(kind, path, resume=True).ok
    assert bits(path) == bits(tmp_path / "whole.vtkhdf")
    assert {one.name for one in tmp_path.iterdir()} == {"whole.vtkhdf", "run.vtkhdf"}


def test_steps_depend_on_all_that_a_checkpoint_holds(tmp_path: Path) -> None:
    """Without its pace, or with another anchor, a run goes on to other bits: the tests above can fail."""
    scene, method = load_scene(FRONTS), METHODS["fem-p2-imex3"]
    solver, tolerance = bind(scene, method, 2, 1.0), Tolerance(1e-4, 3)
    kept: list[Checkpoint] = []

    def keep(moment: Checkpoint) -> Outcome:
        kept.append(moment)
        return COMPLETED

    def after(begin: Checkpoint | None) -> list[bytes]:
        film = Film(solver)
        assert integrate(solver, 1.0, scene.output_times, film, tolerance, begin, keep).ok
        return [state.x.tobytes() for state in film.states]

    whole = after(None)
    middle = kept[len(whole) // 2]
    count = len(whole) // 2 + 1
    memento = solver.memento(middle.state)
    assert after(replace(middle, state=solver.restored(memento))) == whole[count:]
    assert after(replace(middle, pace=None)) != whole[count:]
    for name in ("anchor", "content"):
        changed = memento[name] * (1 + 1e-9)
        assert after(replace(middle, state=solver.restored({**memento, name: changed}))) != whole[count:]


def test_checkpoints_cost_a_fiftieth_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a clock that a step moves by 1 and a checkpoint by 10, and one that is slow by 100."""
    clock, written = [1000.0], []

    class Writer:
        def checkpoint(self, arrays, outcome, wall_seconds):
            written.append(clock[0])
            clock[0] += 100 if len(written) == 3 else 10

    class Solver:
        def memento(self, state):
            return {}

    monkeypatch.setattr(checkpoint.time, "perf_counter", lambda: clock[0])
    moment = Checkpoint(State(0.0, np.zeros((2, 1)), np.ones(1), np.zeros((2, 1))))
    keep = Keeper(Solver(), Writer(), began=1000.0)
    for _ in range(7010):
        assert keep(moment).ok
        clock[0] += 1
    assert [round(t - 1000) for t in written] == [0, 510, 1020, 6120, 6630, 7140]
    stopped = Keeper(Solver(), Writer(), 0.0, stop=lambda: True)(moment)
    assert stopped.ending is Ending.INTERRUPTED


def test_another_run_is_not_gone_on_with(tmp_path: Path) -> None:
    kind, path = QUICK[0], tmp_path / "run.vtkhdf"
    assert go(kind, path, 3).ending is Ending.INTERRUPTED
    before = unfinished(path).read_bytes()
    others = {
        "dt is 0.005, not 0.01": replace(kind, dt=0.01),
        "refine is 2, not 3": replace(kind, refine=3),
        "method is": replace(kind, method="fv-coupled"),
        "scene is": replace(kind, scene=ROUND),
        "rtol is nan, not 0.1": replace(kind, method="fem-p1-imex2", rtol=0.1),
        "fidelity is full, not sector": replace(kind, fidelity=Fidelity.SECTOR),
    }
    for reason, other in others.items():
        with pytest.raises(UserError, match=r"--resume.*another run") as caught:
            go(other, path, resume=True)
        assert reason in str(caught.value) or "method is" in str(caught.value)
        assert "\n" not in str(caught.value)
    assert unfinished(path).read_bytes() == before
    assert go(kind, path, resume=True).ok
    finished = path.read_bytes()
    said = go(kind, path, resume=True)
    assert (said.ending, path.read_bytes()) == (Ending.COMPLETED, finished)
    assert "finished before" in said.message
    with pytest.raises(UserError, match=r"dt is 0\.005, not 0\.01"):
        go(replace(kind, dt=0.01), path, resume=True)


def test_a_checkpoint_that_is_not_whole_is_one_line(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "run.vtkhdf"
    for spoil in ("run/checkpoint/anchor", "run/checkpoint"):
        assert go(QUICK[0], path, 3).ending is Ending.INTERRUPTED
        with h5py.File(unfinished(path), "r+") as file:
            del file[spoil]
        with pytest.raises(UserError, match="--resume: the checkpoint is not whole"):
            go(QUICK[0], path, resume=True)
    unfinished(path).write_bytes(unfinished(path).read_bytes()[:5000])
    with pytest.raises(UserError, match="not a whole run"):
        go(QUICK[0], path, resume=True)


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


# kills, at the worst moments


def _kill_yourself(kind: Kind, path: Path, moment: str) -> None:
    """In a process of its own: run, and be killed while the third file is put in its place, or the last."""
    checkpoint.REST, count = 0.0, 0

    def die(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    write, move = Path.write_bytes, os.replace

    def half(file: Path, content: bytes) -> int:
        nonlocal count
        count += 1
        write(file, content[: len(content) // 2] if count == 3 else content)
        return die() if count == 3 else len(content)

    def placed(source: Path, destination: Path) -> None:
        last = destination == path
        if last and moment == "before the last":
            die()
        move(source, destination)
        if last and moment == "after the last":
            die()

    if moment == "half written":
        Path.write_bytes = half  # type: ignore[method-assign, assignment]
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
    for found in campaign(12, 5, tmp_path, (KINDS[1], KINDS[4], KINDS[5], KINDS[10])):
        assert not found.wrong
        assert found.counts["same bits"] > 0


# disks


def _fill(path: Path, bytes_left: int) -> None:
    """In a process of its own: run with a limit on the size of files."""
    checkpoint.REST = 0.0
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


def test_a_page_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch) -> None:
    page = tmp_path / "index.html"
    replace_file(page, b"old")
    write = Path.write_bytes

    def full(file: Path, content: bytes) -> int:
        write(file, content[:1])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
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


# the command

WORDS = (
    "run",
    FRONTS,
    "--method",
    "fem-p1-paper",
    "--refine",
    "5",
    "--dt",
    "1e-3",
    "--fidelity",
    "full",
    "--quiet",
)


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-W", "error", "-m", "actin_xcheck", *words]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, error = process.communicate(timeout=200)
    return process.returncode, out, error


def wait_for(path: Path) -> None:
    for _ in range(20_000):
        if path.exists():
            return
        time.sleep(0.01)
    raise AssertionError(f"{path} does not appear")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_command_says_how_to_go_on_and_does(number: signal.Signals, tmp_path: Path) -> None:
    path = tmp_path / "my run.vtkhdf"
    words = (*WORDS, "--out", path.name)
    process = started(tmp_path, *words, "--force")
    wait_for(unfinished(path))
    process.send_signal(signal.SIGSTOP)
    code, out, error = ended(started(tmp_path, *words, "--resume"))
    process.send_signal(signal.SIGCONT)
    assert (code, out) == (2, "")  # and the first one goes on
    assert error.count("\n") == 1
    assert "another process is writing it" in error
    process.send_signal(number)
    code, out, error = ended(process)
    assert (code, out) == (130, "")
    assert error.count("\n") == 1
    said, again = error.strip().split("; to go on: ")
    assert said.startswith("actin_xcheck: interrupted at t = ")
    assert 0 < read_run(unfinished(path)).series["time"][-1] < 0.1636
    assert ended(started(tmp_path, *words))[0] == 2  # not to be lost by mistake
    _, *rest = shlex.split(again)
    assert "--force" not in rest
    code, out, error = ended(started(tmp_path, *rest[2:]))
    assert (code, out, error) == (0, f"completed: {path.name}\n", "")
    whole = started(tmp_path, *WORDS, "--out", "whole.vtkhdf")
    assert ended(whole)[0] == 0
    assert bits(path) == bits(tmp_path / "whole.vtkhdf")
    code, out, error = ended(started(tmp_path, *rest[2:]))
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
    words = (*WORDS, "--out")
    with mounted(tmp_path / "small", "size=900k") as folder:
        code, out, error = ended(started(tmp_path, *words, str(folder / "run.vtkhdf")))
        assert (code, out, error.count("\n")) == (2, "", 1)
        assert "No space left on device" in error
        part = unfinished(folder / "run.vtkhdf")
        assert [*folder.iterdir()] == [part]
        assert read_run(part).series["time"][-1] >= 0
        subprocess.run(["mount", "-o", "remount,size=9m", folder], check=True)
        assert ended(started(tmp_path, *words, str(folder / "run.vtkhdf"), "--resume"))[0] == 0
        assert ended(started(tmp_path, *words, "whole.vtkhdf"))[0] == 0
        assert bits(folder / "run.vtkhdf") == bits(tmp_path / "whole.vtkhdf")
    with mounted(tmp_path / "fixed", "ro") as folder:
        code, out, error = ended(started(tmp_path, *words, str(folder / "run.vtkhdf")))
        assert (code, out, error.count("\n")) == (2, "", 1)
        assert "Read-only file system" in error


def test_the_versions_that_differ_are_named_and_a_new_kernel_is_none():
    old = {"python": "3.11.7", "numpy": "2.0", "platform": "Linux-5"}
    now = {"python": "3.11.7", "numpy": "2.1", "platform": "Linux-6"}
    assert checkpoint._unlike(json.dumps(old), json.dumps(now)) == ("numpy 2.0", "numpy 2.1")
    assert checkpoint._unlike(json.dumps(old), json.dumps(old | {"platform": "Linux-6"})) == ("", "")
    assert checkpoint._unlike("damaged", json.dumps(now)) == ("damaged", json.dumps(now))


def test_a_run_goes_on_over_a_new_mesh_to_the_same_bits(tmp_path, monkeypatch):
    """Remeshed in its first step, because that is asked of it, and interrupted in its third."""
    begin = Remeshing.init
    monkeypatch.setattr(Remeshing, "init", lambda solver: replace(begin(solver), limit=0.999))
    monkeypatch.setattr(checkpoint, "REST", 0.0)
    scene, method, steps = load_scene("growing-disk"), METHODS["fem-p2-imex3"], []

    def interrupt(done, total):
        steps.append(done)
        if len(steps) == 4:
            raise KeyboardInterrupt

    def go(name, progress=lambda done, total: None, resume=False, remesh=True):
        path, dt = tmp_path / name, scene.time.end / 5
        return run(scene, method, 2, dt, path, progress=progress, resume=resume, remesh=remesh)

    assert go("whole.vtkhdf").ok
    with pytest.raises(KeyboardInterrupt):
        go("parts.vtkhdf", interrupt)
    with pytest.raises(UserError, match="its remesh is 1, not 0"):
        go("parts.vtkhdf", resume=True, remesh=False)
    assert go("parts.vtkhdf", resume=True).ok
    assert read_run(tmp_path / "whole.vtkhdf").series["remeshings"][[0, 1, -1]].tolist() == [0, 1, 1]
    assert bits(tmp_path / "whole.vtkhdf") == bits(tmp_path / "parts.vtkhdf")
