"""Whatever ends a command ends all that it has started; what is killed costs no other's work; clusters."""

import operator
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.runs.executor import cores, executor
from actin_xcheck.runs.processes import ATTEMPTS, Lost
from actin_xcheck.runs.store import read_run
from actin_xcheck.scene import mesh_file
from actin_xcheck.scene.mesh_file import LostError, aside, read_triangulation
from actin_xcheck.scene.scene import load_scene
from tests.ending import killed, process, raises
from tests.processes import cluster, posix, started, wait_until

linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
FOREVER = "import time; from actin_xcheck.scene.mesh_file import aside; aside(float('inf'), time.sleep, 300)"


def test_what_is_returned_or_raised_comes_home(capfd: pytest.CaptureFixture[str]) -> None:
    assert aside(60, operator.truediv, 3, 2) == 1.5
    assert aside(60, print, "noise", file=None) is None
    with pytest.raises(ZeroDivisionError):
        aside(60, operator.truediv, 1, 0)
    with pytest.raises(UserError, match="did you mean static-decay"):
        aside(60, load_scene, "static-deca")
    assert capfd.readouterr() == ("", "")


def test_a_crash_is_told_and_ends_nothing_else() -> None:
    with pytest.raises(LostError, match=rf"a crash, exit code -{signal.SIGABRT.value}|exit code 3"):
        aside(60, os.abort)


def test_what_does_not_end_is_ended_even_where_the_interpreter_waits_for_it() -> None:
    began = time.monotonic()
    with pytest.raises(LostError, match=r"no end within 1\.5 s"):
        aside(1.5, re.match, r"(a+)+$", "a" * 60 + "b")  # exponential, and no other thread gets a turn
    assert time.monotonic() - began < 30


@pytest.mark.slow
def test_a_reader_of_meshes_that_goes_round_for_ever_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_file, "PATIENCE", 3.0)
    (tmp_path / "cell.node").write_text("")
    began = time.monotonic()
    with pytest.raises(UserError, match=r"cell\.node: meshio cannot read it \(no end within 3 s\); valid: "):
        read_triangulation(tmp_path / "cell.node")
    assert time.monotonic() - began < 30


