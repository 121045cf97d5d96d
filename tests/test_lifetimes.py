"""Whatever ends a command ends all that it has started; a process that is killed costs no other's work."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from actin_xcheck.runs.executor import cores, executor
from actin_xcheck.runs.processes import ATTEMPTS
from actin_xcheck.runs.store import read_run
from tests.ending import killed_often, raises
from tests.processes import started, wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")

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
    *(
        (command, number)
        for command in COMMANDS
        for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
    ),
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
        study = command.split()[0] not in ("nightly", "sweep")
        where = " in out; the same command with --out out goes on" if study else ""
        expected = f"actin_xcheck: ended by {number.name}; what was finished is kept{where}\n"
        assert (process.returncode, said) == (128 + number, expected)


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


def test_what_is_killed_every_time_is_lost_and_the_others_are_finished(tmp_path):
    with executor(2) as processes:
        found = dict(processes.results(killed_often, [(tmp_path, number) for number in range(4)]))
    assert re.fullmatch(rf"its process was ended by SIGKILL .*, {ATTEMPTS} times", found.pop(1).message)
    assert set(found) == {0, 2, 3}
    assert {path.name for path in tmp_path.iterdir()} == {"0", "2", "3"}


def test_what_is_raised_says_where():
    with executor(2) as processes, pytest.raises(ValueError, match="task 0") as error:
        dict(processes.results(raises, range(1)))
    assert "in raises" in error.value.__notes__[0]
