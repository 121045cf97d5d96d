"""Calls in a process of their own: what comes of them, and that the process ends."""

import operator
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from actin_xcheck.core.errors import UserError
from actin_xcheck.scene.mesh_file import LostError, aside
from actin_xcheck.scene.scene import load_scene
from tests.processes import wait_until

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


def test_a_script_is_not_run_once_more(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import math\nfrom actin_xcheck.scene.mesh_file import aside\n"
        "print('once', aside(60, math.sqrt, 4.0))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout == "once 2.0\n"


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are looked up in Linux's /proc")
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