def test_a_script_is_not_run_once_more(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import math\nfrom actin_xcheck.scene.mesh_file import aside\n"
        "print('once', aside(60, math.sqrt, 4.0))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout == "once 2.0\n"


@linux
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_the_process_ends_with_the_one_that_asked(end: signal.Signals) -> None:
    parent = subprocess.Popen([sys.executable, "-c", FOREVER])
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children")
    wait_until(lambda: children.read_text().split(), 60)
    child = Path("/proc", children.read_text().split()[0])
    wait_until(lambda: b"answer" in (child / "cmdline").read_bytes(), 60)
    parent.send_signal(end)
    parent.wait()
    wait_until(lambda: not child.exists() or " Z " in (child / "stat").read_text(), 30)


AT_ONCE = 5.0
"""Seconds within which all must have ended, on a machine that is busy."""

COMMANDS = {
    "compare growing-disk --refine 6": 2,
    "chart fig14-four-fronts": 1,
    "nightly --only compare*": 4,
    "sweep sweep.toml --method fem-p1-paper --refine 6": 2,
}
"""Commands that work in processes for a while, and how many; those of nightly have processes of their own."""

ALIKE = dict.fromkeys(
    ("converge growing-disk", "frontier", "faults", "paper", "extremes", "closures", "distort"), 2
)
"""Studies that are carried out as `compare` is: they are killed at night."""

ENDS = [
    *((command, signal.SIGKILL) for command in COMMANDS),
    *zip(COMMANDS, (signal.SIGTERM, signal.SIGHUP, signal.SIGTERM, signal.SIGHUP), strict=True),
    *(pytest.param(command, signal.SIGKILL, marks=pytest.mark.nightly) for command in ALIKE),
]

SWEEP = """
scene = "growing-disk"
[over.parameters]
d = [1e-3, 1e-2]
"""


def of_session(leader: int) -> dict[int, str]:
    """The processes of a session that have not ended, with what they were called with."""
    found = {}
    for path in Path("/proc").iterdir():
        if path.name.isdigit():
            try:
                state, _, _, session = (path / "stat").read_text().rpartition(")")[2].split()[:4]
                if int(session) == leader and state != "Z":
                    found[int(path.name)] = (path / "cmdline").read_text().replace("\0", " ")
            except (FileNotFoundError, ProcessLookupError):
                continue
    return found


@contextmanager
def of_its_own(folder: Path, command: str) -> Iterator[subprocess.Popen[str]]:
    """A command in a session of its own."""
    (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    quiet = {"stdout": subprocess.DEVNULL, "start_new_session": True}
    process = started(folder, command, "--out", "out", "--quiet", **quiet)
    try:
        yield process
    finally:
        for pid in of_session(process.pid):
            os.kill(pid, signal.SIGKILL)
        process.wait()


def at_work(process: subprocess.Popen[str]) -> list[int]:
    """Its processes that are handed tasks."""
    assert process.poll() is None, process.communicate()
    found = of_session(process.pid).items()
    return [pid for pid, words in found if "spawn_main" in words or "forkserver" in words]


@linux
@pytest.mark.slow
@pytest.mark.parametrize(("command", "number"), ENDS)
def test_nothing_that_a_command_has_started_outlives_it(command, number, tmp_path):
    with of_its_own(tmp_path, command) as process:
        wait_until(lambda: len(at_work(process)) >= min((COMMANDS | ALIKE)[command], 2 * cores()), 120)
        time.sleep(1.0)
        process.send_signal(number)
        wait_until(lambda: not of_session(process.pid), AT_ONCE)
        _, said = process.communicate()
    if number == signal.SIGKILL:
        assert (process.returncode, said) == (-number, "")
    else:
        study = command.split()[0] != "nightly"
        where = "in out; the same command with --out out" if study else r"in out/[0-9-]+; nightly --resume"
        expected = f"actin_xcheck: ended by {number.name}; what was finished is kept {where} goes on\n"
        assert process.returncode == 128 + number
        assert re.fullmatch(expected, said)


@linux
@pytest.mark.slow
def test_a_killed_process_of_a_comparison_is_replaced_and_its_run_made_again(tmp_path):
    with of_its_own(tmp_path, "compare growing-disk --refine 5") as process:
        wait_until(lambda: list(tmp_path.glob("out/*.partial.vtkhdf")), 120)
        os.kill(at_work(process)[0], signal.SIGKILL)
        _, said = process.communicate(timeout=300)
    assert (process.returncode, said) == (0, "")
    runs = sorted(tmp_path.glob("out/*.vtkhdf"))
    assert len(runs) == 6
    assert {read_run(path).attributes["outcome"] for path in runs} == {"completed"}


@posix
def test_a_process_that_is_killed_costs_its_own_task_only(tmp_path: Path) -> None:
    with executor(2) as processes:
        results = dict(processes.results(killed, [(tmp_path, number) for number in range(6)]))
    lost = results.pop(3)
    assert isinstance(lost, Lost)
    assert re.fullmatch(rf"its process was ended by SIGKILL .*, {ATTEMPTS} times", lost.message)
    assert results == {number: number**2 for number in (0, 1, 2, 4, 5)}
    begun = Counter((tmp_path / "begun").read_text().split())
    assert begun == {"0": 1, "1": 2, "2": 1, "3": ATTEMPTS, "4": 1, "5": 1}


@posix
def test_processes_serve_all_that_is_asked_of_them_and_one_that_ended_idle_is_replaced() -> None:
    with executor(2) as processes:
        first = {pid for _, pid in processes.results(process, range(8))}
        assert len(first) <= 2
        again = [pid for _, pid in processes.results(process, [0])]
        assert first.issuperset(again)
        os.kill(again[0], signal.SIGKILL)
        wait_until(lambda: not Path(f"/proc/{again[0]}/exe").exists(), 10)
        ((_, other),) = processes.results(process, [0])
        assert other != again[0]


def test_what_is_raised_says_where():
    with executor(2) as processes, pytest.raises(ValueError, match="task 0") as error:
        dict(processes.results(raises, range(1)))
    assert "in raises" in error.value.__notes__[0]


def refused(said: str):
    return pytest.raises(UserError, match=f"^--scheduler: {said}")


@pytest.mark.slow
@pytest.mark.parametrize("says", [b"", b"HTTP/1.0 400 Bad Request\r\n\r\n<html>no</html>"])
def test_what_listens_but_is_no_scheduler_is_a_mistake_soon(says: bytes) -> None:
    pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor(1) as others:
        address, over = "tcp://{}:{}".format(*server.getsockname()), threading.Event()
        others.submit(answer, server, says, over)
        began = time.monotonic()
        try:
            with refused(f"{address}: no scheduler answers "), executor(1, address):
                pass
        finally:
            over.set()
    assert time.monotonic() - began < 10


def answer(server: socket.socket, says: bytes, over: threading.Event) -> None:
    """Say the same to all who come, and nothing more."""
    server.settimeout(0.1)
    with ExitStack() as came:
        while not over.is_set():
            with suppress(TimeoutError):
                came.enter_context(server.accept()[0]).sendall(says)


@pytest.mark.slow
def test_a_scheduler_of_another_version_is_one_line(tmp_path: Path, monkeypatch) -> None:
    distributed = pytest.importorskip("distributed")
    with cluster(tmp_path, 1) as (address, _):
        theirs = distributed.__version__
        monkeypatch.setattr(distributed, "__version__", "1999.1.0")
        said = f"{address} has dask.distributed {theirs}, this is 1999.1.0; valid: the same version$"
        with refused(said), executor(1, address):
            pass


@pytest.mark.slow
def test_a_scheduler_that_wants_certificates_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    if (openssl := shutil.which("openssl")) is None:
        pytest.skip("nothing makes certificates here")
    wanted = [openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", "key", "-out", "cert"]
    subprocess.run([*wanted, "-subj", "/CN=here"], cwd=tmp_path, check=True, capture_output=True)
    secured = ("--protocol", "tls", "--tls-ca-file", "cert", "--tls-cert", "cert", "--tls-key", "key")
    with cluster(tmp_path, 0, scheduler=secured) as (address, _):
        for asked in (address, address.replace("tls", "tcp")):
            began = time.monotonic()
            with refused(f"{asked}: no scheduler answers "), executor(1, asked):
                pass
            assert time.monotonic() - began < 10
